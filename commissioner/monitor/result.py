"""The answer as plain numbers: the contract's JSON keys, and what the data could not fix, in words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, astuple, fields
from typing import cast

import numpy as np

from commissioner.monitor.chain import Observation, Refused
from commissioner.monitor.contract import (
    AuditDocument,
    FindingRow,
    Indicators,
    LineRow,
    LoadTorque,
    Measured,
    MonitoringDocument,
    OpenDirection,
    PartialMonitoring,
    RefusedMonitoring,
    SensorsDocument,
    SideBands,
    State,
    TModel,
    TrendDocument,
    WatchedRow,
)
from commissioner.monitor.intake.findings import Audited, Finding
from commissioner.monitor.machine.fit import NAMES, Fitted
from commissioner.monitor.machine.waveform import Solved
from commissioner.monitor.partial import Partial, of_terminals
from commissioner.monitor.periods.side_bands import SideBands as BesideSupply
from commissioner.monitor.trend.indicators import Indicator, Pulses
from commissioner.monitor.trend.trend import FALSE_ALARM, Entry, Verdict
from commissioner.motor.circuit import EQUAL_LEAKAGE, PARAMETERS, QUANTILE
from commissioner.motor.running import TCircuit

QUANTITIES = "SI, per-phase star equivalent, referred to the stator; std is one standard deviation"
OPEN = 0.25
"""A combination that keeps more than this share of its prior variance was not fixed by the data."""
UNBALANCE_NOISE, SIDE_BAND_NOISE_DB = 0.002, 3.0
"""Scatter from recording to recording of the current's unbalance (clamps of 0.1 %) and of a side band's level near the floor."""
LARGE_WEIGHT = 0.2
"""A parameter with less weight (of a unit vector) is not named as part of that combination."""
WORDS = {
    "stator_resistance_ohm": "R_s",
    "rotor_resistance_ohm": "R_r",
    "magnetizing_inductance_h": "L_m",
    "leakage_inductance_h": "L_l",
}


def quantity(value: float, std: float) -> Measured:
    return {"value": float(value), "std": float(std)}


def as_document(
    observation: Observation, pulses: Pulses | None, indicators: list[Indicator], verdict: Verdict | None
) -> MonitoringDocument:
    """The contract's `monitor` result. All quantities SI, per-phase star equivalent, referred to the stator."""
    period = observation.period
    load: LoadTorque | None = None
    if period.load_torque_nm is not None and period.load_torque_std is not None:
        load = {"rms_std_nm": float(np.sqrt(np.mean(period.load_torque_std**2)))}
    return {
        "outcome": "done",
        "refused_because": None,
        "mean_speed_rad_per_s": quantity(observation.mean_speed_rad_per_s, observation.mean_speed_std),
        "mean_torque_nm": {
            **quantity(observation.mean_torque_nm, observation.mean_torque_std),
            "std_from_sensors": observation.mean_torque_sensor_std,
        },
        "used": {
            "start_s": float(observation.frame.time_s[0] + observation.audited.start_s),
            "end_s": float(observation.frame.time_s[-1] + observation.audited.start_s),
        },
        "sensors": _sensors(observation),
        "slip": observation.slip,
        "segment": _segment(observation),
        "parameters": _parameters(observation.solved),
        "t_model": _t_model(observation.solved),
        "parameters_from": observation.start.origin,
        "cannot_be_fixed": cannot_be_fixed(observation.fitted),
        "periods": [
            {
                "name": p.name,
                "frequency_hz": quantity(p.frequency_hz, p.frequency_std_hz),
                "period_s": quantity(1 / p.frequency_hz, p.frequency_std_hz / p.frequency_hz**2),
                "ratio_to_shaft": p.ratio_to_shaft,
                "follows": p.follows,
                "harmonics": p.harmonics,
                "periods_averaged": p.periods_averaged,
                "speed_ripple_rms_rad_per_s": p.speed_ripple_rad_per_s,
            }
            for p in observation.load_periods
        ],
        "waveforms": {
            "speed_rms_std_rad_per_s": float(np.sqrt(np.mean(period.speed_std**2))),
            "electromagnetic_torque_rms_std_nm": float(np.sqrt(np.mean(period.torque_std**2))),
            "load_torque": load or why_no_load_torque(observation),
            "starts_at_s": float(period.time_s[0]),
            "shaft_angle": "counted from the first row; its origin is arbitrary without an encoder",
            "contains": "what repeats with the loads; ripple at multiples of the supply frequency is left out",
        },
        "current_resimulation_error": {
            "relative_rms": observation.proof.relative_rms,
            "periodic_share": _finite(observation.proof.periodic_share),
            "over_s": float(np.ptp(observation.proof.time_s)),
        },
        "reference_speed": None,
        "indicators": indicator_document(observation, pulses, indicators),
        "trend": None if verdict is None else verdict_document(verdict),
        "audit": audit_document(observation.audited, observation.findings),
        "quantities": QUANTITIES,
    }


