"""Rows of test sheets - direct current, no load, locked rotor - and which test each of them is.

By what the sheet calls it, by its frequency, and by its inductance: L_s over L_sigma is 5 to 30 of built motors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.intake.points import Array
from commissioner.diagnose.intake.refusal import refused
from commissioner.diagnose.points.meters import is_direct
from commissioner.diagnose.points.table import LEAST_POINTS, lacking
from commissioner.errors import DataRefused
from commissioner.records import DIRECT_TEST, IDLE_TEST, LOCKED_TEST, POINT_COLUMNS

APART = 3.0
"""Least ratio of the inductances of no load and locked rotor: L_s over L_sigma is 5 to 30 of built motors."""
IDLE_POWER_FACTOR = 0.6
"""At most, of a motor without load; one with load has more."""
LEAST_COLUMNS = POINT_COLUMNS[1:3]
"""Of every table: a test with direct current has no frequency, and needs no power."""
COLUMNS = ("frequency_hz", "voltage_v", "current_a", "power_w", "said")


@dataclass(frozen=True)
class Rows:
    """Points of one test, `(n,)` each."""

    frequency_hz: Array
    voltage_v: Array
    current_a: Array
    power_w: Array
    said: Array
    """`records.DIRECT_TEST` and its like where the sheet names the test, else not a number."""

    @property
    def resistance_ohm(self) -> Array:
        return np.asarray(self.power_w / (3.0 * self.current_a**2))

    @property
    def impedance_ohm(self) -> Array:
        return np.asarray(self.voltage_v / np.sqrt(3.0) / self.current_a)

    @property
    def power_factor(self) -> Array:
        return np.asarray(self.resistance_ohm / self.impedance_ohm)

    @property
    def reactance_ohm(self) -> Array:
        return np.asarray(np.sqrt(np.maximum(self.impedance_ohm**2 - self.resistance_ohm**2, 0.0)))

    @property
    def inductance_h(self) -> Array:
        return np.asarray(self.reactance_ohm / (2.0 * np.pi * self.frequency_hz))

    def at(self, keep: NDArray[np.bool_]) -> Rows:
        return Rows(*(getattr(self, name)[keep] for name in COLUMNS))


def are_three_tests(tables: Sequence[Mapping[str, Array]]) -> bool:
    """Whether the tables, each of one test (`apart`), are tests of a motor together of which one has too few points for itself."""
    if any(lacking(t, LEAST_COLUMNS) for t in tables):
        return False
    every = [pooled(t) for t in tables]
    alternating = [rows for rows in every if not are_of_direct_current(rows)]
    if not alternating:
        return True
    ac, has_direct = joined(alternating), len(alternating) < len(every)
    few = any(rows.frequency_hz.size < LEAST_POINTS for rows in alternating)
    return few and (has_direct or _are_named(ac) or looks_idle(ac) is not None)


def apart(table: Mapping[str, Array]) -> list[tuple[float, NDArray[np.bool_]]]:
    """(test, its rows (n,)) for each test that a table holds, in the order direct current, no load, locked rotor; not a number: one
    test which nobody names. Rows of no known test stand in none where others are named, nor do those of a loaded motor."""
    rows = pooled(table)
    tests = np.full(rows.said.size, np.nan)
    direct = of_direct_current(rows)
    ac = rows.at(~direct)
    idle = np.isfinite(ac.said) & (ac.said == IDLE_TEST) if _are_named(ac) else _lies_apart(ac)
    if idle is not None:
        named = np.isfinite(ac.said) if _are_named(ac) else np.ones(idle.size, dtype=bool)
        loaded = idle & (ac.power_factor > IDLE_POWER_FACTOR)
        tests[~direct] = np.where(named & ~loaded, np.where(idle, IDLE_TEST, LOCKED_TEST), np.nan)
    tests[direct] = DIRECT_TEST
    found = [(test, tests == test) for test in (DIRECT_TEST, IDLE_TEST, LOCKED_TEST) if np.any(tests == test)]
    rest = ~direct & (idle is None)
    return [*found, *([(np.nan, rest)] if np.any(rest) else [])]


def misnamed(tables: Sequence[Mapping[str, Array]]) -> DataRefused | None:
    """A row of a series that is called by another test's name."""
    rows = joined([pooled(t) for t in tables])
    ac = rows.at(~of_direct_current(rows))
    return called_otherwise(ac, _lies_apart(ac))


