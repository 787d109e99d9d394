"""What part of the data says: currents without voltages, a recording without a plate. Each number that is withheld has its reason."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from commissioner.monitor.chain import Wishes
from commissioner.monitor.intake.audit import inspect, measure_fundamental
from commissioner.monitor.intake.columns import complete
from commissioner.monitor.intake.findings import Audited, Finding, Fundamental
from commissioner.monitor.loads.pairing_by_slip import LEAST_SLIP_STD
from commissioner.monitor.machine.fit import PRIOR_FROM_NAMEPLATE, Start
from commissioner.monitor.machine.slow_slip import slip_phase
from commissioner.monitor.periods import combs, periods
from commissioner.monitor.periods.combs import mean_supply
from commissioner.monitor.periods.periods import ShaftSearch, slip_of
from commissioner.monitor.periods.side_bands import SideBands, bar_or_load, side_bands
from commissioner.monitor.periods.steadiness import frequency_wander, too_little
from commissioner.monitor.signals.quiet import quietest
from commissioner.monitor.signals.supply import (
    TurningFrame,
    Vector,
    dominant_frequency_hz,
    follow_supply,
    phase_voltages,
    space_vector,
    turning_frame,
)
from commissioner.motor.circuit import Quantity
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import from_nameplate, slip_at_current, stator_impedance
from commissioner.records import ONE_CURRENT, UNUSED_VOLTAGE, RunningRecording

SLIP_TRUST = 0.5
"""Relative standard deviation of the slip that a current alone suggests: at light load it is that of the magnetizing current."""
LEAST_S = 1.0
MOST_LINES = 6
NEAR_SUPPLY_HZ = 0.6
"""A line of the mains' own within so much of a multiple of their frequency."""
NO_VOLTAGE = "no voltages were recorded"
NO_PHASES = "one current tells nothing of the other phases"
NO_PLATE = "no nameplate is known (--motor, or the recording's metadata)"
OF_POWER = ("voltage_rms_v", "voltage_unbalance", "power_w", "reactive_power_var", "power_factor")
OF_SHAFT = ("mean_speed_rad_per_s", "slip", "rotor_side_bands")
OF_PHASES = ("current_unbalance", "runs_backwards")
OF_MODEL = ("parameters", "waveforms", "current_resimulation_error", "negative_sequence_excess_percent")
"""What takes voltages, what takes the shaft's line, what takes more than one current, and what takes all and a plate."""


@dataclass(frozen=True)
class Line:
    """A modulation of the current, Hz, and how far it stands above the noise around it."""

    frequency_hz: float
    above_floor: float


@dataclass(frozen=True)
class Partial:
    """What is known, the indicators by name, and what is withheld with the reason."""

    speed_rad_per_s: Quantity | None
    torque_nm: Quantity | None
    supply_hz: float
    lines: tuple[Line, ...]
    indicators: Mapping[str, float]
    withheld: Mapping[str, str]
    findings: tuple[Finding, ...] = ()
    by_slip_nm: float | None = None
    """Torque that the plate has at this slip at its own voltage: only tells operating points apart."""
    side_bands: SideBands | None = None