def why_no_load_torque(observation: Observation) -> str:
    """Words for an answer without load torque."""
    if observation.inertia_kg_m2 is None:
        return "not given: the inertia is unknown (inertia_kg_m2 or --inertia)"
    return "not given: its movement within the period is smaller than the uncertainty of that movement"


def refused_document(refused: Refused) -> RefusedMonitoring:
    """What was learned before the refusal, and the reason with its number."""
    reason = refused.reason
    return {
        "outcome": "rejected",
        "refused_because": {
            "code": reason.code,
            "what": reason.what,
            "value": reason.value,
            "limit": reason.limit,
            "remedy": reason.remedy,
        },
        "mean_speed_rad_per_s": None,
        "mean_torque_nm": None,
        "parameters": None,
        "periods": [],
        "current_resimulation_error": None,
        "indicators": _terminal(refused.audited),
        "audit": audit_document(refused.audited, refused.findings),
    }


def partial_document(part: Partial, stretches: list[State], audited: Audited) -> PartialMonitoring:
    """The numbers that could be had, and why others could not."""
    speed, torque = part.speed_rad_per_s, part.torque_nm
    bands = {} if part.side_bands is None else {"rotor_side_bands": _bands(part.side_bands)}
    return {
        "outcome": "partial",
        "mean_speed_rad_per_s": None if speed is None else quantity(speed.value, speed.std),
        "mean_torque_nm": None if torque is None else quantity(torque.value, torque.std),
        "parameters": None,
        "periods": [cast("LineRow", asdict(line)) for line in part.lines],
        "reference_speed": None,
        "indicators": {"supply_frequency_hz": part.supply_hz, **part.indicators, **bands},
        "withheld": dict(part.withheld),
        "trend": None,
        "states": stretches,
        "audit": audit_document(audited, tuple(dict.fromkeys((*audited.findings, *part.findings)))),
        "quantities": QUANTITIES,
    }


def entry_of_part(part: Partial, source: str) -> Entry | None:
    """What a baseline stores of currents alone: the operating point by the slip; None where the speed is not known,
    or nothing is there to compare."""
    if part.speed_rad_per_s is None or part.by_slip_nm is None:
        return None
    unbalance = part.indicators.get("current_unbalance")
    watched = {} if unbalance is None else {"current_unbalance": (unbalance, UNBALANCE_NOISE)}
    if part.side_bands is not None:
        watched["rotor_side_band_db"] = (part.side_bands.level_db, SIDE_BAND_NOISE_DB)
    return Entry(source, part.speed_rad_per_s.value, part.by_slip_nm, part.supply_hz, watched) if watched else None


def cannot_be_fixed(fitted: Fitted) -> OpenDirection:
    """The combination of parameters that is least known, in words, and how much of it is prior."""
    parts = [
        f"{WORDS[name]}^{weight:+.2f}"
        for name, weight in zip(NAMES, fitted.open_direction, strict=True)
        if abs(weight) > 0.05
    ]
    named = [WORDS[n] for n, w in zip(NAMES, fitted.open_direction, strict=True) if abs(w) > LARGE_WEIGHT]
    symbols = " and ".join(named) + (" together" if len(named) > 1 else "")
    std = float(np.sqrt(fitted.open_direction @ fitted.log_covariance @ fitted.open_direction))
    return {
        "combination": " * ".join(parts),
        "relative_std": std,
        "share_from_prior": fitted.open_share,
        "sentence": (
            f"This recording hardly fixes {symbols}: {fitted.open_share:.0%} of what was unsure before is left. "
            "Take them from a commissioning run."
            if fitted.open_share > OPEN
            else f"Least known: {symbols}, to ± {QUANTILE * std:.1%}; all four are usable."
        ),
    }