def _are_named(ac: Rows) -> bool:
    return {IDLE_TEST, LOCKED_TEST} <= set(ac.said.tolist())


def _lies_apart(ac: Rows) -> NDArray[np.bool_] | None:
    """(n,) No load, where the inductances lie in two groups with nothing between them: iron that saturates fills no such gap."""
    order = np.argsort(ac.inductance_h)
    gaps = np.diff(np.log(np.maximum(ac.inductance_h[order], 1e-12)))
    if not gaps.size or not gaps.max() > np.log(APART):
        return None
    idle = np.zeros(order.size, dtype=bool)
    idle[order[int(np.argmax(gaps)) + 1 :]] = True
    return idle


def pooled(table: Mapping[str, Array]) -> Rows:
    """The rows of a table that has `LEAST_COLUMNS`; what else it lacks is not a number."""
    size = table[LEAST_COLUMNS[0]].size
    nothing = np.full(size, np.nan)
    return Rows(*(np.asarray(table.get(c, nothing), dtype=float) for c in (*POINT_COLUMNS, "test")))


def joined(every: Sequence[Rows]) -> Rows:
    return Rows(*(np.concatenate([getattr(r, name) for r in every]) for name in COLUMNS))


def of_direct_current(rows: Rows) -> NDArray[np.bool_]:
    """A row without frequency is of direct current, unless it is called otherwise."""
    return np.asarray(is_direct(rows.frequency_hz, rows.said) & (rows.voltage_v > 0.0) & (rows.current_a > 0.0))


def are_of_direct_current(rows: Rows) -> bool:
    return bool(np.all(of_direct_current(rows)))


def looks_idle(ac: Rows) -> NDArray[np.bool_] | None:
    """By the inductance of each row; None where all are of one kind."""
    inductance = np.maximum(ac.inductance_h, 1e-12)
    if not inductance.size or not inductance.max() >= APART * inductance.min():
        return None
    return np.asarray(inductance > np.sqrt(inductance.max() * inductance.min()))


CALLED = {DIRECT_TEST: "direct current", IDLE_TEST: "no load", LOCKED_TEST: "locked rotor"}


def called_otherwise(ac: Rows, looks: NDArray[np.bool_] | None) -> DataRefused | None:
    """A row whose test, as the sheet calls it, is not what its values are; `looks` (n,): no load by its values."""
    if (wrong := np.flatnonzero(ac.said == DIRECT_TEST)).size:
        hz = float(ac.frequency_hz[wrong[0]])
        return refused(
            f"a row is called direct current and has a frequency of {hz:g} Hz", hz, "no frequency, or 0",
            "correct the frequency or the test's name",
        )  # fmt: skip
    against = (
        np.flatnonzero(np.isfinite(ac.said) & ((ac.said == IDLE_TEST) != looks))
        if looks is not None
        else np.array([], dtype=int)
    )
    if not against.size:
        return None
    k = int(against[0])
    name, other = (
        CALLED[c] for c in ((IDLE_TEST, LOCKED_TEST) if ac.said[k] == IDLE_TEST else (LOCKED_TEST, IDLE_TEST))
    )
    return refused(
        f"the row with {ac.voltage_v[k]:g} V and {ac.current_a[k]:g} A is called {name} and is {other} by its inductance",
        f"{1e3 * ac.inductance_h[k]:.4g} mH, the rows hold {1e3 * ac.inductance_h.min():.4g} to {1e3 * ac.inductance_h.max():.4g} mH",
        "a larger inductance at no load than with a locked rotor", "correct the test's name or the values",
    )  # fmt: skip
