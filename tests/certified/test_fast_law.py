"""The fast law on published machines: accuracy without noise, scatter against the Cramer-Rao bound with it."""

from __future__ import annotations

import numpy as np
import pytest

from commissioner.identify.excite.tones import ExcitationLimits, design
from commissioner.identify.observer.observer import ParallelObserver
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import prior, rated_flux
from tests.support.exact.cramer_rao import cramer_rao
from tests.support.standstill import linear_current, usable_motors

PERIOD_S = 2e-4
MOTORS = {m.name: m for m in usable_motors()}
SEEDS = 60


def excitation_voltage(motor, seconds: float) -> np.ndarray:
    """What the product drives knowing only the plate."""
    flux = 0.9 * rated_flux(motor.plate, prior(motor.plate).typical.stator_resistance_ohm).stator_peak_wb
    limits = ExcitationLimits(flux, motor.plate.rated_current_peak_a, 0.5 * motor.plate.rated_voltage_v)
    chosen = design(prior(motor.plate).typical, limits, PERIOD_S).excitation
    return chosen.voltage_v(np.arange(round(seconds / PERIOD_S)) * PERIOD_S)


@pytest.mark.parametrize("name", list(MOTORS))
def test_every_parameter_is_within_a_tenth_of_a_per_cent_knowing_only_the_plate(name):
    motor = MOTORS[name]
    voltage = excitation_voltage(motor, max(5.0, 5.0 * motor.rotor_time_constant_s))
    observer = ParallelObserver(prior(motor.plate), PERIOD_S, motor.plate.rated_current_peak_a)
    block = observer.advance(voltage, linear_current(motor.truth, voltage, PERIOD_S))
    assert np.max(np.abs(np.array(block.parameters.as_tuple()) / motor.truth - 1.0)) < 1e-3


def scattered(name: str, seeds: int, seconds: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(relative errors, relative stated errors, relative bound) over seeds, 10 % noise."""
    motor = MOTORS[name]
    voltage = excitation_voltage(motor, seconds)
    current = linear_current(motor.truth, voltage, PERIOD_S)
    noise = 0.1 * float(np.std(current))
    bound = np.sqrt(np.diag(cramer_rao(InverseGamma(*motor.truth), voltage, PERIOD_S, noise))) / motor.truth
    errors, stated = [], []
    for seed in range(seeds):
        observer = ParallelObserver(prior(motor.plate), PERIOD_S, motor.plate.rated_current_peak_a)
        noisy = current + noise * np.random.default_rng(seed).standard_normal(current.size)
        block = observer.advance(voltage, noisy)
        errors.append(np.array(block.parameters.as_tuple()) / motor.truth - 1.0)
        stated.append(np.array(block.std) / motor.truth)
    return np.array(errors), np.array(stated), bound


@pytest.mark.parametrize("name", ["abb_2k2", "sps_50hp_400v_50hz"])
def test_scatter_bias_and_intervals_meet_the_bound(name):
    errors, stated, bound = scattered(name, SEEDS, 10.0)
    chance = 3.0 / np.sqrt(2 * SEEDS)  # three standard deviations of a standard deviation
    assert np.all(np.std(errors, axis=0, ddof=1) < 1.2 * bound * (1.0 + chance))
    assert np.all(np.abs(np.mean(errors, axis=0)) < bound * (0.2 + 3.0 / np.sqrt(SEEDS)))
    covered = np.mean(np.abs(errors) < 1.96 * stated)
    assert 0.93 - 0.04 < covered < 0.97 + 0.03  # 240 correlated trials: one standard deviation is 1.5 to 2 %
