"""The designed tones: under the limits, informative, and honest about what they will yield."""

from __future__ import annotations

import numpy as np
import pytest

from commissioner.identify.batch.fit import fit_segments
from commissioner.identify.batch.segments import Segment
from commissioner.identify.excite.tones import Excitation, ExcitationLimits, Tone, design, predicted_peaks
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import rated_flux
from tests.support.standstill import linear_response, multitone, usable_motors

PERIOD_S = 2e-4
MOTORS = list(usable_motors())


def limits_of(motor) -> ExcitationLimits:
    flux = 0.9 * rated_flux(motor.plate, motor.truth[0]).stator_peak_wb
    return ExcitationLimits(
        flux, motor.plate.rated_current_peak_a, 0.5 * motor.plate.rated_voltage_v, 0.005 * motor.plate.rated_current_a
    )


@pytest.mark.parametrize("motor", MOTORS[::4], ids=lambda m: m.name)
def test_true_flux_and_current_stay_under_the_limits_and_use_them(motor):
    limits = limits_of(motor)
    chosen = design(InverseGamma(*motor.truth), limits, PERIOD_S)
    time = np.arange(round(chosen.seconds / PERIOD_S)) * PERIOD_S
    current, rotor = linear_response(motor.truth, chosen.excitation.voltage_v(time), PERIOD_S)
    stator = np.max(np.abs(rotor + motor.truth[2] * current))
    assert stator <= 1.0001 * limits.flux_wb
    assert np.max(np.abs(current)) <= 1.0001 * limits.current_a
    assert max(stator / limits.flux_wb, np.max(np.abs(current)) / limits.current_a) > 0.7
    assert (chosen.peak_flux_wb, chosen.peak_current_a) == pytest.approx((stator, np.max(np.abs(current))), rel=1e-6)


@pytest.mark.parametrize("motor", MOTORS[::8], ids=lambda m: m.name)
def test_at_least_four_tones_on_a_common_grid_and_at_most_twelve_seconds_with_the_staircase(motor):
    chosen = design(InverseGamma(*motor.truth), limits_of(motor), PERIOD_S)
    frequencies = [t.frequency_hz for t in chosen.excitation.tones]
    assert 4 <= len(frequencies) <= 8
    grid = 0.01
    assert np.allclose(np.array(frequencies) / grid, np.round(np.array(frequencies) / grid), atol=1e-6)
    assert chosen.seconds <= 12.0 * max(1.0, motor.rotor_time_constant_s / 0.5)


def designed(motor, factor):
    """For its estimate times the factor; no parameter lies on a rounding boundary."""
    return design(InverseGamma(*(1.0003 * factor * np.array(motor.truth))), limits_of(motor), PERIOD_S, seconds=2.0)


@pytest.mark.parametrize("motor", MOTORS[::6], ids=lambda m: m.name)
def test_an_estimate_that_differs_by_rounding_gets_the_same_tones(motor):
    for one, other in zip(*(designed(motor, k).excitation.tones for k in (1.0, 1.0 + 1e-8)), strict=True):
        assert (one.frequency_hz, one.phase_rad) == (other.frequency_hz, other.phase_rad)
        assert one.amplitude_v == pytest.approx(other.amplitude_v, rel=1e-6)


@pytest.mark.parametrize("motor", MOTORS[::6], ids=lambda m: m.name)
def test_the_search_ends_at_an_optimum_from_a_start_beside(motor):
    """A hundredth of every parameter moves the worst standard error by a hundredth: where it moves more, a search stopped short."""
    worst = [max(designed(motor, k).relative_std) for k in (1.0, 1.01)]
    assert worst[0] == pytest.approx(worst[1], rel=0.02)


def test_stated_standard_errors_are_what_a_fit_scatters():
    motor = next(m for m in MOTORS if m.name == "abb_2k2")
    limits = limits_of(motor)
    chosen = design(InverseGamma(*motor.truth), limits, PERIOD_S, seconds=3.0)
    voltage = chosen.excitation.voltage_v(np.arange(round(chosen.seconds / PERIOD_S)) * PERIOD_S)
    current = linear_response(motor.truth, voltage, PERIOD_S)[0]
    found = []
    from commissioner.identify.batch.model import ModelChoice

    for seed in range(25):
        measured = current + limits.noise_a * np.random.default_rng(seed).standard_normal(current.size)
        fit = fit_segments(
            [Segment(voltage, measured, 0.0, True)], PERIOD_S, InverseGamma(*motor.truth), ModelChoice(with_delay=True)
        )
        found.append(np.array(fit.inverse_gamma_at(0.0)[0].as_tuple()) / motor.truth)
    ratio = np.std(found, axis=0) / np.array(chosen.relative_std)
    assert np.all((ratio > 0.5) & (ratio < 1.6)), ratio  # steady-state information against a record with a transient


def test_the_design_beats_the_same_peak_flux_spent_on_decade_spaced_tones():
    motor = next(m for m in MOTORS if m.name == "abb_2k2")
    machine, limits = InverseGamma(*motor.truth), limits_of(motor)
    chosen = design(machine, limits, PERIOD_S)
    plain = multitone([(1.0, f, 0.3 * k) for k, f in enumerate((0.5, 5.0, 50.0))], chosen.seconds, PERIOD_S)
    current, rotor = linear_response(motor.truth, plain, PERIOD_S)
    use = max(
        np.max(np.abs(rotor + motor.truth[2] * current)) / limits.flux_wb, np.max(np.abs(current)) / limits.current_a
    )
    from tests.support.exact.cramer_rao import cramer_rao

    ours = chosen.excitation.voltage_v(np.arange(round(chosen.seconds / PERIOD_S)) * PERIOD_S)
    worst = [
        np.max(np.sqrt(np.diag(cramer_rao(machine, u, PERIOD_S, limits.noise_a))) / motor.truth)
        for u in (ours, plain / use)
    ]
    assert worst[0] < worst[1]
    assert predicted_peaks(machine, chosen.excitation, PERIOD_S)[0] <= 1.02 * limits.flux_wb


def test_a_quarter_of_the_time_has_twice_the_standard_errors_and_nothing_is_gained_by_going_on():
    motor = MOTORS[0]
    chosen = design(InverseGamma(*motor.truth), limits_of(motor), PERIOD_S, seconds=4.0)
    cut = chosen.cut_to(1.0)
    assert cut.seconds == 1.0
    assert cut.relative_std == pytest.approx([2.0 * std for std in chosen.relative_std])
    assert chosen.cut_to(4.5) == chosen


def test_a_tone_that_is_turned_is_its_cosine():
    time = 3.7 + np.arange(1000) * PERIOD_S
    tones = Excitation((Tone(30.0, 0.7, 0.3), Tone(20.0, 173.4, -1.0)), 1.5, 5.0)
    exact = 30.0 * np.cos(2.0 * np.pi * 0.7 * time + 0.3) + 20.0 * np.cos(2.0 * np.pi * 173.4 * time - 1.0)
    assert tones.voltage_v(time, 0.5) == pytest.approx(1.5 + 0.5 * exact, abs=1e-10)
    assert tones.voltage_v(time[:1]) == pytest.approx(1.5 + exact[:1], abs=1e-10)
    assert tones.voltage_v(time[:0]).size == 0
