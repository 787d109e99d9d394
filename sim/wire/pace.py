"""How long bytes take on a serial line, and a slave to begin its answer: what makes a link slow."""

from __future__ import annotations

from dataclasses import dataclass

CHARACTER_BITS = 11
"""Start bit, eight of data, parity or a second stop bit, stop bit (Modbus over serial line V1.02, 2.5.1)."""
SILENT_CHARACTERS, SILENT_ABOVE_19200_S = 3.5, 0.00175
RTU_EXTRA = 3
"""Characters of a frame besides its PDU: address and CRC."""


@dataclass(frozen=True)
class Pace:
    """`baud` 0: the wire takes no time. `turnaround_s`: from the end of a request to the begin of its answer, at the least."""

    baud: int = 0
    turnaround_s: float = 0.0

    @property
    def is_free(self) -> bool:
        return self.baud == 0 and self.turnaround_s == 0.0

    def bytes_s(self, count: int) -> float:
        """So many characters on the wire."""
        return CHARACTER_BITS * count / self.baud if self.baud else 0.0

    def frame_s(self, pdu_bytes: int) -> float:
        """One frame of a PDU of this length on the wire."""
        return self.bytes_s(pdu_bytes + RTU_EXTRA)

    @property
    def silence_s(self) -> float:
        """What must pass between two frames."""
        if not self.baud:
            return 0.0
        return SILENT_ABOVE_19200_S if self.baud > 19200 else SILENT_CHARACTERS * CHARACTER_BITS / self.baud
