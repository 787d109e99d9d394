"""The parallel adaptive observer as an object: blocks, gaps, offsets, fading excitation, soundness over hours."""

from __future__ import annotations

import numpy as np
import pytest

from commissioner.errors import UsageError
from commissioner.identify.inverter.compensation import Compensation
from commissioner.identify.observer.convergence import percent
from commissioner.identify.observer.coordinates import filter_poles, positive_real_margin
from commissioner.identify.observer.observer import ParallelObserver
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import ParameterBox, prior
from tests.support.standstill import linear_response, multitone, usable_motors

PERIOD_S = 2e-4
MOTOR = next(m for m in usable_motors() if m.name == "abb_2k2")
BOX = prior(MOTOR.plate)
TONES = [(14.0, 0.7, 0.0), (4.0, 2.3, 1.0), (12.0, 19.8, 2.0), (9.0, 60.1, 3.0)]


def observer(**options) -> ParallelObserver:
    return ParallelObserver(BOX, PERIOD_S, MOTOR.plate.rated_current_peak_a, **options)


def record(seconds: float, noise: float = 0.0, seed: int = 1):
    voltage = multitone(TONES, seconds, PERIOD_S)
    current, flux = linear_response(MOTOR.truth, voltage, PERIOD_S)
    measured = current + noise * np.std(current) * np.random.default_rng(seed).standard_normal(current.size)
    return voltage, measured, current, flux


def errors(machine: InverseGamma) -> np.ndarray:
    return np.array(machine.as_tuple()) / np.array(MOTOR.truth) - 1.0


def test_one_block_or_many_give_the_same_bits():
    voltage, measured, _, _ = record(3.0, 0.05)
    whole, pieces = observer(), observer()
    at_once = whole.advance(voltage, measured)
    for part in np.array_split(np.arange(voltage.size), 37):
        last = pieces.advance(voltage[part], measured[part])
    assert last.parameters == at_once.parameters
    assert last.std == at_once.std


def test_rotor_flux_is_the_machines_once_the_parameters_are():
    voltage, measured, current, flux = record(4.0)
    block = observer().advance(voltage, measured)
    tail = slice(-5000, None)
    assert np.max(np.abs(block.rotor_flux_wb - flux)[tail]) < 1e-6 * np.max(np.abs(flux))
    stator = flux + MOTOR.truth[2] * current
    assert np.max(np.abs(block.stator_flux_wb - stator)[tail]) < 1e-6 * np.max(np.abs(stator))


def test_a_sensor_offset_does_not_move_the_parameters():
    voltage, measured, _, _ = record(6.0)
    block = observer().advance(voltage, measured + 0.05)
    assert np.max(np.abs(errors(block.parameters))) < 1e-4


@pytest.mark.parametrize("lost", [1, 40, 700])
def test_gaps_leave_no_bias(lost):
    voltage, measured, _, _ = record(8.0)
    machine = observer()
    machine.advance(voltage[:9000], measured[:9000])
    machine.advance(voltage[9000 + lost : 21000], measured[9000 + lost : 21000], lost_before=lost)
    block = machine.advance(voltage[21000 + lost :], measured[21000 + lost :], lost_before=lost)
    assert np.max(np.abs(errors(block.parameters))) < 1e-4
    assert (block.lost_samples, block.restarts) == (2 * lost, 2)


def test_a_gap_of_known_voltage_is_run_through_open_loop():
    voltage, measured, _, _ = record(6.0)
    machine = observer()
    machine.advance(voltage[:9000], measured[:9000])
    block = machine.advance(voltage[9400:], measured[9400:], 400, lost_voltage_v=voltage[9000:9400])
    assert np.max(np.abs(errors(block.parameters))) < 1e-4
    assert (block.lost_samples, block.restarts) == (400, 0)


def test_a_stream_that_begins_in_the_middle_is_followed_once_the_parameters_are_about_known():
    voltage, measured, _, _ = record(8.0, 0.05)
    roughly = InverseGamma(*(np.array(MOTOR.truth) * [1.01, 0.98, 1.015, 0.975]))
    machine = observer(starts_at_rest=False, start=roughly, start_log_std=0.03)
    machine.advance(voltage[7777:], measured[7777:])
    machine.review()
    assert np.all(np.abs(np.array(machine.parameters.as_tuple()) - MOTOR.truth) < 4.0 * np.array(machine.std()))


