"""The guard in closed loop: a short version of `python -m tests.campaigns.flux_guard 1000`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import StateSpace, lsim

from commissioner.identify.excite.flux_guard import FluxAdvice, FluxGuard
from commissioner.identify.excite.tones import Excitation, Tone
from commissioner.identify.inverter.staircase import knee_shape
from commissioner.identify.observer.observer import BlockEstimate
from commissioner.motor.circuit import InverseGamma
from commissioner.procedure.plan import BELOW_TRIP
from tests.campaigns.flux_guard import run_case
from tests.support.standstill import saturating_block

CASES = range(20_000, 20_024)


@pytest.fixture(scope="module")
def outcomes():
    return [run_case(seed) for seed in CASES]


def test_true_flux_never_passes_the_limit_by_more_than_two_per_cent(outcomes):
    over = [o for o in outcomes if o.peak > 1.02]
    assert over == []


def test_nothing_is_aborted_while_the_true_flux_is_below_the_limit(outcomes):
    assert [o for o in outcomes if o.aborted and o.peak < 1.0] == []


def test_the_current_never_reaches_what_trips_the_drive(outcomes):
    assert [o for o in outcomes if o.current > 1.0] == []


def test_the_amplitude_is_raised_where_flux_and_current_permit(outcomes):
    reached = sorted(max(o.peak, o.current / BELOW_TRIP) for o in outcomes if o.begin.startswith("measured"))
    assert reached[len(reached) // 2] > 0.7


def test_the_first_scale_is_safe_for_a_machine_without_resistance():
    tones = (Tone(10.0, 0.5, 0.0), Tone(20.0, 7.3, 1.0))
    guard = FluxGuard(0.9, 0.02, Excitation(tones, 0.0, 5.0), 2e-4, 3.7)
    time = np.arange(50_000) * 2e-4
    flux = np.cumsum(guard.safe_scale * Excitation(tones, 0.0, 5.0).voltage_v(time)) * 2e-4
    assert np.max(np.abs(flux)) <= 0.9


MACHINE = InverseGamma(0.62, 0.376, 0.0107, 0.19)
TONES = (Tone(18.0, 0.7, 0.0), Tone(15.0, 4.1, 1.5), Tone(4.5, 44.6, 1.6))


def true_peak_wb(machine, excitation, scale, ramp_per_s):
    """Stator flux of the linear machine from rest, by scipy's exact discretisation."""
    alpha = machine.rotor_resistance_ohm / machine.magnetizing_inductance_h
    r, leak = machine.stator_resistance_ohm + machine.rotor_resistance_ohm, machine.leakage_inductance_h
    a = np.array([[-r / leak, alpha / leak], [machine.rotor_resistance_ohm, -alpha]])
    time = np.arange(0.0, excitation.duration_s, 2e-4)
    voltage = excitation.voltage_v(time, np.minimum(time * ramp_per_s, scale))
    system = StateSpace(a, [[1.0 / leak], [0.0]], [[leak, 1.0]], [[0.0]])
    return float(np.max(np.abs(lsim(system, voltage, time)[1])))


def test_the_amplitude_for_a_known_machine_keeps_its_flux_below_the_limit_and_uses_most_of_it():
    excitation = Excitation(TONES, 0.0, 4.6)
    guard = FluxGuard(0.9, 0.02, excitation, 2e-4, MACHINE.stator_resistance_ohm)
    scale = guard.begin_known(MACHINE, 0.05, 5.0)
    assert guard.safe_scale < scale < 1.0
    assert 0.7 * 0.9 < true_peak_wb(MACHINE, excitation, scale, 5.0) < 0.87 * 0.9
    off = replace(MACHINE, magnetizing_inductance_h=1.05 * 0.19, stator_resistance_ohm=0.95 * 0.62)
    assert true_peak_wb(off, excitation, scale, 5.0) < 0.9


