"""The guard in closed loop: a short version of `python -m tests.campaigns.flux_guard 1000`."""

from __future__ import annotations

import pytest

from commissioner.identify.excitation import Excitation, Tone
from commissioner.identify.flux import FluxGuard
from tests.campaigns.flux_guard import run_case

CASES = range(20_000, 20_024)


@pytest.fixture(scope="module")
def outcomes():
    return [run_case(seed) for seed in CASES]


def test_true_flux_never_passes_the_limit_by_more_than_two_per_cent(outcomes):
    over = [o for o in outcomes if o.peak > 1.02]
    assert over == []


def test_nothing_is_aborted_while_the_true_flux_is_below_the_limit(outcomes):
    assert [o for o in outcomes if o.aborted and o.peak < 1.0] == []


def test_the_amplitude_is_raised_where_the_flux_permits(outcomes):
    reached = sorted(o.peak for o in outcomes)
    assert reached[len(reached) // 2] > 0.6


def test_the_first_scale_is_safe_for_a_machine_without_resistance():
    tones = (Tone(10.0, 0.5, 0.0), Tone(20.0, 7.3, 1.0))
    guard = FluxGuard(0.9, 0.02, Excitation(tones, 0.0, 5.0), 2e-4, 3.7)
    import numpy as np

    time = np.arange(50_000) * 2e-4
    flux = np.cumsum(guard.safe_scale * Excitation(tones, 0.0, 5.0).voltage_v(time)) * 2e-4
    assert np.max(np.abs(flux)) <= 0.9
