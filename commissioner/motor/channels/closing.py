"""By how much the currents are behind the voltages: a closing at rest tells it, nothing steady does.

In the first milliseconds behind a contactor's closing the machine is a resistance and a leakage, and its rotor's flux what has come through R_R:
`int u dt = L i + (R_s + R_R) int i dt + (c + j d) int int i dt` with constants, whatever the motor. Currents that are `t` late add `-t L di/dt`. Of a
sine that is one with a resistance; of what a closing makes it is not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.motor.channels.late import shifted
from commissioner.records import RunningRecording, Signal

Array = NDArray[np.float64]
Vector = NDArray[np.complex128]
SPANS_S = (6e-3, 8e-3, 10e-3)
"""Behind the closing: iron that saturates, a shaft that has come up to speed, bars show in how they differ."""
QUIET_S, SKIPPED_S = 0.01, 8e-4
"""Without current before a closing; from the current's first sample on, in which poles close one by one and a delay is across the kink."""
FLOWS, FED = 0.1, 0.2
"""Of the largest current, and of the rated voltage's peak, behind a closing."""
LEAST_ROWS = 12
BESIDES_S, OF_FIT = 1e-5, 3.0
"""Standard deviation beside that of the fit, and how many times that one counts: what is left is no white noise."""
MOST_LEFT = 0.005
"""Of the flux, rms, that the law may leave."""
SURE, LEAST_S, MOST_S = 4.0, 4e-5, 1.5e-3
"""Standard deviations and seconds from which a delay is one, and up to which it is looked for."""
PASSES = 4
TURNS = 2.0 / 3.0 * np.exp(2j * np.pi / 3.0 * np.arange(3))
"""Of three phases, in their vector."""


@dataclass(frozen=True)
class Behind:
    """The currents are `late_s` behind the voltages (below zero: before them); one standard deviation."""

    late_s: float
    std_s: float

    @property
    def is_told(self) -> bool:
        return abs(self.late_s) > max(SURE * self.std_s, LEAST_S)

    @property
    def words(self) -> str:
        """`all currents are 400 us behind the voltages`."""
        way = "behind" if self.late_s > 0.0 else "before"
        return f"all currents are {abs(self.late_s) * 1e6:.3g} us {way} the voltages (+- {2e6 * self.std_s:.2g} us, by the closing)"


def currents_behind(one: RunningRecording, rated_voltage_peak_v: float) -> Behind | None:
    """None where no closing tells it."""
    period = one.sample_period_s
    if not period > 0.0 or round(SPANS_S[0] / period) < LEAST_ROWS:
        return None
    current, voltage = _vectors(one)
    at = _closing(current, voltage, period, rated_voltage_peak_v)
    if at is None:
        return None
    first, last = at - round(QUIET_S / period), at + round((SPANS_S[-1] + 2.0 * MOST_S) / period) + 10
    steps = np.diff(one.time_s[first:last])
    i, v = current[first:last], voltage[first:last]
    if last > current.size or not np.isfinite(i).all() or not np.isfinite(v).all() or not np.all(steps < 1.5 * period):
        return None
    i = i - i[: round(0.5 * QUIET_S / period)].mean()
    total, std = 0.0, 0.0
    for _ in range(PASSES):
        found = _fitted(i, v, total, round(QUIET_S / period), period)
        if found is None or abs(total + found[0]) > MOST_S:
            return None
        total, std = total + found[0], found[1]
        if abs(found[0]) < 0.1 * std:
            break
    return Behind(total, std)


def _vectors(one: RunningRecording) -> tuple[Vector, Vector]:
    """Space vectors; one absent channel is minus the sum of the others."""
    groups = []
    for group in (one.currents_a, one.voltages_v):
        x = np.array(group)
        absent = [k for k in range(3) if not np.isfinite(x[k]).any()]
        if len(absent) == 1:
            x[absent[0]] = -sum(x[k] for k in range(3) if k != absent[0])
        groups.append(x)
    i, v = groups
    if one.voltages_are_line_to_line:
        v = np.array([v[0] - v[2], v[1] - v[0], v[2] - v[1]]) / 3.0
    return TURNS @ i, TURNS @ v


def _closing(current: Vector, voltage: Vector, period_s: float, rated_voltage_peak_v: float) -> int | None:
    """The first sample with current behind a stretch without any, where the voltage is there from then on."""
    size = np.nan_to_num(np.abs(current))
    flows = size > FLOWS * float(np.quantile(size, 0.999))
    quiet, span = round(QUIET_S / period_s), round(SPANS_S[-1] / period_s)
    at = int(np.argmax(flows))
    if not flows[at] or at < 2 * quiet or at + span > flows.size:
        return None
    volts = np.abs(voltage[at + round(SKIPPED_S / period_s) : at + span])
    return at if bool(np.all(volts > FED * rated_voltage_peak_v)) else None


def _fitted(i: Vector, v: Vector, late_s: float, at: int, period_s: float) -> tuple[float, float] | None:
    """(delay beside `late_s`, its standard deviation); None where the law leaves more than a machine at rest does."""
    moved = shifted(i.real, late_s / period_s) + 1j * shifted(i.imag, late_s / period_s)
    there = np.isfinite(moved)
    i = np.where(there, moved, 0.0)
    slope = np.zeros_like(i)
    slope[2:-2] = (8.0 * (i[3:-1] - i[1:-3]) - (i[4:] - i[:-4])) / (12.0 * period_s)
    through, flux = _integral(i, period_s), _integral(v, period_s)
    twice = _integral(through, period_s)
    told = []
    for span in SPANS_S:
        rows = slice(at + round(SKIPPED_S / period_s), at + round(span / period_s))
        columns = [x[rows] for x in (i, slope, through, twice, 1j * twice)]
        columns += [np.ones(columns[0].size, dtype=np.complex128), np.full(columns[0].size, 1j)]
        design, target = np.array([_both(x) for x in columns]).T, _both(flux[rows])
        unit = np.linalg.norm(design, axis=0)
        x = np.linalg.lstsq(design / unit, target, rcond=None)[0]
        left = target - design / unit @ x
        spread = np.linalg.pinv((design / unit).T @ (design / unit)) * float(left @ left) / (target.size - x.size)
        inductance = x[0] / unit[0]
        if not inductance > 0.0 or float(left @ left) > MOST_LEFT**2 * float(target @ target):
            return None
        told.append((x[1] / unit[1] / inductance, np.sqrt(spread[1, 1]) / unit[1] / inductance))
    late, own = told[1]
    apart = max(abs(other - late) for other, _ in told)
    return float(late), float(np.sqrt(BESIDES_S**2 + (OF_FIT * own) ** 2 + (2.0 * apart) ** 2))


def _integral(x: Vector, period_s: float) -> Vector:
    return np.asarray(np.concatenate([[0.0], np.cumsum(0.5 * (x[1:] + x[:-1]))]) * period_s)


def _both(x: Vector) -> Signal:
    return np.concatenate([x.real, x.imag])