@pytest.mark.parametrize("seed", range(12))
def test_no_command_below_a_direct_voltage_makes_more_flux_than_that_voltage(seed):
    rng = np.random.default_rng(seed)
    hz = np.exp(rng.uniform(np.log(0.05), np.log(20.0), 4))
    tones = tuple(
        Tone(a, f, p) for a, f, p in zip(rng.uniform(2.0, 20.0, 4), hz, rng.uniform(0.0, 6.28, 4), strict=True)
    )
    excitation, held_v = Excitation(tones, 0.0, 8.0), 12.0
    limit_wb = (
        held_v / MACHINE.stator_resistance_ohm * (MACHINE.leakage_inductance_h + MACHINE.magnetizing_inductance_h)
    )
    guard = FluxGuard(limit_wb, 0.02, excitation, 2e-4, 0.62, held_v=held_v)
    assert true_peak_wb(MACHINE, excitation, guard.first_scale, 5.0) < limit_wb
    assert guard.first_scale * excitation.peaks_v >= 0.999 * held_v or guard.first_scale == 1.0


LARGE = InverseGamma(0.0629, 0.105, 0.0036, 0.056)  # 19 kW; its inverter loses several times R_s I
LOSS = knee_shape(14.4, 0.5, 5.0)
LARGE_TONES = (Tone(17.6, 1.0, 0.0), Tone(18.4, 3.1, 0.2), Tone(2.5, 22.9, 0.2))


def current_behind_the_inverter(scale, ramp_per_s, excitation):
    """Peak of the linear 19-kW machine behind tanh-shaped legs, by the midpoint rule."""
    time = np.arange(0.0, excitation.duration_s, 2e-4)
    voltage = excitation.voltage_v(time, np.minimum(time * ramp_per_s, scale))
    ratio = 1.0 + LARGE.leakage_inductance_h / LARGE.magnetizing_inductance_h
    machine = np.array([LARGE.stator_resistance_ohm, ratio**2 * LARGE.rotor_resistance_ohm,
        ratio * LARGE.leakage_inductance_h, LARGE.leakage_inductance_h + LARGE.magnetizing_inductance_h, 1e-3, 7.0])  # fmt: skip
    current, flux = np.empty_like(time), np.empty_like(time)
    legs = np.array([1.0, -0.5, -0.5])
    saturating_block(voltage, 2e-4, np.zeros(2), machine, 14.4, 0.5, legs, current, flux)
    return float(np.max(np.abs(current)))


def test_the_amplitude_for_a_known_machine_behind_a_large_loss_is_held_by_its_current():
    excitation = Excitation(LARGE_TONES, 0.0, 4.6)
    guard = FluxGuard(0.9, 0.02, excitation, 2e-4, LARGE.stator_resistance_ohm, LOSS, current_a=40.0, trip_a=50.0)
    scale = guard.begin_known(LARGE, 0.05, 5.0)
    assert current_behind_the_inverter(1.0, 5.0, excitation) > 60.0
    assert 10.0 < current_behind_the_inverter(scale, 5.0, excitation) < 40.0


def estimate_at(current_a: float) -> BlockEstimate:
    """An observer that knows the machine and sees a constant current and no flux."""
    signal = np.full(50, current_a)
    return BlockEstimate(
        MACHINE, lambda: (0.006, 0.004, 1e-4, 2e-3), 0.0, 0.01, signal, 0.0 * signal, 0.0 * signal, 50, 0, 0
    )


@pytest.mark.parametrize(("current_a", "backs_off"), [(9.9, False), (11.5, True)])
def test_a_current_half_way_to_the_drives_limit_takes_the_amplitude_back(current_a, backs_off):
    guard = FluxGuard(9.0, 0.02, Excitation(TONES, 0.0, 4.6), 2e-4, 0.62, current_a=10.0, trip_a=12.0)
    signal = np.full(50, current_a)
    reading = guard.advance(0.62 * signal, signal, estimate_at(current_a), 0.5)
    assert (reading.advice is FluxAdvice.BACK_OFF) is backs_off
    assert (reading.current_fraction > 1.0) is backs_off
    if backs_off:
        assert reading.permitted_scale < 0.5


def test_a_dc_bias_is_refused_because_no_amplitude_of_tones_could_limit_it():
    with pytest.raises(ValueError, match="DC bias"):
        FluxGuard(0.9, 0.02, Excitation(TONES, 5.0, 4.6), 2e-4, 0.62)
