"""A window of a running recording: its rows one after the other, and its parts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Window:
    """`current` (n, 3: alpha, beta, zero); `voltage`, `speed` (2n - 1, 2) at samples and between; speed electrical and its slope."""

    time_s: Array
    current: Array
    voltage: Array
    speed: Array
    state: NDArray[np.int64]
    is_from_rest: bool

    @property
    def count(self) -> int:
        """Samples."""
        return int(self.time_s.size)

    @property
    def direction(self) -> float:
        """In which the supply turns: 1 or -1."""
        return -1.0 if turns_backwards(self.voltage) else 1.0


def turns_backwards(voltage: Array) -> bool:
    return bool(np.nansum(swept(voltage)) < 0)


def swept(voltage: Array) -> Array:
    """Twice the area that the voltage's vector sweeps from each sample to the next, V^2: its sign is the supply's direction."""
    v = voltage[:, 0] + 1j * voltage[:, 1]
    return np.asarray(np.imag(np.conj(v[:-1]) * v[1:]))


def last_part(w: Window, first: int) -> Window:
    """The window from its sample `first` on."""
    return replace(
        w, time_s=w.time_s[first:] - w.time_s[first], current=w.current[first:], voltage=w.voltage[2 * first :], speed=w.speed[2 * first :],
        state=w.state[first:],
    )  # fmt: skip


def first_part(w: Window, count: int) -> Window:
    """The window's first samples."""
    return replace(
        w, time_s=w.time_s[:count], current=w.current[:count], voltage=w.voltage[: 2 * count - 1], speed=w.speed[: 2 * count - 1],
        state=w.state[:count],
    )  # fmt: skip
