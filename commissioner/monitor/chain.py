"""The whole chain: recording in, motion and parameters out, or the finding that refuses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from commissioner.monitor.intake.against_plate import (
    against_plate,
    doubt_of,
    of_contradiction,
    over_currents,
    unresolved_shaft,
    unscaled_order_deg,
    volts_per_hertz,
)
from commissioner.monitor.intake.audit import inspect
from commissioner.monitor.intake.channels import Wiring
from commissioner.monitor.intake.findings import Audited, Finding
from commissioner.monitor.intake.levels import late_currents
from commissioner.monitor.intake.sensors import SKEW_STD_S
from commissioner.monitor.intake.terminals import lost_in_loop_w
from commissioner.monitor.loads.mean_speed import whole_record_speed
from commissioner.monitor.loads.mean_torque import whole_record_torque
from commissioner.monitor.loads.members import members_of, pole_count, with_wobble
from commissioner.monitor.loads.pairing_by_slip import better_order, shaft_search
from commissioner.monitor.machine import fit as fitting
from commissioner.monitor.machine import waveform
from commissioner.monitor.machine.characteristic import LoadPeriod, characteristic, load_periods
from commissioner.monitor.machine.estimate import estimate
from commissioner.monitor.machine.fit import Fitted, Problem, Start
from commissioner.monitor.machine.proof import Proof, prove
from commissioner.monitor.machine.slow_slip import slip_phase
from commissioner.monitor.machine.systematic import with_systematic
from commissioner.monitor.machine.waveform import Solved, Waveform
from commissioner.monitor.periods import combs as comb_search
from commissioner.monitor.periods.combs import SUPPLY_ORDERS, Found
from commissioner.monitor.periods.periods import ShaftSearch, slip_of
from commissioner.monitor.periods.side_bands import SideBands, bar_or_load, side_bands
from commissioner.monitor.periods.steadiness import frequency_wander, too_little
from commissioner.monitor.signals import feeder
from commissioner.monitor.signals.averaging import Comb, Lines, separate
from commissioner.monitor.signals.quiet import quietest
from commissioner.monitor.signals.supply import TurningFrame, turning_frame
from commissioner.motor.circuit import Quantity
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import from_nameplate
from commissioner.records import RunningRecording


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
    mean_torque_sensor_std: float
    proof: Proof
    findings: tuple[Finding, ...]
    inertia_kg_m2: float | None
    side_bands: SideBands | None

    @property
    def pole_pairs(self) -> int:
        return self.problem.pole_pairs

    @property
    def slip(self) -> float:
        return slip_of(self.segment_speed_rad_per_s, self.lines.supply_rad_per_s, self.pole_pairs)


@dataclass(frozen=True)
class Refused:
    """No answer, with what was learned on the way; `shaft_hz`: the shaft's frequency where it was seen,
    and only the periods are too few."""

    audited: Audited
    reason: Finding
    findings: tuple[Finding, ...]
    shaft_hz: Quantity | None = None


@dataclass(frozen=True)
class Wishes:
    """What the caller knows: load frequencies in Hz, the inertia, a better start than the plate; `trust`: plate | data, which is
    right where the two contradict each other; `wired`: how the current channels are, `skew_std_s`: how well their delay against the voltages is known, where a start shows it."""

    load_frequencies_hz: tuple[float, ...] = ()
    inertia_kg_m2: float | None = None
    start: Start | None = None
    trust: str | None = None
    wired: Wiring | None = None
    skew_std_s: float = SKEW_STD_S


def observe(
    recording: RunningRecording, plate: Nameplate, wishes: Wishes | None = None, lag_deg: float | None = None
) -> Observation | Refused:
    """Speed, torque and load torque of the recording's periodic state, with uncertainties, or why not.

    `lag_deg`: the lag of the channels' order that the slip has chosen.
    """
    wishes = wishes or Wishes()
    start = wishes.start or Start(from_nameplate(plate), fitting.PRIOR_FROM_NAMEPLATE, "nameplate")
    audited = inspect(recording, plate, start.circuit, lag_deg, wishes.wired, wishes.skew_std_s)
    if audited.refusal or audited.supply is None or audited.fundamental is None:
        reason = audited.refusal or Finding("unknown", "refused", "the audit did not finish")
        return Refused(audited, reason, audited.findings)
    frame = turning_frame(audited.current_a, audited.voltage_v, audited.supply, audited.sample_period_s)
    frame = replace(frame, slip_phase_rad=slip_phase(frame, start.circuit))
    part = quietest(frame)
    wander = frequency_wander(frame, part)
    if wander.stops:
        return Refused(audited, wander, (*audited.findings, wander))
    search = shaft_search(audited, frame, part, plate, start)
    found = comb_search.find(frame, part, search, wishes.load_frequencies_hz)
    if lag_deg is None and wishes.wired is None:
        order = better_order(audited, frame, part, plate, start, search, found, wishes.trust)
        if isinstance(order, Finding):
            return Refused(audited, order, (*audited.findings, order))
        if order is not None:
            return observe(recording, plate, wishes, order)
    shaft_hz = found.shaft.frequency_hz if found.shaft and np.isfinite(found.shaft.frequency_std_hz) else None
    trouble = too_little(frame, part, found, search)
    if trouble is not None:
        trouble = volts_per_hertz(audited, plate) or trouble
        seen = Quantity(shaft_hz, found.shaft.frequency_std_hz) if found.shaft and shaft_hz is not None else None
        return Refused(audited, trouble, (*audited.findings, trouble), seen)
    poles = pole_count(found, found.spectrum, plate.pole_pairs, wishes.load_frequencies_hz)
    if poles is not None:
        audited = replace(audited, findings=(*audited.findings, poles))
        if poles.stops:
            return Refused(audited, poles, audited.findings)
    against, said = against_plate(audited, shaft_hz, plate), doubt_of(audited, shaft_hz, plate)
    if said is not None:
        audited = replace(audited, findings=(*audited.findings, said))
    blurred = None if against is None else unresolved_shaft(audited, shaft_hz, float(np.ptp(frame.time_s[part])), plate)
    if blurred is not None:
        return Refused(audited, blurred, (*audited.findings, blurred))
    if against is not None:
        other = unscaled_order_deg(audited, shaft_hz, plate)
        if lag_deg is None and other is not None:
            return observe(recording, plate, wishes, other)
        if wishes.trust == "plate" and against.likely is not None:
            return observe(over_currents(recording, against.likely), plate, replace(wishes, trust=None), lag_deg)
        finding = of_contradiction(against, stops=wishes.trust != "data")
        audited = replace(audited, findings=(*audited.findings, finding))
        if finding.stops:
            return Refused(audited, finding, audited.findings)
    inertia = wishes.inertia_kg_m2 if wishes.inertia_kg_m2 is not None else plate.inertia_kg_m2
    return _invert(audited, frame, part, search, found, start, plate, inertia)


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
    members = members_of(found)
    combs = tuple(
        comb_search.comb_of(frame, part, member, [m.frequency_hz for m in members[:k]])
        for k, member in enumerate(members)
    )
    assert found.shaft is not None
    shaft_speed = 2 * np.pi * found.shaft.frequency_hz
    shaft_std = 2 * np.pi * found.shaft.frequency_std_hz
    delay_std = audited.sensors.skew_std_s
    lines = _lines(audited, frame, part, combs)
    lines, problem, fitted, kept = estimate(lines, len(combs), start, pairs, shaft_speed, shaft_std, delay_std)
    if len(combs) > 1:
        bent = with_wobble(combs, problem, fitted, kept, shaft_speed)
        if bent is not None:
            combs = bent
            lines = _lines(audited, frame, part, combs)
            lines, problem, fitted, kept = estimate(lines, len(combs), start, pairs, shaft_speed, shaft_std, delay_std)
    solved = with_systematic(
        waveform.solve(problem, fitted, kept), audited.sensors.gain_std, lines, len(combs), problem, fitted, start
    )
    period = characteristic(audited, frame, part, combs, found.shaft.frequency_hz, problem, solved, inertia)
    torque, torque_std, sensor_std = waveform.mean_torque_nm(problem, solved)
    torque, torque_std = whole_record_torque(frame, part, found, fitted, pairs, (torque, torque_std))
    assert audited.fundamental is not None
    torque_std = float(
        np.hypot(torque_std, lost_in_loop_w(audited.fundamental, plate) * pairs / lines.supply_rad_per_s)
    )
    ripple = solved.speed.amplitude_rad_per_s / problem.lines.rate_rad_per_s[problem.on.positive]
    ripple_rad = float(np.sqrt(2 * np.sum(np.abs(ripple) ** 2)))
    whole, whole_std = whole_record_speed(frame, part, found, lines, ripple_rad, fitted)
    slip = slip_of(shaft_speed, lines.supply_rad_per_s, pairs)
    bands = side_bands(found, search.supply_hz, slip, float(abs(lines.current_a[0])))
    proof = prove(audited, frame, part, combs, problem, solved, fitted.delay_s)
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
            load_periods(members, combs, found.shaft.frequency_hz, problem, solved, float(np.ptp(frame.time_s[part])))
        ),
        whole,
        whole_std,
        shaft_speed,
        torque,
        torque_std,
        sensor_std,
        proof,
        (
            *audited.findings,
            *late_currents(fitted.delay_s, fitted.delay_std_s),
            frequency_wander(frame, part),
            *bar_or_load(bands),
        ),
        inertia,
        bands,
    )


def _lines(audited: Audited, frame: TurningFrame, part: slice, combs: tuple[Comb, ...]) -> Lines:
    """All lines of the segment, the voltages at load frequencies as the feeder makes them."""
    lines = separate(frame, part, list(combs), SUPPLY_ORDERS)
    return feeder.quieten(replace(lines, asymmetry=audited.sensors.asymmetry), len(combs))
