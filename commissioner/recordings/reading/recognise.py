"""Columns of a file as the contract's: by the user's mapping, by their names, in SI by their units. Nothing is guessed
that would change a value by a factor: a unit that does not fit or may be two things is refused."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from commissioner.errors import DataRefused
from commissioner.recordings.catalogue.names import key_of as key_of_plate
from commissioner.recordings.names import (
    counted_from_zero,
    in_company,
    is_per_minute,
    is_remark,
    meaning_of,
    reversed_pair,
    turned,
    unit_of,
    uses_rst,
)
from commissioner.recordings.reading.mapping import Target
from commissioner.recordings.reading.preface import UnitSaid
from commissioner.recordings.reading.said_tests import is_title
from commissioner.recordings.sheet_names import is_sheet, resistance_meaning, sheet_columns, sheet_unit, winding_columns
from commissioner.recordings.table import CONTRACT_COLUMNS, HOW_TO_MAP, ColumnReading
from commissioner.recordings.units import (
    FOREIGN,
    IN_NAME,
    MEASURES,
    NO_UNIT,
    is_peak,
    is_rms,
    is_temperature,
    measured_by,
    read_unit,
    unbracketed,
    unit_in,
    without_brackets,
)
from commissioner.records import ReadingNote, Signal

SHOWN = {"time": "s", "current": "A", "voltage": "V", "power": "W", "frequency": "Hz", "resistance": "ohm", "angle": "deg",
         "torque": "Nm", "speed": "rad/s"}  # fmt: skip
SAME_TIME = 0.01
"""Of a sample period, by which two columns of one time may differ."""
INDEX, LEAST_ROWS = "__index_level_0__", 16
"""What pandas calls an index without a name in Parquet (in CSV nothing), and rows from which on its steps tell what it is."""
SAME_VALUE = 0.05
"""Of the largest value, by which two columns of one current or voltage may differ: one of them was rounded, or filtered."""
CHANNEL = re.compile(
    r"(?:ch|chan|channel|kanal|kanaal|voie|canale?|c|trace|math|通道)[ ._]?\d*[a-h]?\d{0,2}", re.IGNORECASE
)
"""What an instrument calls a channel that nobody has named."""
_QUANTITY = re.compile(r"([+-]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)\s*(\D\S*)?")


@dataclass(frozen=True)
class Recognised:
    columns: dict[str, Signal]
    readings: tuple[ColumnReading, ...]
    notes: tuple[ReadingNote, ...]
    unnamed: tuple[str, ...]
    """Channels whose names say nothing."""


def recognise(
    names: Sequence[str], units: Sequence[str], values: Sequence[Signal], targets: Mapping[str, Target], source: str,
    said: Mapping[str, UnitSaid],
) -> Recognised:  # fmt: skip
    """The columns by the contract's names where they mean one, else by their own; see the module. `said`: units that stand once above
    the columns."""
    names, indexed = _with_index(names, values)
    own, units = units, [unit or _said_once(name, said) for name, unit in zip(names, units, strict=True)]
    names = [f"{n} [{u}]" if is_temperature(u) and not unit_in(n) else n for n, u in zip(names, units, strict=True)]
    meant = in_company(names)
    with_s = uses_rst([n for n in meant.values() if n])
    of_sheet, from_zero = is_sheet(names), counted_from_zero(names)
    of_points = sheet_columns(names) if of_sheet else winding_columns(names)
    columns: dict[str, Signal] = {}
    place: dict[str, int] = {}
    meaning: str | None
    readings, notes, unnamed, rms = [], indexed, [], []
    order = sorted(range(len(names)), key=lambda k: (names[k] not in targets, names[k] not in CONTRACT_COLUMNS, k))
    for k in order:
        name = names[k]
        unit = units[k] if units[k] not in ("", unit_in(name)) else unit_of(meant[name], with_s)
        if not name:
            continue
        target = targets.get(name) or targets.get(IN_NAME.sub("", name).strip())
        is_asked = name in from_zero and target is None
        if name not in targets and name not in CONTRACT_COLUMNS and (found := of_points.get(name)):
            unit = unit or sheet_unit(name)
            if is_peak(unit):
                raise _refused(name, unit, found, source, "a peak, where a test sheet holds rms values")
            meaning, factor = found, _factor(name, unit, found, source)
        else:
            meaning, factor = (None, 1.0) if is_asked else _meaning(meant[name], unit, target, with_s, source)
        if meaning in columns:
            if meaning == "time_s":
                _require_one_time(names, (place[meaning], k), (columns[meaning], factor * values[k]), source)
            elif name not in targets and names[place[meaning]] not in (*targets, *CONTRACT_COLUMNS):
                _require_alike(names, (place[meaning], k), (columns[meaning], factor * values[k]), meaning, source)
            notes.append(ReadingNote("second_column", f"{name} means {meaning} too, which is there: not used"))
            meaning = None
        if meaning is None:
            unnamed += [name] if is_asked or CHANNEL.fullmatch(IN_NAME.sub("", name).strip()) else []
            columns.setdefault("test" if of_sheet and is_title(name) else name, values[k])
        else:
            place[meaning] = k
            with np.errstate(invalid="ignore", over="ignore"):
                columns[meaning] = factor * values[k] if factor != 1.0 else values[k]
        if not of_sheet and meaning is not None and name not in targets and is_rms(unit or unit_in(name)):
            rms.append(name)
        readings.append(ColumnReading(name, meaning, unit or _own_unit(name), factor))
    if rms:
        notes.append(ReadingNote("rms", f"the unit of {', '.join(rms)} is one of rms values: samples are taken as they are printed; where "
                                 "they were divided by sqrt(2), map the channels with a factor of 1.41421"))  # fmt: skip
    once = [name for name, before, unit in zip(names, own, units, strict=True) if unit != before]
    notes += (
        [ReadingNote("unit_once", f"{', '.join(once)}: in the unit that a line above the columns gives")]
        if once
        else []
    )
    notes += _units_apart(readings, said, targets, source)
    return Recognised(columns, tuple(readings), tuple(notes), tuple(unnamed))


def _with_index(names: Sequence[str], values: Sequence[Signal]) -> tuple[Sequence[str], list[ReadingNote]]:
    """The names with that of a time for an index, as pandas saves it, where no other is a time, and it rises evenly and not by ones."""
    place = next((k for k, name in enumerate(names) if name == INDEX or (not name and k == 0)), None)
    if place is None or values[place].size < LEAST_ROWS or any(map(_is_time, names)):
        return names, []
    steps = np.diff(values[place])
    usual = float(np.median(steps))
    if not (usual > 0.0 and usual % 1.0 and np.all(np.abs(steps - usual) < usual / 2.0)):
        return names, []
    what = f"column {place + 1} has no name and rises by {usual:.4g} from row to row: taken as the time in seconds"
    return [*names[:place], "time_s", *names[place + 1 :]], [ReadingNote("index", what)]


def _is_time(name: str) -> bool:
    return meaning_of(name) == "time_s"


def _said_once(name: str, said: Mapping[str, UnitSaid]) -> str:
    """The unit that stands once above the columns for all that measure the same; nothing of other columns, or of a name with its own."""
    meaning = meaning_of(name) if said and name not in CONTRACT_COLUMNS and not unit_of(name) else None
    line = said.get(measured_by(meaning) or "") if meaning else None
    return line.unit if line else ""


def _units_apart(
    readings: Sequence[ColumnReading], said: Mapping[str, UnitSaid], targets: Mapping[str, Target], source: str
) -> list[ReadingNote]:
    """Notes of columns whose own unit is another than a line above them says. DataRefused: of a column of the contract, whose name is
    often given to values that nobody has divided."""
    apart = []
    for reading in readings:
        line, target = said.get(measured_by(reading.meaning or "") or ""), targets.get(reading.name)
        unit = read_unit(line.unit) if line and not (target and target.factor is not None) else None
        if line and unit and not np.isclose(unit.scale, abs(reading.factor), rtol=1e-9):
            apart.append((reading, line, unit, reading.unit or SHOWN[unit.measures]))
    ours = [one for one in apart if one[0].name in CONTRACT_COLUMNS]
    if ours:
        reading, line, unit, own = ours[0]
        factors = " and ".join(f"`# {r.name}: {r.meaning} * {u.scale:g}`" for r, _, u, _ in ours)
        raise DataRefused(
            f"{source}: {reading.name} is in {own} by its name and in {line.unit} by the line {line.line[:80]!r}", step="recognise columns",
            value=f"{reading.name} [{line.unit}]", limit=f"one unit: {own}", remedy="where the line is right, say so by comment lines "
            f"with a factor, {factors}; where the name is right, take the line out",
        )  # fmt: skip
    return [
        ReadingNote("two_units", f"{reading.name} is in {own}, and the line {line.line[:80]!r} says {line.unit}: {own} was taken")
        for reading, line, _, own in apart
    ]  # fmt: skip


def _require_one_time(names: Sequence[str], places: tuple[int, int], times: tuple[Signal, Signal], source: str) -> None:
    """DataRefused: two columns of time run at one rate and apart, so that channels were not sampled together. Times that count
    from another zero (further apart than the recording is long) or in other steps tell nothing of that."""
    if times[0].size != times[1].size or times[0].size < 3:
        return
    steps = [float(np.nanmedian(np.diff(t))) for t in times if np.isfinite(t).sum() > 2]
    apart = float(np.nanmax(np.abs(times[1] - times[0]), initial=0.0))
    if len(steps) < 2 or not abs(steps[1] - steps[0]) < SAME_TIME * steps[0]:
        return
    if SAME_TIME * steps[0] < apart < float(np.ptp(times[0][np.isfinite(times[0])])):
        first, second = (f"{names[k]} (column {k + 1})" for k in places)
        raise DataRefused(
            f"{source}: {first} and {second} are two times, {apart:.4g} s apart", step="read the time", value=f"{apart / steps[0]:.3g} of a sample period",
            limit=f"{SAME_TIME} of one: all channels sampled at one time", remedy="resample all channels to one time column and leave "
            "the others out; where both mean the same, take one as ignore by --map",
        )  # fmt: skip


def _require_alike(
    names: Sequence[str], places: tuple[int, int], values: tuple[Signal, Signal], meaning: str, source: str
) -> None:
    """DataRefused: two columns mean the same current, voltage or power and differ, as of two motors, or of the mains and the motor."""
    if not meaning.startswith(("current_", "voltage_", "power_")) or values[0].size != values[1].size:
        return
    with np.errstate(invalid="ignore"):
        apart = np.abs(values[1] - values[0]) / np.nanmax(np.abs(values[0]), initial=1e-12)
    if float(np.nanmax(apart, initial=0.0)) > SAME_VALUE:
        first, second = (f"{names[k]} (column {k + 1})" for k in places)
        raise DataRefused(
            f"{source}: {first} and {second} both mean {meaning} and differ", step="recognise columns",
            value=f"{float(np.nanmax(apart)):.3g} of the largest value", limit=f"{SAME_VALUE}, or one column",
            remedy=f"take the column that is not meant out of the file, or as ignore: {HOW_TO_MAP}",
        )  # fmt: skip


def _own_unit(name: str) -> str:
    """What a name of the contract says by its ending; nothing of other names."""
    if name not in CONTRACT_COLUMNS:
        return ""
    if name == "speed_rad_per_s":
        return "rad/s"
    return next((SHOWN[measures] for ending, measures in MEASURES.items() if name.endswith(ending)), "")


def windings_said(metadata: Mapping[str, float | str], source: str) -> dict[str, float | str]:
    """What lines above a test sheet say of the windings (`# R_uv (mOhm): 1520`, `# Schaltung: Dreieck`), by the contract's names, in ohm."""
    out: dict[str, float | str] = {}
    windings = winding_columns(metadata)
    for name, value in metadata.items():
        if key_of_plate(name) == "connection":
            out["connection"] = value
        meaning = windings.get(name) or resistance_meaning(name)
        if meaning and name not in CONTRACT_COLUMNS and (number := quantity(name, value, meaning, source)) is not None:
            out[meaning] = number
    return out