def test_nothing_winds_up_while_the_excitation_is_gone():
    voltage, measured, _, _ = record(5.0, 0.02)
    machine = observer()
    before = machine.advance(voltage, measured)
    noise = 0.02 * np.random.default_rng(2).standard_normal(200_000)
    zero = np.zeros(200_000)
    decay = linear_response(MOTOR.truth, np.concatenate([voltage, zero]), PERIOD_S)[0][voltage.size :]
    faded = machine.advance(zero, decay + noise)
    assert np.all(np.array(faded.std) <= 1.001 * np.array(before.std))
    assert np.all(
        np.abs(np.array(faded.parameters.as_tuple()) - before.parameters.as_tuple()) < 4 * np.array(before.std)
    )


def test_an_hour_of_samples_leaves_a_sound_covariance_and_no_drift():
    voltage, _, current, _ = record(60.0)
    machine = observer(memory_s=30.0)
    for minute in range(60):
        rng = np.random.default_rng(minute)
        noise = 0.05 * np.std(current) * rng.standard_normal(current.size)
        machine.advance(voltage, current + noise, begins_at_rest=minute > 0)
    covariance = machine.covariance()
    assert np.allclose(covariance, covariance.T, rtol=1e-9)
    assert np.all(np.linalg.eigvalsh(covariance / np.outer(MOTOR.truth, MOTOR.truth)) > 0)
    assert machine.history == ()
    assert np.all(np.abs(np.array(machine.parameters.as_tuple()) - MOTOR.truth) < 4.5 * np.array(machine.std()))


def test_delay_taken_off_leaves_no_bias():
    voltage, _, _, _ = record(6.0)
    fine = PERIOD_S / 4
    held = np.repeat(voltage, 4)
    late = np.concatenate([np.zeros(3), held[:-3]])  # 150 us
    current = linear_response(MOTOR.truth, late, fine)[0][::4]
    taken_off = observer(compensation=Compensation(delay_s=150e-6)).advance(voltage, current)
    left_in = observer().advance(voltage, current)
    assert np.max(np.abs(errors(taken_off.parameters))) < 1e-3
    assert np.max(np.abs(errors(left_in.parameters))) > 1e-2


def test_positive_real_margin_covers_the_prior_of_every_published_plate():
    for motor in usable_motors():
        box = prior(motor.plate)
        assert positive_real_margin(box, filter_poles(box, 3e-4), 3e-4) > 0.0, motor.name


def test_the_gradient_law_refuses_gains_without_a_positive_real_margin():
    low = InverseGamma(0.01, 0.01, 1e-4, 10.0)
    high = InverseGamma(1000.0, 1000.0, 1.0, 0.01)
    with pytest.raises(UsageError, match="positive-real"):
        ParallelObserver(ParameterBox(low, BOX.typical, high), PERIOD_S, 7.0, law="lyapunov")


def test_wrong_shapes_are_refused():
    with pytest.raises(ValueError, match="equal"):
        observer().advance(np.zeros(10), np.zeros(9))


def known_observer(scale: float, log_std: float) -> ParallelObserver:
    start = InverseGamma(*(scale * v for v in MOTOR.truth))
    return ParallelObserver(
        prior(MOTOR.plate), PERIOD_S, MOTOR.plate.rated_current_peak_a, start=start, start_log_std=log_std
    )


def test_samples_of_the_dead_band_move_the_states_and_not_the_parameters():
    voltage, measured, _, flux = record(4.0)
    asleep = known_observer(1.03, 0.05)
    start = asleep.parameters
    first = asleep.advance(voltage[:1500], np.zeros(1500), adapts=False)
    assert first.parameters.as_tuple() == pytest.approx(start.as_tuple(), rel=1e-9)
    assert first.rotor_flux_wb[-1] == pytest.approx(flux[1499], rel=0.1)
    then = asleep.advance(voltage[1500:], measured[1500:])
    assert np.max(np.abs(errors(then.parameters))) < 0.01


def test_a_machine_that_is_known_is_not_walked_away_from_by_repeated_reviews():
    voltage, measured, _, _ = record(0.5, 0.3)
    known = known_observer(1.0, 0.01)
    block = known.advance(voltage, measured)
    for _ in range(10):
        known.review()
    assert np.max(np.abs(errors(block.parameters))) < 0.03
    assert known.parameters == block.parameters


@pytest.mark.parametrize(("share", "said"), [(0.1295, "12.95%"), (0.0, "0.00%"), (5e-4, "0.05%"), (1e-5, "0.001%")])
def test_a_share_that_is_allowed_is_never_told_as_nothing(share, said):
    assert percent(share) == said
