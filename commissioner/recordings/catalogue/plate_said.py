"""What lines above a recording's columns say of the plate under other names than the contract's: `Rated power: 2.2 kW`, `GD²: 0.08 kgm²`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import fields

from commissioner.errors import DataRefused
from commissioner.identify.catalogue.sheet import Sheet
from commissioner.motor.nameplate import RATED_VALUES, Nameplate, connection_of
from commissioner.recordings.catalogue import names
from commissioner.recordings.catalogue.reading import Entry, values_of
from commissioner.recordings.words import translated
from commissioner.records import ReadingNote

ALWAYS = frozenset({"inertia_kg_m2", "flywheel_effect", "pole_pairs", "poles"})
"""Keys of values that only a plate has, whatever stands beside them."""
LEAST_RATED = 3
"""So many values that are called rated make the lines a plate: a power factor among them is the plate's, not a measurement's."""
_RATED = re.compile(r"rated|nominal|nenn|bemessung|full[ -]?load|name ?plate|typenschild", re.IGNORECASE)
_SYMBOL = re.compile(r"[PUVIfn]_?[Nn]\b|cos ?\w+_?N\b")
_REST = re.compile(r"(.*?)\s*[:=]\s*(?=[-+]?[.,]?\d)(.+)")
_OWN = frozenset(one.name for one in fields(Nameplate))


def plate_said(metadata: Mapping[str, float | str], source: str) -> tuple[dict[str, float | str], list[ReadingNote]]:
    """(the plate's values under the contract's names, notes of what was taken and of what was not); of keys that stand there themselves
    nothing."""
    lines = [line for line in map(_whole, metadata.items()) if line[0] not in _OWN]
    found = [(names.key_of(name), name, printed) for name, printed in lines]
    rated = {key for key, name, _ in found if key in RATED_VALUES and _is_rated(name)}
    out: dict[str, float | str] = {}
    taken, notes = [], []
    for key, name, printed in found:
        is_plate = (
            key in ALWAYS or (key in rated and _is_rated(name)) or (len(rated) >= LEAST_RATED and key == "power_factor")
        )
        if key == "connection" and connection_of(printed) in ("star", "delta"):
            out["connection"] = str(connection_of(printed))
        elif key and is_plate:
            try:
                values = dict(_read(key, name, printed, metadata, source))
            except DataRefused as refusal:
                notes.append(
                    ReadingNote(
                        "plate_not_said",
                        f"{name}: {printed} was not used: {refusal.what.removeprefix(source).strip(': ')}",
                    )
                )
                continue
            taken += [f"{name} {printed}" for own in values if own not in metadata]
            out |= {own: value for own, value in values.items() if own not in out}
            notes += _apart(name, printed, values, metadata)
    if taken:
        notes.append(
            ReadingNote("plate_said", f"of the plate was taken what lines above the columns say: {'; '.join(taken)}")
        )
    return out, notes


def _whole(line: tuple[str, float | str]) -> tuple[str, str]:
    """A key that its own sign has cut (`J = GD²/4: 0.02`) whole again."""
    name, value = line[0], str(line[1])
    rest = _REST.fullmatch(value)
    is_cut = rest is not None and not re.match(r"[-+]?[.,]?\d", value)
    return (f"{name} = {rest[1]}", rest[2]) if rest and is_cut else (name, value)


def _is_rated(name: str) -> bool:
    return _RATED.search(translated(name)) is not None or _SYMBOL.match(name.strip()) is not None


def _read(
    key: str, name: str, printed: str, metadata: Mapping[str, float | str], source: str
) -> Iterator[tuple[str, float]]:
    connection = next((str(connection_of(v)) for k, v in metadata.items() if names.key_of(k) == "connection"), "")
    sheet = Sheet({}, connection if connection in ("star", "delta") else "", "", source)
    for own, value in values_of(Entry(key, name, printed), sheet):
        yield own, value.value


def _apart(
    name: str, printed: str, values: Mapping[str, float], metadata: Mapping[str, float | str]
) -> list[ReadingNote]:
    """Notes of values that differ from the contract's, which stand."""
    return [
        ReadingNote("plate_apart", f"{name} {printed} says {key} {value:.6g}, and {key} is {own:.6g} there: that was taken")
        for key, value in values.items()
        if isinstance(own := metadata.get(key), float) and abs(own / value - 1.0) > 0.01
    ]  # fmt: skip
