"""Recordings at the level of the switches: every pulse of a centre-aligned modulator, a linear machine, a capacitor behind a resistor,
and currents taken where the carrier turns, behind a filter or not. Shares nothing with `sim`, nor with the averages it steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from commissioner.records import StandstillRecording

PERIOD_S = 2e-4
LINK_V = 560.0
PLATE = {
    "rated_power_w": 2200.0, "rated_voltage_v": 400.0, "rated_frequency_hz": 50.0, "rated_current_a": 5.0,
    "switching_frequency_hz": 5000.0, "sample_period_s": PERIOD_S,
}  # fmt: skip
PEAK_A = math.sqrt(2.0) * 5.0
SEGMENTS = ((0.0, 1.0, 0.0), (60.0, 1.5, 0.0), (120.0, 1.0, 0.3), (0.0, 1.0, 0.0))
"""Axis in degrees, level of the tones, bias as a share of the rated peak current."""
TONES_HZ = (0.5, 2.3, 8.0, 33.0, 110.0, 329.0)
SHARE = 0.08
PAUSE_S = 1.0
LONGEST_S = 4e-6
"""Runge-Kutta step between two edges."""


@dataclass(frozen=True)
class Drive:
    """Inverse-Gamma machine in ohm and H; what its sensors and its link do, nothing by default."""

    r_s: float = 3.1
    r_r: float = 2.4
    l_sigma: float = 0.021
    l_m: float = 0.27
    lag_s: float = 0.0
    """Of a first-order filter before the converter."""
    dead_s: float = 0.0
    """Between one switch of a leg and the other: meanwhile the current chooses the diode."""
    charging_ohm: float = 0.0
    """Resistance between a stiff source and the link's capacitor."""
    link_f: float = 2e-4
    knows_link: bool = False
    noise: float = 5e-4
    """Of the rated peak current."""


def _command(drive: Drive, level: float, bias: float, seconds: float, random: np.random.Generator) -> np.ndarray:
    t = np.arange(round(seconds / PERIOD_S)) * PERIOD_S
    out = np.full(t.size, drive.r_s * bias * PEAK_A)
    for hz in TONES_HZ:
        s = 2j * math.pi * hz
        ohms = abs(drive.r_s + s * drive.l_sigma + s * drive.l_m * drive.r_r / (drive.r_r + s * drive.l_m))
        out += SHARE * level * PEAK_A * ohms * np.cos(2.0 * math.pi * hz * t + random.uniform(-math.pi, math.pi))
    return out * np.clip((t - 0.2) / 0.1, 0.0, 1.0)


def switched(drive: Drive, seconds: float = 2.0, seed: int = 1) -> StandstillRecording:
    """All segments one after the other, each from rest."""
    random = np.random.default_rng([seed, 5])
    rows: list[list[np.ndarray]] = []
    for k, (axis, level, bias) in enumerate(SEGMENTS):
        volts = _command(drive, level, bias, seconds, np.random.default_rng([seed, 0 if k == 3 else k]))
        angles = math.radians(axis) - 2.0 * math.pi / 3.0 * np.arange(3)
        legs = np.cos(angles)[:, None] * volts
        numbers = (
            drive.r_s,
            drive.r_r,
            drive.l_sigma,
            drive.l_m,
            drive.lag_s,
            drive.dead_s,
            drive.charging_ohm,
            drive.link_f,
        )
        phases, link = _through_the_pulses(np.ascontiguousarray(legs), *numbers)
        phases += drive.noise * PEAK_A * random.normal(size=phases.shape)
        t = k * (seconds + PAUSE_S) + np.arange(volts.size) * PERIOD_S
        rows.append([t, np.full(t.size, float(k)), np.full(t.size, axis), volts, *phases, link])
    columns = [np.concatenate(column) for column in zip(*rows, strict=True)]
    link_v = columns.pop()
    return StandstillRecording(*columns, link_v if drive.knows_link else None, PERIOD_S, PLATE)


@njit(cache=True)
def _rates(x, v, r_s, r_r, l_sigma, l_m, lag, d):
    """x: stator current and rotor flux (alpha, beta), three currents behind the filter."""
    for c in range(2):
        induced = r_r * (x[c] - x[2 + c] / l_m)
        d[c] = (v[c] - r_s * x[c] - induced) / l_sigma
        d[2 + c] = induced
    for p in range(3):
        d[4 + p] = (_phase(x, p) - x[4 + p]) / lag if lag > 0.0 else 0.0


@njit(cache=True)
def _phase(x, p):
    if p == 0:
        return x[0]
    return -0.5 * x[0] + (0.5 if p == 1 else -0.5) * math.sqrt(3.0) * x[1]


@njit(cache=True)
def _through_the_pulses(legs_v, r_s, r_r, l_sigma, l_m, lag, dead, charging, farad):
    """Phase currents (3, n) that the converter takes and link voltage (n,), where the carrier turns: all legs low on both sides."""
    n = legs_v.shape[1]
    out, link = np.zeros((3, n)), np.zeros(n)
    x, y, v = np.zeros(7), np.zeros(7), np.zeros(2)
    k1, k2, k3, k4 = np.zeros(7), np.zeros(7), np.zeros(7), np.zeros(7)
    edges, on = np.zeros(13), np.zeros(3)
    u = LINK_V
    for k in range(n):
        for p in range(3):
            out[p, k] = x[4 + p] if lag > 0.0 else _phase(x, p)
        link[k] = u
        for p in range(3):
            duty = 0.5 + legs_v[p, k] / LINK_V
            edges[p], edges[3 + p] = 0.5 * PERIOD_S * (1.0 - duty), 0.5 * PERIOD_S * (1.0 + duty)
        edges[6:12] = edges[:6] + dead
        edges[12] = PERIOD_S
        begin = 0.0
        for end in np.sort(edges):
            steps = math.ceil((end - begin) / LONGEST_S)
            h = (end - begin) / max(steps, 1)
            middle = 0.5 * (begin + end)
            for _ in range(steps):
                for p in range(3):
                    waits = edges[p] < middle < edges[6 + p] or edges[3 + p] < middle < edges[9 + p]
                    is_on = edges[6 + p] < middle < edges[3 + p]
                    on[p] = 1.0 if is_on or (waits and _phase(x, p) < 0.0) else 0.0
                v[0] = u * (2.0 * on[0] - on[1] - on[2]) / 3.0
                v[1] = u * (on[1] - on[2]) / math.sqrt(3.0)
                _rates(x, v, r_s, r_r, l_sigma, l_m, lag, k1)
                y[:] = x + 0.5 * h * k1
                _rates(y, v, r_s, r_r, l_sigma, l_m, lag, k2)
                y[:] = x + 0.5 * h * k2
                _rates(y, v, r_s, r_r, l_sigma, l_m, lag, k3)
                y[:] = x + h * k3
                _rates(y, v, r_s, r_r, l_sigma, l_m, lag, k4)
                drawn = on[0] * _phase(x, 0) + on[1] * _phase(x, 1) + on[2] * _phase(x, 2)
                x += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
                if charging > 0.0:
                    u += h / farad * ((LINK_V - u) / charging - drawn)
            begin = end
    return out, link
