"""Steady-state test points (locked rotor, no load) as data: what a table must hold, and which test it is.

Per point the terminal impedance is R + jX with R = P / (3 I^2) and |Z| = V / (sqrt(3) I) (IEC 60034-28, IEEE 112).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
NEEDED = ("frequency_hz", "voltage_line_v", "current_line_a", "power_w")
RESISTANCES = ("winding_resistance_uv_ohm", "winding_resistance_ohm", "resistance_ohm", "winding_resistance_line_ohm")
LEAST_POINTS = 5
NO_LOAD_SLOPE = -0.5
"""d ln R / d ln V of R = P/(3 I^2): about 0 with a locked rotor, between -1 and -2 at no load."""


@dataclass(frozen=True)
class Points:
    """Steady-state points of one test: `(n,)` each, line values rms, three-phase power; `resistance_ohm` per star phase."""

    name: str
    frequency_hz: Array
    voltage_line_v: Array
    current_line_a: Array
    power_w: Array
    resistance_ohm: Array | None
    is_locked: bool

    @property
    def count(self) -> int:
        return int(self.current_line_a.shape[0])

    @property
    def omega(self) -> Array:
        return np.asarray(2.0 * np.pi * self.frequency_hz)

    @property
    def phase_voltage_v(self) -> Array:
        return np.asarray(self.voltage_line_v / np.sqrt(3.0))

    def without(self, k: int) -> Points:
        keep = np.arange(self.count) != k
        return self._at(keep)

    def only(self, k: int) -> Points:
        return self._at(np.arange(self.count) == k)

    def _at(self, keep: NDArray[np.bool_]) -> Points:
        return replace(
            self, frequency_hz=self.frequency_hz[keep], voltage_line_v=self.voltage_line_v[keep],
            current_line_a=self.current_line_a[keep], power_w=self.power_w[keep],
            resistance_ohm=None if self.resistance_ohm is None else self.resistance_ohm[keep],
        )


def is_points_table(columns: Sequence[str]) -> bool:
    return all(name in columns for name in NEEDED)


def read_points(columns: Mapping[str, Array], name: str) -> Points | str:
    """The points of a table, or the sentence that says why they cannot be used."""
    values = [np.asarray(columns[c], dtype=float) for c in NEEDED]
    if any(not np.all(np.isfinite(v)) or np.any(v <= 0) for v in values):
        return "frequency, voltage, current and power must be positive numbers in every row"
    if values[0].shape[0] < LEAST_POINTS:
        return f"{values[0].shape[0]} points cannot carry an answer; at least {LEAST_POINTS} are needed"
    f, v, i, p = values
    if np.any(p > np.sqrt(3.0) * v * i):
        row = int(np.argmax(p / (v * i)))
        return f"row {row + 1}: the power {p[row]:.6g} W exceeds the apparent power {np.sqrt(3.0) * v[row] * i[row]:.6g} VA"
    if _loaded(f, v, i):
        return "the current changes at constant voltage and frequency: points of a loaded motor, not of a locked or idle one"
    between = next((np.asarray(columns[c], dtype=float) for c in RESISTANCES if c in columns), None)
    return Points(name, f, v, i, p, None if between is None else 0.5 * between, _is_locked(f, v, i, p, name))


def _is_locked(f: Array, v: Array, i: Array, p: Array, name: str) -> bool:
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
