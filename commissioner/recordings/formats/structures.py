"""MATLAB variables as channels: what stands beside a signal's values - its time, unit and scale - belongs to its name.

`ia.Data` with `ia.Time` (a timeseries as a structure), `ia.signals.values` (Simulink), `ia.unit` or `units.ia`, `ia_scale`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from commissioner.recordings.formats.counts import in_unit, is_said
from commissioner.recordings.formats.matlab import variables
from commissioner.recordings.units import without_brackets
from commissioner.records import ReadingNote, Signal

_VALUES = re.compile(r"(.+?)\.(?:signals\.)?(?:data|values?)", re.IGNORECASE)
_TIME = re.compile(r".+\.time", re.IGNORECASE)
_UNIT = re.compile(
    r"(?:(?P<of>.+?)(?:\.datainfo)?[._]units?(?:\.units)?|(?:.+\.)?units?\.(?P<under>[^.]+))", re.IGNORECASE
)


def channels(path: Path) -> tuple[dict[str, Signal], dict[str, float | str], tuple[ReadingNote, ...]]:
    """(values by `name [unit]`, texts, what was taken by a scale or passed over). DataRefused: as `variables`; a gain."""
    found, texts, left = variables(path)
    units, single = _units(texts), {name: float(v[0]) for name, v in found.items() if v.size == 1}
    columns: dict[str, Signal] = {name: found[name] for name in single}
    notes = [ReadingNote("passed_over", f"{name} was not read: {kind}") for name, kind in left.items()]
    for name, stored in _without_repeated_times(found).items():
        if name in single:
            continue
        match = _VALUES.fullmatch(name)
        own = match[1] if match and match[1] not in found else name
        values, more = in_unit(own, stored, _beside(own, single), str(path))
        notes += more
        unit = units.get(own) or units.get(own.rpartition(".")[2], "")
        columns[f"{own} [{unit}]" if unit and own == without_brackets(own) else own] = values
    return columns, texts, tuple(notes)


def _without_repeated_times(found: Mapping[str, Signal]) -> dict[str, Signal]:
    """Each signal's own time once where it is the same for several."""
    times: list[Signal] = []
    out = {}
    for name, values in found.items():
        if _TIME.fullmatch(name):
            if any(np.array_equal(values, time) for time in times):
                continue
            times.append(values)
        out[name] = values
    return out


def _units(texts: Mapping[str, float | str]) -> dict[str, str]:
    said = {name: (_UNIT.fullmatch(name), str(text).strip()) for name, text in texts.items()}
    return {match["of"] or match["under"]: text for match, text in said.values() if match and text}


def _beside(name: str, single: Mapping[str, float]) -> dict[str, float]:
    """Single numbers that say how the counts of a signal are scaled: `ia_scale`, `ia.scale`, `scale.ia`."""
    last, out = name.rpartition(".")[2], {}
    for other, value in single.items():
        above, _, under = other.rpartition(".")
        begins = other.startswith((f"{name}_", f"{name}."))
        key = other[len(name) + 1 :] if begins else above.rpartition(".")[2] if under == last else ""
        if is_said(key):
            out[key.lower()] = value
    return out
