"""Steady-state test points as they are diagnosed: what `points.table` reads and what a cause is told."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
    remarks: tuple[str, ...] = ()

    @property
    def count(self) -> int:
        return int(self.current_line_a.shape[0])

    @cached_property
    def omega(self) -> Array:
        return np.asarray(2.0 * np.pi * self.frequency_hz)

    @cached_property
    def phase_voltage_v(self) -> Array:
        return np.asarray(self.voltage_line_v / np.sqrt(3.0))

    def without(self, k: int) -> Points:
        keep = np.arange(self.count) != k
        return self._at(keep)

    def only(self, k: int) -> Points:
        return self._at(np.arange(self.count) == k)

    def _at(self, keep: NDArray[np.bool_]) -> Points:
        return replace(
            self,
            frequency_hz=self.frequency_hz[keep],
            voltage_line_v=self.voltage_line_v[keep],
            current_line_a=self.current_line_a[keep],
            power_w=self.power_w[keep],
            resistance_ohm=None if self.resistance_ohm is None else self.resistance_ohm[keep],
        )
