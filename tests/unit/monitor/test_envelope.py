"""The share of each harmonic that is drawn, the sensors' trust, and the pole count read from the lines."""

from __future__ import annotations

import numpy as np
import pytest

from commissioner.monitor.intake.sensors import GAIN_STD, evened, trust_of
from commissioner.monitor.signals.envelope import shares
from commissioner.monitor.signals.supply import follow_supply, space_vector
from tests.campaigns.monitor import as_plate, as_recording
from tests.support.running import refused_in

ORDERS = np.arange(1, 21)


def drawn(rng: np.random.Generator, decay: float, step: int, noise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A load's complex harmonics (multiples of `step` only) and what is seen of them."""
    place = ORDERS / step
    size = np.where(ORDERS % step == 0, 100.0 * place**-decay, 0.0)
    true = size * np.exp(2j * np.pi * rng.uniform(size=ORDERS.size))
    return true, true + noise * (rng.standard_normal(ORDERS.size) + 1j * rng.standard_normal(ORDERS.size)) / np.sqrt(2)


@pytest.mark.parametrize(("decay", "step"), [(1.5, 1), (2.0, 2), (2.3, 3)])
def test_shares_come_close_to_the_best_possible_and_state_their_error(decay: float, step: int) -> None:
    """Against the oracle that knows each harmonic's size, over 200 draws; the stated error is the true one within a half."""
    rng = np.random.default_rng(5)
    noise = 0.1 * ORDERS**2.0
    own = best = stated = alone = 0.0
    for _ in range(200):
        true, seen = drawn(rng, decay, step, noise)
        made = shares(ORDERS, np.abs(seen) ** 2, noise**2)
        own += float(np.sum(np.abs(made.share * seen - true) ** 2))
        stated += float(np.sum(made.share**2 * noise**2 + made.missing))
        oracle = np.abs(true) ** 2 / (np.abs(true) ** 2 + noise**2)
        best += float(np.sum(np.abs(oracle * seen - true) ** 2))
        positive = np.maximum(0.0, 1 - noise**2 / np.abs(seen) ** 2)
        alone += float(np.sum(np.abs(positive * seen - true) ** 2))
    assert own < 2.2 * best
    assert own < 0.5 * alone
    assert 0.5 < stated / own < 2.0


def test_a_line_far_above_its_envelope_is_kept() -> None:
    power = 1e4 * ORDERS**-4.0
    power[16] = 400.0
    made = shares(ORDERS, power, np.ones(ORDERS.size))
    assert made.share[16] > 0.95


def test_unlike_sensors_show_in_sums_that_are_zero() -> None:
    time = np.arange(16000) / 8000
    phases = [np.cos(2 * np.pi * 50 * time - k * 2 * np.pi / 3) for k in range(3)]
    supply = follow_supply(space_vector(*phases), 1 / 8000, 50.0)
    made_up = evened(phases, True, supply, 1 / 8000)
    equal = trust_of(made_up, made_up, supply)
    assert equal.gain_std == pytest.approx(np.hypot(GAIN_STD, equal.asymmetry))
    assert equal.asymmetry < 0.008  # three that sum to zero exactly may be two and their sum: nothing is known
    star = [1.03 * phases[0], phases[1], 0.98 * phases[2]]
    unlike = trust_of(made_up, evened(star, False, supply, 1 / 8000), supply)
    assert 0.008 < unlike.asymmetry < 0.03
    assert unlike.skew_std_s > equal.skew_std_s


def test_gains_are_evened_by_the_sum_that_must_be_zero() -> None:
    time = np.arange(16000) / 8000
    phases = [np.cos(2 * np.pi * 50 * time - k * 2 * np.pi / 3) for k in range(3)]
    supply = follow_supply(space_vector(*phases), 1 / 8000, 50.0)
    gains = np.array([1.04, 0.98, 0.99])
    even = evened([g * x for g, x in zip(gains, phases, strict=True)], True, supply, 1 / 8000)
    assert even.difference == pytest.approx(gains - gains.mean(), abs=1e-3)
    vector = space_vector(*even.signals)
    turned = np.exp(1j * supply.angle_rad(time))
    assert abs(np.mean(vector * turned)) < 2e-3 * abs(np.mean(vector / turned))


@pytest.mark.parametrize("pairs", [1, 3])
def test_plate_of_another_pole_count_is_noticed(pairs: int) -> None:
    """Speed and poles of the plate agree with each other, not with the motor."""
    from sim.recordings.running import load_scenario, record

    scenario = load_scenario("running_leak")
    scenario["recording"]["duration_s"] = 8.0
    columns, metadata, _ = record(scenario, 4)
    metadata |= {"pole_pairs": pairs, "rated_speed_rpm": metadata["rated_speed_rpm"] * 2 / pairs}
    assert refused_in(as_recording(columns, metadata), as_plate(metadata)).reason.code == "pole_count"
