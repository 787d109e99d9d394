"""The test signal that is asked for and what it must look like, by the map's own formula."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Supervision:
    """What the drive is told to watch over."""

    watchdog_ms: int
    current_limit_a: float
    test_time_limit_s: float
    voltage_limit_v: float


@dataclass(frozen=True)
class Signal:
    """One excitation; tones are (amplitude_v, frequency_hz, phase_rad). `mask`: channels, bit 0 the axis voltage."""

    bias_v: float = 0.0
    bias_ramp_v_per_s: float = 100.0
    scale: float = 1.0
    scale_ramp_per_s: float = 10.0
    duration_s: float = 30.0
    axis_deg: float = 0.0
    tones: tuple[tuple[float, float, float], ...] = ()
    mask: int = 0b1111
    decimation: int = 1


def commanded_v(signal: Signal, samples: int, period_s: float) -> Real:
    """u(t) = bias(t) + scale(t) sum A cos(2 pi f t + phi) at t = 0, T, 2T ...; ramps are one step on at t = 0."""
    t = np.arange(samples) * period_s
    bias = np.sign(signal.bias_v) * np.minimum(abs(signal.bias_v), signal.bias_ramp_v_per_s * (t + period_s))
    scale = np.minimum(signal.scale, signal.scale_ramp_per_s * (t + period_s))
    tones = np.zeros(samples)
    for amplitude_v, frequency_hz, phase_rad in signal.tones:
        tones += amplitude_v * np.cos(2 * np.pi * frequency_hz * t + phase_rad)
    return np.asarray(bias + scale * tones)


def ramp_allowance_v(signal: Signal, period_s: float) -> float:
    """What starting a ramp a period earlier or later makes at most (V)."""
    amplitude_v = sum(abs(tone[0]) for tone in signal.tones)
    return period_s * (signal.bias_ramp_v_per_s + signal.scale_ramp_per_s * amplitude_v)


def block_means(values: Real, length: int) -> Real:
    """Means over stretches of `length`; an unfinished last one is left out."""
    whole = len(values) // length * length
    return np.asarray(values[:whole].reshape(-1, length).mean(axis=1))
