"""Line values of a test sheet from what its meters showed: between lines, to the neutral, in one phase, in all three.

A symmetric motor on a symmetric supply: V_line = sqrt(3) V_neutral, of three meters the mean, and of wattmeters the sum; two of them
tell the apparent power as well, 2 sqrt(P1^2 - P1 P2 + P2^2), and with it whether one was read backward (IEEE 112).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.intake.points import Array
from commissioner.diagnose.intake.refusal import refused
from commissioner.errors import DataRefused
from commissioner.motor.nameplate import connection_of
from commissioner.records import DIRECT_TEST, LOAD_TEST, LOCKED_TEST, SINGLE_PHASE_TEST, WATT_METERS

VOLTS_APART, AMPERES_APART = 0.05, 0.15
"""By which one of three meters may differ from their mean. NEMA MG 1-14.36: no motor is to run on volts that differ by more than
5 %, and currents differ by 6 to 10 times as much; with the 1 % beyond which it derates, and meters of class 2.5, 15 %."""
FACTOR_STEP = 0.02
"""Of a power factor that is printed with two digits, in which a meter of class 1 may be wrong at no load."""
ROOT_3 = float(np.sqrt(3.0))


@dataclass(frozen=True)
class _Form:
    """One way in which a sheet gives volts or amperes: values `(n,)` as line values, what was done in words."""

    columns: tuple[str, ...]
    values: Array
    said: str


@dataclass(frozen=True)
class LineValues:
    """`columns` with `voltage_line_v` and `current_line_a` where they follow; `remarks`: from what."""

    columns: Mapping[str, Array]
    remarks: tuple[str, ...] = ()


def is_direct(frequency_hz: Array, said: Array) -> NDArray[np.bool_]:
    """`(n,)`: rows without a frequency, unless the sheet calls them another test."""
    return np.asarray(~(np.nan_to_num(frequency_hz) > 0.0) & ~(said > DIRECT_TEST))


def line_values(columns: Mapping[str, Array], said: Mapping[str, float | str]) -> LineValues | DataRefused:
    """The columns with line values. `said`: the plate as far as it is known, and `resistance_measured`.

    DataRefused: meters of one quantity contradict each other, or it is not told what `phase` means.
    """
    out, remarks = dict(columns), []
    for line, forms in (("voltage_line_v", _volts), ("current_line_a", _amperes), ("power_w", _watts)):
        given = list(forms(out, said))
        for form in given:
            if isinstance(form, DataRefused):
                return form
        found = [form for form in given if isinstance(form, _Form)]
        if (against := _contradiction(found, columns)) is not None:
            return against
        for form in reversed(found):
            is_there = np.isfinite(form.values)
            if form.columns != (line,) and np.any(is_there & ~np.isfinite(found[0].values) | (form is found[0])):
                remarks.append(f"{line} {form.said}")
            out[line] = np.where(is_there, form.values, out.get(line, form.values))
    return _of_three_phases(_without_loads(LineValues(out, tuple(remarks))))


def _without_loads(seen: LineValues) -> LineValues:
    """Without rows that the sheet calls those of a load, or of the plate, where others stand beside them: by its inductance alone such a
    row may be a locked rotor's."""
    loads = np.asarray(seen.columns.get("test", np.nan)) == LOAD_TEST
    if not np.any(loads) or np.all(loads):
        return seen
    said = f"{int(loads.sum())} rows of a loaded motor or of another name were not used."
    return LineValues({name: values[~loads] for name, values in seen.columns.items()}, (*seen.remarks, said))


def _of_three_phases(seen: LineValues) -> LineValues:
    """Single-phase tests of a locked rotor as the three-phase test of the same current: between two terminals lie two phases, so that
    Z = V / (2 I) and R = P / (2 I^2) of each."""
    single = np.asarray(seen.columns.get("test", np.nan)) == SINGLE_PHASE_TEST
    if not np.any(single):
        return seen
    out = dict(seen.columns)
    for name, factor in (("voltage_line_v", ROOT_3 / 2.0), ("power_w", 1.5)):
        if name in out:
            out[name] = np.where(single, factor, 1.0) * out[name]
    out["test"] = np.where(single, LOCKED_TEST, out["test"])
    said = "Single-phase current was taken as flowing between two terminals, the third open: a phase has Z = V / (2 I), R = P / (2 I^2)."
    return LineValues(out, (*seen.remarks, said))