def of_currents(recording: RunningRecording, plate: Nameplate, wishes: Wishes) -> Partial | Finding:
    """Speed, periodicities and indicators of a recording without voltages; a finding where the currents cannot carry them.

    The supply's angle is that of the currents' own fundamental, its size the plate's: good for where the lines lie, and
    for nothing that needs power.
    """
    made = _with_made_voltages(recording, plate)
    if made is None:
        return Finding(
            "currents_only", "refused", "the currents show no supply frequency", None, "a steady fundamental",
            "record a second of steady running, with voltages where a torque is wanted",
        )  # fmt: skip
    start = wishes.start or Start(from_nameplate(plate), PRIOR_FROM_NAMEPLATE, "nameplate")
    audited = inspect(made, plate, start.circuit)
    if audited.refusal or audited.supply is None or audited.fundamental is None:
        return audited.refusal or Finding("unknown", "refused", "the audit did not finish")
    frame = turning_frame(audited.current_a, audited.voltage_v, audited.supply, audited.sample_period_s)
    frame = replace(frame, slip_phase_rad=slip_phase(frame, start.circuit))
    part = quietest(frame)
    wander = frequency_wander(frame, part)
    if wander.stops:
        return wander
    supply = mean_supply(frame, part)
    current = float(abs(frame.current_a[part].mean()))
    slip = slip_at_current(start.circuit, supply, float(abs(frame.voltage_v[part].mean())), current)
    search = ShaftSearch(
        plate.pole_pairs, supply / (2 * np.pi), slip, float(np.hypot(SLIP_TRUST * slip, LEAST_SLIP_STD))
    )
    found = combs.find(frame, part, search, wishes.load_frequencies_hz)
    trouble = too_little(frame, part, found, search)
    indicators = of_currents_alone(audited.fundamental) | {"current_rms_a": current / np.sqrt(2.0)}
    withheld = dict.fromkeys(("mean_torque_nm", *OF_MODEL, *OF_POWER), _no_voltage(recording))
    speed, by_slip, bands = None, None, None
    if trouble is None and found.shaft is not None:
        speed = Quantity(2 * np.pi * found.shaft.frequency_hz, 2 * np.pi * found.shaft.frequency_std_hz)
        seen = slip_of(speed.value, supply, plate.pole_pairs)
        by_slip = plate.rated_power_w / (plate.rated_speed_rpm * np.pi / 30) * seen / plate.rated_slip
        indicators["slip"] = seen
        bands = side_bands(found, supply / (2 * np.pi), seen, current)
        if bands is None:
            withheld["rotor_side_bands"] = "at this slip they lie too near the fundamental for the length recorded"
    else:
        withheld |= dict.fromkeys(OF_SHAFT, trouble.what if trouble else "no line of the shaft is seen")
    own = tuple(Line(f.frequency_hz, f.evidence) for f in (found.shaft, *found.loads) if f is not None)
    hidden = {
        "third_voltage",
        "crossed_channels",
        "computed_voltage",
        *(("computed_current",) if _is_one(recording) else ()),
    }
    notes = (*(f for f in audited.findings if f.code not in hidden), *bar_or_load(bands))
    whole = Partial(speed, None, supply / (2 * np.pi), own, indicators, withheld, notes, by_slip, bands)
    return _of_one(whole) if _is_one(recording) else whole


def _is_one(recording: RunningRecording) -> bool:
    """Whether one current stands for the three."""
    return any(note.code == ONE_CURRENT for note in recording.notes)


def _of_one(part: Partial) -> Partial:
    """What one current tells: nothing that compares the phases."""
    told = {name: value for name, value in part.indicators.items() if name not in OF_PHASES}
    return replace(part, indicators=told, withheld={**part.withheld, **dict.fromkeys(OF_PHASES, NO_PHASES)})


def _no_voltage(recording: RunningRecording) -> str:
    """Why there is none: the columns in volts that could not be used, or that there are none."""
    return next((note.what for note in recording.notes if note.code == UNUSED_VOLTAGE), NO_VOLTAGE)


def without_plate(recording: RunningRecording) -> Partial | Finding:
    """What needs no plate: what the terminals take, their unbalance, and what modulates the current."""
    completed, _ = complete(recording)
    good = np.all([np.isfinite(x) for x in completed.currents_a], axis=0)
    period = recording.sample_period_s
    if good.sum() * period < LEAST_S or not period > 0.0:
        return Finding(
            "too_short", "refused", f"the recording holds {good.sum() * period:.2g} s", float(good.sum() * period),
            f"{LEAST_S:g} s", "record longer",
        )  # fmt: skip
    i = _centred(space_vector(*(np.nan_to_num(x) for x in completed.currents_a)))
    volts = completed.voltages_v
    has_volts = all(np.isfinite(x).any() for x in volts)
    star = phase_voltages(*volts) if recording.voltages_are_line_to_line else volts
    v = _centred(space_vector(*(np.nan_to_num(x) for x in star))) if has_volts else i
    signed = dominant_frequency_hz(v, period)
    if abs(signed) < 1.0 or not np.std(np.abs(i)) < 0.7 * np.mean(np.abs(i)):
        return Finding(
            "no_supply", "refused", "the signals show no steady supply frequency", abs(signed), "three phases of a running motor",
            "record a second of steady running",
        )  # fmt: skip
    i, v = (i, v) if signed > 0 else (np.conj(i), np.conj(v))
    supply = follow_supply(v, period, abs(signed))
    f = measure_fundamental(i, v, supply, period, signed < 0)
    frame = turning_frame(i, v, supply, period)
    indicators = of_terminals(f) if has_volts else of_currents_alone(f)
    withheld = dict.fromkeys(("mean_torque_nm", *OF_SHAFT, *OF_MODEL), NO_PLATE)
    if not has_volts:
        withheld |= dict.fromkeys(OF_POWER, _no_voltage(recording))
    whole = Partial(None, None, f.frequency_hz, _lines(frame, f.frequency_hz), indicators, withheld)
    return _of_one(whole) if _is_one(recording) else whole


