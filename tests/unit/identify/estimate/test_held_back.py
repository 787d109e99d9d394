"""A drive that limits its current or voltage silently: what a fit leaves unexplained names it."""

from types import SimpleNamespace

import numpy as np
import pytest

from commissioner.identify.batch.segments import Segment
from commissioner.identify.estimate.held_back import held_back
from commissioner.motor.circuit import InverseGamma

MACHINE = InverseGamma(3.7, 2.2, 0.021, 0.31)
PERIOD_S = 5e-4
TIME_S = np.arange(0.0, 8.0, PERIOD_S)
VOLTAGE_V = sum(12.0 * np.cos(2 * np.pi * hz * TIME_S + hz) for hz in (0.9, 3.1, 11.0, 47.0))


def currents(limit_a=np.inf, limit_v=np.inf, leakage_drop=0.0):
    """Of the machine step by step, behind a drive that folds back; `leakage_drop`: of the leakage at 6 A."""
    r_s, r_r, leakage_h, main_h = MACHINE.as_tuple()
    flux = current = 0.0
    out = []
    for asked in VOLTAGE_V:
        out.append(current)
        volts = np.clip(asked, -limit_v, limit_v) - 10.0 * np.sign(current) * max(abs(current) - limit_a, 0.0)
        main = r_r * (current - flux / main_h)
        flux += PERIOD_S * main
        current += PERIOD_S * (volts - r_s * current - main) / (leakage_h * (1.0 - leakage_drop * (current / 6.0) ** 2))
    return np.array(out)


def seen(every=1, **drive):
    """`held_back` of a fit that knows the machine, from every n-th current of those the drive made, with a sensor's noise."""
    measured = currents(**drive) + np.random.default_rng(1).normal(0.0, 0.01, TIME_S.size)
    weight = np.where(np.arange(TIME_S.size) % every == 0, 1.0, 0.0)
    segment = Segment(VOLTAGE_V, measured, 0.0, starts_at_rest=True, weight=None if every == 1 else weight)
    residual = segment.measured(measured - currents())
    return held_back([segment], SimpleNamespace(residuals=(residual,), sample_period_s=PERIOD_S), MACHINE)


TOP_A, TOP_V = np.max(np.abs(currents())), np.max(np.abs(VOLTAGE_V))


@pytest.mark.parametrize("every", [1, 3])
def test_a_current_that_is_folded_back_is_named_with_its_size(every):
    found = seen(every, limit_a=0.8 * TOP_A)
    assert (found.what, found.unit) == ("current", "A")
    assert found.at == pytest.approx(0.9 * TOP_A, rel=0.05)
    assert "wherever the current came near" in found.sentence


def test_a_voltage_that_is_clamped_is_named_with_what_is_missing():
    found = seen(limit_v=0.8 * TOP_V)
    at_peaks = np.abs(VOLTAGE_V) >= 0.9 * TOP_V
    assert (found.what, found.unit) == ("voltage", "V")
    assert found.missing_v == pytest.approx(np.mean(np.abs(VOLTAGE_V[at_peaks])) - 0.8 * TOP_V, rel=0.15)


@pytest.mark.parametrize("drive", [{}, {"limit_a": 1.1 * TOP_A}, {"leakage_drop": 0.1}])
def test_a_drive_that_holds_nothing_back_is_not_accused(drive):
    """Also where the leakage saturates: its volts follow the slope of the current."""
    assert seen(**drive) is None


def test_means_too_long_to_show_peaks_accuse_nobody():
    assert seen(every=20, limit_a=0.8 * TOP_A) is None
