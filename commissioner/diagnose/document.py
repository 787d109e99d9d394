"""The JSON document of `diagnose`: the contract's keys, more numbers beside them."""

from __future__ import annotations

from collections.abc import Mapping

from commissioner.diagnose.contract import CONVENTION, CauseDocument, DiagnosisDocument, Measured
from commissioner.diagnose.diagnosis import NEVER_NAMEABLE, Diagnosis
from commissioner.diagnose.points.diagnosis import PointsDiagnosis
from commissioner.diagnose.search.journal import written
from commissioner.diagnose.verdict.causes import Cause
from commissioner.diagnose.verdict.detection_limits import detection_limits
from commissioner.errors import DataRefused
from commissioner.motor.circuit import Quantity

OF_RECORDINGS = (
    "resistance, leakage and time constant of the rotor are those of slow currents; a sensor's full scale is twice the rated peak "
    "current; the shaft's speed is electrical"
)


def as_document(seen: Diagnosis) -> DiagnosisDocument:
    """Document of a recording's diagnosis."""
    held, noise, left = seen.held_out, seen.noise, seen.left
    document: DiagnosisDocument = {
        "verdict": seen.verdict,
        "reason": seen.reason,
        "kind": "recording",
        "convention": f"{CONVENTION}; {OF_RECORDINGS}",
        "causes": [_cause(c) for c in seen.causes],
        "gain": {
            "held_out": held.share if held and held.is_measured else None,
            "rmse_before_a": held.rmse_before_a if held else None,
            "rmse_after_a": held.rmse_after_a if held else None,
            "noise_floor_a": held.noise_a if held else None,
            "explained_share": seen.explained_share if held else None,
            "structured_error_over_noise": left.sigma if left else None,
        },
        "noise": None
        if noise is None
        else {
            "source": noise.source,
            "is_known": noise.is_known,
            "is_white": noise.is_white,
            "sigma_a": [float(x) for x in noise.sigma_a],
        },
        "parameters_before": _quantities(seen.parameters_before),
        "parameters_after": _quantities(seen.parameters_after),
        "below_materiality": list(seen.below_materiality),
        "detection_limits": detection_limits(seen.found) if seen.found else {},
        "cannot_tell": list(NEVER_NAMEABLE) if seen.found else [],
        "line_levels_db": dict(seen.split.level_db) if seen.split else {},
        "audit": list(seen.audit.sentences),
        "remarks": list(seen.remarks),
        "is_complete": seen.is_complete,
        "search": written(seen.steps),
        "next_experiment": seen.next_experiment,
        "model_file": None,
    }
    if seen.refusal is not None:
        document["error"] = seen.refusal.as_dict()
    return document


def _cause(cause: Cause) -> CauseDocument:
    return {
        "name": cause.name,
        "title": cause.title,
        "parameters": {k: {"value": v, "std": s, "unit": u} for k, (v, s, u) in cause.sizes.items()},
        "gain_share": cause.gain_share,
        "confidence": cause.confidence,
        "equivalent": list(cause.equivalent),
        "strength_over_noise": cause.strength_sigma,
        "delta_chi2": cause.delta_chi2,
        "alternatives": dict(cause.rivals.items()),
        "found_by": "audit" if cause.from_audit else "fit",
    }


def _quantities(values: Mapping[str, Quantity]) -> dict[str, Measured]:
    return {name: {"value": q.value, "std": q.std} for name, q in values.items()}


def points_document(seen: PointsDiagnosis) -> DiagnosisDocument:
    """Document of a points table's diagnosis; errors are of the predicted line current, left-out points."""
    return {
        "verdict": seen.verdict,
        "reason": seen.reason,
        "kind": "points",
        "test": seen.test,
        "convention": CONVENTION,
        "causes": [
            {
                "name": c.name,
                "parameters": {k: {"value": v, "std": s, "unit": u} for k, (v, s, u) in c.sizes.items()},
                "gain_share": c.gain_share,
                "confidence": 1.0 - min(c.p_value * 100.0, 0.5),
                "equivalent": [],
                "p_value": c.p_value,
            }
            for c in seen.causes
        ],
        "gain": {
            "held_out": seen.held_out_gain,
            "rmse_before_a": seen.rmse_before_a,
            "rmse_after_a": seen.rmse_after_a,
            "noise_floor_a": None,
            "relative_error_before": seen.relative_before,
            "relative_error_after": seen.relative_after,
        },
        "parameters_before": _quantities(seen.parameters_before),
        "parameters_after": _quantities(seen.parameters_after),
        "tested_p_values": dict(seen.tested),
        "remarks": list(seen.points.remarks),
        "points": _points(seen),
        "next_experiment": None,
        "model_file": None,
    }


def _points(seen: PointsDiagnosis) -> list[dict[str, float | None]]:
    """Every point with the relative error of its predicted current and power, left out of the fit and in it."""
    columns = {
        "frequency_hz": seen.points.frequency_hz,
        "voltage_line_v": seen.points.voltage_line_v,
        "current_line_a": seen.points.current_line_a,
        "power_w": seen.points.power_w,
    }
    for when, errors in (("before", seen.errors_before), ("after", seen.errors_after)):
        for how, table in (("left_out", errors.left_out), ("fitted", errors.fitted)):
            for k, what in enumerate(("current", "power")):
                columns[f"{what}_error_{when}_{how}"] = table[:, k]
    return [{key: float(column[k]) for key, column in columns.items()} for k in range(seen.points.count)]


def refused_document(refusal: DataRefused, kind: str) -> DiagnosisDocument:
    """The document where nothing could be answered."""
    return {
        "verdict": "refused",
        "reason": f"{refusal.what}; {refusal.remedy}",
        "error": refusal.as_dict(),
        "kind": kind,
        "convention": CONVENTION,
        "causes": [],
        "gain": {"held_out": None, "rmse_before_a": None, "rmse_after_a": None, "noise_floor_a": None},
        "parameters_before": {},
        "parameters_after": {},
        "next_experiment": None,
        "model_file": None,
    }
