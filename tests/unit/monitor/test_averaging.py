"""Averaging: known waveforms come back, close lines stay apart, and the claimed noise is the noise."""

from __future__ import annotations

import numpy as np
import pytest

from commissioner.monitor.signals.averaging import Comb, free_orders, separate
from commissioner.monitor.signals.supply import TurningFrame

PERIOD_S = 1 / 1500


def waveform(turns: np.ndarray) -> np.ndarray:
    """A complex periodic signal with four orders."""
    phase = 2 * np.pi * turns
    return (
        2.0
        + 0.3 * np.exp(1j * phase)
        + (0.1 - 0.2j) * np.exp(-1j * phase)
        + 0.05 * np.exp(3j * phase)
        - 0.02 * np.exp(-4j * phase)
    )


def synchronous_average(signal: np.ndarray, frequency_hz: float) -> np.ndarray:
    """Schantz & Leeb (2), (3): resampled by zero padding to floor(f_s T_p) points per period, whole periods averaged."""
    count = signal.size
    points, periods = int(1 / frequency_hz / PERIOD_S), int(count * PERIOD_S * frequency_hz)
    spectrum = np.fft.fft(signal)
    padded = np.zeros(8 * count, dtype=np.complex128)
    padded[: count - count // 2], padded[-(count // 2) :] = spectrum[: count - count // 2], spectrum[-(count // 2) :]
    fine = 8 * np.fft.ifft(padded)
    place = np.arange(points * periods) / (points * frequency_hz * PERIOD_S / 8)
    sampled = np.interp(place, np.arange(fine.size), fine)
    return np.asarray(sampled.reshape(periods, points).mean(axis=0))


def frame_of(current: np.ndarray, time: np.ndarray, supply_hz: float = 50.0) -> TurningFrame:
    angle = 2 * np.pi * supply_hz * time
    return TurningFrame(
        time,
        current,
        0 * current + 300,
        angle,
        np.full(time.size, 2 * np.pi * supply_hz),
        PERIOD_S,
        700.0,
        0.0,
        0 * time,
    )


def comb_at(frequency_hz: float, time: np.ndarray, orders: tuple[int, ...]) -> Comb:
    return Comb("load", 2 * np.pi * frequency_hz * time, frequency_hz, orders, "clock")


def test_least_squares_and_synchronous_average_agree() -> None:
    time = np.arange(15000) * PERIOD_S
    rng = np.random.default_rng(4)
    signal = waveform(24.3 * time) + 0.05 * (rng.standard_normal(time.size) + 1j * rng.standard_normal(time.size))
    lines = separate(frame_of(signal, time), slice(None), [comb_at(24.3, time, (1, 2, 3, 4))], 4)
    mean = np.fft.fft(synchronous_average(signal, 24.3))
    mean = mean / mean.size
    own = dict(zip(lines.order[lines.comb <= 0].tolist(), lines.current_a[lines.comb <= 0], strict=True))
    for order in (0, 1, -1, 3, -4):
        assert abs(own[order] - mean[order]) < 5 * 0.05 * np.sqrt(2 / time.size) + 2e-4


def test_lines_two_cells_apart_are_separated() -> None:
    time = np.arange(15000) * PERIOD_S  # 10 s: one cell is 0.1 Hz
    signal = waveform(24.3 * time) + 0.4 * np.exp(2j * np.pi * 24.5 * time) + 0.7 * np.exp(-2j * np.pi * 48.9 * time)
    combs = [comb_at(24.3, time, (1, 2, 3, 4)), comb_at(24.5, time, (1,)), comb_at(48.9, time, (1,))]
    lines = separate(frame_of(signal, time), slice(None), combs, 4)
    first = lines.current_a[(lines.comb == 0) & (lines.order == 1)][0]
    assert first == pytest.approx(0.3, abs=1e-6)
    assert lines.current_a[(lines.comb == 1) & (lines.order == 1)][0] == pytest.approx(0.4, abs=1e-6)
    assert lines.current_a[(lines.comb == 2) & (lines.order == -1)][0] == pytest.approx(0.7, abs=1e-6)


def test_the_claimed_noise_is_the_noise() -> None:
    """z^2 of a line over 60 seeds has mean 1 (two degrees of freedom each): within 5 standard deviations of that mean."""
    time = np.arange(6000) * PERIOD_S
    scores = []
    for seed in range(60):
        rng = np.random.default_rng([seed, 9])
        noise = rng.standard_normal(time.size) + 1j * rng.standard_normal(time.size)
        coloured = np.convolve(noise, [1.0, 0.8, 0.4], mode="same")
        lines = separate(
            frame_of(waveform(24.3 * time) + 0.1 * coloured, time), slice(None), [comb_at(24.3, time, (1, 2, 3, 4))], 2
        )
        k = int(np.flatnonzero((lines.comb == 0) & (lines.order == 2))[0])
        claimed = np.sum(np.abs(lines.current_influence[:, k]) ** 2)
        scores.append(abs(lines.current_a[k]) ** 2 / claimed)
    # 24 blocks make the claimed variance itself scatter: the ratio is F(2, 23)-like, mean 23/21, std about 1.2
    assert abs(np.mean(scores) - 23 / 21) < 5 * 1.2 / np.sqrt(60)


def test_orders_that_collide_with_the_mains_are_left_out() -> None:
    orders = free_orders(24.99, 8, [], 50.0, 10.0)
    assert 2 not in orders and 4 not in orders and {1, 3, 5} <= set(orders)
    assert free_orders(24.3, 8, [], 50.0, 10.0) == (1, 2, 3, 4, 5, 6, 7, 8)


def test_orders_that_another_comb_holds_are_left_out() -> None:
    assert 13 not in free_orders(1.9, 20, [24.70], 50.0, 10.0)
