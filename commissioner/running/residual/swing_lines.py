"""How many times a turn a load pulsates at a frequency of its own: the strongest line of what a fit leaves, and of the speed, over the shaft's angle.

A torque that pulsates k times a turn makes lines at f_s +- k f_r, pairs about the supply as seen from a frame that turns with the voltage (W. T. Thomson,
I. Culbert, Current Signature Analysis, Wiley-IEEE 2017, ch. 8). Over the angle they stay lines where a load step changes the speed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from commissioner.estimation.fit import CALM_S, Machine, Problem, residuals, simulate
from commissioner.estimation.record import STATES
from commissioner.estimation.window import Window
from commissioner.running.residual.shaft_lines import frame_of_voltage

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
MOST_TURNS = 6.0
"""Times a turn up to which a load may pulsate: the shaft's inertia hides what is faster, slots are there."""
LEAST_HZ = 0.5 / CALM_S
"""What is slower is in the load's knots."""
BESIDE_BINS, FINER = 4, 4
"""About whole multiples of the shaft's turns, which are another's, of the supply's frequency, and of twice the slip's, which are a broken bar's; bins of a
spectrum between two whole numbers of periods."""
LEAST_SAMPLES = 200
STEADY_SPEED = 0.05
"""By which the speed may be below its last, behind a run-up."""
STANDS_OUT, AROUND = 100.0, 120
"""Of the median power of so many bins about it, from which a bin of the speed's spectrum holds a line: chance reaches 20, the skirts of a load step 10."""
LEAST_SWING = 2e-4
"""Of the speed."""
BY_VOLTAGE = 25.0
"""Torque's swing, of rated, over the voltage's, of its own, up to which flicker of the mains may make it: near the frequency at which rotor and field
swing against each other (17 Hz, 2.2 and 7.5 kW) it made 7 and 8 times."""


@dataclass(frozen=True)
class Swing:
    """Of the strongest line of the speed: amplitudes of the speed, of its mean, and of the torque in the air gap, N m."""

    times_a_turn: float
    hz: float
    of_speed: float
    torque_nm: float


