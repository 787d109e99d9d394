"""The exact discrete machine against a matrix exponential and a fine integration."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from commissioner.motor.circuit import InverseGamma
from commissioner.motor.space_vector import axis_current_a, orthogonal_current_a
from commissioner.motor.standstill import (
    admittance_s,
    held_input,
    poles_per_s,
)
from tests.support.exact.pulse_transfer import from_pulse_transfer, pulse_transfer

MACHINE = InverseGamma(3.7, 2.09, 0.021, 0.224)


def continuous(machine):
    """(A, b) of d(i, psi_R)/dt = A (i, psi_R) + b u; A is (2, 2), b is (2,)."""
    r_s, r_r, l_s, l_m = machine.as_tuple()
    alpha = r_r / l_m
    return np.array([[-(r_s + r_r) / l_s, alpha / l_s], [r_r, -alpha]]), np.array([1.0 / l_s, 0.0])


def test_published_machine_has_its_published_poles():
    slow, fast = poles_per_s(MACHINE)
    assert (slow, fast) == (pytest.approx(-5.9, abs=0.05), pytest.approx(-280.0, abs=1.0))


@pytest.mark.parametrize("period_s", [5e-5, 3e-4, 1e-3, 1e-2])
def test_held_input_model_is_the_matrix_exponential(period_s):
    matrix, gain = continuous(MACHINE)
    exact = expm(np.block([[matrix, gain[:, None]], [np.zeros((1, 3))]]) * period_s)
    found, found_gain = held_input(MACHINE, period_s)
    assert np.allclose(found, exact[:2, :2], rtol=0, atol=1e-13)
    assert np.allclose(found_gain, exact[:2, 2], rtol=1e-12, atol=1e-16)


def test_held_input_model_follows_a_fine_integration_of_the_circuit():
    voltage = [10.0, -4.0, 7.0, 0.0, 3.0]
    state, exact = np.zeros(2), np.zeros(2)
    matrix, gain = held_input(MACHINE, 1e-3)
    for u in voltage:
        state = matrix @ state + gain * u

        def rate(_t, x, u=u):
            i, psi = x
            alpha = 2.09 / 0.224
            return [(u - (3.7 + 2.09) * i + alpha * psi) / 0.021, 2.09 * i - alpha * psi]

        exact = solve_ivp(rate, (0.0, 1e-3), exact, rtol=1e-11, atol=1e-13).y[:, -1]
    assert np.allclose(state, exact, rtol=1e-8)


@pytest.mark.parametrize("period_s", [5e-5, 2e-4, 1e-3, 5e-3])
def test_parameters_are_read_back_from_the_pulse_transfer_without_approximation(period_s):
    found = from_pulse_transfer(pulse_transfer(MACHINE, period_s), period_s)
    assert found is not None
    assert found.as_tuple() == pytest.approx(MACHINE.as_tuple(), rel=1e-8)


def test_an_unstable_transfer_is_no_machine():
    transfer = pulse_transfer(MACHINE, 2e-4)
    assert from_pulse_transfer(transfer * [1.01, 1.0, 1.0, 1.0], 2e-4) is None


def test_admittance_at_zero_frequency_is_one_over_the_resistance():
    assert abs(admittance_s(MACHINE, np.array([1e-9]))[0]) == pytest.approx(1 / 3.7, rel=1e-6)


def test_axis_current_has_the_phase_amplitude_and_nothing_across():
    angle = np.radians(37.0)
    length = np.array([2.0, -1.0])
    u, v, w = (length * np.cos(angle - shift) for shift in np.radians([0.0, 120.0, 240.0]))
    for third in (w, None):
        assert axis_current_a(u, v, third, 37.0) == pytest.approx(length)
        assert orthogonal_current_a(u, v, third, 37.0) == pytest.approx([0.0, 0.0], abs=1e-12)