def quantity(name: str, value: float | str, meaning: str, source: str) -> float | None:
    """What a line above the columns says (`R_uv (mOhm): 1520`, `axis: 60 deg`), in SI; None where it is no number."""
    said = _QUANTITY.fullmatch(str(value).strip())
    if said is None:
        return None
    return _factor(name, said[2] or unit_of(name) or sheet_unit(name), meaning, source) * float(
        said[1].replace(",", ".")
    )


def _meaning(name: str, unit: str, target: Target | None, with_s: bool, source: str) -> tuple[str | None, float]:
    if target is not None:
        if target.column == "ignore":
            return None, 1.0
        sign = -1.0 if target.is_turned else 1.0
        return target.column, sign * (
            target.factor if target.factor is not None else _factor(name, unit, target.column, source)
        )
    bare = without_brackets(name)
    spelt = re.sub(r"[\s-]+", "_", bare.lower())
    bare = spelt if spelt in CONTRACT_COLUMNS else bare
    if bare in CONTRACT_COLUMNS:
        return bare, _factor(name, unit if unit != unit_in(bare) else "", bare, source)
    if of := turned(name):
        meaning, factor = _meaning(of, unit, None, with_s, source)
        return meaning, -factor
    meaning, sign = meaning_of(name, with_s), 1.0
    if meaning is None and (pair := reversed_pair(name)):
        meaning, sign = pair, -1.0
    if meaning is None:
        return None, 1.0
    if meaning == "speed_rad_per_s" and is_per_minute(name) and read_unit(unit) is None:
        return meaning, np.pi / 30
    return meaning, sign * _factor(name, unit, meaning, source)


