"""A manufacturer's sheet as an identification, as a model for other verbs, and as what a diagnosis says of it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, cast

import numpy as np

from commissioner.diagnose.contract import DiagnosisDocument
from commissioner.diagnose.export.contract import ModelDocument
from commissioner.diagnose.export.model_file import FORMAT, nominal_of
from commissioner.diagnose.export.scenario import plain_scenario
from commissioner.encoding import plain
from commissioner.errors import DataRefused, UsageError
from commissioner.export.forms import FORMS
from commissioner.export.found import Found
from commissioner.identify.catalogue.answer import Answer, answer
from commissioner.identify.catalogue.contradictions import settled, with_plate
from commissioner.identify.catalogue.document import KIND, document
from commissioner.identify.catalogue.sheet import Sheet
from commissioner.identify.contract import SheetDocument
from commissioner.motor.circuit import EQUAL_LEAKAGE, PARAMETERS, InverseGamma, Quantity, to_t_model
from commissioner.recordings.whole import whole_file, write_texts
from commissioner.settings import load_motor

TRUSTED = frozenset({"plate", "data", "slip", "speed", "efficiency", "current", "power", "torque", "ratio", "absolute", "rated", "starting",
                     "breakdown"})  # fmt: skip
TELLS = (
    "A manufacturer's sheet leaves nothing over: its circuit meets the values, no cause can be seen or ruled out. The circuit is below; "
    "`identify` shows each value beside what the circuit makes of it."
)


def answered(sheet: Sheet, motor: str | None, trust: str | None) -> Answer:
    """DataRefused: a contradiction that nobody decided, or too little. UsageError: a trust in no word."""
    words = frozenset(w.strip() for w in (trust or "").split(",") if w.strip())
    if words - TRUSTED:
        wrong = ", ".join(sorted(words - TRUSTED))
        raise UsageError(f"there is no trust in {wrong!r}", step="command line", value=wrong, limit=", ".join(sorted(TRUSTED)),
                         remedy="say which of the two is right where they contradict each other")  # fmt: skip
    if motor is not None:
        sheet = with_plate(sheet, load_motor(motor), words)
    return answer(settled(sheet, words))


def identified(sheet: Sheet, motor: str | None, trust: str | None, out: Path | None) -> SheetDocument:
    """The document; with `out` the report, the model for `simulate`, `sim` and `--motor`, and its other forms are written there."""
    found = answered(sheet, motor, trust)
    made = document(found)
    if out is not None:
        _write(out, found, made, Path(sheet.source))
    return made


def diagnosed(sheet: Sheet, motor: str | None, trust: str | None, out: Path | None) -> DiagnosisDocument:
    """What the sheet can and cannot tell."""
    found = answered(sheet, motor, trust)
    made = document(found)
    told: dict[str, Any] = {
        "verdict": "nothing_significant", "reason": TELLS, "kind": "points", "test": KIND, "causes": [], "parameters_before": {},
        "parameters_after": made["parameters"], "next_experiment": None, "model_file": None,
        "gain": {"held_out": None, "rmse_before_a": None, "rmse_after_a": None, "noise_floor_a": None,
                 "relative_error_before": None, "relative_error_after": None},
        **{k: v for k, v in made.items() if k not in ("outcome", "reason", "parameters", "kind")},
    }  # fmt: skip
    if out is not None:
        _write(out, found, made, Path(sheet.source), told)
    return cast("DiagnosisDocument", told)


def _write(
    out: Path, found: Answer, made: Mapping[str, Any], source: Path, told: Mapping[str, Any] | None = None
) -> None:
    from commissioner.report.identification.catalogue import catalogue_page
    from commissioner.report.page import render

    texts = {"report.html": render(catalogue_page(made, source.name))}
    name = "identification.json" if told is None else "diagnosis.json"
    texts[name] = json.dumps(plain(made if told is None else told), indent=2)
    if found.plate is not None:
        texts["motor.toml"] = _motor_file(asdict(found.plate), source.stem)
        if not found.withheld:
            texts["model.json"] = json.dumps(plain(model_document(found)), indent=1)
    write_texts(out, texts)
    if "model.json" in texts and told is None:
        for form in FORMS.values():
            with whole_file(out / f"motor{form.ending}") as temporary:
                temporary.write_bytes(form.write(_found(found, source.stem)))


def _circuit(found: Answer) -> InverseGamma:
    return InverseGamma(*(found.parameters[name].value for name in PARAMETERS))


def model_document(found: Answer) -> ModelDocument:
    """The plain model that `commissioner simulate` and `python -m sim --scenario` play. DataRefused: the sheet tells a part only."""
    if found.plate is None or found.withheld:
        raise DataRefused(
            f"{found.sheet.source}: the sheet tells only a part of the motor", step="simulate", value=", ".join(found.withheld) or "plate",
            limit="all four parameters, speed and power factor", remedy="add what `commissioner identify` names",
        )  # fmt: skip
    circuit = _circuit(found)
    plate = found.plate.known()
    return {
        "kind": "extended_model", "format": FORMAT, "nominal": nominal_of(circuit.as_tuple()), "nameplate": plate,
        "effects": {}, "terms": [], "dictionary": {}, "lines_hz": {}, "scenario": plain_scenario(circuit.as_tuple(), plate),
    }  # fmt: skip


def _motor_file(plate: Mapping[str, Any], name: str) -> str:
    lines = [f"name = {json.dumps(name)}"]
    lines += [f"{k} = {json.dumps(v)}" for k, v in plate.items() if v is not None]
    return "\n".join(lines) + "\n"


def _found(found: Answer, name: str) -> Found:
    """As the forms of `runs export` are written from."""
    assert found.plate is not None
    quantities = {k: Quantity(v.value, v.std) for k, v in found.parameters.items()}
    errors = np.diag([found.parameters[name].std ** 2 for name in PARAMETERS])
    model = asdict(to_t_model(_circuit(found), errors))
    assumption = str(model.pop("assumption", EQUAL_LEAKAGE))
    return Found(
        name, "", "identified", found.plate.known(), quantities,
        {k: Quantity(*v) for k, v in model.items()}, assumption, found.stator_flux_wb, (), (), None, (),
    )  # fmt: skip
