"""The forms by name: which ending a file of each has, and what writes it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from commissioner.errors import UsageError
from commissioner.export import lists, matlab, modelica, motulator
from commissioner.export.found import Found

SAMPLES = "samples"
"""The form that is a recording, not a model."""


@dataclass(frozen=True)
class Form:
    ending: str
    write: Callable[[Found], bytes]
    says: str


FORMS: Mapping[str, Form] = {
    "csv": Form(".csv", lists.as_csv, "parameter list with registers, a table"),
    "json": Form(".json", lists.as_json, "parameter list with registers, curve and leg's loss"),
    "motulator": Form(".py", motulator.as_module, "module for motulator 0.5"),
    "matlab": Form(".mat", matlab.as_struct, "struct for MATLAB and Simulink"),
    "modelica": Form(".mo", modelica.as_record, "record for Modelica.Electrical.Machines"),
}


def form_named(name: str, target: Path) -> Form:
    """UsageError: no such form, or the file's name has another's ending."""
    if name not in FORMS:
        raise UsageError(
            f"there is no form {name!r}",
            step="export",
            value=name,
            limit=", ".join((SAMPLES, *FORMS)),
            remedy="give one of these names",
        )
    if target.suffix != FORMS[name].ending:
        raise UsageError(
            f"{target.name} is not the name of a {name} file", step="export", value=target.suffix, limit=FORMS[name].ending,
            remedy=f"end the name in {FORMS[name].ending}",
        )  # fmt: skip
    return FORMS[name]