def _volts(columns: Mapping[str, Array], said: Mapping[str, float | str]) -> Iterator[_Form | DataRefused]:
    yield from _as_given(columns, "voltage_line_v")
    yield from _of_meters(columns, tuple(f"voltage_{pair}_v" for pair in ("uv", "vw", "wu")), VOLTS_APART)
    for meters in (tuple(f"voltage_{p}_v" for p in "uvw"), ("voltage_neutral_v",), ("voltage_phase_v",)):
        for form in _of_meters(columns, meters, VOLTS_APART):
            yield _from_neutral(form, columns, said) if isinstance(form, _Form) else form


def _amperes(columns: Mapping[str, Array], said: Mapping[str, float | str]) -> Iterator[_Form | DataRefused]:
    yield from _as_given(columns, "current_line_a")
    yield from _of_meters(columns, tuple(f"current_{p}_a" for p in "uvw"), AMPERES_APART)
    for form in _as_given(columns, "current_phase_a"):
        is_star = _connection(said) == "star"
        yield (
            _Form(form.columns, form.values, "is current_phase_a: in star the same.")
            if is_star
            else _ask(columns, "current_phase_a")
        )


def _watts(columns: Mapping[str, Array], _said: Mapping[str, float | str]) -> Iterator[_Form | DataRefused]:
    """The power of all phases. `columns`: with line volts and amperes as far as they are known."""
    yield from _as_given(columns, "power_w")
    yield from _of_one_phase(columns)
    yield from _of_power_factor(columns)
    there = tuple(name for name in WATT_METERS if name in columns)
    if len(there) == 1 and "power_w" not in columns:
        yield refused(
            f"{there[0]} is one wattmeter's alone", None, "power_w of all three phases, or two or three wattmeters",
            "give the others too, or the power of all phases",
        )  # fmt: skip
    if len(there) < 2:
        return
    shown, direct = np.stack([np.asarray(columns[name], dtype=float) for name in there]), _direct(columns)
    if np.any(lost := ~np.isfinite(shown) & ~direct):
        yield _lost(there, lost)
    elif len(there) == 2 and (turned := _read_backward(there, shown, columns)) is not None:
        yield turned
    else:
        yield _Form(
            there, np.where(direct, np.nansum(shown, axis=0), shown.sum(axis=0)), f"is the sum of {', '.join(there)}."
        )


def _of_one_phase(columns: Mapping[str, Array]) -> Iterator[_Form | DataRefused]:
    """Three times the power of a phase; of direct current what was written."""
    for form in _as_given(columns, "power_phase_w"):
        if np.any(np.asarray(columns.get("test", np.nan)) == SINGLE_PHASE_TEST):
            yield refused(
                "power_phase_w stands beside a single-phase test, whose power may be all of it", None, "the power of all phases in that row",
                "give power_w",
            )  # fmt: skip
        else:
            yield _Form(form.columns, np.where(_direct(columns), 1.0, 3.0) * form.values, "is 3 times power_phase_w.")