def indicator_document(observation: Observation, pulses: Pulses | None, indicators: list[Indicator]) -> Indicators:
    document: dict[str, Measured | SideBands | float | bool | str | None] = {
        indicator.name: quantity(indicator.quantity.value, indicator.quantity.std) for indicator in indicators
    }
    document["pulses_per_turn"] = None if pulses is None else pulses.per_turn
    document |= _terminal(observation.audited)
    bands = observation.side_bands
    document["rotor_side_bands"] = None if bands is None else _bands(bands)
    return document


def _bands(bands: BesideSupply) -> SideBands:
    return cast("SideBands", asdict(bands))


def entry_of(observation: Observation, indicators: list[Indicator], source: str) -> Entry:
    """What a baseline stores of this recording."""
    return Entry(
        source,
        observation.mean_speed_rad_per_s,
        observation.mean_torque_nm,
        observation.search.supply_hz,
        {i.name: (i.quantity.value, i.noise_std) for i in indicators},
    )


def verdict_document(verdict: Verdict) -> TrendDocument:
    return {
        "state": verdict.state.name.lower(),
        "sentence": verdict.sentence,
        "compared_with": verdict.compared_with,
        "alarms": list(verdict.names),
        "false_alarm_per_indicator": FALSE_ALARM,
        "healthy_recordings_that_alarm_against_the_others": verdict.left_out_alarms,
        "healthy_recordings_at_other_operating_points": verdict.other_operating_points,
        "watched": [cast("WatchedRow", {**asdict(w), "alarms": w.alarms}) for w in verdict.watched],
    }


def audit_document(audited: Audited, findings: tuple[Finding, ...]) -> AuditDocument:
    return {
        "sample_period_s": audited.sample_period_s,
        "channels": dict(audited.channel_map),
        "findings": [cast("FindingRow", asdict(f)) for f in findings],
    }


def _sensors(observation: Observation) -> SensorsDocument:
    """What was found of the sensors' own errors, and what was taken where one recording shows nothing."""
    trust, fitted = observation.audited.sensors, observation.fitted
    return {
        "gain_std": trust.gain_std,
        "current_to_voltage_skew_std_s": trust.skew_std_s,
        "current_delay_s": quantity(fitted.delay_s, fitted.delay_std_s),
        "asymmetry": trust.asymmetry,
        "sentence": "The currents' delay is fitted together with the motor; a gain common to three sensors does not show in a "
        "recording: each std holds its share. The asymmetry is measured: sums that should be zero.",
    }


def _terminal(audited: Audited) -> Indicators:
    """What the fundamental alone says."""
    f = audited.fundamental
    if f is None:
        return {}
    return {"supply_frequency_hz": f.frequency_hz, **of_terminals(f)}


def _segment(observation: Observation) -> dict[str, float]:
    """The stretch that was inverted; `mean_speed_rad_per_s` at the top is that of everything that was `used`."""
    time = observation.frame.time_s[observation.part] + observation.audited.start_s
    shaft = observation.found.shaft
    assert shaft is not None
    return {
        "start_s": float(time[0]),
        "end_s": float(time[-1]),
        "mean_speed_rad_per_s": observation.segment_speed_rad_per_s,
        "mean_speed_std_rad_per_s": 2 * np.pi * shaft.frequency_std_hz,
        "supply_frequency_hz": observation.lines.supply_rad_per_s / (2 * np.pi),
    }


def _parameters(solved: Solved) -> dict[str, Measured]:
    return _spread(
        solved, lambda c: (*c.as_inverse_gamma().as_tuple(), c.as_inverse_gamma().rotor_time_constant_s),
        (*PARAMETERS, "rotor_time_constant_s"),
    )  # fmt: skip


def _t_model(solved: Solved) -> TModel:
    c = solved.circuit
    share = c.stator_leakage_h / (c.stator_leakage_h + c.rotor_leakage_h)
    said = EQUAL_LEAKAGE if abs(share - 0.5) < 1e-9 else f"{share:.2f} of the leakage in the stator"
    return cast("TModel", {**_spread(solved, astuple, tuple(f.name for f in fields(c))), "assumption": said})


def _spread(
    solved: Solved, values_of: Callable[[TCircuit], tuple[float, ...]], names: tuple[str, ...]
) -> dict[str, Measured]:
    """Values of the circuit, each with what all one-sigma changes, the sensors' and the iron's too, make of it."""
    value = np.array(values_of(solved.circuit))
    moved = np.array([values_of(change[0]) for change in solved.changes])
    std = np.sqrt(np.sum((moved - value) ** 2, axis=0))
    return {name: quantity(v, s) for name, v, s in zip(names, value, std, strict=True)}


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
