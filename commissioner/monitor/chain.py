"""The whole chain: recording in, motion and parameters out, or the finding that refuses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from commissioner.monitor import combs as comb_search
from commissioner.monitor import feeder, periods, waveform
from commissioner.monitor import fit as fitting
from commissioner.monitor.audit import LARGEST_FREQUENCY_WANDER, Audited, Finding, inspect
from commissioner.monitor.averaging import Comb, Lines, separate
from commissioner.monitor.combs import SUPPLY_ORDERS, Found
from commissioner.monitor.estimate import band_weights, estimate, speed_lines
from commissioner.monitor.fit import Fitted, Problem, Start
from commissioner.monitor.periods import Periodicity, PhaseDrift, ShaftSearch
from commissioner.monitor.proof import Proof, prove
from commissioner.monitor.slow_slip import slip_phase
from commissioner.monitor.supply import TurningFrame, Vector, quietest, turning_frame
from commissioner.monitor.waveform import Solved, Waveform
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import from_nameplate, slip_at_power
from commissioner.records import RunningRecording, Signal

SLIP_TRUST = 0.25
"""Relative standard deviation of the slip that the plate and the measured power suggest: plate tolerance and warmth."""
LEAST_TURNS = 30
LEAST_LOAD_PERIODS = 8
POINTS_PER_TURN = 360
MOST_POINTS = 7200
FM_MATTERS_RAD = 0.02


@dataclass(frozen=True)
class LoadPeriod:
    """One periodicity as reported: what it is, how long, how sure, how much it moves the shaft."""

    name: str
    frequency_hz: float
    frequency_std_hz: float
    ratio_to_shaft: float
    follows: str
    harmonics: int
    periods_averaged: float
    speed_ripple_rad_per_s: float
    evidence: float


@dataclass(frozen=True)
class Observation:
    """All that the chain found. Times are the recording's own."""

    audited: Audited
    frame: TurningFrame
    part: slice
    found: Found
    search: ShaftSearch
    lines: Lines
    combs: tuple[Comb, ...]
    problem: Problem
    fitted: Fitted
    start: Start
    solved: Solved
    period: Waveform
    load_periods: tuple[LoadPeriod, ...]
    mean_speed_rad_per_s: float
    mean_speed_std: float
    segment_speed_rad_per_s: float
    mean_torque_nm: float
    mean_torque_std: float
    proof: Proof
    findings: tuple[Finding, ...]
    inertia_kg_m2: float | None

    @property
    def pole_pairs(self) -> int:
        return self.problem.pole_pairs

    @property
    def slip(self) -> float:
        return 1 - self.segment_speed_rad_per_s * self.pole_pairs / self.lines.supply_rad_per_s


@dataclass(frozen=True)
class Refused:
    """No answer, with what was learned on the way."""

    audited: Audited
    reason: Finding
    findings: tuple[Finding, ...]


@dataclass(frozen=True)
class Wishes:
    """What the caller knows: load frequencies in Hz, the inertia, a better start than the plate."""

    load_frequencies_hz: tuple[float, ...] = ()
    inertia_kg_m2: float | None = None
    start: Start | None = None
    segment_s: float = 10.0


