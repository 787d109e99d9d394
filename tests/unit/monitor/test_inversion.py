"""The inversion against closed forms: the steady state, and a machine driven by a prescribed speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from commissioner.estimation.driven import driven
from commissioner.monitor.machine.estimate import band_weights, speed_lines
from commissioner.monitor.machine.fit import PRIOR_FROM_NAMEPLATE, Start, fit, pose
from commissioner.monitor.machine.inversion import SpeedLines, complex_speed, rotor_state, torque_of, torus
from commissioner.monitor.machine.waveform import Parts, Waveform, without_unknown_load
from commissioner.monitor.periods.periods import CAP, pair_spectrum, top_of_line
from commissioner.monitor.signals.averaging import Lines
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import (
    TCircuit,
    equal_leakages,
    from_nameplate,
    pull_out_slip,
    slip_at_current,
    slip_at_power,
    stator_impedance,
)

MACHINE = TCircuit(3.7, 2.296, 0.0107, 0.0107, 0.2243)
SUPPLY = 2 * np.pi * 50
PAIRS = 2
PLATE = Nameplate(2200, 400, 50, 5.0, 1436, 0.8, 2, "star")
VOLTAGE = 400 * np.sqrt(2 / 3)


def lines_of(current: np.ndarray, voltage: np.ndarray, orders: np.ndarray, base_hz: float) -> Lines:
    """Noise-free lines of one comb; line 0 is the mean."""
    quiet = np.zeros((4, orders.size), dtype=complex)
    comb = np.where(orders == 0, -1, 0)
    return Lines(comb, orders, 2 * np.pi * base_hz * orders, current, voltage, quiet, quiet, SUPPLY)


def steady(slip: float) -> tuple[complex, Lines]:
    current = VOLTAGE / stator_impedance(MACHINE, SUPPLY, slip)
    return current, lines_of(np.array([current]), np.array([VOLTAGE + 0j]), np.array([0]), 24.0)


@pytest.mark.parametrize("slip", [0.002, 0.03, 0.08])
def test_steady_state_gives_the_slip_that_made_it(slip: float) -> None:
    _, lines = steady(slip)
    mean, *_ = complex_speed(MACHINE, PAIRS, lines, torus(lines))
    assert mean == pytest.approx(SUPPLY / PAIRS * (1 - slip), rel=1e-12)


@pytest.mark.parametrize("slip", [0.002, 0.03, 0.08])
def test_torque_is_air_gap_power_over_synchronous_speed(slip: float) -> None:
    current, lines = steady(slip)
    on = torus(lines)
    state = rotor_state(MACHINE, PAIRS, lines, on, SpeedLines(SUPPLY / PAIRS * (1 - slip), np.zeros(0, dtype=complex)))
    torque = torque_of(MACHINE, PAIRS, state.flux_wb, lines.current_a)[0]
    gap = 1.5 * (VOLTAGE * np.conj(current)).real - 1.5 * MACHINE.stator_resistance_ohm * abs(current) ** 2
    assert torque == pytest.approx(gap / (SUPPLY / PAIRS), rel=1e-9)


def forward(base_hz: float, ripple: np.ndarray, mean: float) -> tuple[Lines, np.ndarray]:
    """Lines of the current of (4), (5) at the speed mean + 2 Re sum ripple_h e^{j h phase}, constant voltage: harmonic balance.

    Written out as one linear system in stator and rotor flux lines, independent of the inversion's own algebra.
    """
    highest = 12
    orders = np.arange(-highest, highest + 1)
    count = orders.size
    d = MACHINE.determinant_h2
    l_s, l_r, l_m = MACHINE.stator_inductance_h, MACHINE.rotor_inductance_h, MACHINE.magnetizing_inductance_h
    rate = 1j * 2 * np.pi * base_hz * orders
    speed = {0: mean} | {h + 1: r for h, r in enumerate(ripple)} | {-h - 1: np.conj(r) for h, r in enumerate(ripple)}
    turning = np.array([[speed.get(int(a - b), 0.0) for b in orders] for a in orders])
    eye = np.eye(count)
    r_s, r_r = MACHINE.stator_resistance_ohm, MACHINE.rotor_resistance_ohm
    top = np.hstack([np.diag(rate) + 1j * SUPPLY * eye - r_s * l_r / d * eye, r_s * l_m / d * eye])
    bottom = np.hstack(
        [r_r * l_m / d * eye, np.diag(rate) + 1j * SUPPLY * eye - 1j * PAIRS * turning - r_r * l_s / d * eye]
    )
    drive = np.zeros(2 * count, dtype=complex)
    drive[highest] = VOLTAGE
    flux = np.linalg.solve(np.vstack([top, bottom]), drive)
    current = (l_m * flux[count:] - l_r * flux[:count]) / d
    arranged = [highest] + [highest + s * h for h in range(1, highest + 1) for s in (1, -1)]
    voltage = np.where(orders == 0, VOLTAGE + 0j, 0)
    torque = -1.5 * PAIRS * l_m / d * 1  # sign and factor of (15), used below
    phase = 2 * np.pi * np.arange(512) / 512
    basis = np.exp(1j * np.outer(phase, orders))
    wave = -torque * np.imag(np.conj(basis @ flux[:count]) * (basis @ flux[count:]))
    return lines_of(current[arranged], voltage[arranged], orders[arranged], base_hz), wave


RIPPLE = np.array([0.3 * np.exp(0.4j), 0.9 * np.exp(-1.1j), 0.0, 0.12])


def test_a_prescribed_ripple_comes_back_from_the_currents() -> None:
    base, mean = 24.2, 2 * np.pi * 24.2
    lines, _ = forward(base, RIPPLE, mean)
    found, upper, lower = complex_speed(MACHINE, PAIRS, lines, torus(lines))
    assert found == pytest.approx(mean, rel=1e-6)
    np.testing.assert_allclose(upper[:4], RIPPLE, atol=2e-4)
    np.testing.assert_allclose(lower[:4], RIPPLE, atol=2e-4)


def test_the_rotor_equation_gives_the_torque_of_the_forward_solution() -> None:
    base, mean = 24.2, 2 * np.pi * 24.2
    lines, torque = forward(base, RIPPLE, mean)
    on = torus(lines)
    amplitude = np.zeros(12, dtype=complex)
    amplitude[:4] = RIPPLE
    state = rotor_state(MACHINE, PAIRS, lines, on, SpeedLines(mean, amplitude))
    phase = 2 * np.pi * np.arange(512) / 512
    basis = np.exp(1j * np.outer(phase, lines.order))
    own = torque_of(MACHINE, PAIRS, basis @ state.flux_wb, basis @ lines.current_a)
    assert np.sqrt(np.mean((own - torque) ** 2)) < 1e-3 * np.ptp(torque)


def test_noise_free_lines_fix_rotor_resistance_and_magnetizing_inductance() -> None:
    """From a plate that is 15 % off. R_s and L_l are known to be the weak pair: they only have to move the right way."""
    base, mean = 24.2, 2 * np.pi * 24.2
    lines, _ = forward(base, RIPPLE, mean)
    start = Start(
        TCircuit(3.7 * 1.15, 2.296 * 0.85, 0.0107 * 1.15, 0.0107 * 1.15, 0.2243 * 1.1), PRIOR_FROM_NAMEPLATE, "test"
    )
    problem = pose(lines, start.circuit, PAIRS, mean, 1e-5)
    fitted = fit(problem, start)
    assert fitted.circuit.rotor_resistance_ohm == pytest.approx(2.296, rel=0.02)
    assert fitted.circuit.magnetizing_inductance_h == pytest.approx(0.2243, rel=0.02)
    assert abs(fitted.circuit.stator_leakage_h / 0.0107 - 1) < 0.10
    weight = band_weights(problem, fitted)
    np.testing.assert_allclose(speed_lines(problem, fitted, weight).amplitude_rad_per_s[:2], RIPPLE[:2], rtol=0.05)


def test_a_band_near_standstill_in_stator_coordinates_is_trusted_less() -> None:
    base, mean = 24.2, 2 * np.pi * 24.2
    lines, _ = forward(base, RIPPLE, mean)
    rng = np.random.default_rng(2)
    noise = 1e-4 * (rng.standard_normal((24, lines.order.size)) + 1j * rng.standard_normal((24, lines.order.size)))
    noisy = Lines(
        lines.comb, lines.order, lines.rate_rad_per_s, lines.current_a, lines.voltage_v, noise, 60 * noise[::-1], SUPPLY
    )
    problem = pose(noisy, MACHINE, PAIRS, mean, 1e-5)
    fitted = fit(problem, Start(MACHINE, PRIOR_FROM_NAMEPLATE, "test"))
    weight = dict(zip(noisy.order[problem.on.positive].tolist(), band_weights(problem, fitted), strict=True))
    assert weight[2] > 0.9  # -2 x 24.2 Hz is 1.6 Hz in stator coordinates
    assert all(abs(weight[h] - 0.5) < weight[2] - 0.5 for h in (4, 5, 6, 8))


def test_driven_at_constant_speed_the_machine_settles_to_the_steady_state() -> None:
    slip, count, period_s = 0.03, 8000, 1.25e-4
    current, _ = steady(slip)
    turn = np.exp(1j * SUPPLY * period_s * np.arange(count))
    speed = np.full(count, SUPPLY * (1 - slip))
    out = driven(MACHINE.as_inverse_gamma(), VOLTAGE * turn, speed, period_s, 0j, 0j)
    assert out[-1] / turn[-1] == pytest.approx(current, rel=1e-4)


def test_the_plate_s_circuit_draws_the_rated_current_at_the_rated_power_factor() -> None:
    circuit = from_nameplate(PLATE)
    slip = 1 - 1436 * 2 / 60 / 50
    current = 400 / np.sqrt(3) / stator_impedance(circuit, SUPPLY, slip)
    assert abs(current) == pytest.approx(5.0, rel=2e-3)
    assert np.cos(np.angle(current)) == pytest.approx(0.8, abs=2e-3)


def test_equal_leakages_keep_the_terminals() -> None:
    odd = TCircuit(3.7, 2.3, 0.004, 0.016, 0.22)
    even = equal_leakages(odd.as_inverse_gamma())
    assert even.stator_leakage_h == pytest.approx(even.rotor_leakage_h)
    for slip in (0.01, 0.5, 1.9):
        assert stator_impedance(even, SUPPLY, slip) == pytest.approx(stator_impedance(odd, SUPPLY, slip), rel=1e-9)


def test_slip_at_power_and_at_current_invert_the_impedance() -> None:
    current = VOLTAGE / stator_impedance(MACHINE, SUPPLY, 0.037)
    assert slip_at_power(MACHINE, SUPPLY, VOLTAGE, 1.5 * VOLTAGE * current.real) == pytest.approx(0.037, rel=1e-6)
    assert slip_at_current(MACHINE, SUPPLY, VOLTAGE, abs(current)) == pytest.approx(0.037, rel=1e-6)
    assert slip_at_power(MACHINE, SUPPLY, VOLTAGE, 1e6) == pull_out_slip(MACHINE, SUPPLY)
    assert slip_at_current(MACHINE, SUPPLY, VOLTAGE, 0.1) == 0.0


def test_a_strong_line_is_followed_from_its_top_and_not_from_its_skirt() -> None:
    """The capped score is flat over a strong line: 0.14 Hz beside it, where the operating point drew it, the phase wraps."""
    period, shaft_hz = 2e-3, 23.4567
    time = np.arange(5000) * period
    noise = np.random.default_rng(2).standard_normal((2, time.size))
    spectrum = pair_spectrum(np.cos(2 * np.pi * shaft_hz * time) + 1e-2 * (noise[0] + 1j * noise[1]), period, 100.0)
    assert spectrum.at(shaft_hz + 0.14, 0.01)[0] > CAP
    for beside in (-0.14, 0.0, 0.14):
        assert top_of_line(spectrum, shaft_hz + beside, (1,)) == pytest.approx(shaft_hz, abs=0.025)


def test_a_load_torque_whose_movement_is_known_is_shown_though_its_mean_is_not() -> None:
    angle = 2 * np.pi * np.arange(90) / 90
    parts = Parts(0.0, 0.0, 0.01)
    unsure = Waveform(
        angle, angle, angle, angle, 10 + 0.1 * np.sin(angle), angle, angle, np.full(90, 0.5), parts, parts
    )  # fmt: skip
    assert without_unknown_load(unsure).load_torque_nm is unsure.load_torque_nm
    noisy = replace(unsure, moving_std=Parts(0.0, 0.0, 0.1))
    assert without_unknown_load(noisy).load_torque_nm is None
