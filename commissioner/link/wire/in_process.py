"""A port without a wire: PDUs go to a simulated drive in this process, whose time is the motor's. Nothing sleeps.

The bytes are those of the Modbus application protocol (V1.1b3, 6.3, 6.6, 6.12, 6.17), so that whoever answers needs to know
nothing of this program.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Protocol

from commissioner.errors import ReplyMismatch, RequestRefused
from commissioner.link.wire.port import LinkStats, Words


class Simulator(Protocol):
    """A drive in this process."""

    @property
    def now_s(self) -> float:
        """Motor time."""
        ...

    def answer(self, request: bytes) -> bytes:
        """The response PDU to a request PDU."""
        ...

    def pass_time(self, seconds: float) -> None:
        """Let motor time pass without a request."""
        ...


class InProcessPort:
    """`Port` to a simulator. What is lost on a wire is not lost here; a refusal is one all the same."""

    read_retries = 0
    patience_s = 0.0
    reply_timeout_s = 0.25

    def __init__(self, simulator: Simulator) -> None:
        self.stats = LinkStats(connections=1)
        self._simulator = simulator

    def read(self, address: int, count: int) -> Words:
        return self._words(struct.pack(">BHH", 3, address, count), count)

    def write(self, address: int, values: Sequence[int]) -> None:
        head = struct.pack(">BHHB", 16, address, len(values), 2 * len(values))
        self._ask(head + struct.pack(f">{len(values)}H", *values))

    def exchange(
        self, write_address: int, values: Sequence[int], read_address: int, count: int, *, proves_itself: bool = False
    ) -> Words:
        head = struct.pack(">BHHHHB", 23, read_address, count, write_address, len(values), 2 * len(values))
        return self._words(head + struct.pack(f">{len(values)}H", *values), count)

    def write_coil(self, address: int, value: bool) -> None:
        self._ask(struct.pack(">BHH", 5, address, 0xFF00 if value else 0))

    def read_coil(self, address: int) -> bool:
        return bool(self._ask(struct.pack(">BHH", 1, address, 1))[2] & 1)

    def doubt(self) -> None:
        """No answer of another request can come here."""

    def close(self) -> None:
        """Nothing is held."""

    def _words(self, request: bytes, count: int) -> Words:
        response = self._ask(request)
        if len(response) != 2 + 2 * count:
            self.stats.mismatches += 1
            raise ReplyMismatch(
                "the simulator answered with other registers", step="read", value=f"{len(response)} bytes",
                limit=f"{2 + 2 * count} bytes", remedy="this is a defect of the simulator",
            )  # fmt: skip
        return struct.unpack(f">{count}H", response[2:])

    def _ask(self, request: bytes) -> bytes:
        asked_s = self._simulator.now_s
        self.stats.requests += 1
        response = self._simulator.answer(request)
        self.stats.latencies_s.append(self._simulator.now_s - asked_s)
        if response[0] & 0x80:
            self.stats.refusals += 1
            raise RequestRefused(
                f"the simulator refused function {request[0]} with exception {response[1]}", step="request", value=response[1],
                limit="a request the drive allows now", remedy="look at the scenario's faults",
            )  # fmt: skip
        return response
