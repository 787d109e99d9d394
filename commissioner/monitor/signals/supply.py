"""What the mains do: sequence, frequency over time, and the frame that turns with them.

The frame's angle is a stiff cubic spline through the demodulated voltage, so the filter is zero-phase and has no start-up.
Any smooth angle is exact for the model as long as voltage, current and omega_e use the same one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.interpolate import BSpline, make_lsq_spline

from commissioner.records import Signal

Vector = NDArray[np.complex128]
Instants = NDArray[np.floating[Any]]

KNOT_SPACING_S = 1.5
"""Slower than any load modulation the method resolves, faster than a grid's frequency wander."""
LEAST_SAMPLES = 64
"""For a first look at the supply, however far the samples are apart."""
BAND_IN_SUPPLY_FREQUENCIES = 14.0
"""Kept either side of the supply frequency: shaft harmonics up to 28 of a four-pole motor, supply lines up to 13."""


@dataclass(frozen=True)
class SupplyAngle:
    """theta_e(t) as carrier plus spline: `angle_rad(t)` and `frequency_rad_per_s(t)` at any time inside the stretch."""

    carrier_rad_per_s: float
    deviation: BSpline

    def angle_rad(self, time_s: Instants) -> Signal:
        return np.asarray(self.carrier_rad_per_s * time_s + self._slow(time_s, 0), dtype=np.float64)

    def frequency_rad_per_s(self, time_s: Instants) -> Signal:
        return np.asarray(self.carrier_rad_per_s + self._slow(time_s, 1), dtype=np.float64)

    def _slow(self, time_s: Instants, derivative: int) -> Signal:
        """The spline; on long signals from a grid of 2 ms (it bends over 1.5 s: below 1e-7 rad off)."""
        points = int(np.ptp(time_s) / 2e-3) + 2
        if points >= time_s.size:
            return np.asarray(self.deviation(time_s, derivative))
        grid = np.linspace(time_s[0], time_s[-1], points)
        return np.asarray(np.interp(time_s, grid, self.deviation(grid, derivative)), dtype=np.float64)


@dataclass(frozen=True)
class TurningFrame:
    """Currents and voltages in the supply's frame, `(n,)` complex, low-passed and resampled to `sample_period_s`.

    `start_angle_rad` was added to the frame so that the mean current lies at 45 degrees: i_d and i_q keep their sign.
    `slip_phase_rad` is how far the rotor has moved away from a constant slip, in electrical radians.
    """

    time_s: Signal
    current_a: Vector
    voltage_v: Vector
    supply_angle_rad: Signal
    supply_rad_per_s: Signal
    sample_period_s: float
    band_hz: float
    start_angle_rad: float
    slip_phase_rad: Signal


def space_vector(u: Signal, v: Signal, w: Signal) -> Vector:
    """(2/3)(u + a v + a^2 w): amplitude-invariant, blind to the common mode."""
    real = (2.0 * u - v - w) / 3.0
    return np.asarray(real + 1j * ((v - w) / np.sqrt(3.0)), dtype=np.complex128)


def phase_voltages(uv: Signal, vw: Signal, wu: Signal) -> tuple[Signal, Signal, Signal]:
    """Star voltages without common mode from three line-to-line voltages."""
    return (uv - wu) / 3.0, (vw - uv) / 3.0, (wu - vw) / 3.0


def dominant_frequency_hz(vector: Vector, sample_period_s: float) -> float:
    """Signed frequency of the strongest line: negative means the phases follow each other backwards."""
    count = min(vector.size, max(int(4.0 / sample_period_s), LEAST_SAMPLES))
    padded = fft.next_fast_len(4 * count)
    window = np.hanning(count)
    spectrum = np.abs(fft.fft((vector[:count] - vector[:count].mean()) * window, padded))
    frequency = fft.fftfreq(padded, sample_period_s)
    k = int(np.argmax(spectrum))
    left, mid, right = np.log(spectrum[[k - 1, k, (k + 1) % padded]] + 1e-300)
    shift = 0.5 * (left - right) / (left - 2 * mid + right)
    return float(frequency[k] + shift / (padded * sample_period_s))