@dataclass(frozen=True)
class _Stretch:
    """Behind a window's run-up: `angle` of the shaft, rad, `speed`, rad/s, mechanical, `supply` frequency, rad/s."""

    part: slice
    angle: Array
    speed: Array
    supply: float

    @property
    def usual(self) -> float:
        return abs(float(np.mean(self.speed)))

    def spectrum(self, x: NDArray[np.complex128] | Array) -> NDArray[np.complex128]:
        """Amplitudes (2n - 1,), both sides, of what stands at `times`, without the mean."""
        even = np.linspace(self.angle[0], self.angle[-1], x.size)
        level = np.interp(even, self.angle, x.real) + 1j * np.interp(even, self.angle, x.imag)
        window = np.hanning(x.size)
        own = np.fft.fft((level - level.mean()) * window, FINER * x.size) / window.sum()
        half = own.size // 2
        return np.stack([own[1:half], own[:half:-1][: half - 1]])

    @property
    def times(self) -> Array:
        """A turn, of the spectrum's bins."""
        step = 2.0 * np.pi / float(self.angle[-1] - self.angle[0]) / FINER
        return step * np.arange(1, FINER * self.angle.size // 2, dtype=np.float64)

    def lines(self, x: Array) -> tuple[Array, Bools]:
        """Amplitudes (n,) at `times`, and which of them stand out."""
        amplitude = 2.0 * np.abs(self.spectrum(x)[0])
        return amplitude, np.asarray(amplitude > np.sqrt(STANDS_OUT) * median_filter(amplitude, AROUND * FINER))

    def times_of(self, power: Array, top: int) -> float:
        """A turn, of the line whose largest bin is `top`: the top of a parabola through the logarithms beside it."""
        step = 0.0
        if 0 < top < power.size - 1:
            a, b, c = np.log(np.maximum(power[top - 1 : top + 2], 1e-300))
            step = float(np.clip(0.5 * (a - c) / min(a - 2.0 * b + c, -1e-12), -0.5, 0.5))
        return float(self.times[top] + step * self.times[0])

    def is_asked(self, pole_pairs: int) -> Bools:
        """Where a load of its own may pulsate."""
        times, beside = self.times, BESIDE_BINS * 2.0 * np.pi / (self.angle[-1] - self.angle[0])
        supply = self.supply / self.usual
        asked = (times > LEAST_HZ * 2.0 * np.pi / self.usual) & (times < MOST_TURNS)
        moved = float(np.ptp(self.speed)) / self.usual  # what goes with the supply is no line over the angle then
        for whole, wide in ((1.0, 0.0), (supply, moved)):
            nearest = np.maximum(np.round(times / whole), 1.0) * whole
            asked &= np.abs(times - nearest) > beside + wide * nearest
        return np.asarray(asked & (np.abs(times - 2.0 * abs(supply - pole_pairs)) > beside))


def turns_of_swing(problem: Problem, machine: Machine) -> float:
    """Of the shaft, a turn: where the strongest pair of lines stands in what is left, of all windows; 0 where none is long enough."""
    best, found = 0.0, 0.0
    pairs = problem.record.scales.pole_pairs
    whitened = residuals(problem, machine)
    for w, rest, (_, shaft) in zip(problem.record.windows, whitened, simulate(problem, machine), strict=True):
        stretch = _stretch(w, shaft[:, 0] / pairs, problem.period)
        if stretch is None:
            continue
        seen = (rest[:, 0] + 1j * rest[:, 1]) * np.conj(frame_of_voltage(w)[0])
        power = np.sum(np.abs(stretch.spectrum(seen[stretch.part])) ** 2, axis=0)
        is_asked = stretch.is_asked(pairs)
        top = int(np.argmax(power * is_asked))
        if is_asked[top] and power[top] > best:
            best, found = float(power[top]), stretch.times_of(power, top)
    return found


def swing_of(problem: Problem, machine: Machine) -> Swing | None:
    """Of the window whose speed, measured or of the fitted shaft, swings most at a frequency of its own that the voltage does not swing with; None where none does."""
    found, scales = None, problem.record.scales
    for w, (_, shaft) in zip(problem.record.windows, simulate(problem, machine), strict=True):
        stretch = _stretch(w, shaft[:, 0] / scales.pole_pairs, problem.period)
        if stretch is None:
            continue
        (seen, is_line), (torque, _) = (stretch.lines(x) for x in (stretch.speed, shaft[stretch.part, 1]))
        is_told = is_line & stretch.is_asked(scales.pole_pairs)
        top = int(np.argmax(seen * is_told))
        of_speed = float(seen[top]) / stretch.usual
        if not is_told[top] or of_speed < LEAST_SWING:
            continue
        voltage = np.hypot(*w.voltage[::2][stretch.part].T)
        in_voltage, is_flicker = stretch.lines(voltage)
        by_voltage = BY_VOLTAGE * scales.torque_nm * float(in_voltage[top] / voltage.mean())
        if (is_flicker[top] and torque[top] < by_voltage) or (found and of_speed < found.of_speed):
            continue
        times = stretch.times_of(seen, top)
        found = Swing(times, times * stretch.usual / (2.0 * np.pi), of_speed, float(torque[top]))
    return found


def of_swing(swing: Swing | None) -> Iterator[str]:
    """A remark on the load that makes it."""
    if swing is not None:
        yield (
            f"The load pulsates at {swing.hz:.4g} Hz, {swing.times_a_turn:.4g} times a turn of the shaft: the speed swings by {swing.of_speed:.2%} of its mean, the "
            f"torque in the air gap by {swing.torque_nm:.3g} Nm. That is what the motor drives, behind a belt or a gear, and no fault of the motor."
        )


def _stretch(w: Window, speed: Array, period_s: float) -> _Stretch | None:
    """None where too little is left behind the run-up."""
    usual = abs(float(np.median(speed[-max(speed.size // 4, 1) :])))
    slow = np.flatnonzero((np.abs(speed) < (1.0 - STEADY_SPEED) * usual) | (w.state == STATES.index("start")))
    part = slice(int(slow[-1]) + 1 if slow.size else 0, w.count)
    if part.stop - part.start < LEAST_SAMPLES or not usual > 0.0:
        return None
    angle = np.abs(np.cumsum(speed * period_s))[part]
    return _Stretch(part, angle, speed[part], 2.0 * np.pi * frame_of_voltage(w)[1] / period_s)
