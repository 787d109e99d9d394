"""Faults on demand: `NAME[:ARGUMENT][@WHEN]`, on the wire byte by byte, or in the drive.

WHEN: `17` the 17th request, `17+` from there on, `17x3` three of them; `w5`, `w5+`, `w5x2` the same among the requests
that write (FC16); `2.5s` motor time, `e0.5s` motor time since the first energising, `commit` / `store` just before that
command is carried out. Without it: from the first request on.
"""

from __future__ import annotations

import math
import random
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from sim.drive.firmware import Firmware
from sim.drive.states import Trip

WIRE = {
    "late": 0.5,
    "lost": None,
    "lost_request": None,
    "repeated": None,
    "truncated": 3,
    "corrupted": None,
    "reordered": None,
    "stray_before": "00ff",
    "stray_after": "7f00",
    "wrong_unit": 17,
    "wrong_function": None,
    "short_reply": 1,
    "wrong_transaction": None,
    "gateway": 11,
    "drops_bytes": 1e-4,
}
"""Faults of a single reply (or request) and their default argument."""
TARGET_FAILED = 11
"""Of a gateway's exceptions the one behind which the drive may have carried the request out; behind another it did not get it."""
SERVER = {"stall": 1.0, "restart": 1.0, "half_open": None}
DRIVE = {
    "overcurrent": None,
    "heatsink": None,
    "winding": None,
    "earth_fault": None,
    "sto": None,
    "undervoltage": None,
    "overrun": 100,
    "sample_gap": 5,
    "power_cycle": None,
    "stuck_commit": None,
    "store_fails": None,
    "heartbeat_ignored": None,
    "ignore": "control_word",
    "refuse": "watchdog_ms",
    "other_map": 100,
    "runs_away": None,
    "loses_voltage": 0.2,
    "clamps_voltage": 20.0,
    "clamps_current": 5.0,
}
CUTS = {"loses_voltage": "lost_voltage", "clamps_voltage": "most_voltage_v", "clamps_current": "most_current_a"}
"""What a drive does to its output without saying so (a part, V, A), and the fact of the drive that it is."""
WRITE_REGISTERS = 16
NUMBERED = {
    "late",
    "truncated",
    "wrong_unit",
    "short_reply",
    "stall",
    "restart",
    "overrun",
    "sample_gap",
    "other_map",
    "gateway",
    "drops_bytes",
    *CUTS,
}


class FaultError(Exception):
    """The fault text cannot be understood; the message says what would be right."""


@dataclass(frozen=True)
class Fault:
    """One knob. `first`, `last`: numbers of requests, or of writing ones; `motor_time_s`, `command`: other triggers."""

    name: str
    argument: str | float | None
    first: float = 1
    last: float = math.inf
    motor_time_s: float | None = None
    since_energised: bool = False
    command: str | None = None
    among_writes: bool = False

    def hits(self, request: int, write: int | None) -> bool:
        """Whether the fault is meant for this request; both counted from 1, `write` None where it does not write."""
        number = write if self.among_writes else request
        is_numbered = self.motor_time_s is None and self.command is None
        return is_numbered and number is not None and self.first <= number <= self.last


def parse(text: str) -> Fault:
    """A fault from its text. FaultError names what is wrong."""
    match = re.fullmatch(r"([a-z_]+)(?::([^@]*))?(?:@(.+))?", text)
    known = {**WIRE, **SERVER, **DRIVE}
    if not match or match[1] not in known:
        raise FaultError(f"fault {text!r}: NAME[:ARGUMENT][@WHEN] with NAME one of {', '.join(sorted(known))}")
    name, argument, when = match.groups()
    value: str | float | None = argument if argument is not None else known[name]
    if name in NUMBERED:
        value = _number(text, value)
    if name in ("stray_before", "stray_after"):
        value = _hex(text, str(value))
    return _timed(text, Fault(name, value), when)


def _number(text: str, value: object) -> float:
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise FaultError(f"fault {text!r}: the argument must be a number") from None


def _hex(text: str, value: str) -> str:
    try:
        bytes.fromhex(value)
    except ValueError:
        raise FaultError(f"fault {text!r}: the argument must be hexadecimal bytes") from None
    return value


