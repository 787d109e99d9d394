"""The JSON of a running diagnosis: the keys that a standstill one promises, and what a running one adds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from commissioner.motor.circuit import Quantity
from commissioner.running.at_flux import OF_IRON
from commissioner.running.causes import CATALOGUE
from commissioner.running.diagnosis import Diagnosis, NamedCause

if TYPE_CHECKING:
    from commissioner.diagnose.contract import (
        CauseDocument,
        DiagnosisDocument,
        Excitation,
        Limit,
        Measured,
        NothingRecorded,
    )

CONVENTION = "SI, per-phase star equivalent, referred to the stator; std is one standard deviation; all but the stator resistance at the stated flux where saturation is named"
NEVER_NAMEABLE = (
    "common gain of the current sensors | common gain of the voltage sensors | all impedances",
    "delay | first-order lag of the current sensors",
    "resistance in all lines | R_s",
)


def as_document(seen: Diagnosis) -> DiagnosisDocument:
    """Plain JSON types."""
    gain, left, found, record = seen.gain, seen.left, seen.found, seen.record
    document: DiagnosisDocument = {
        "verdict": seen.verdict,
        "reason": seen.reason,
        "kind": "recording",
        "test": "running",
        "convention": CONVENTION,
        "causes": [_cause(c) for c in seen.causes],
        "gain": {
            "held_out": gain.held_out if gain else None,
            "rmse_before_a": gain.rmse_before_a if gain else None,
            "rmse_after_a": gain.rmse_after_a if gain else None,
            "noise_floor_a": gain.noise_floor_a if gain else None,
            "explained_share": gain.explained_share if gain else None,
            "structured_error_over_noise": left.sigma if left else None,
        },
        "noise": None if record is None else {
            "source": "sixth differences, and the voltage's noise through the fitted machine", "is_known": True, "is_white": False,
            "sigma_a": list(record.sigma_a),
        },
        "parameters_before": _quantities(seen.parameters_before),
        "parameters_after": _quantities(seen.parameters_after, seen.stator_flux_wb),
        "below_materiality": list(dict.fromkeys(t.cause.cause for t in found.trifles)) if found else [],
        "detection_limits": _limits(seen),
        "cannot_tell": list(NEVER_NAMEABLE) if found else [],
        "left_by_state_over_noise": dict(left.by_state) if left else {},
        "shaft_lines": [{"per_turn": line.per_turn, "over_noise": line.sigma} for line in left.shaft_lines] if left else [],
        "excitation": _excitation(seen),
        "audit": [],
        "remarks": list(seen.remarks),
        "is_complete": seen.is_complete,
        "next_experiment": None if seen.next_experiment is None else {
            "do": seen.next_experiment.do, "steps": list(seen.next_experiment.steps), "splits": list(seen.next_experiment.splits),
            "repeats": seen.next_experiment.repeats, "command": seen.next_experiment.command,
        },
        "model_file": None,
    }  # fmt: skip
    if seen.refusal is not None:
        document["error"] = seen.refusal.as_dict()
    return document


def _excitation(seen: Diagnosis) -> Excitation | NothingRecorded:
    """What the recording has that separates causes: seconds of each state, speed measured, currents measured."""
    record = seen.record
    if record is None:
        return {}
    from commissioner.estimation.record import STATES

    seconds = {
        name: float(sum((w.state == k).sum() for w in record.windows)) * record.period_s
        for k, name in enumerate(STATES)
    }
    return {
        "seconds": {k: v for k, v in seconds.items() if v},
        "has_speed": record.has_speed,
        "has_three_currents": record.has_zero,
        "has_start": record.has_start,
    }


def _cause(c: NamedCause) -> CauseDocument:
    entry = CATALOGUE[c.name]
    return {
        "name": c.name,
        "title": entry.title,
        "form": c.form,
        "parameters": {k: {"value": v, "std": s, "unit": u} for k, (v, s, u) in c.sizes.items()},
        "gain_share": c.gain_share,
        "confidence": c.confidence,
        "equivalent": list(c.equivalent),
        "strength_over_noise": c.strength_sigma,
        "delta_chi2": c.delta_chi2,
        "alternatives": dict(c.rivals),
        "found_by": "fit",
        "is_of_measurement": entry.is_of_measurement,
    }


def _limits(seen: Diagnosis) -> dict[str, Limit | dict[str, Limit]]:
    """Smallest size of what was not found, six standard deviations beside all that was."""
    if seen.found is None or seen.record is None:
        return {}
    out: dict[str, Limit | dict[str, Limit]] = {}
    for name, number in seen.found.limits.items():
        if not number < 1e3:
            continue
        cause = CATALOGUE[name]
        own = dict.fromkeys((n for f in cause.forms for n in f.numbers), 0.0) | {cause.forms[0].numbers[0]: number}
        key, (size, unit) = next(iter(cause.sizes({**seen.numbers(), **own}, seen.record.scales).items()))
        out[name] = {"value": abs(size), "unit": unit, "of": key}
    return out


def _quantities(values: Mapping[str, Quantity], flux_wb: float | None = None) -> dict[str, Measured]:
    """`flux_wb`: peak stator flux at which `OF_IRON` hold, where that is not one value for all."""
    out: dict[str, Measured] = {name: {"value": q.value, "std": q.std} for name, q in values.items()}
    for name in OF_IRON if flux_wb is not None else ():
        out[name]["at_stator_flux_wb"] = flux_wb
    return out