def observe(recording: RunningRecording, plate: Nameplate, wishes: Wishes | None = None) -> Observation | Refused:
    """Speed, torque and load torque of the recording's periodic state, with uncertainties, or why not."""
    wishes = wishes or Wishes()
    start = wishes.start or Start(from_nameplate(plate), fitting.PRIOR_FROM_NAMEPLATE, "nameplate")
    audited = inspect(recording, plate, start.circuit)
    if audited.refusal or audited.supply is None or audited.fundamental is None:
        reason = audited.refusal or Finding("unknown", "refused", "the audit did not finish")
        return Refused(audited, reason, audited.findings)
    frame = turning_frame(audited.current_a, audited.voltage_v, audited.supply, audited.sample_period_s)
    frame = replace(frame, slip_phase_rad=slip_phase(frame, start.circuit))
    part = quietest(frame, wishes.segment_s)
    wander = _wander(frame, part)
    if wander.stops:
        return Refused(audited, wander, (*audited.findings, wander))
    search = _search(frame, part, plate, start)
    found = comb_search.find(frame, part, search, wishes.load_frequencies_hz)
    trouble = _too_little(frame, part, found)
    if trouble is not None:
        return Refused(audited, trouble, (*audited.findings, trouble))
    inertia = wishes.inertia_kg_m2 if wishes.inertia_kg_m2 is not None else plate.inertia_kg_m2
    return _invert(audited, frame, part, search, found, start, plate, inertia)


def _wander(frame: TurningFrame, part: slice) -> Finding:
    """How far the supply frequency moves inside the segment."""
    frequency = frame.supply_rad_per_s[part]
    share = float(np.ptp(frequency) / frequency.mean())
    kind = "refused" if share > LARGEST_FREQUENCY_WANDER else "note"
    return Finding(
        "frequency_wander",
        kind,
        f"the supply frequency moves by {share:.2%} within the quietest stretch: "
        + ("the motor is not in a steady state" if kind == "refused" else "steady"),
        share,
        LARGEST_FREQUENCY_WANDER,
        "record at a steady set point",
    )


def _search(frame: TurningFrame, part: slice, plate: Nameplate, start: Start) -> ShaftSearch:
    """Where the operating point puts the slip: the start circuit at the measured power."""
    supply = comb_search.mean_supply(frame, part)
    power = 1.5 * float(np.mean(np.real(frame.voltage_v[part] * np.conj(frame.current_a[part]))))
    slip = slip_at_power(start.circuit, supply, float(abs(frame.voltage_v[part].mean())), power)
    return ShaftSearch(plate.pole_pairs, supply / (2 * np.pi), slip, float(np.hypot(SLIP_TRUST * slip, 0.0015)))


def _too_little(frame: TurningFrame, part: slice, found: Found) -> Finding | None:
    length = float(np.ptp(frame.time_s[part]))
    if found.shaft is None and not found.loads:
        return Finding(
            "no_period",
            "refused",
            "the currents show neither the shaft nor any periodic load",
            float(found.spectrum.power.max()),
            periods.SIGNIFICANT,
            "record longer, with better sensors, or at a load that turns",
        )
    slowest = min([f.frequency_hz for f in (found.shaft, *found.loads) if f is not None])
    turns = length * slowest
    least = LEAST_TURNS if found.loads == () else LEAST_LOAD_PERIODS
    if turns < least:
        return Finding(
            "too_few_periods",
            "refused",
            f"only {turns:.1f} load periods in {length:.2f} s",
            turns,
            float(least),
            "record 30-60 s at steady load",
        )
    if found.shaft is None:
        return Finding(
            "no_shaft_line",
            "refused",
            "periodic loads are seen but no shaft line: the mean speed is not fixed",
            None,
            None,
            "record longer or with better current sensors; give the rotor slots",
        )
    return None