def _timed(text: str, fault: Fault, when: str | None) -> Fault:
    if when is None:
        return fault
    if when in ("commit", "store"):
        return replace(fault, command=when)
    if match := re.fullmatch(r"(e?)(\d+(?:\.\d+)?)s", when):
        return replace(fault, motor_time_s=float(match[2]), since_energised=bool(match[1]))
    if match := re.fullmatch(r"(w?)(\d+)(?:(\+)|x(\d+))?", when):
        first = int(match[2])
        last = math.inf if match[3] else first + int(match[4] or 1) - 1
        return replace(fault, first=first, last=last, among_writes=bool(match[1]))
    raise FaultError(f"fault {text!r}: WHEN is N, N+, NxCOUNT (w before N: writes), SECONDSs, eSECONDSs, commit, store")


@dataclass
class Delivery:
    """Pieces of bytes to send, each after a delay (s); `held` goes out behind the next reply."""

    pieces: list[tuple[float, bytes]] = field(default_factory=list)
    held: bytes = b""


def deliver(fault: Fault, frame: bytes, is_rtu: bool, rebuild: Callable[[bytes], bytes]) -> Delivery:
    """What becomes of one reply on the wire. `rebuild` gives an altered body its framing and check sum again."""
    name = fault.name
    if name == "lost":
        return Delivery()
    if name == "late":
        return Delivery([(float(fault.argument or 0.0), frame)])
    if name == "repeated":
        return Delivery([(0.0, frame), (0.002, frame)])
    if name == "truncated":
        return Delivery([(0.0, frame[: -int(float(fault.argument or 1))])])
    if name == "corrupted":
        place = len(frame) // 2
        return Delivery([(0.0, frame[:place] + bytes([frame[place] ^ 0x5A]) + frame[place + 1 :])])
    if name == "reordered":
        return Delivery(held=frame)
    if name == "stray_before":
        return Delivery([(0.0, bytes.fromhex(str(fault.argument)) + frame)])
    if name == "stray_after":
        return Delivery([(0.0, frame + bytes.fromhex(str(fault.argument)))])
    return Delivery([(0.0, _altered(fault, frame, is_rtu, rebuild))])


def _altered(fault: Fault, frame: bytes, is_rtu: bool, rebuild: Callable[[bytes], bytes]) -> bytes:
    """A reply that is well-formed and wrong: another unit, function, transaction or length."""
    body = bytearray(frame[:-2] if is_rtu else frame[6:])  # unit, function, data
    if fault.name == "wrong_unit":
        body[0] = int(float(fault.argument or 17))
    elif fault.name == "wrong_function":
        body[1] ^= 0x07
    elif fault.name == "short_reply" and len(body) > 5 and body[1] in (3, 23):
        cut = 2 * int(float(fault.argument or 1))
        body = body[:-cut]
        body[2] -= cut
    elif fault.name == "gateway":
        body[1:] = body[1] | 0x80, int(float(fault.argument or TARGET_FAILED))
    elif fault.name == "wrong_transaction" and not is_rtu:
        return bytes([frame[0] ^ 0x11, frame[1] ^ 0x22]) + frame[2:]
    return rebuild(bytes(body))


TRIPS = {
    "overcurrent": (Trip.OVERCURRENT, 15.2, 14.0),
    "heatsink": (Trip.HEATSINK, 88.5, 85.0),
    "winding": (Trip.WINDING, 131.0, 120.0),
    "earth_fault": (Trip.EARTH_FAULT, 1.4, 0.5),
    "sto": (Trip.STO, 0.0, 1.0),
    "undervoltage": (Trip.UNDERVOLTAGE, 402.0, 480.0),
}


def strike(fault: Fault, drive: Firmware) -> None:
    """Let a drive fault happen now. Trips need an energised drive; an opened STO stays open."""
    drive.log.write("fault", drive.t, name=fault.name, argument=fault.argument)
    if fault.name in TRIPS:
        if fault.name == "sto":
            drive.setup.interlocks["sto_released"] = False
        if drive.is_energised:
            drive.trip(*TRIPS[fault.name])
    elif fault.name == "power_cycle":
        drive.power_cycle()
    elif fault.name == "overrun":
        drive.run_until_sample(drive.produced + int(float(fault.argument or 0)))
        drive.samples.forget()
    elif fault.name == "sample_gap":
        drive.samples.gaps.append((drive.produced, int(float(fault.argument or 1))))
    else:
        _misbehave(fault, drive)


