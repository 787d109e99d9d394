"""Sample periods of 50 us to 1 ms: the chosen scheme against the exact answer of the continuous circuit."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from commissioner.identify.batch.fit import fit_segments
from commissioner.identify.batch.segments import Segment
from commissioner.identify.observer.observer import ParallelObserver
from commissioner.motor.nameplate import prior
from tests.support.standstill import linear_current, multitone, usable_motors

MOTOR = next(m for m in usable_motors() if m.name == "abb_2k2")
TONES = [(9.0, 0.5, 0.0), (6.0, 2.3, 1.0), (9.0, 9.7, 2.0), (12.0, 41.9, 3.0)]


@pytest.mark.parametrize("period_s", [50e-6, 100e-6, 200e-6, 300e-6, 500e-6, 1e-3])
def test_bias_is_below_a_tenth_of_a_per_cent_at_every_sample_period(period_s):
    voltage = multitone(TONES, 6.0, period_s)
    current = linear_current(MOTOR.truth, voltage, period_s)
    observer = ParallelObserver(prior(MOTOR.plate), period_s, MOTOR.plate.rated_current_peak_a)
    online = observer.advance(voltage, current).parameters
    batch = fit_segments([Segment(voltage, current, 0.0, True)], period_s, prior(MOTOR.plate).typical)
    for found in (online, batch.inverse_gamma_at(0.0)[0]):
        assert np.max(np.abs(np.array(found.as_tuple()) / MOTOR.truth - 1.0)) < 1e-4


def test_the_generator_of_these_tests_is_the_continuous_circuit():
    r_s, r_r, l_sigma, l_m = MOTOR.truth
    voltage = multitone(TONES, 0.02, 1e-3)
    state, seen = np.zeros(2), []
    for u in voltage:
        seen.append(state[0])

        def rate(_t, x, u=u):
            return [
                (u - (r_s + r_r) * x[0] + r_r / l_m * x[1]) / l_sigma,
                r_r * x[0] - r_r / l_m * x[1],
            ]

        state = solve_ivp(rate, (0.0, 1e-3), state, rtol=1e-11, atol=1e-13).y[:, -1]
    assert linear_current(MOTOR.truth, voltage, 1e-3) == pytest.approx(seen, rel=1e-7, abs=1e-10)
