"""What is wrong with a field, in a technician's words: its name, its unit and what is wanted. No word of pydantic's."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import UnionType
from typing import Any, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationError, ValidationInfo, field_validator
from pydantic.fields import FieldInfo

from commissioner.errors import NO_SUCH_KEY
from commissioner.text import did_you_mean

UNITS = {
    "w": "W", "v": "V", "hz": "Hz", "a": "A", "rpm": "1/min", "m2": "kg m2", "s": "s", "ms": "ms", "deg": "degrees",
    "degc": "degC", "percent": "%",
}  # fmt: skip
"""By the end of a key: the unit its number is in."""


class FileTable(BaseModel):
    """A table of a file that a person writes: no key too many, and a truth is no number."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_as_number(cls, value: object, field: ValidationInfo) -> object:
        """`pole_pairs = true` is not one pair, as Python counts it."""
        if isinstance(value, bool) and cls.model_fields[str(field.field_name)].annotation is not bool:
            raise ValueError(f"not {str(value).lower()}")
        return value


_WANTED = {
    "int": "a whole number",
    "float": "a number",
    "finite": "a finite number",
    "bool": "true or false",
    "string": "text",
    "list": "a list",
    "tuple": "a list",
    "dict": "a table of keys and values",
    "model": "a table of keys and values",
    "json": "valid JSON",
    "none": "nothing",
}
"""By the first word of pydantic's kind of problem; where a limit is broken, `_limit` says which."""


@dataclass(frozen=True)
class FieldProblem:
    """`key` as it is written, dotted; `value` None where it is missing; `expected`: what would be right."""

    key: str
    value: object
    expected: str


def first_problem(error: ValidationError, model: type[BaseModel]) -> FieldProblem:
    """The most telling one: a misspelt key explains a missing one."""
    problem = min(error.errors(), key=lambda one: one["type"] != "extra_forbidden")
    key = ".".join(map(str, _named(problem["loc"])))
    return FieldProblem(key, None if problem["type"] == "missing" else problem["input"], wanted(problem, model))


def wanted(problem: Mapping[str, Any], model: type[BaseModel] | None = None) -> str:
    """What a field must be. `problem`: one of pydantic's; `model`: whose field it is, where that is known."""
    location = _named(problem["loc"])
    if problem["type"] == "extra_forbidden":
        known = _keys(model, location[:-1]) if model else []
        return (
            NO_SUCH_KEY
            + (f"; known here: {', '.join(known)}" if known else "")
            + did_you_mean(str(location[-1]), known)
        )
    name = _spoken(location)[0] or "the whole"
    field = _field(model, location) if model else None
    description = f" ({field.description})" if field is not None and field.description else ""
    return f"{name}: {requirement(problem)}{description}"


def requirement(problem: Mapping[str, Any]) -> str:
    """The same without the field's name: `needed`, `a whole number`, `50 1/min or more`."""
    unit = _spoken(_named(problem["loc"]))[1]
    kind = problem["type"].partition("_")[0]
    if kind in ("missing", "value"):
        return "needed" if kind == "missing" else str(problem["ctx"]["error"])
    what = _limit(problem, f" {unit}" if unit else "") or _WANTED.get(kind, "another value")
    return what + (f" in {unit}" if unit and kind in ("int", "float", "finite") else "")


def _named(location: Sequence[int | str]) -> list[int | str]:
    """Without pydantic's own words for the member of a union that was tried: `list[str]`, `float`."""
    return [
        part
        for part in location
        if isinstance(part, int) or not ("[" in part or part in ("str", "int", "float", "bool"))
    ]


def _spoken(location: Sequence[int | str]) -> tuple[str, str]:
    """What the last key is called, with the entry of its list, and the unit of its number; empty for the whole document."""
    entries = [f"entry {part + 1}" for part in location[-1:] if isinstance(part, int)]
    key = next((part for part in reversed(location) if isinstance(part, str)), "")
    name, unit = human(key)
    return ", ".join(filter(None, [name, *entries])), unit


def human(key: str) -> tuple[str, str]:
    """A key as words and the unit of its number: `rated_current_a` is the rated current, in A."""
    words = key.split("_")
    if len(words) > 1 and words[-1] in UNITS:
        unit = UNITS[words[-1]]
        return " ".join(words[:-2] if words[-1] == "m2" else words[:-1]), unit
    return " ".join(words), ""


def _limit(problem: Mapping[str, Any], unit: str) -> str:
    bound: Mapping[str, Any] = problem.get("ctx") or {}
    if isinstance(problem.get("input"), float) and not math.isfinite(problem["input"]):
        return "a finite number"
    match problem["type"]:
        case "greater_than":
            return f"above {bound['gt']:g}{unit}"
        case "greater_than_equal":
            return f"{bound['ge']:g}{unit} or more"
        case "less_than":
            return f"below {bound['lt']:g}{unit}"
        case "less_than_equal":
            return f"at most {bound['le']:g}{unit}"
        case "literal_error":
            return f"one of {bound['expected']}"
        case "string_too_short":
            least = bound["min_length"]
            return "text, not empty" if least == 1 else f"text of at least {least} characters"
        case "string_too_long":
            return f"text of at most {bound['max_length']} characters"
        case "string_pattern_mismatch":
            return f"text of the form {bound['pattern']}"
        case "too_short":
            least = bound["min_length"]
            return "at least one entry" if least == 1 else f"at least {least} entries"
        case "too_long":
            return f"at most {bound['max_length']} entries"
    return ""


def _keys(model: type[BaseModel], location: Sequence[object]) -> list[str]:
    for part in location:
        field = model.model_fields.get(str(part))
        model = (_table_in(field.annotation) if field is not None else None) or model
    return sorted(field.alias or name for name, field in model.model_fields.items())


def _field(model: type[BaseModel], location: Sequence[object]) -> FieldInfo | None:
    field: FieldInfo | None = None
    for part in location:
        if str(part) in model.model_fields:
            field = model.model_fields[str(part)]
            model = _table_in(field.annotation) or model
    return field


def _table_in(annotation: Any) -> type[BaseModel] | None:
    """The table model inside an annotation such as `X`, `X | None`, `list[X]` or `dict[str, X]`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    if get_origin(annotation) in (UnionType, Union, dict, list):
        return next((found for part in get_args(annotation) if (found := _table_in(part))), None)
    return None