def _misbehave(fault: Fault, drive: Firmware) -> None:
    if fault.name == "stuck_commit":
        drive.setup.commit_sticks = True
    elif fault.name == "store_fails":
        drive.setup.store_fails = True
    elif fault.name == "heartbeat_ignored":
        drive.setup.heeds_heartbeat = False
    elif fault.name == "runs_away":  # energised it heeds no command, and its watchdog is dead
        drive.setup.runs_away = True
    elif fault.name == "ignore":
        drive.setup.ignores = drive.setup.ignores | {str(fault.argument)}
    elif fault.name in CUTS:
        setattr(drive.setup, CUTS[fault.name], float(fault.argument or 0.0))
        drive.take_cuts()
    elif fault.name == "refuse":
        drive.setup.refuses = drive.setup.refuses | {str(fault.argument)}


class Plan:
    """All faults of a run and what has been counted so far."""

    def __init__(self, faults: list[Fault]) -> None:
        self.faults = faults
        self.requests = 0
        self.writes = 0
        self.struck: set[int] = set()
        self.chance = random.Random(1)

    def thinned(self, fault: Fault, frame: bytes) -> bytes:
        """What a line that loses this part of all bytes leaves of a frame."""
        return bytes(byte for byte in frame if self.chance.random() >= float(fault.argument or 0.0))

    def arm(self, drive: Firmware) -> None:
        """Hang the timed drive faults into the drive's clock."""
        for fault in self.faults:
            if fault.name in DRIVE and fault.motor_time_s is not None:
                self._arm_one(fault, drive)

    def _arm_one(self, fault: Fault, drive: Firmware) -> None:
        seconds = float(fault.motor_time_s or 0.0)
        if not fault.since_energised:
            drive.at(seconds, lambda: strike(fault, drive))
            return

        def once() -> None:
            drive.on_energised.remove(once)
            drive.at(drive.t + seconds, lambda: strike(fault, drive))

        drive.on_energised.append(once)

    def next_request(self, drive: Firmware, function: int) -> list[Fault]:
        """Count a request, strike the drive faults due by number, return the wire and server faults that hit it."""
        self.requests += 1
        self.writes += function == WRITE_REGISTERS
        number = self.requests, self.writes if function == WRITE_REGISTERS else None
        for j, fault in enumerate(self.faults):
            if fault.name in DRIVE and fault.hits(*number) and j not in self.struck and fault.name != "other_map":
                self.struck.add(j)
                strike(fault, drive)
        hits = self._timed_due(drive) + [f for f in self.faults if f.name not in DRIVE and f.hits(*number)]
        for fault in hits:
            drive.log.write(
                "fault", drive.t, name=fault.name, argument=fault.argument, request=self.requests, function=function
            )
        return hits

    def _timed_due(self, drive: Firmware) -> list[Fault]:
        """Wire and server faults whose motor time has come: each hits the next request once."""
        due = []
        for j, fault in enumerate(self.faults):
            is_due = fault.motor_time_s is not None and not fault.since_energised and drive.t >= fault.motor_time_s
            if fault.motor_time_s is not None and fault.since_energised and drive.first_energised_s is not None:
                is_due = drive.t >= drive.first_energised_s + fault.motor_time_s
            if fault.name not in DRIVE and is_due and j not in self.struck:
                self.struck.add(j)
                due.append(fault)
        return due

    def before_command(self, command: str, drive: Firmware) -> bool:
        """Strike faults that wait for this command; whether the command is lost to it (a power cycle)."""
        was_lost = False
        for j, fault in enumerate(self.faults):
            if fault.command == command and j not in self.struck:
                self.struck.add(j)
                strike(fault, drive)
                was_lost = was_lost or fault.name == "power_cycle"
        return was_lost

    @property
    def map_shift(self) -> int:
        return next((int(float(f.argument or 0)) for f in self.faults if f.name == "other_map"), 0)