def _invert(
    audited: Audited,
    frame: TurningFrame,
    part: slice,
    search: ShaftSearch,
    found: Found,
    start: Start,
    plate: Nameplate,
    inertia: float | None,
) -> Observation:
    pairs = plate.pole_pairs
    members = _members(found)
    combs = tuple(
        comb_search.comb_of(frame, part, member, [m.frequency_hz for m in members[:k]])
        for k, member in enumerate(members)
    )
    first = members[0]
    assert found.shaft is not None
    shaft_speed = 2 * np.pi * found.shaft.frequency_hz
    shaft_std = 2 * np.pi * found.shaft.frequency_std_hz
    lines = feeder.quieten(separate(frame, part, list(combs), SUPPLY_ORDERS), len(combs))
    lines, problem, fitted = estimate(lines, len(combs), start, pairs, shaft_speed, shaft_std)
    if len(combs) > 1:
        bent = _with_wobble(frame, part, combs, problem, fitted, shaft_speed)
        if bent is not None:
            combs = bent
            lines = feeder.quieten(separate(frame, part, list(combs), SUPPLY_ORDERS), len(combs))
            lines, problem, fitted = estimate(lines, len(combs), start, pairs, shaft_speed, shaft_std)
    solved = waveform.solve(problem, fitted)
    period = _characteristic(
        audited, frame, part, combs, first.frequency_hz, found.shaft.frequency_hz, problem, solved, inertia
    )
    torque, torque_std = waveform.mean_torque_nm(problem, solved)
    whole, whole_std = _whole_record_speed(frame, part, found, lines)
    proof = prove(audited, frame, part, combs, problem, solved)
    return Observation(
        audited,
        frame,
        part,
        found,
        search,
        lines,
        combs,
        problem,
        fitted,
        start,
        solved,
        period,
        tuple(
            _load_periods(members, combs, found.shaft.frequency_hz, problem, solved, float(np.ptp(frame.time_s[part])))
        ),
        whole,
        whole_std,
        shaft_speed,
        torque,
        torque_std,
        proof,
        (*audited.findings, _wander(frame, part)),
        inertia,
    )


def _members(found: Found) -> list[Periodicity]:
    """Shaft and loads; a load at a rational share of the shaft becomes one comb with it, of the longest common period."""
    assert found.shaft is not None
    shaft = found.shaft
    independent: list[Periodicity] = []
    divisor = 1
    for load in found.loads:
        ratio = Fraction(load.frequency_hz / shaft.frequency_hz).limit_denominator(MOST_TURNS)
        apart = abs(load.frequency_hz - shaft.frequency_hz * ratio.numerator / ratio.denominator)
        if apart < 4 * float(np.hypot(load.frequency_std_hz, shaft.frequency_std_hz)) + 1e-5 * shaft.frequency_hz:
            divisor = int(np.lcm(divisor, ratio.denominator))
        else:
            independent.append(load)
    if divisor > 1:
        drift = shaft.drift
        slow = PhaseDrift(drift.polynomial / divisor, drift.centre_s, drift.half_s) if drift else None
        shaft = replace(
            shaft,
            name=f"{divisor} shaft turns",
            frequency_hz=shaft.frequency_hz / divisor,
            frequency_std_hz=shaft.frequency_std_hz / divisor,
            drift=slow,
        )
    return [shaft, *independent]


MOST_TURNS = 6
"""A load that repeats after at most so many shaft turns is one comb with the shaft."""


def _with_wobble(
    frame: TurningFrame, part: slice, combs: tuple[Comb, ...], problem: Problem, fitted: Fitted, shaft_speed: float
) -> tuple[Comb, ...] | None:
    """Combs locked to the shaft with the phase that the other loads' speed ripple gives it; None where it is small.

    delta phi = integral of the ripple of all combs that do not follow the shaft: sum 2 Re(Omega / (j rate) e^{j phase}).
    """
    speed = speed_lines(problem, fitted, band_weights(problem, fitted))
    lines, on = problem.lines, problem.on
    orders, owner, rate = lines.order[on.positive], lines.comb[on.positive], lines.rate_rad_per_s[on.positive]
    wobble = np.zeros(combs[0].phase_rad.size)
    for p, comb in enumerate(combs[1:], start=1):
        for k in np.flatnonzero(owner == p):
            amplitude = 2 * speed.amplitude_rad_per_s[k] / (1j * rate[k])
            if abs(amplitude) > 1e-5:
                wobble = wobble + np.real(amplitude * np.exp(1j * orders[k] * comb.phase_rad))
    if np.abs(wobble).max() * 8 < FM_MATTERS_RAD:
        return None
    bent = [
        replace(combs[0], phase_rad=combs[0].phase_rad + wobble * (2 * np.pi * combs[0].frequency_hz / shaft_speed))
    ]
    return (*bent, *combs[1:])


