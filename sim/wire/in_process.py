"""The drive without a wire: Modbus PDUs as bytes in and out, in the caller's process and in motor time.

What crosses is what crosses a wire, so that a client built for one needs to know no more. Functions 3, 6, 16 and 23.
"""

from __future__ import annotations

import struct
from typing import Any

from sim.drive.states import Answer
from sim.physics import layout as at
from sim.scenario import Scenario
from sim.truth import answer_key
from sim.wire.faults import DRIVE, FaultError
from sim.wire.pace import Pace
from sim.wire.station import Drive, Options

ILLEGAL_FUNCTION, ILLEGAL_VALUE = 1, 3


class Station:
    """One drive and its motor. Time is motor time: requests and `pass_time` move it, nothing else does.

    With a `pace` a request takes what its bytes, the slave's turn-around and the answer's bytes take, and a window holds
    the samples that there are by then; without one a window waits until it is full. FaultError: one that only a line can have."""

    def __init__(self, scenario: Scenario, seed: int, faults: tuple[str, ...] = (), pace: Pace = Pace()) -> None:  # noqa: B008
        self.scenario, self.seed, self.pace = scenario, seed, pace
        self.drive = Drive(
            scenario, Options(seed=seed, faults=faults), keeps_motor_time=True, is_paced=not pace.is_free
        )
        for fault in self.drive.plan.faults:
            if fault.name not in DRIVE:
                raise FaultError(
                    f"fault {fault.name!r} is one of a line, and a drive in memory has none: give it over TCP"
                )
        self.highest_flux_wb = 0.0
        """Peak stator flux that really was, so far."""

    @property
    def now_s(self) -> float:
        return float(self.drive.firmware.t)

    def pass_time(self, seconds: float) -> None:
        """Let the drive live so long without a request."""
        self.drive.firmware.advance(seconds)
        self.drive.firmware.check_watchdog()

    def truth(self) -> dict[str, Any]:
        """The answer key."""
        return answer_key(self.scenario, self.seed)

    def answer(self, request: bytes) -> bytes:
        """A response PDU, or an exception's."""
        pace = self.pace
        self.drive.plan.next_request(self.drive.firmware, request[0])
        if not pace.is_free:
            self.pass_time(pace.silence_s + pace.frame_s(len(request)) + max(pace.silence_s, pace.turnaround_s))
        response = self._answer(request)
        if not pace.is_free:
            self.pass_time(pace.frame_s(len(response)))
        self.highest_flux_wb = max(self.highest_flux_wb, float(self.drive.firmware.x[at.X_PEAK_S]))
        return response

    def _answer(self, request: bytes) -> bytes:
        function = request[0]
        try:
            if function == 3:
                address, count = struct.unpack(">HH", request[1:])
                return self._read(function, address, count)
            if function == 6:
                address, value = struct.unpack(">HH", request[1:])
                return self._written(function, self.drive.write(address, [value]), request[1:])
            if function == 16:
                address, count, size = struct.unpack(">HHB", request[1:6])
                values = list(struct.unpack(f">{count}H", request[6 : 6 + size]))
                return self._written(function, self.drive.write(address, values), request[1:5])
            if function == 23:
                read_at, read_count, write_at, count, size = struct.unpack(">HHHHB", request[1:10])
                values = list(struct.unpack(f">{count}H", request[10 : 10 + size]))
                wrote = self.drive.write(write_at, values, takes_time=False)
                return (
                    self._read(function, read_at, read_count)
                    if wrote is Answer.DONE
                    else _refusal(function, wrote.value)
                )
        except struct.error:
            return _refusal(function, ILLEGAL_VALUE)
        return _refusal(function, ILLEGAL_FUNCTION)

    def _read(self, function: int, address: int, count: int) -> bytes:
        words = self.drive.read(address, count)
        if isinstance(words, Answer):
            return _refusal(function, words.value)
        return struct.pack(f">BB{count}H", function, 2 * count, *words)

    def _written(self, function: int, answer: Answer, echo: bytes) -> bytes:
        return bytes([function]) + echo if answer is Answer.DONE else _refusal(function, answer.value)


def _refusal(function: int, code: int) -> bytes:
    return bytes([function | 0x80, code])
