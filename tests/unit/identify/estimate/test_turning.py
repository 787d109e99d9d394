"""A turning shaft, told by the current beside the axis."""

from types import SimpleNamespace

import numpy as np
import pytest

from commissioner.identify.estimate.turning import turning_doubt, turning_rad_per_s
from commissioner.motor.circuit import InverseGamma

MACHINE = InverseGamma(3.7, 2.2, 0.021, 0.31)
PERIOD_S = 5e-4
TIME_S = np.arange(0.0, 4.0, PERIOD_S)
ALONG_A = sum(np.sin(2 * np.pi * hz * TIME_S + hz) for hz in (0.9, 3.1, 11.0, 47.0)) + 2.0


def beside(speed: float) -> np.ndarray:
    """Current beside the axis of a rotor at this electrical speed, step by step."""
    r_s, r_r, leakage_h, main_h = MACHINE.as_tuple()
    along = across = current = 0.0
    out = []
    for along_a in ALONG_A:
        out.append(current)
        moved = r_r * current - r_r / main_h * across + speed * along
        along += PERIOD_S * (r_r * along_a - r_r / main_h * along - speed * across)
        across += PERIOD_S * moved
        current += PERIOD_S * (-r_s * current - moved) / leakage_h
    return np.array(out)


def seen(speed: float, gain: float = 0.0) -> float:
    noise = np.random.default_rng(1).normal(0.0, 0.01, TIME_S.size)
    stretch = SimpleNamespace(current_a=ALONG_A, cross_a=beside(speed) + gain * ALONG_A + 0.02 + noise)
    return turning_rad_per_s([stretch], MACHINE, PERIOD_S)


@pytest.mark.parametrize("speed", [0.5, -2.0])
def test_the_speed_of_a_shaft_that_turns_is_found(speed):
    assert seen(speed, gain=0.02) == pytest.approx(abs(speed), rel=0.1)


def test_a_still_shaft_is_still_whatever_the_sensors_gains():
    assert seen(0.0) == seen(0.0, gain=0.05) == 0.0


def test_a_played_recording_without_noise_is_still():
    played = SimpleNamespace(current_a=ALONG_A, cross_a=1e-5 * beside(1.0))
    silent = SimpleNamespace(current_a=ALONG_A, cross_a=0.0 * ALONG_A)
    assert turning_rad_per_s([played], MACHINE, PERIOD_S) == turning_rad_per_s([silent], MACHINE, PERIOD_S) == 0.0


def test_a_test_too_short_tells_nothing():
    short = SimpleNamespace(current_a=ALONG_A[:100], cross_a=ALONG_A[:100])
    assert turning_rad_per_s([short], MACHINE, PERIOD_S) == turning_rad_per_s([], MACHINE, PERIOD_S) == 0.0


def test_the_doubt_is_the_square_of_the_angle_turned_in_a_time_constant():
    assert turning_doubt(1.0, MACHINE) == pytest.approx((0.31 / 2.2) ** 2)
