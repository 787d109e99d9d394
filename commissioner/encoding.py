"""The one encoder: records as JSON types. Light: a list of runs needs it, and no numpy."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Container, Mapping
from enum import Enum, StrEnum
from types import MappingProxyType
from typing import Any, TypeAlias

from typing_extensions import TypeAliasType

Json = TypeAliasType("Json", "bool | int | float | str | list[Json] | dict[str, Json] | None")
"""Whatever JSON can say."""
JsonObject: TypeAlias = dict[str, Any]
"""A JSON object that another version, another process or a person wrote: of no shape that could be promised, and passed on as it is."""
LARGEST = 1 << 63
"""Beyond it, either way, a whole number fits neither a database nor, some way on, a float."""
HIDDEN = MappingProxyType({"is_hidden": True})
"""Metadata of a field that is no part of the JSON."""


def plain(value: Any, *, without: Container[str] = ()) -> Any:
    """A record as JSON types, `without` these of its own fields; arrays become lists, NaN and infinity become null."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        shown = [f for f in dataclasses.fields(value) if not f.metadata.get("is_hidden") and f.name not in without]
        return {f.name: plain(getattr(value, f.name)) for f in shown}
    if isinstance(value, Enum):
        return value.value if isinstance(value, StrEnum) else value.name.lower()
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if hasattr(value, "_asdict"):
        return plain(value._asdict())
    if hasattr(value, "tolist"):  # arrays and scalars of numpy
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(v) for v in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, str | int | bool | None) else str(value)


def read_json(text: str | bytes) -> Any:
    """What the JSON in `text` says, `?` for half a character that no file can hold. ValueError: it is none, is nested deeper than
    any of ours, or holds a whole number that no counter of ours can be."""
    said = text if isinstance(text, str) else text.decode("utf-8")
    try:
        document = json.loads(said, parse_int=_whole_number)
        if "\\ud" in said.lower():
            return json.loads(json.dumps(document, ensure_ascii=False).encode("utf-8", "replace"))
    except RecursionError as error:
        raise ValueError("JSON that is nested too deep") from error
    return document


def _whole_number(digits: str) -> int:
    number = int(digits)
    if not -LARGEST <= number < LARGEST:
        raise ValueError(f"a whole number of {len(digits)} digits")
    return number
