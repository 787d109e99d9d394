"""A running recording watched state by state: the answer is of its longest steady stretch, the others have their own."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import cast

import numpy as np

from commissioner.monitor.chain import Observation, Refused, Wishes, observe
from commissioner.monitor.contract import State
from commissioner.monitor.intake.against_plate import against_plate, doubt_of, of_contradiction, over_currents
from commissioner.monitor.intake.carrier import means_over_carrier
from commissioner.monitor.intake.channels import Wiring, is_straight_motor
from commissioner.monitor.intake.findings import Audited, Finding
from commissioner.monitor.intake.states.naming import LEAST_STEADY_S, START_CURRENT
from commissioner.monitor.intake.states.standing import highest_standing_speed
from commissioner.monitor.intake.states.stretches import Stretch, cut_out, states
from commissioner.monitor.intake.terminals import Terminals, from_terminals, power_wander_w
from commissioner.monitor.loads.pairing_by_start import wired_in
from commissioner.monitor.partial import OF_MODEL, Partial, of_terminals, refused_audit
from commissioner.monitor.periods.periods import slip_of
from commissioner.motor import standing
from commissioner.motor.channels.faults import currents_on_time
from commissioner.motor.circuit import Quantity
from commissioner.motor.nameplate import Nameplate
from commissioner.records import ReadingNote, RunningRecording

SHORT = frozenset({"too_short", "missing_samples", "too_few_periods"})
"""Refusals of a stretch that is steady, but short."""
SILENT = frozenset({"no_period", "no_shaft_line"})
"""Refusals of a stretch that is steady, but too even for the shaft to be seen: a fan, a pump, a healthy coupling."""
MARGIN_S = 0.06
"""At either end of a steady stretch: the window that finds it reaches so far over its edge."""
UNFED = frozenset({"off", "residual"})
"""What precedes a closing."""
AGREES = 3.0
"""Standard deviations of the terminals' speed within which a line is the shaft's."""


def in_its_states(
    recording: RunningRecording, plate: Nameplate, wishes: Wishes
) -> tuple[Observation | Refused, RunningRecording, list[State]]:
    """(what the longest steady stretch says, that stretch, all stretches). A recording of one state is watched whole."""
    recording, carrier = means_over_carrier(recording)
    if carrier is not None and carrier.stops:
        return _not_watched(recording, carrier), recording, []
    if carrier is not None:
        recording = replace(recording, notes=(*recording.notes, ReadingNote(carrier.code, carrier.what)))
    recording, wishes = _on_time(recording, plate, wishes)
    stretches = states(recording, plate)
    steady = [s for s in stretches if s.state == "steady" and s.duration_s > 3.0 * MARGIN_S]
    if {s.state for s in stretches} <= {"steady", "lost"}:
        seen = (_watched if steady else observe)(recording, plate, wishes)
        out = [as_state(s, used=s.state == "steady") for s in stretches]
        for stretch, state in zip(stretches, out, strict=True):
            if stretch in steady and isinstance(seen, Refused):
                _add_own(state, seen, plate)
        return seen, recording, out
    if not steady:
        return (
            _not_watched(recording, _never_steady(recording, stretches, plate)),
            recording,
            [as_state(s, used=False) for s in stretches],
        )
    wishes = replace(wishes, wired=_wired(recording, stretches, plate))
    longest = max(steady, key=lambda s: s.duration_s)
    part = cut_out(recording, longest, MARGIN_S)
    note = ReadingNote(
        "states", f"{_listed(stretches)}: the answer is of the steady {_span(longest)}, what is beside it was not used"
    )
    noted = replace(part, notes=(*part.notes, note))
    parts = {s: noted if s is longest else cut_out(recording, s, MARGIN_S) for s in steady}
    watched = _wired_alike(parts, plate, wishes)
    out = [as_state(s, used=s is longest) for s in stretches]
    for stretch, state in zip(stretches, out, strict=True):
        if stretch in watched:
            _add_own(state, watched[stretch], plate)
    return watched[longest], part, out


def _on_time(recording: RunningRecording, plate: Nameplate, wishes: Wishes) -> tuple[RunningRecording, Wishes]:
    """The recording with its currents beside their voltages where a start shows how late they are, and how well that is known."""
    recording, behind = currents_on_time(recording, np.sqrt(2.0 / 3.0) * plate.rated_voltage_v)
    if behind is None:
        return recording, wishes
    known = behind.std_s if behind.is_told else float(np.hypot(behind.std_s, behind.late_s))
    return recording, replace(wishes, skew_std_s=min(wishes.skew_std_s, known))


def _wired_alike(
    parts: dict[Stretch, RunningRecording], plate: Nameplate, wishes: Wishes
) -> dict[Stretch, Observation | Refused]:
    """What each stretch says. Where one alone leaves open whether it generates or is crossed, however short it is, the wiring is that of
    the others: of those that read, as they are named, as a motor in no second way."""
    watched = {stretch: _watched(part, plate, wishes) for stretch, part in parts.items()}
    told = {seen.audited.wired for seen in watched.values() if is_straight_motor(seen.audited)}
    if len(told) == 1:
        known = replace(wishes, wired=told.pop())
        for stretch, seen in watched.items():
            generator = seen.audited.generator
            if generator is not None and generator.is_named:
                watched[stretch] = _watched(parts[stretch], plate, known)
    return watched


def _wired(recording: RunningRecording, stretches: tuple[Stretch, ...], plate: Nameplate) -> Wiring | None:
    starts = (wired_in(cut_out(recording, s, 0.0), plate) for s in stretches if s.state == "start")
    return next((wired for wired in starts if wired is not None), None)


def _never_steady(recording: RunningRecording, stretches: tuple[Stretch, ...], plate: Nameplate) -> Finding:
    """A current that is a start's to the end of the recording may as well be another unit's, where its closing is not in it."""
    last = stretches[-1]
    share = last.current_a / plate.rated_current_a
    has_closed = len(stretches) > 1 and {s.state for s in stretches[:-1]} <= UNFED
    speed = (
        highest_standing_speed(cut_out(recording, last, 0.0), plate) if has_closed and last.state == "start" else None
    )
    if speed is not None:
        return Finding(
            "not_started", "refused", standing.words(share, last.duration_s, speed), share, f"a start within {last.duration_s:.3g} s",
            "switch off before it burns, look for a blocked shaft, too much load, a low voltage or a wrong connection; of a motor that starts so long, record until it runs",
        )  # fmt: skip
    if {s.state for s in stretches} == {"start"}:
        return Finding(
            "current_level", "refused",
            f"the motor starts to the end of the recording, or the currents are in another unit: {share:.3g} times the rated one on the mean",
            share, f"settled at less than {START_CURRENT:g} times the rated current for {LEAST_STEADY_S:g} s",
            "give the currents in ampere (probe factor, mA?), or correct the plate; of a motor that starts so long, record until it runs",
        )  # fmt: skip
    return Finding(
        "no_steady_stretch", "refused", "the motor is never in a steady state", _listed(stretches), "a steady stretch of a second",
        "record longer at constant supply and load",
    )  # fmt: skip


def _watched(part: RunningRecording, plate: Nameplate, wishes: Wishes) -> Observation | Refused:
    """As the chain sees it. Where only the terminals are left to tell a torque, the plate is asked without the shaft; what contradicts it
    is asked again with a shaft that is seen: a fault's currents have another power factor than the plate's motor at their slip."""
    seen = observe(part, plate, wishes)
    if isinstance(seen, Observation) or seen.reason.code not in SHORT | SILENT:
        return seen
    against, said = against_plate(seen.audited, None, plate), doubt_of(seen.audited, None, plate)
    if against is not None and seen.shaft_hz is not None:
        shaft_hz = seen.shaft_hz.value
        against, said = against_plate(seen.audited, shaft_hz, plate), doubt_of(seen.audited, shaft_hz, plate)
    if against is not None:
        if wishes.trust == "plate" and against.likely is not None:
            return observe(over_currents(part, against.likely), plate, replace(wishes, trust=None))
        said = of_contradiction(against, stops=wishes.trust != "data")
    if said is None:
        return seen
    audited = replace(seen.audited, findings=(*seen.audited.findings, said))
    return Refused(audited, said if said.stops else seen.reason, audited.findings)


def _add_own(state: State, seen: Observation | Refused, plate: Nameplate) -> None:
    """What a steady stretch says: as the chain has it, else, of a short or even one, as its terminals do, and why no more."""
    if isinstance(seen, Observation):
        state["mean_speed_rad_per_s"] = {"value": seen.mean_speed_rad_per_s, "std": seen.mean_speed_std}
        state["mean_torque_nm"] = {"value": seen.mean_torque_nm, "std": seen.mean_torque_std}
        return
    of_terminals_alone = seen.reason.code in SHORT | SILENT
    state["withheld"] = ("from current, voltage and plate only: " if of_terminals_alone else "") + seen.reason.what
    if not of_terminals_alone:
        return
    terminal = _terminals(seen.audited, plate)
    if terminal is not None:
        speed = _by_shaft(seen, terminal, plate)
        state["mean_speed_rad_per_s"] = {"value": speed.value, "std": speed.std}
        state["mean_torque_nm"] = {"value": terminal.torque_nm, "std": terminal.torque_std_nm}
        if speed.value != terminal.speed_rad_per_s:
            state["withheld"] = f"torque {state['withheld']}"


def _terminals(audited: Audited, plate: Nameplate, *, moves: bool = True, is_late: bool = True) -> Terminals | None:
    """What they say of a stretch; without what its load moves by, or what a delay of the currents would do, in the deviations."""
    late_s = audited.sensors.skew_std_s if is_late else 0.0
    return from_terminals(audited.fundamental, plate, power_wander_w(audited) if moves else 0.0, late_s)


def _by_shaft(seen: Refused, terminal: Terminals, plate: Nameplate) -> Quantity:
    """The speed of the shaft's line where it is seen and agrees with the terminals' and the plate's slip, else that slip's. A load that moves
    moves the slip with it: the line is that of the quietest part."""
    by_slip, f = Quantity(terminal.speed_rad_per_s, terminal.speed_std_rad_per_s), seen.audited.fundamental
    if seen.shaft_hz is None or f is None:
        return by_slip
    shaft, std = 2 * np.pi * seen.shaft_hz.value, 2 * np.pi * seen.shaft_hz.std
    drop = 2 * np.pi * f.frequency_hz / plate.pole_pairs - shaft
    std = float(np.hypot(std, drop * power_wander_w(seen.audited) / abs(f.power_w)))
    return Quantity(shaft, std) if abs(shaft - by_slip.value) < AGREES * by_slip.std and std < by_slip.std else by_slip


def longest_steady(
    recording: RunningRecording, stretches: tuple[Stretch, ...]
) -> tuple[RunningRecording, Stretch | None]:
    """The longest steady stretch of a recording of several states, else all of it."""
    steady = [s for s in stretches if s.state == "steady"]
    longest = max(steady, key=lambda s: s.duration_s, default=None)
    if longest is None or len(stretches) == 1:
        return recording, longest
    return cut_out(recording, longest, MARGIN_S if longest.duration_s > 3.0 * MARGIN_S else 0.0), longest


def _load_moves(audited: Audited, plate: Nameplate) -> Finding | None:
    """Where a load that drifts or swings is as much of the stated deviation as all that terminals do not know."""
    still, stated = _terminals(audited, plate, moves=False), _terminals(audited, plate)
    if still is None or stated is None or stated.torque_std_nm < np.sqrt(2.0) * still.torque_std_nm:
        return None
    moves = float(np.sqrt(stated.torque_std_nm**2 - still.torque_std_nm**2))
    return Finding(
        "load_moves", "note", f"the load moves by {moves:.2g} N m (rms) within the stretch: that is in the torque's standard deviation",
        moves, still.torque_std_nm, "record at steady load",
    )  # fmt: skip


def _delay_open(audited: Audited, plate: Nameplate) -> Finding | None:
    """Where a delay that nothing tells is as much of the stated deviation as all else that terminals do not know."""
    told, stated = _terminals(audited, plate, is_late=False), _terminals(audited, plate)
    if told is None or stated is None or stated.torque_std_nm < np.sqrt(2.0) * told.torque_std_nm:
        return None
    late_s = audited.sensors.skew_std_s
    by = float(np.sqrt(stated.torque_std_nm**2 - told.torque_std_nm**2))
    return Finding(
        "delay_open", "note",
        f"whether all currents are late against the voltages a steady stretch does not tell: {late_s * 1e6:.2g} us of it are {by:.2g} N m, which are in the torque's standard deviation",
        by, told.torque_std_nm, "record from before the contactor closes: a start tells the delay",
    )  # fmt: skip


def said_by_terminals(seen: Refused, stretches: list[State], plate: Nameplate) -> Partial | None:
    """Of a recording whose steady stretches are too short or too even for the chain: what the terminals say of the longest."""
    told = [s for s in stretches if s["state"] == "steady" and "mean_torque_nm" in s]
    if seen.reason.code not in SHORT | SILENT or not told:
        return None
    best = max(told, key=lambda s: s["end_s"] - s["start_s"])
    for state in stretches:
        state["used"] = state is best
    speed, torque = best["mean_speed_rad_per_s"], best["mean_torque_nm"]
    limit = seen.reason.limit
    wanted = f"{limit:g}" if isinstance(limit, float) else limit
    why = seen.reason.what if wanted is None else f"{seen.reason.what}; wanted: {wanted}"
    withheld = dict.fromkeys((*OF_MODEL, "periods", "rotor_side_bands", "trend"), why)
    unused = ", ".join(sorted({s["state"] for s in stretches if s["state"] not in ("steady", "off", "lost")}))
    if unused:
        withheld["from other states"] = (
            f"{unused}: `identify` and `diagnose` use a start, a ramp or a load step, this verb does not"
        )
    notes = (_load_moves(seen.audited, plate), _delay_open(seen.audited, plate))
    f = seen.audited.fundamental
    indicators = {} if f is None else of_terminals(f)
    if f is not None:
        indicators["slip"] = slip_of(speed["value"], 2 * np.pi * f.frequency_hz, plate.pole_pairs)
    return Partial(
        Quantity(speed["value"], speed["std"] or 0.0), Quantity(torque["value"], torque["std"] or 0.0), best["frequency_hz"],
        (), indicators, withheld, tuple(note for note in notes if note is not None),
    )  # fmt: skip


def as_state(stretch: Stretch, *, used: bool) -> State:
    return cast("State", {**asdict(stretch), "used": used})


def _span(stretch: Stretch) -> str:
    return f"{stretch.start_s:.3g} ... {stretch.end_s:.3g} s"


def _listed(stretches: tuple[Stretch, ...]) -> str:
    return ", ".join(f"{s.state} {_span(s)}" for s in stretches)


def _not_watched(recording: RunningRecording, finding: Finding) -> Refused:
    audited = refused_audit(recording, finding)
    return Refused(audited, finding, audited.findings)