def _of_power_factor(columns: Mapping[str, Array]) -> Iterator[_Form | DataRefused]:
    """Watts of sqrt(3) V I cos phi, where none are given. DataRefused: where both are and contradict each other, beyond what a printed
    factor is rounded by."""
    if not {"power_factor", "voltage_line_v", "current_line_a"} <= columns.keys():
        return
    factor = np.where(_direct(columns), np.nan, columns["power_factor"])
    apparent = ROOT_3 * np.asarray(columns["voltage_line_v"]) * np.asarray(columns["current_line_a"])
    watts = np.asarray(columns.get("power_w", np.full(factor.size, np.nan)))
    if (wrong := np.flatnonzero(np.abs(factor) > 1.0)).size:
        yield refused(
            f"power_factor is {factor[wrong[0]]:g} in row {wrong[0] + 1}", float(factor[wrong[0]]), "at most 1",
            "write its unit, if it is per cent: `cos phi (%)`",
        )  # fmt: skip
        return
    told = watts / apparent
    if (off := np.flatnonzero(np.abs(told - factor) > FACTOR_STEP + AMPERES_APART * np.abs(factor))).size:
        yield refused(
            f"power_w of row {off[0] + 1} is a power factor of {told[off[0]]:.3g}, and the sheet says {factor[off[0]]:.3g}",
            float(told[off[0]] / factor[off[0]]), "a ratio of 1 with line-to-line volts, line amperes and the watts of all phases",
            "correct what is a phase's (3 times its watts, sqrt(3) times its volts), or take the wrong column out",
        )  # fmt: skip
    elif not {"power_phase_w", *WATT_METERS} & columns.keys() and np.any(
        lacks := np.isfinite(factor) & ~np.isfinite(watts)
    ):
        yield _Form(
            ("power_factor",),
            np.where(lacks, factor * apparent, np.nan),
            "is sqrt(3) times volts, amperes and power_factor.",
        )


def _read_backward(there: tuple[str, ...], shown: Array, columns: Mapping[str, Array]) -> DataRefused | None:
    """The wattmeter that must be negative, where the apparent power says so: below a power factor of 0.5 one deflects backward."""
    if not {"voltage_line_v", "current_line_a"} <= columns.keys():
        return None
    apparent = ROOT_3 * np.asarray(columns["voltage_line_v"]) * np.asarray(columns["current_line_a"])
    first, second = shown
    told, turned = (
        2.0 * np.sqrt(first**2 - sign * first * second + second**2) / apparent - 1.0 for sign in (1.0, -1.0)
    )
    wrong = np.flatnonzero(
        (np.abs(told) > AMPERES_APART)
        & (np.abs(turned) < np.minimum(AMPERES_APART, np.abs(told) / 2))
        & ~_direct(columns)
    )
    if not wrong.size:
        return None
    row = int(wrong[0])
    meter = int(np.argmin(np.abs(shown[:, row])))
    return refused(
        f"{there[meter]} is {shown[meter, row]:g} W in row {row + 1}, and the apparent power wants the other sign", float(1.0 + told[row]),
        "a ratio of 1 of the wattmeters' apparent power to the volts' and amperes'", "write what a wattmeter showed with its leads "
        "reversed as a negative number",
    )  # fmt: skip


def _as_given(columns: Mapping[str, Array], name: str) -> Iterator[_Form]:
    if name in columns:
        yield _Form((name,), np.asarray(columns[name], dtype=float), f"is {name}.")


def _of_meters(columns: Mapping[str, Array], names: tuple[str, ...], apart: float) -> Iterator[_Form | DataRefused]:
    """The mean of the meters that are there; of direct current of those that show something, whichever way it flowed."""
    there = tuple(name for name in names if name in columns)
    if not there:
        return
    shown = np.stack([np.asarray(columns[name], dtype=float) for name in there])
    direct = _direct(columns)
    shown[:, direct] = np.where(shown[:, direct] == 0.0, np.nan, np.abs(shown[:, direct]))
    if np.any(lost := ~np.isfinite(shown) & ~direct):
        yield _lost(there, lost)
        return
    counts = np.where(direct, np.isfinite(shown).sum(axis=0), len(there))
    mean = np.where(direct, np.nansum(shown, axis=0), shown.sum(axis=0)) / np.maximum(counts, 1)
    off = np.nan_to_num(np.abs(shown - mean) / np.abs(mean))
    if off.max(initial=0.0) > apart:
        yield _odd_one(there, shown, off, apart)
    else:
        apart_by = f", at most {off.max(initial=0.0):.2g} of it apart" if len(there) > 1 else ""
        yield _Form(there, np.where(counts > 0, mean, np.nan), f"is {_mean_of(there)}{apart_by}.")