def follow_supply(voltage: Vector, sample_period_s: float, frequency_hz: float) -> SupplyAngle:
    """The angle of the positive-sequence voltage: means over whole supply periods, phase unwrapped, stiff spline; of a single period its phase."""
    step = min(max(1, round(1 / (frequency_hz * sample_period_s))), voltage.size)
    blocks = voltage.size // step
    carrier = 2 * np.pi * frequency_hz
    time = np.arange(blocks * step) * sample_period_s
    turned = voltage[: blocks * step] * np.exp(-1j * carrier * time)
    mean = turned.reshape(blocks, step).mean(axis=1)
    phase = np.unwrap(np.angle(mean))
    centre = (np.arange(blocks) * step + 0.5 * (step - 1)) * sample_period_s
    end = (voltage.size - 1) * sample_period_s
    pieces = max(1, min(int(end / KNOT_SPACING_S), blocks - 1))
    order = 3 if blocks >= 4 * (pieces + 3) else min(blocks - 1, 1)
    inner = np.linspace(0.0, end, pieces + 1)[1:-1]
    knots = np.concatenate([np.zeros(order + 1), inner, np.full(order + 1, end)])
    return SupplyAngle(carrier, make_lsq_spline(centre, phase, knots, k=order))


def fundamental_phasor(signal: Instants, angle_rad: Instants) -> complex:
    """Complex amplitude of the line at the angle's own rate in a real signal, over a Hann window (leakage of neighbours below 1e-4)."""
    window = np.hanning(signal.size + 2)[1:-1]
    return complex(2.0 * np.sum(window * signal * np.exp(-1j * angle_rad)) / window.sum())


def resample_band(vector: Vector, sample_period_s: float, band_hz: float) -> tuple[Vector, float]:
    """The same signal at the lowest rate that carries +-band_hz: its spectrum cropped in the frequency domain.

    The crop keeps 10 % of guard and is tapered there; the record is mirrored at neither end, so the outermost
    few samples ring and are left out by the caller.
    """
    count = vector.size
    kept = min(count, fft.next_fast_len(int(np.ceil(2.2 * band_hz * count * sample_period_s))))
    if kept >= count:
        return vector, sample_period_s
    spectrum = fft.fft(vector)
    half = kept // 2
    cropped = np.concatenate([spectrum[: kept - half], spectrum[-half:]])
    frequency = np.abs(fft.fftfreq(kept, count * sample_period_s / kept))
    edge = frequency.max()
    taper = np.clip((edge - frequency) / (edge - band_hz), 0.0, 1.0)
    smooth = taper * taper * (3 - 2 * taper)
    return fft.ifft(cropped * smooth) * (kept / count), count * sample_period_s / kept


def turning_frame(current: Vector, voltage: Vector, supply: SupplyAngle, sample_period_s: float) -> TurningFrame:
    """Both vectors in the supply's frame, low-passed to the band the method uses; the ends are cut."""
    count = _fast_length(current.size)
    time = np.arange(count) * sample_period_s
    backwards = np.exp(-1j * supply.angle_rad(time))
    i, v = current[:count] * backwards, voltage[:count] * backwards
    start = np.pi / 4 - float(np.angle(i.mean()))
    frequency = supply.carrier_rad_per_s / (2 * np.pi)
    band = min(BAND_IN_SUPPLY_FREQUENCIES * frequency, 0.45 / sample_period_s)
    turn = np.exp(1j * start)
    slow_i, period = resample_band(i * turn, sample_period_s, band)
    slow_v, _ = resample_band(v * turn, sample_period_s, band)
    cut = 0 if slow_i.size == count else int(np.ceil(0.02 / period))
    keep = slice(cut, slow_i.size - cut)
    slow_time = np.asarray(np.arange(slow_i.size)[keep] * period, dtype=np.float64)
    return TurningFrame(
        slow_time,
        slow_i[keep],
        slow_v[keep],
        supply.angle_rad(slow_time),
        supply.frequency_rad_per_s(slow_time),
        period,
        band,
        start,
        np.zeros(slow_time.size),
    )


def _fast_length(count: int) -> int:
    """The largest length up to `count` whose FFT is quick, losing at most 1 % of the record."""
    for candidate in range(count, int(0.99 * count), -1):
        if fft.next_fast_len(candidate) == candidate:
            return candidate
    return count
