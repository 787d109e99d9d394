"""The extended model as a document: what `commissioner simulate` plays and `python -m sim` reads.

Zero effects = the plain four-parameter motor. `terms` and `dictionary` are exact, `effects` the same in engineering
sizes, `scenario` the nearest machine of the simulated inverter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.export.contract import DictionaryEntry, ModelDocument, Nominal, TermRow
from commissioner.diagnose.export.scenario import scenario
from commissioner.diagnose.plant.model import KINDS, Layout, Model, Term
from commissioner.encoding import JsonObject

FORMAT = 5
"""2: a lag is its sum and its shape, no longer two time constants. 3: tilts of L_sigma and L_M are what they become together.

4: heat leaks away with more time constants, and the channels behind it have moved. 5: numbers name the channel they multiply.
"""


def model_document(found: Any, causes: Sequence[Any]) -> ModelDocument:
    """A JSON/TOML-ready document of the fitted model."""
    model = found.fit.model
    for cause in CATALOGUE.values():
        model = cause.without_recorded(model, found.record)
    kept = [(t, v) for t, v in zip(model.terms, model.values, strict=True) if v]
    return {
        "kind": "extended_model",
        "format": FORMAT,
        "nominal": nominal_of(model.nominal),
        "nameplate": {k: v for k, v in found.record.facts.metadata.items() if not isinstance(v, bool)},
        "effects": {c.name: {key: value for key, (value, _, _) in c.sizes.items()} for c in causes},
        "terms": [_term(t, v) for t, v in kept],
        "dictionary": _dictionary(found.layout) if kept else {},
        "lines_hz": dict(found.setting.lines_hz),
        "scenario": scenario(model, found.setting, causes),
    }


def nominal_of(values: tuple[float, float, float, float]) -> Nominal:
    """R_s, R_R, L_sigma, L_M by their names."""
    r_s, r_r, l_sigma, l_m = values
    return {
        "stator_resistance_ohm": r_s, "rotor_resistance_ohm": r_r, "leakage_inductance_h": l_sigma,
        "magnetizing_inductance_h": l_m,
    }  # fmt: skip


def _term(term: Term, value: float) -> TermRow:
    return {
        "effect": term.effect,
        "symbol": term.symbol,
        "unit": term.unit,
        "kind": term.kind,
        "index": term.index,
        "segment": term.segment,
        "channel": term.channel,
        "value": value,
    }


def _dictionary(layout: Layout) -> dict[str, DictionaryEntry]:
    out: dict[str, DictionaryEntry] = {}
    for key, value in ((f.name, getattr(layout, f.name)) for f in fields(layout)):
        if isinstance(value, np.ndarray):
            out[key] = value.tolist()
        else:
            out[key] = value
    return out


def model_from(document: Mapping[str, Any]) -> tuple[Model, Layout | None]:
    """The model and its dictionary back from the document. KeyError, TypeError or ValueError where it is not one."""
    if not isinstance(document, Mapping) or document.get("kind") != "extended_model":
        raise ValueError("not an extended model")
    if document.get("format") != FORMAT:
        raise ValueError(
            f"an extended model of format {document.get('format')}, read is {FORMAT}: diagnose the recording again"
        )
    n = document["nominal"]
    nominal = (
        float(n["stator_resistance_ohm"]),
        float(n["rotor_resistance_ohm"]),
        float(n["leakage_inductance_h"]),
        float(n["magnetizing_inductance_h"]),
    )
    terms = tuple(
        Term(
            t["effect"],
            t["symbol"],
            t["unit"],
            int(t["kind"]),
            int(t["index"]),
            1.0,
            segment=int(t["segment"]),
            channel=str(t["channel"]),
        )
        for t in document["terms"]
    )
    values = tuple(float(t["value"]) for t in document["terms"])
    if not min(nominal) > 0.0 or not np.isfinite([*nominal, *values]).all():
        raise ValueError(f"R_s, R_R, L_sigma and L_M must be above zero, and every number finite: {nominal}")
    if unknown := sorted({t.kind for t in terms} - KINDS):
        raise ValueError(f"numbers of kind {unknown[0]}, which no effect has")
    if terms and not document["dictionary"]:
        raise ValueError("numbers without the dictionary they refer to")
    return Model(nominal, terms, values), _layout(document["dictionary"]) if document["dictionary"] else None


def _layout(entry: Mapping[str, Any]) -> Layout:
    arrays = {"legs_vectors", "iron_vectors", "leak_vectors", "stop_radius_wb", "branch_time_s", "channel_ends_a"}
    values: dict[str, Any] = {k: (np.array(v, dtype=float) if k in arrays else v) for k, v in entry.items()}
    return Layout(**values)


def plain(document: Mapping[str, Any]) -> JsonObject:
    """A nominal-only copy of a document that was read."""
    return {**document, "effects": {}, "terms": [], "dictionary": {}}