def _factor(name: str, unit: str, meaning: str, source: str) -> float:
    """To SI. DataRefused: mega or milli, a unit of something else, one that needs a factor which is not given, or none that is
    known."""
    known, bare = read_unit(unit), unbracketed(unit).lower()
    if meaning == "power_factor" and bare == "%":
        return 0.01
    if known is None and bare in FOREIGN:
        raise _refused(name, unit, meaning, source, "a unit that needs a factor")
    if known is None and (bare in NO_UNIT or is_remark(bare)):
        return 1.0
    if known is None:
        raise _refused(name, unit, meaning, source, "none that is known")
    expected = measured_by(meaning)
    if expected is None or (known.measures != expected and name.endswith(f"_{unit}") and known.scale == 1.0):
        return 1.0
    if known.measures != expected:
        raise _refused(name, unit, meaning, source, f"a {known.measures}, not a {expected}")
    if known.is_ambiguous:
        raise _refused(name, unit, meaning, source, "milli or mega")
    return known.scale


def _refused(name: str, unit: str, meaning: str, source: str, why: str) -> DataRefused:
    return DataRefused(
        f"{source}: the unit {unit} of {name} is {why}", step="recognise columns", value=f"{name} [{unit}]",
        limit=f"{meaning} in a unit with a known factor", remedy=HOW_TO_MAP,
    )  # fmt: skip