def _characteristic(
    audited: Audited,
    frame: TurningFrame,
    part: slice,
    combs: tuple[Comb, ...],
    base_hz: float,
    shaft_hz: float,
    problem: Problem,
    solved: Solved,
    inertia: float | None,
) -> Waveform:
    """One longest period from the segment's middle on, at `POINTS_PER_TURN` points a shaft turn."""
    longest = 1 / min(comb.frequency_hz for comb in combs)
    count = int(min(max(POINTS_PER_TURN * longest * shaft_hz, POINTS_PER_TURN), MOST_POINTS))
    time = frame.time_s[part]
    middle = float(time[time.size // 2])
    instants = middle + longest * np.arange(count) / count
    phases = {p: np.interp(instants, time, comb.phase_rad) for p, comb in enumerate(combs)}
    if len(combs) == 1:
        phases = {0: 2 * np.pi * np.arange(count) / count + float(np.interp(middle, time, combs[0].phase_rad))}
    made = waveform.evaluate(problem, solved, instants, phases, inertia)
    return replace(made, time_s=made.time_s + audited.start_s)


def _whole_record_speed(frame: TurningFrame, part: slice, found: Found, lines: Lines) -> tuple[float, float]:
    """Mean shaft speed over the whole stretch: the comb followed beyond the segment, (rad/s, standard error).

    Where the comb is lost outside the segment the segment's ratio to the mains stands, with the slip's spread as error.
    """
    shaft = found.shaft
    assert shaft is not None
    everything = slice(0, frame.time_s.size)
    supply = comb_search.mean_supply(frame, everything)
    ratio = 2 * np.pi * shaft.frequency_hz / comb_search.mean_supply(frame, part)
    speed, std = ratio * supply, 2 * np.pi * shaft.frequency_std_hz
    if part.start == 0 and part.stop >= frame.time_s.size:
        return speed, std
    time = frame.time_s
    phase = ratio * (frame.supply_angle_rad + frame.slip_phase_rad)
    blocks = int(np.clip(np.ptp(time) / 0.8, 16, 256))
    orders = sorted(set(shaft.harmonics_seen) | {1, 2}, key=lambda h: -_power(lines, h))[:3]
    demodulated = periods.demodulate(frame.current_a - _smooth(frame.current_a), time, phase, orders, blocks)
    drift = periods.track(demodulated, int(np.clip(np.ptp(time) / 4, 2, 16)))
    turned = float(drift(time[-1:])[0] - drift(time[:1])[0]) / float(np.ptp(time))
    return speed + turned, float(np.hypot(std, 0.02 * abs(turned)))


def _power(lines: Lines, order: int) -> float:
    return float(np.sum(np.abs(lines.current_a[(lines.comb == 0) & (np.abs(lines.order) == order)]) ** 2)) * order**2


def _smooth(current: Vector) -> complex:
    return complex(current.mean())


def _load_periods(
    members: list[Periodicity],
    combs: tuple[Comb, ...],
    shaft_hz: float,
    problem: Problem,
    solved: Solved,
    length_s: float,
) -> list[LoadPeriod]:
    made = []
    owner: NDArray[np.int64] = problem.lines.comb[problem.on.positive]
    for p, (member, comb) in enumerate(zip(members, combs, strict=True)):
        own = solved.speed.amplitude_rad_per_s[owner == p]
        ripple: Signal = np.abs(own)
        made.append(
            LoadPeriod(
                member.name,
                member.frequency_hz,
                member.frequency_std_hz,
                member.frequency_hz / shaft_hz,
                comb.follows,
                int(own.size),
                length_s * member.frequency_hz,
                float(np.sqrt(2 * np.sum(ripple**2))),
                member.evidence,
            )
        )
    return made
