"""What a channel's samples hold that their neighbours do not tell: white noise, and single samples that stand out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from commissioner.records import Signal

SPIKE, SPIKE_SIGMA, SHAPE = 0.1, 20.0, 0.12
"""Of the channel's usual size, and of what its samples usually differ from the cubic through their neighbours, by which a spike does; by how much
of it the neighbours may differ from what a single one makes of them: at a corner, where a contactor closes, a sixth."""
STEPS = 4.0
"""Of the converter, by which a spike stands out at least: a channel without current shows one now and then."""
MOSTLY = 0.75
"""Quantile of what is compared: neither spikes nor a pause before the start count."""
MOST_SPIKES = 0.005
"""Of the samples: more are another kind of signal."""
LONE = np.array([1.0, -4.0, -4.0, 1.0]) / 6.0
"""Of a lone sample's height, by which the two before and the two behind it are off the cubic through their own neighbours."""


def noise_of(x: Signal) -> float:
    """Standard deviation of white noise from sixth differences, which no harmonic of the supply passes (robust)."""
    d = np.diff(x, 6)
    d = d[np.isfinite(d)]
    return float(np.median(np.abs(d)) / 0.6745 / np.sqrt(924.0)) if d.size else 0.0


def without_spikes(x: Signal) -> tuple[Signal, int]:
    """(the channel with the samples that stand out alone as their neighbours tell them, how many they were)."""
    if x.size < 9:
        return x, 0
    told = x.copy()  # by the cubic through its neighbours
    told[2:-2] = (4.0 * (x[1:-3] + x[3:-1]) - x[:-4] - x[4:]) / 6.0
    at = _spikes(x, np.nan_to_num(x - told))
    if at.size == 0 or at.size > MOST_SPIKES * x.size:
        return x, 0
    out = x.copy()
    out[at] = told[at]
    return out, int(at.size)


def _step(x: Signal) -> float:
    """Of a converter: the least by which values differ."""
    gaps = np.diff(np.unique(x[np.isfinite(x)]))
    return float(gaps.min(initial=np.inf)) if gaps.size else 0.0


def _spikes(x: Signal, off: Signal) -> NDArray[np.int64]:
    """Where one sample alone is `off` its neighbours."""
    if not np.isfinite(x).any():
        return np.zeros(0, dtype=np.int64)
    usual = float(np.median(np.abs(off))) / 0.6745
    least = max(SPIKE_SIGMA * usual, SPIKE * float(np.nanquantile(np.abs(x), MOSTLY)))
    at = np.flatnonzero(np.abs(off) > least)
    at = at[(at >= 4) & (at < x.size - 4)]
    if at.size:
        at = at[np.abs(off[at]) > STEPS * _step(x)]
    around = np.stack([off[at + k] for k in (-2, -1, 1, 2)], axis=1) / off[at, None]
    return at[np.all(np.abs(around - LONE) < SHAPE, axis=1)]