def _with_made_voltages(recording: RunningRecording, plate: Nameplate) -> RunningRecording | None:
    """The recording with the phase voltages that the plate's circuit would have at these currents."""
    completed, _ = complete(recording)
    i = _centred(space_vector(*(np.nan_to_num(x) for x in completed.currents_a)))
    period = recording.sample_period_s
    if i.size < 200 or not period > 0.0:
        return None
    signed = dominant_frequency_hz(i, period)
    if abs(signed) < 1.0 or abs(signed) * period > 0.25:
        return None
    turned = i if signed > 0 else np.conj(i)
    supply = follow_supply(turned, period, abs(signed))
    angle = supply.angle_rad(np.arange(i.size) * period)
    amplitude = float(abs(np.mean(turned * np.exp(-1j * angle))))
    circuit, omega = from_nameplate(plate), 2 * np.pi * abs(signed)
    volts = float(np.sqrt(2 / 3) * plate.rated_voltage_v * abs(signed) / plate.rated_frequency_hz)
    slip = slip_at_current(circuit, omega, volts, amplitude)
    lag = float(np.angle(stator_impedance(circuit, omega, slip)))
    sign = 1.0 if signed > 0 else -1.0
    u, v, w = (volts * np.cos(angle + lag - sign * k * 2 * np.pi / 3) for k in range(3))
    return replace(recording, voltages_v=(u, v, w), voltages_are_line_to_line=False)


def _centred(x: Vector) -> Vector:
    return np.asarray(x - x.mean())


def of_terminals(f: Fundamental) -> dict[str, float]:
    """What the fundamental alone says."""
    return {
        "voltage_rms_v": float(abs(f.voltage_v) / np.sqrt(2.0)), "voltage_unbalance": f.voltage_unbalance, "power_w": f.power_w,
        "reactive_power_var": f.reactive_var, "power_factor": f.power_factor, **of_currents_alone(f),
    }  # fmt: skip


def of_currents_alone(f: Fundamental) -> dict[str, float]:
    """What its currents say."""
    return {
        "current_rms_a": float(abs(f.current_a) / np.sqrt(2.0)), "current_unbalance": f.current_unbalance,
        "runs_backwards": f.runs_backwards,
    }  # fmt: skip


def _lines(frame: TurningFrame, supply_hz: float) -> tuple[Line, ...]:
    """The strongest modulations of the current that are not the mains' own, each once."""
    current = frame.current_a - frame.current_a.mean()
    spectrum = periods.pair_spectrum(
        current, frame.sample_period_s, 0.95 * frame.band_hz, float(abs(frame.current_a.mean()))
    )
    f, power = spectrum.frequency_hz, spectrum.power.copy()
    reach = max(2.0 * spectrum.cell_hz, NEAR_SUPPLY_HZ)
    power[(periods.beside_multiple(f, supply_hz) < reach) | (f < periods.LOWEST_LOAD_HZ)] = 0.0
    out: list[Line] = []
    while len(out) < MOST_LINES and power.max() > periods.SIGNIFICANT:
        k = int(np.argmax(power))
        out.append(Line(float(f[k]), float(power[k])))
        power[np.abs(f - f[k]) < 3.0 * spectrum.cell_hz] = 0.0
    return tuple(out)


def refused_audit(recording: RunningRecording, finding: Finding | None) -> Audited:
    """An audit of what was said on reading and one finding, for what never came to one."""
    empty = np.zeros(0, dtype=np.complex128)
    notes = tuple(Finding(n.code, "note", n.what) for n in recording.notes)
    return Audited(
        0, 0.0, recording.sample_period_s, empty, empty, None, None, (*notes, *([finding] if finding else [])), {}
    )