def _lost(there: tuple[str, ...], lost: NDArray[np.bool_]) -> DataRefused:
    meter, row = np.argwhere(lost)[0]
    return refused(
        f"{there[meter]} holds no number in row {row + 1}",
        None,
        "a number in every row",
        "fill the cell, or leave the row out",
    )


def _mean_of(names: tuple[str, ...]) -> str:
    return f"the mean of {', '.join(names)}" if len(names) > 1 else names[0]


def _odd_one(names: tuple[str, ...], shown: Array, off: Array, apart: float) -> DataRefused:
    """The refusal names the meter furthest from the middle one, in the row where they differ most."""
    row = int(np.argmax(off.max(axis=0)))
    odd = int(np.nanargmax(np.abs(shown[:, row] - np.nanmedian(shown[:, row]))))
    others = ", ".join(
        f"{name} {value:g}" for k, (name, value) in enumerate(zip(names, shown[:, row], strict=True)) if k != odd
    )
    return refused(
        f"{names[odd]} is {shown[odd, row]:g} in row {row + 1} and its neighbours are not: {others}", float(off[:, row].max()),
        f"meters within {apart:.0%} of their mean", "correct the cell or its unit; where the motor or the supply is not symmetric, "
        "no circuit of one phase describes it",
    )  # fmt: skip


def _from_neutral(form: _Form, columns: Mapping[str, Array], said: Mapping[str, float | str]) -> _Form | DataRefused:
    """Line volts from those of a phase. DataRefused: where `phase` may be a winding that is no star's, or of direct current."""
    is_known = _connection(said) == "star" or (_connection(said) != "delta" and "voltage_line_v" in columns)
    if form.columns == ("voltage_phase_v",) and not is_known:
        return _ask(columns, "voltage_phase_v")
    direct = _direct(columns)
    if np.any(direct & np.isfinite(form.values)) and "resistance_measured" not in said:
        return refused(
            "the volts of direct current stand among phase voltages, and where they were measured is not told", ", ".join(form.columns),
            "volts between two terminals, or of one winding", "add `# resistance_measured: line_to_line` (between two terminals), "
            "phase_winding or star_equivalent",
        )  # fmt: skip
    line = np.where(direct, form.values, ROOT_3 * form.values)
    return _Form(form.columns, line, f"is sqrt(3) times {_mean_of(form.columns)}.")


def _ask(columns: Mapping[str, Array], name: str) -> DataRefused:
    return refused(
        f"{name} may be of a winding or of a line, and which is not told", float(np.asarray(columns[name])[0]),
        "line values, or `connection: star`, in which both are one", "give voltage_line_v (between terminals; a delta winding's own), "
        "voltage_neutral_v or current_line_a (in a delta sqrt(3) times the winding's)",
    )  # fmt: skip


def _contradiction(found: list[_Form], columns: Mapping[str, Array]) -> DataRefused | None:
    """Where the sheet gives one quantity in two ways that disagree beyond three meters' own limit."""
    ac = ~_direct(columns)
    for other in found[1:]:
        ratio = other.values[ac] / found[0].values[ac]
        if ratio.size and np.nanmax(np.abs(ratio - 1.0), initial=0.0) > AMPERES_APART:
            return refused(
                f"{', '.join(found[0].columns)} and {', '.join(other.columns)} contradict each other", float(np.nanmedian(ratio)),
                "a ratio of 1 when both are taken as line values", "leave out or rename the one that is not what it is called",
            )  # fmt: skip
    return None


def _direct(columns: Mapping[str, Array]) -> NDArray[np.bool_]:
    nothing = np.full(next(iter(columns.values())).size, np.nan)
    return is_direct(np.asarray(columns.get("frequency_hz", nothing)), np.asarray(columns.get("test", nothing)))


def _connection(said: Mapping[str, float | str]) -> object:
    return connection_of(said.get("connection", ""))
