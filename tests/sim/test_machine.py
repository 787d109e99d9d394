"""The simulated machine against closed forms that its code does not contain."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from sim.physics import layout as at
from sim.physics.inductance import inverse_gamma
from sim.physics.kernel import all_currents, coast, play_voltages
from sim.physics.machine import Effect, Heating, Machine, Plant, PowerStage, Sensors
from sim.physics.packing import fresh_state, pack
from sim.truth import axis_error_v

IDEAL = Plant(
    machine=Machine(saturation_at_rated_flux=0.0, inductance_h=0.245),
    power_stage=PowerStage(dead_time_s=0.0, threshold_v=0.0, slope_ohm=0.0, link_ripple=0.0),
    sensors=Sensors(noise_a=0.0, delay_s=0.0, lag_s=0.0),
    heating=Heating(0.0, 0.0),
)
REAL = replace(IDEAL, machine=Machine(), power_stage=PowerStage(link_ripple=0.0))


def play(plant: Plant, voltage: np.ndarray, axis_deg: float = 0.0, accuracy: float = 1.0):
    p, _ = pack(plant, accuracy=accuracy)
    x = fresh_state(p)
    points, link = np.zeros((voltage.size, at.POINTS, 2)), np.zeros(voltage.size)
    play_voltages(x, p, voltage, math.radians(axis_deg), points, link)
    return points, x, p


def along(points: np.ndarray, axis_deg: float) -> np.ndarray:
    a = math.radians(axis_deg)
    return points[..., 0] * math.cos(a) + points[..., 1] * math.sin(a)


@pytest.mark.parametrize("axis_deg", [0.0, 37.0, 60.0, 120.0])
def test_direct_current_is_voltage_over_resistance_on_every_axis(axis_deg):
    points, _, _ = play(IDEAL, np.full(20000, 10.0), axis_deg)
    assert along(points[-1, -1], axis_deg) == pytest.approx(10.0 / 3.7, rel=1e-9)
    assert along(points[-1, -1], axis_deg + 90.0) == pytest.approx(0.0, abs=1e-12)


def test_linear_machine_follows_the_exact_zero_order_hold_solution():
    random = np.random.default_rng(1)
    u = random.normal(0.0, 20.0, 3000)
    points, _, p = play(IDEAL, u, 20.0)
    m, period = IDEAL.machine, IDEAL.control_period_s
    per_leak, per_ls = 1.0 / m.leakage_inductance_h, 1.0 / m.inductance_h
    current = np.array([per_ls + per_leak, -per_leak])  # i_s of (psi_s, psi_r)
    a = np.array([-m.stator_resistance_ohm * current, m.rotor_resistance_ohm * np.array([per_leak, -per_leak])])
    block = expm(np.block([[a, np.array([[1.0], [0.0]])], [np.zeros((1, 3))]]) * period)
    flux, exact = np.zeros(2), np.zeros(u.size)
    for k, v in enumerate(u):
        flux = block[:2, :2] @ flux + block[:2, 2] * v
        exact[k] = current @ flux
    assert p[at.P_SUBSTEPS] == 1
    np.testing.assert_allclose(along(points[:, -1], 20.0), exact, atol=1e-7 * np.abs(exact).max())


@pytest.mark.parametrize("frequency_hz", [0.5, 9.7, 41.9, 331.7])
def test_linear_impedance_is_that_of_the_inverse_gamma_circuit(frequency_hz):
    q = inverse_gamma(IDEAL, 0.5)
    jw = 2j * math.pi * frequency_hz
    parallel = 1.0 / (1.0 / q["rotor_resistance_ohm"] + 1.0 / (jw * q["magnetizing_inductance_h"]))
    expected = q["stator_resistance_ohm"] + jw * q["leakage_inductance_h"] + parallel
    n = round(30.0 / IDEAL.control_period_s)
    t = np.arange(n) * IDEAL.control_period_s
    points, _, _ = play(IDEAL, 10.0 * np.cos(2.0 * math.pi * frequency_hz * t), accuracy=2)
    tail = slice(n - round(20.0 / IDEAL.control_period_s), n)  # whole number of 0.1 Hz periods
    fine = (t[tail, None] + np.arange(4) / 4 * IDEAL.control_period_s).ravel()  # four samples a period: no images
    line = np.exp(-2j * math.pi * frequency_hz * fine)
    held = np.sinc(frequency_hz * IDEAL.control_period_s) * cmath.exp(-jw * IDEAL.control_period_s / 2.0)
    measured = 10.0 * held / (2.0 * np.mean(points[tail, :4, 0].ravel() * line))
    assert measured == pytest.approx(expected, rel=1.5e-3)


def test_saturated_direct_current_and_flux_satisfy_the_published_law():
    points, x, _ = play(replace(REAL, power_stage=IDEAL.power_stage), np.full(30000, 18.0))
    current = points[-1, -1, 0]
    flux = brentq(lambda psi: psi * (1.0 + (0.84 * psi) ** 7) / 0.34 - current, 0.0, 2.0)
    assert current == pytest.approx(18.0 / 3.7, rel=1e-6)
    assert x[0] == pytest.approx(flux, rel=1e-6)


@pytest.mark.parametrize("axis_deg", [0.0, 30.0, 77.0])
def test_steady_voltage_is_resistance_drop_plus_the_leg_errors_on_that_axis(axis_deg):
    points, _, _ = play(REAL, np.full(40000, 20.0), axis_deg)
    current = along(points[-1, -1], axis_deg)
    assert pytest.approx(3.7 * current + axis_error_v(REAL, axis_deg, current), abs=1e-3) == 20.0


def test_energy_taken_is_heat_plus_magnetic_energy():
    t = np.arange(5000) * 2e-4
    _, x, _ = play(IDEAL, 25.0 * np.cos(2.0 * math.pi * 5.0 * t), 10.0, accuracy=8)
    i_r = (x[2:4] - x[0:2]) / IDEAL.machine.leakage_inductance_h
    stored = 1.5 * (x[0] ** 2 + x[1] ** 2) / (2 * 0.245) + 1.5 * (i_r @ i_r) * IDEAL.machine.leakage_inductance_h / 2
    assert x[at.X_ENERGY_IN] == pytest.approx(x[at.X_ENERGY_LOSS] + stored, rel=2e-3)


def test_halving_the_step_moves_the_current_by_far_less_than_the_noise():
    t = np.arange(10000) * 2e-4
    u = 20 * np.cos(2 * np.pi * 2 * t) + 10 * np.cos(2 * np.pi * 41.9 * t) + 8 * np.cos(2 * np.pi * 331 * t)
    coarse, fine, finer = (play(REAL, u, 33.0, accuracy=a)[0] for a in (1, 4, 8))
    assert np.sqrt(np.mean((coarse - finer) ** 2)) < 0.05 * Sensors().noise_a
    assert np.sqrt(np.mean((fine - finer) ** 2)) < 0.002 * Sensors().noise_a


def test_blocked_output_kills_the_current_in_milliseconds_and_leaves_the_rotor_to_decay():
    _, x, p = play(IDEAL, np.full(10000, 15.0))
    before = x[2]
    assert 0.0 < coast(x, p, 0.0501) < 0.005
    assert all_currents(x, p)[:2] == pytest.approx((0.0, 0.0), abs=1e-9)
    m = IDEAL.machine
    time_constant = (m.inductance_h + m.leakage_inductance_h) / m.rotor_resistance_ohm
    middle = x[2]
    coast(x, p, time_constant)
    assert x[2] / middle == pytest.approx(math.exp(-1.0), rel=2e-3)
    assert middle < before


@pytest.mark.parametrize("shape", ["leakage", "main"])
def test_an_open_anisotropic_machine_carries_no_current_and_its_flux_decays_by_direction(shape):
    """d psi_r/dt = -R_r (L_s + L_leak)^-1 psi_r with both inductances tensors: the closed form of the open Gamma circuit."""
    size, angle = 0.05, math.radians(2.0 * 30.0)
    plant = replace(IDEAL, effects=(Effect("inductance_anisotropy", size, shape, {"angle_deg": 30.0}),))
    m, tilt = plant.machine, np.array([[math.cos(angle), math.sin(angle)], [math.sin(angle), -math.cos(angle)]])
    tilted, plain = np.linalg.inv(np.eye(2) + size * tilt), np.eye(2)
    main, leak = (tilted, plain) if shape == "main" else (plain, tilted)
    rate = m.rotor_resistance_ohm * np.linalg.inv(m.inductance_h * main + m.leakage_inductance_h * leak)
    _, x, p = play(plant, np.full(10000, 15.0))
    coast(x, p, 0.0501)
    assert all_currents(x, p)[:2] == pytest.approx((0.0, 0.0), abs=1e-9)
    before = x[2:4].copy()
    coast(x, p, 0.1)
    assert x[2:4] == pytest.approx(expm(-0.1 * rate) @ before, rel=1e-3, abs=2e-5 * before[0])


def test_inverse_gamma_and_gamma_circuits_have_one_impedance():
    m, q = REAL.machine, inverse_gamma(REAL, 0.9)
    ls = 0.34 / (1.0 + (0.84 * 0.9) ** 7)
    for w in (1.0, 30.0, 1000.0):
        rotor = m.rotor_resistance_ohm + 1j * w * m.leakage_inductance_h
        gamma = 1j * w * ls * rotor / (rotor + 1j * w * ls)
        magnetizing = 1j * w * q["magnetizing_inductance_h"]
        other = 1j * w * q["leakage_inductance_h"] + magnetizing * q["rotor_resistance_ohm"] / (
            magnetizing + q["rotor_resistance_ohm"]
        )
        assert gamma == pytest.approx(other, rel=1e-5)


def test_sine_inductance_lies_between_secant_at_peak_and_unsaturated():
    values = [inverse_gamma(REAL, 1.0, kind)["magnetizing_inductance_h"] for kind in ("incremental", "secant", "sine")]
    assert values == sorted(values)
    assert values[-1] < inverse_gamma(REAL, 0.0)["magnetizing_inductance_h"]


def test_phase_resistance_warms_by_what_its_own_current_says():
    plant = replace(IDEAL, heating=Heating(0.05, 0.0, 1e6))
    _, x, _ = play(plant, np.full(50000, 3.7 * 2.0))
    seconds = 50000 * 2e-4
    full = 0.05 / 60.0 * (2.0 / 5.0) ** 2 * seconds
    assert x[at.X_HEAT_A] == pytest.approx(full, rel=0.02)
    assert x[at.X_HEAT_B] == pytest.approx(full / 4.0, rel=0.02)


def test_deep_bars_raise_the_rotor_resistance_at_rated_frequency_by_the_named_share():
    plant = replace(IDEAL, effects=(Effect("rotor_skin_effect", 0.3, "one_cell"),))
    p, _ = pack(plant)
    w = 2.0 * math.pi * 50.0
    cell = 1.0 / (1.0 / p[at.P_SKIN1_OHM] + 1.0 / (1j * w * p[at.P_SKIN1_H]))
    assert (p[at.P_RR] + cell.real) / p[at.P_RR] == pytest.approx(1.3)
    assert p[at.P_LEAK_H] + p[at.P_SKIN1_H] == pytest.approx(0.023)


def test_rotor_turning_shows_on_the_other_axis():
    t = np.arange(20000) * 2e-4
    u = 15.0 * np.cos(2.0 * math.pi * 1.0 * t)
    still, _, _ = play(IDEAL, u)
    turning, _, _ = play(replace(IDEAL, effects=(Effect("shaft_motion", 1.0, "creep"),)), u)
    assert np.abs(still[:, 0, 1]).max() < 1e-9
    assert np.abs(turning[:, 0, 1]).max() > 0.02
