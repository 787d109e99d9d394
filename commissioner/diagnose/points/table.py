"""Steady-state test points (locked rotor, no load) as data: what a table must hold, and which test it is.

Per point the terminal impedance is R + jX with R = P / (3 I^2) and |Z| = V / (sqrt(3) I) (IEC 60034-28, IEEE 112).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from commissioner.diagnose.intake.points import Array, Points
from commissioner.diagnose.intake.refusal import refused
from commissioner.diagnose.points.resistance import column_of, of_one_measurement, star_resistance, unread
from commissioner.errors import DataRefused
from commissioner.records import IDLE_TEST, LOCKED_TEST, POINT_COLUMNS, POINT_FORMS

LEAST_POINTS, MOST_POINTS = 5, 300
LEAST_SPREAD, LEAST_FLUX_SPREAD = 1.3, 1.15
"""Largest over smallest current (locked rotor) and flux (no load) from which on a circuit can be seen to bend."""
LEAST_POWER_FACTOR = 0.005
"""A large motor at no load has 0.03; kilowatts read as watts make a thousandth of any."""
NO_LOAD_SLOPE = -0.5
"""d ln R / d ln V of R = P/(3 I^2): about 0 with a locked rotor, between -1 and -2 at no load."""


def is_points_table(columns: Sequence[str]) -> bool:
    """Whether the names are meant to be a points table's: most of what one needs, or a test or other meters' forms of it, and no time."""
    beside = ("test", *POINT_FORMS) if "frequency_hz" in columns else ()
    return "time_s" not in columns and (
        sum(name in columns for name in POINT_COLUMNS) >= 2 or any(name in columns for name in beside)
    )


def lacking(columns: Mapping[str, Array], needed: Sequence[str] = POINT_COLUMNS) -> DataRefused | None:
    """What a table lacks of the columns that a test needs; None where it has them all."""
    missing = [c for c in needed if c not in columns]
    if not missing:
        return None
    return refused(
        f"a table of test points needs the column {missing[0]}", ", ".join(columns), ", ".join(needed),
        f"add or rename: {', '.join(missing)}; line values are sqrt(3) times phase ones, of three meters the mean",
    )  # fmt: skip


def read_points(
    columns: Mapping[str, Array], name: str, metadata: Mapping[str, float | str] | None = None
) -> Points | DataRefused:
    """The points of a table, rows that are copies taken once, or why they cannot be used.

    `metadata`: the plate as far as it is known, and `resistance_measured`.
    """
    said = metadata or {}
    if (lacks := lacking(columns)) is not None:
        return lacks
    resistance = column_of(columns, said)
    if isinstance(resistance, DataRefused):
        return resistance
    names = (*POINT_COLUMNS, *([resistance[0]] if resistance else []))
    everything = {**columns, resistance[0]: resistance[1]} if resistance else columns
    for column in names:
        values = np.asarray(everything[column], dtype=float)
        wrong = np.flatnonzero(~(np.isfinite(values) & (values > 0)))
        if wrong.size:
            return refused(
                f"{column} is {values[wrong[0]]:g} in row {wrong[0] + 1}",
                float(values[wrong[0]]),
                "positive numbers in every row",
                "correct the cell or leave the row out",
            )
    rows = np.stack([np.asarray(everything[c], dtype=float) for c in names], axis=1)
    _, first = np.unique(rows, axis=0, return_index=True)
    copies, rows = rows.shape[0] - first.size, rows[np.sort(first)]
    f, v, i, p = rows[:, :4].T
    is_locked = _is_locked(f, v, i, p, name, np.unique(columns.get("test", np.nan)))
    if (refusal := _not_usable(f, v, i, p, is_locked=is_locked)) is not None:
        return refusal
    remarks = [f"{copies} rows are copies of others: each was taken once."] if copies else []
    if resistance is None:
        remarks.append(_without_resistance(columns, said))
        return Points(name, f, v, i, p, None, is_locked, tuple(remarks))
    measured = p / (3.0 * i**2)
    ohm = star_resistance(resistance[0], rows[:, 4], measured, said, is_locked=is_locked)
    if isinstance(ohm, DataRefused):
        return ohm
    remarks += ohm.remarks
    if is_locked and ohm.star_ohm is not None:
        remarks += of_one_measurement(ohm.star_ohm, measured)
    return Points(name, f, v, i, p, ohm.star_ohm, is_locked, tuple(remarks))


def _without_resistance(columns: Mapping[str, Array], said: Mapping[str, float | str]) -> str:
    """Why none is known, and what follows from it."""
    left = unread(columns, said)
    why = (
        f"What is in {', '.join(left)} was not understood as a winding resistance and not used; name it winding_resistance_uv_ohm "
        "(between two terminals) or winding_resistance_phase_ohm (of one winding)"
        if left
        else "No winding resistance is given (column winding_resistance_uv_ohm, between two terminals, at every point)"
    )
    return f"{why}: windings that warm up or cool down during the test count as the rotor's resistance or as loss."


def _not_usable(f: Array, v: Array, i: Array, p: Array, *, is_locked: bool) -> DataRefused | None:
    if f.size < LEAST_POINTS:
        return refused(
            f"{f.size} different points cannot carry an answer",
            f.size,
            f"at least {LEAST_POINTS}",
            "measure at more voltages; or give the direct-current, no-load and locked-rotor tests together",
        )
    if f.size > MOST_POINTS:
        return refused(
            f"{f.size} points are no test by hand",
            f.size,
            f"at most {MOST_POINTS}",
            "give the steady points, each once; a recording over time needs the column time_s",
        )
    factor = p / (np.sqrt(3.0) * v * i)
    if factor.max() > 1.0:
        row = int(np.argmax(factor))
        return refused(
            f"the power {p[row]:.6g} W at {v[row]:g} V and {i[row]:g} A exceeds the apparent power {p[row] / factor[row]:.6g} VA",
            float(factor[row]),
            "a power factor of at most 1",
            "give line-to-line volts, line amperes and the watts of all three phases",
        )
    if factor.min() < LEAST_POWER_FACTOR:
        row = int(np.argmin(factor))
        return refused(
            f"the power {p[row]:.6g} W at {v[row]:g} V and {i[row]:g} A is a power factor of {factor[row]:.2g}",
            float(factor[row]),
            f"at least {LEAST_POWER_FACTOR}",
            "check the units: volts, amperes and watts, with a decimal point",
        )
    if _loaded(f, v, i):
        return refused(
            "the current changes at constant voltage and frequency: points of a loaded motor, not of a locked or idle one",
            float(np.ptp(i)),
            "currents that follow the voltage",
            "give the points of a locked-rotor or a no-load test",
        )
    what, values, least = ("current", i, LEAST_SPREAD) if is_locked else ("flux", v / f, LEAST_FLUX_SPREAD)
    spread = float(values.max() / values.min())
    if spread < least and not (is_locked and np.unique(f).size > 1):
        return refused(
            f"the largest {what} is only {spread:.3g} times the smallest: nothing can be seen to bend",
            spread,
            f"at least {least}",
            "measure over a wider range of voltage",
        )
    return None


def _is_locked(f: Array, v: Array, i: Array, p: Array, name: str, said: Array) -> bool:
    """As every row is called (`said`), else as the table is, else by its points."""
    if said.size == 1 and said[0] in (IDLE_TEST, LOCKED_TEST):
        return bool(said[0] == LOCKED_TEST)
    lowered = name.lower().replace("-", "_").replace(" ", "_")
    if "no_load" in lowered or "noload" in lowered:
        return False
    if "locked" in lowered or "short_circuit" in lowered:
        return True
    slopes = [_slope(p[k] / i[k] ** 2, v[k]) for k in (f == one for one in np.unique(f)) if np.ptp(np.log(v[k])) > 0.05]
    return float(np.median(slopes or [0.0])) > NO_LOAD_SLOPE


def _slope(y: Array, x: Array) -> float:
    """d ln y / d ln x by least squares."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def _loaded(f: Array, v: Array, i: Array) -> bool:
    """At one voltage and frequency the current changes by a quarter and more: a shaft that is loaded, not tested."""
    same = [(f == one) & (np.abs(v / np.median(v[f == one]) - 1.0) < 0.02) for one in np.unique(f)]
    return any(int(k.sum()) >= 3 and float(np.ptp(np.log(i[k]))) > 0.22 for k in same)
