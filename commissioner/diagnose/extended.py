"""The extended model as a document: what `commissioner simulate` plays and what a scenario of `python -m sim` needs.

Zero effects = the plain four-parameter motor. `terms` and `dictionary` are exact; `effects` gives the same in
engineering sizes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from commissioner.diagnose.plant import Layout, Model, Term

FORMAT = 1
GAMMA_KEYS = ("stator_resistance_ohm", "rotor_resistance_ohm", "leakage_inductance_h", "inductance_h")


def model_document(found: Any, causes: Sequence[Any]) -> dict[str, Any]:
    """A JSON/TOML-ready document of the fitted model."""
    r_s, r_r, l_sigma, l_m = found.fit.model.nominal
    kept = [(t, v) for t, v in zip(found.fit.model.terms, found.fit.model.values, strict=True) if t.effect and v]
    return {
        "kind": "extended_model",
        "format": FORMAT,
        "nominal": {
            "stator_resistance_ohm": r_s, "rotor_resistance_ohm": r_r,
            "leakage_inductance_h": l_sigma, "magnetizing_inductance_h": l_m,
        },
        "machine": gamma_machine(found.fit.model.nominal),
        "nameplate": {k: v for k, v in found.record.facts.metadata.items() if not isinstance(v, bool)},
        "effects": {c.name: {key: value for key, (value, _, _) in c.sizes.items()} for c in causes},
        "terms": [_term(t, v) for t, v in kept],
        "dictionary": _dictionary(found.layout) if kept else {},
        "lines_hz": dict(found.setting.lines_hz),
        "sim_effects": {c.name: sim_effect(c) for c in causes if sim_effect(c)},
    }


def gamma_machine(nominal: tuple[float, float, float, float]) -> dict[str, float]:
    """Gamma form (R_s, R_r, L_leak, L_s) of the inverse-Gamma set (Slemon 1989): ratio L_s / L_M."""
    r_s, r_r, l_sigma, l_m = nominal
    ratio = (l_m + l_sigma) / l_m
    return dict(zip(GAMMA_KEYS, (r_s, r_r * ratio**2, l_sigma * ratio, l_m + l_sigma), strict=True))


def sim_effect(cause: Any) -> dict[str, float]:
    """The cause as an entry of a simulated inverter's scenario: one size in that catalogue's unit, where it has one."""
    sizes = {key: value for key, (value, _, _) in cause.sizes.items()}
    scale = {
        "voltage_v": 1.0, "sag_at_rated_power": 1.0, "delay_us": 1e-6, "time_constant_us": 1e-6, "coercive_current_a": 1.0,
        "flux_wb": 1.0, "conductance_ms": 1e-3, "rise_per_minute_at_rated_current": 1.0, "drift_ppm": -1.0,
        "speed_rad_per_s": 1.0, "capacitance_nf": 1e-9, "step_a": 1.0,
    }
    first = next(iter(sizes), "")
    if first.startswith("amplitude_"):
        return {"size": sizes[first]}
    return {"size": sizes[first] * scale[first]} if first in scale else {}


def _term(term: Term, value: float) -> dict[str, Any]:
    return {
        "effect": term.effect, "symbol": term.symbol, "unit": term.unit, "kind": term.kind, "index": term.index,
        "segment": term.segment, "value": value,
    }


def _dictionary(layout: Layout) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for key, value in ((f.name, getattr(layout, f.name)) for f in fields(layout)):
        if isinstance(value, np.ndarray):
            out[key] = value.tolist()
        else:
            out[key] = value
    return out


def model_from(document: Mapping[str, Any]) -> tuple[Model, Layout | None]:
    """The model and its dictionary back from the document. KeyError or ValueError where it is not one."""
    if document.get("kind") != "extended_model" or document.get("format") != FORMAT:
        raise ValueError("not an extended model of a known format")
    n = document["nominal"]
    nominal = (
        float(n["stator_resistance_ohm"]), float(n["rotor_resistance_ohm"]),
        float(n["leakage_inductance_h"]), float(n["magnetizing_inductance_h"]),
    )
    terms = tuple(
        Term(t["effect"], t["symbol"], t["unit"], int(t["kind"]), int(t["index"]), 1.0, segment=int(t["segment"]))
        for t in document["terms"]
    )
    values = tuple(float(t["value"]) for t in document["terms"])
    return Model(nominal, terms, values), _layout(document["dictionary"]) if document["dictionary"] else None


def _layout(entry: Mapping[str, Any]) -> Layout:
    arrays = {"legs_vectors", "iron_vectors", "leak_vectors", "stop_radius_wb", "branch_time_s"}
    values: dict[str, Any] = {k: (np.array(v, dtype=float) if k in arrays else v) for k, v in entry.items()}
    return Layout(**values)


def plain(document: Mapping[str, Any]) -> dict[str, Any]:
    """A nominal-only copy of a document."""
    return {**document, "effects": {}, "terms": [], "dictionary": {}}


__all__ = ["gamma_machine", "model_document", "model_from", "plain"]
