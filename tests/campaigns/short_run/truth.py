"""What is wrong with a run, judged by the simulator's log and memory alone: every function yields broken invariants."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sim.wire.faults import SERVER, WIRE, Fault

GRACE_S = 0.1
"""Beyond the watchdog's time, until the output must be dead."""
FLUX_TOLERANCE = 1.02
READING = (3, 23)
"""Functions whose reply can be cut shorter and stay well-formed."""
RUNAWAY = "runs_away"
PARAMETER_ITEMS = ("staged_", "commit", "store")

Entry = Mapping[str, Any]


@dataclass(frozen=True)
class Allowed:
    """What the run was allowed to do to the drive."""

    max_watchdog_ms: float
    current_a: float
    voltage_v: float
    flux_wb: float
    writing: bool


@dataclass
class Requests:
    """Wall time of every request that reached the drive's station, and whether the wire or the server harmed it."""

    seen: list[tuple[float, bool]] = field(default_factory=list)

    def loss_before(self, wall: float) -> float | None:
        """Seconds from the first harmed request after the last sound one until `wall`; None after a sound one."""
        begun = None
        for when, is_harmed in self.seen:
            if when > wall:
                break
            begun = (begun or when) if is_harmed else None
        return None if begun is None else wall - begun


def deny_the_answer(hits: Sequence[Fault], wire: str, function: int, reply_timeout_s: float) -> bool:
    """Whether a request of this function gets no believable answer in time. Of several wire faults the first is carried out."""
    first = next((fault for fault in hits if fault.name in WIRE), None)
    acting = [fault for fault in hits if fault is first or fault.name in SERVER or fault.name == "lost_request"]
    return any(_denies_the_answer(fault, wire, function, reply_timeout_s) for fault in acting)


def _denies_the_answer(fault: Fault, wire: str, function: int, reply_timeout_s: float) -> bool:
    if fault.name in ("late", "stall"):
        return float(fault.argument or 0.0) > reply_timeout_s
    if fault.name == "short_reply" and function not in READING:
        return False
    if wire == "rtu" and fault.name in ("stray_before", "wrong_transaction"):  # passed over; no such number in RTU
        return False
    return fault.name not in ("repeated", "stray_after")


def read_log(path: Path) -> list[Entry]:
    """The simulator's entries; a line cut by its death is left out."""
    return [json.loads(line) for line in path.read_text("utf-8").splitlines() if line.endswith("}")]


def of(log: Sequence[Entry], event: str) -> list[Entry]:
    return [entry for entry in log if entry["event"] == event]


def sessions(log: Sequence[Entry]) -> Iterator[tuple[Entry, Entry | None]]:
    """(energised, de_energised or None) in order."""
    begun: Entry | None = None
    for entry in log:
        if entry["event"] == "energised":
            begun = entry
        elif entry["event"] == "de_energised" and begun is not None:
            yield begun, entry
            begun = None
    if begun is not None:
        yield begun, None


def is_energised(log: Sequence[Entry]) -> bool:
    return any(end is None for _, end in sessions(log))


def before_runaway(log: Sequence[Entry]) -> Sequence[Entry]:
    """The entries up to the session in which the drive stopped heeding anyone; all of them where it never did.

    Nobody but its supply can make such a drive dead: from there on only what the run says of it can be judged.
    """
    struck = next((k for k, e in enumerate(log) if e["event"] == "fault" and e["name"] == RUNAWAY), len(log))
    if struck == len(log):
        return log
    begun = [k for k, entry in enumerate(log[:struck]) if entry["event"] == "energised"]
    return log[: begun[-1]] if begun and is_energised(log[:struck]) else log[:struck]


def broken_runaway(log: Sequence[Entry], outcome: str, remedy: str) -> Iterator[str]:
    """A run that leaves its drive energised ends as a fault, and says what alone helps."""
    if len(before_runaway(log)) < len(log) and is_energised(log) and (outcome != "faulted" or "isolate" not in remedy):
        yield f"the drive is live, and the run ended as {outcome} with the remedy {remedy!r}"


