"""Iron between the leakages of stator and rotor, as in every T circuit: its own place, and the flux it has seen."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from commissioner.identify.batch.extensions import select_model
from commissioner.identify.batch.fit import fit_segments
from commissioner.identify.batch.model import SPLIT, ModelChoice, iron_flux, start_theta, stator_flux
from commissioner.identify.batch.segments import Segment
from commissioner.motor.circuit import InverseGamma
from tests.support.standstill import multitone

PERIOD_S = 2e-4
R_S, R_R, L_LS, L_LR, L_M, KNEE_WB, ORDER = 1.2, 1.8, 0.016, 0.018, 0.28, 0.75, 5.0
NOISE_A = 0.02


@njit()
def main_flux(sum_a, knee_wb):
    """Of the node where the leakages meet the saturating iron: both leakages' currents are `sum_a` at none."""
    g, order = 1.0 / L_LS + 1.0 / L_LR, ORDER
    flux = sum_a / (g + 1.0 / L_M)
    for _ in range(40):
        bent = (abs(flux) / knee_wb) ** order
        flux -= (flux * (g + (1.0 + bent) / L_M) - sum_a) / (g + (1.0 + (1.0 + order) * bent) / L_M)
    return flux


@njit()
def t_circuit(voltage, knee_wb):
    """(current, main flux, stator flux) of a T circuit from rest, its main inductance L_M / (1 + (flux / knee)^S): midpoint rule."""
    current, flux, stator = np.empty_like(voltage), np.empty_like(voltage), np.empty_like(voltage)
    steps, s, r = 8, 0.0, 0.0
    h = PERIOD_S / steps
    for k in range(voltage.size):
        flux[k] = main_flux(s / L_LS + r / L_LR, knee_wb)
        stator[k], current[k] = s, (s - flux[k]) / L_LS
        for _ in range(steps):
            x, y = s, r
            for part in (0.5, 1.0):
                m = main_flux(x / L_LS + y / L_LR, knee_wb)
                x, y = s + part * h * (voltage[k] - R_S * (x - m) / L_LS), r + part * h * R_R * (m - y) / L_LR
            s, r = x, y
    return current, flux, stator


def machine_at(stator_wb, knee_wb):
    """The inverse-Gamma circuit of the secant main inductance where the stator carries this flux at rest."""
    low, high = 0.0, stator_wb
    for _ in range(60):
        m = 0.5 * (low + high)
        secant_h = L_M / (1.0 + (m / knee_wb) ** ORDER)
        low, high = (m, high) if m * (1.0 + L_LS / secant_h) < stator_wb else (low, m)
    k = secant_h / (secant_h + L_LR)
    return np.array((R_S, R_R * k * k, L_LS + k * L_LR, k * secant_h))


def a_test(knee_wb, seed=5):
    tones = [(4.0, 0.7, 0.0), (4.0, 2.3, 1.0), (14.0, 19.8, 2.0), (12.0, 60.1, 3.0), (12.0, 170.0, 1.0)]
    voltage = multitone(tones, 4.0, PERIOD_S)
    current, flux, stator = t_circuit(voltage, knee_wb)
    noise = NOISE_A * np.random.default_rng(seed).standard_normal(voltage.size)
    return [Segment(voltage, current + noise, 0.0, True)], float(np.max(np.abs(flux))), stator


START = InverseGamma(*machine_at(1e-3, KNEE_WB))


def test_a_saturating_t_circuit_is_found_at_every_flux_it_reached():
    parts, reached_wb, stator_wb = a_test(KNEE_WB)
    fit = select_model(parts, PERIOD_S, [START], None)
    assert fit.model.with_split and fit.noise_a == pytest.approx(NOISE_A, rel=0.02)
    assert fit.peak_iron_flux_wb == pytest.approx(fit.peak_flux_wb, rel=0.1)
    for share in (0.3, 0.6, 0.8, 0.95):
        found, covariance = fit.inverse_gamma_at(share * fit.peak_flux_wb)
        truth = machine_at(share * fit.peak_flux_wb, KNEE_WB)
        assert np.all(np.abs(np.array(found.as_tuple()) - truth) < 3.5 * np.sqrt(np.diag(covariance)) + 1e-3 * truth), (
            share
        )
        assert np.array(found.as_tuple()) == pytest.approx(truth, rel=0.02)
    assert fit.stator_flux_wb[0] == pytest.approx(stator_wb, abs=2e-3)
    secant_h = L_M / (1.0 + (reached_wb / KNEE_WB) ** ORDER)
    assert fit.peak_flux_wb == pytest.approx(reached_wb * (1.0 + L_LS / secant_h), rel=5e-3)


def test_iron_that_hardly_saturates_is_left_where_it_is_cheapest():
    parts, *_ = a_test(4.0)
    fit = select_model(parts, PERIOD_S, [START], None)
    assert not fit.model.with_split
    assert np.array(fit.inverse_gamma_at(0.5)[0].as_tuple()) == pytest.approx(machine_at(0.5, 4.0), rel=2e-3)


def test_the_iron_and_the_stator_have_one_flux_only_beside_it():
    model = ModelChoice(1, 0.8, with_split=True)
    theta = start_theta(START, model)
    theta[-1] = 3.0
    assert stator_flux(theta, model, 0.7) == iron_flux(theta, model, 0.7) == 0.7
    theta[SPLIT] = 0.45
    at_stator = stator_flux(theta, model, 0.7)
    assert at_stator == pytest.approx(0.7 + 0.45**2 * theta[2] * 3.0 * (0.7 / 0.8) ** 7)
    assert iron_flux(theta, model, at_stator) == pytest.approx(0.7)


def test_a_machine_of_straight_iron_is_the_same_wherever_it_stands():
    parts, *_ = a_test(40.0)
    at_stator = fit_segments(parts, PERIOD_S, START, ModelChoice(1, 0.8))
    theta = at_stator.theta.copy()
    theta[-1] = 0.0
    there = at_stator.inverse_gamma_at(0.0)[0].as_tuple()
    theta[SPLIT] = 0.45
    moved = fit_segments(parts, PERIOD_S, START, ModelChoice(1, 0.8, with_split=True), theta, max_iterations=0)
    assert moved.inverse_gamma_at(0.0)[0].as_tuple() == pytest.approx(there)