def broken_supervision(log: Sequence[Entry], allowed: Allowed) -> Iterator[str]:
    """Energised only behind an armed watchdog and inside the limits, and dead in time after the last heartbeat."""
    for begun, end in sessions(log):
        watchdog_ms = begun["watchdog_ms"]
        if not 0 < watchdog_ms <= allowed.max_watchdog_ms:
            yield f"energised with a watchdog of {watchdog_ms} ms"
        if not 0 < begun["current_limit_a"] <= 1.0001 * allowed.current_a:
            yield f"energised with a current limit of {begun['current_limit_a']} A"
        if not 0 < begun["voltage_limit_v"] <= 1.0001 * allowed.voltage_v:
            yield f"energised with a voltage limit of {begun['voltage_limit_v']} V"
        if end is not None and end["since_heartbeat_s"] > watchdog_ms / 1000 + GRACE_S:
            yield f"energised {end['since_heartbeat_s']:.3f} s after the last heartbeat"


def broken_loss(log: Sequence[Entry], requests: Requests) -> Iterator[str]:
    """The output is off within the watchdog's time and a grace after the answers stopped for good."""
    for begun, end in sessions(log):
        loss_s = requests.loss_before(end["wall"]) if end is not None else None
        if loss_s is not None and loss_s > begun["watchdog_ms"] / 1000 + GRACE_S:
            yield f"energised {loss_s:.3f} s after the answers stopped"


def broken_end(log: Sequence[Entry], ended_wall: float) -> Iterator[str]:
    """Dead when the run says that it has ended, and never energised again."""
    for begun, end in sessions(log):
        if end is None or end["wall"] > ended_wall:
            yield "energised after the run had ended"
        if begun["wall"] > ended_wall:
            yield "switched on after the run had ended"


def broken_limits(log: Sequence[Entry], allowed: Allowed) -> Iterator[str]:
    """True peaks of flux and current; nothing asked for that lies outside."""
    for peaks in of(log, "peaks"):
        if peaks["stator_flux_wb"] > FLUX_TOLERANCE * allowed.flux_wb:
            yield f"true stator flux {peaks['stator_flux_wb']:.4f} Wb, limit {allowed.flux_wb:.4f} Wb"
        if peaks["current_a"] > 1.05 * allowed.current_a:
            yield f"true current {peaks['current_a']:.3f} A, limit {allowed.current_a:.3f} A"
    for write in of(log, "write"):
        if write["item"] == "dc_bias_v" and abs(write["value"]) > 1.0001 * allowed.voltage_v:
            yield f"a bias of {write['value']} V was asked for"
        if write["item"] == "watchdog_ms" and write["value"] > allowed.max_watchdog_ms:
            yield f"a watchdog of {write['value']} ms was asked for"


def broken_permission(log: Sequence[Entry], allowed: Allowed) -> Iterator[str]:
    """No parameter register touched without a verdict that allows it."""
    touched = [w["item"] for w in of(log, "write") if w["item"].startswith(PARAMETER_ITEMS)]
    if touched and not allowed.writing:
        yield f"wrote {touched[0]} though the verdict did not allow it"


def parameters(log: Sequence[Entry]) -> tuple[list[float], list[float]]:
    """(in use, stored), in wire units, as the drive last had them."""
    in_use: list[float] = []
    stored: list[float] = []
    for entry in log:
        if entry["event"] == "power_up":
            in_use = stored = entry["parameters"]
        elif entry["event"] == "commit":
            in_use = entry["in_use"]
        elif entry["event"] == "store":
            stored = entry["stored"]
    return in_use, stored


def which_set(values: Sequence[float], old: Sequence[float], new: Sequence[float] | None) -> str:
    """`old`, `new` or `mixture`, in the resolution of the wire."""
    for name, wanted in (("old", old), ("new", new)):
        if wanted is not None and all(abs(v - w) <= 1e-6 * abs(w) for v, w in zip(values, wanted, strict=True)):
            return name
    return "mixture"
