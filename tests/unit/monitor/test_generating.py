"""A machine that generates is never taken for a motor with crossed channels without a word. Phasors are the circuit's own at negative slip;
a start tells what a steady stretch cannot."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from commissioner.monitor.chain import Observation, Refused, Wishes
from commissioner.monitor.intake.channels import THIRD, Pairing, is_straight_motor, pair
from commissioner.monitor.intake.findings import miswired
from commissioner.monitor.intake.terminals import from_terminals
from commissioner.monitor.loads.pairing_by_start import wired_in
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import (
    TCircuit,
    equal_leakages,
    from_nameplate,
    slip_at_lag,
    slip_at_power,
    stator_impedance,
)
from commissioner.operations.recordings.stretches import in_its_states
from commissioner.records import RunningRecording
from tests.support.running import rewired, seen_in, taken_with
from tests.support.standstill import usable_motors

MACHINES = [(m.plate, equal_leakages(InverseGamma(*m.truth))) for m in usable_motors()]
PLATE, CIRCUIT = MACHINES[0]
ORDERS = tuple(itertools.permutations(range(3)))
STRAIGHT = (0, 1, 2)


def phasors(plate: Nameplate, circuit: TCircuit, load: float, backwards: bool) -> tuple[list[complex], list[complex]]:
    """(currents, voltages) of the phases u, v, w at a share of rated slip."""
    impedance = stator_impedance(circuit, plate.rated_frequency_rad_per_s, load * plate.rated_slip)
    way = -1 if backwards else 1
    volts = [plate.rated_voltage_v * math.sqrt(2 / 3) * np.exp(-1j * way * THIRD * k) for k in range(3)]
    return [v / impedance for v in volts], volts


def paired(
    machine: int, load: float, order: tuple[int, ...] = STRAIGHT, sign: int = 1, backwards: bool = False
) -> Pairing:
    plate, circuit = MACHINES[machine]
    currents, volts = phasors(plate, circuit, load, backwards)
    return pair(
        [sign * currents[k] for k in order], volts, plate, from_nameplate(plate), plate.rated_frequency_hz, False
    )


def is_right(found: Pairing, order: tuple[int, ...], sign: int, backwards: bool) -> bool:
    """Whether each phase has its own current: phase k of a sequence that runs backwards is that of the k-th of u, w, v."""
    named = (0, 2, 1) if backwards else STRAIGHT
    return all(order[found.current_order[k]] == named[k] and found.current_sign[k] == sign for k in range(3))


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("load", [-1.2, -0.9, -0.6, -0.4, -0.25])
def test_a_generator_with_columns_as_named_is_never_taken_for_a_motor(load: float, backwards: bool) -> None:
    for machine in range(len(MACHINES)):
        found = paired(machine, load, backwards=backwards)
        open_ = found.generator is not None and found.generator.is_named
        assert is_right(found, STRAIGHT, 1, backwards) or found.is_refused or open_, MACHINES[machine][0]


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize(("order", "sign"), [(o, s) for o in ORDERS for s in (1, -1)])
@pytest.mark.parametrize("load", [-1.2, -0.8, -0.5, -0.25])
def test_a_generator_with_any_channels_is_read_right_or_with_a_word(
    load: float, order: tuple[int, ...], sign: int, backwards: bool
) -> None:
    for machine in range(len(MACHINES)):
        found = paired(machine, load, order, sign, backwards)
        is_like_a_motor = found.lag_deg < 90.0 and not miswired(found.findings)  # crossed so that nothing shows it
        has_word = is_like_a_motor or bool(miswired(found.findings))
        assert is_right(found, order, sign, backwards) or found.is_refused or has_word, MACHINES[machine][0]


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("load", [0.1, 0.5, 0.8, 1.0, 1.2])
def test_a_motor_with_columns_as_named_is_a_motor(load: float, backwards: bool) -> None:
    for machine in range(len(MACHINES)):
        found = paired(machine, load, backwards=backwards)
        assert is_right(found, STRAIGHT, 1, backwards) and found.generator is None


def recorded(
    load: float, order: tuple[int, ...] = STRAIGHT, sign: int = 1, *, start_s: float = 0.0, seconds: float = 2.0
) -> RunningRecording:
    """Steady running as the circuit draws it, behind `start_s` of standing still at full voltage."""
    period, w = 2e-4, PLATE.rated_frequency_rad_per_s
    time = np.arange(round((seconds + start_s) / period)) * period
    rng = np.random.default_rng(1)
    standing, running = (phasors(PLATE, CIRCUIT, x, False) for x in (1.0 / PLATE.rated_slip, load))
    noise = 0.002 * PLATE.rated_current_a
    currents = [
        sign * np.real(np.where(time < start_s, standing[0][k], running[0][k]) * np.exp(1j * w * time))
        + noise * rng.standard_normal(time.size)
        for k in order
    ]
    volts = [np.real(v * np.exp(1j * w * time)) for v in running[1]]
    u, v, w_ = currents
    return RunningRecording(time, (u, v, w_), (volts[0], volts[1], volts[2]), False, None, period, {}, "circuit")


def torque_of(seen: Observation | Refused) -> float:
    said = from_terminals(seen.audited.fundamental, PLATE)
    assert isinstance(seen, Refused) and said is not None
    return said.torque_nm


def true_torque(load: float) -> float:
    currents, volts = phasors(PLATE, CIRCUIT, load, False)
    gap_w = 1.5 * (volts[0] * np.conj(currents[0])).real - 1.5 * CIRCUIT.stator_resistance_ohm * abs(currents[0]) ** 2
    return float(gap_w * PLATE.pole_pairs / PLATE.rated_frequency_rad_per_s)


@pytest.mark.parametrize("load", [-0.5, 0.5])
@pytest.mark.parametrize(("order", "sign"), [(STRAIGHT, 1), ((1, 2, 0), -1), ((2, 0, 1), -1), ((0, 2, 1), 1)])
def test_a_start_tells_a_generator_from_a_motor_with_crossed_channels(
    load: float, order: tuple[int, ...], sign: int
) -> None:
    seen, _, _ = in_its_states(recorded(load, order, sign, start_s=0.4), PLATE, Wishes())
    assert torque_of(seen) == pytest.approx(true_torque(load), rel=0.05)


@pytest.mark.parametrize(("load", "order", "sign"), [(-0.35, STRAIGHT, 1), (0.5, (2, 0, 1), -1)])
def test_without_a_start_the_two_are_not_distinguishable_until_one_is_trusted(
    load: float, order: tuple[int, ...], sign: int
) -> None:
    """A generator with straight channels, and the motor with crossed ones that looks like it."""
    recording = recorded(load, order, sign)
    seen, _, _ = in_its_states(recording, PLATE, Wishes())
    assert isinstance(seen, Refused) and seen.reason.code == "generating_or_crossed"
    assert "--trust data" in seen.reason.remedy and "--map" in seen.reason.remedy
    torques = [torque_of(in_its_states(recording, PLATE, Wishes(trust=trust))[0]) for trust in ("data", "plate")]
    assert torques[0] < 0.0 < torques[1]
    assert torques[0 if load < 0.0 else 1] == pytest.approx(true_torque(load), rel=0.05)


def hoist(
    loads: tuple[float, float], order: tuple[int, ...] = STRAIGHT, sign: int = 1, begins_s: float = 2.0
) -> RunningRecording:
    """Lifting, then lowering: so long at one load, 3 s at the other."""
    first, second = (recorded(load, order, sign, seconds=s) for load, s in zip(loads, (begins_s, 3.0), strict=True))

    def joined(a: tuple[np.ndarray, ...], b: tuple[np.ndarray, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        u, v, w = (np.concatenate(pair_) for pair_ in zip(a, b, strict=True))
        return u, v, w

    time = np.arange(first.time_s.size + second.time_s.size) * first.sample_period_s
    currents, volts = joined(first.currents_a, second.currents_a), joined(first.voltages_v, second.voltages_v)
    return RunningRecording(time, currents, volts, False, None, first.sample_period_s, {}, "circuit")


@pytest.mark.parametrize("lowering", [-0.35, -0.5])
def test_a_hoist_that_lowers_is_wired_as_it_is_when_it_lifts(lowering: float) -> None:
    """The lowering, being longest, had been refused, and the whole recording with it."""
    seen, _, told = in_its_states(hoist((0.8, lowering)), PLATE, Wishes())
    assert torque_of(seen) == pytest.approx(true_torque(lowering), rel=0.05)
    torques = [s["mean_torque_nm"]["value"] for s in told if "mean_torque_nm" in s]
    assert torques == pytest.approx([true_torque(0.8), true_torque(lowering)], rel=0.05)


@pytest.mark.parametrize("lowering", [-0.35, -0.5])
def test_a_short_lowering_is_wired_as_the_lifting_beside_it(lowering: float) -> None:
    """Too short for the slip to be asked, it had been told as a motor with crossed channels: 30 standard deviations of the torque off."""
    _, _, told = in_its_states(hoist((lowering, 0.8), begins_s=1.5), PLATE, Wishes())
    torques = [s["mean_torque_nm"]["value"] for s in told if "mean_torque_nm" in s]
    assert torques == pytest.approx([true_torque(lowering), true_torque(0.8)], rel=0.05)


def test_a_hoist_with_crossed_channels_is_not_told_otherwise() -> None:
    seen, _, _ = in_its_states(hoist((0.5, 0.4), (2, 0, 1), -1), PLATE, Wishes())
    assert isinstance(seen, Refused) and seen.reason.code == "generating_or_crossed"


@pytest.mark.parametrize(("order", "sign"), [(o, s) for o in ORDERS for s in (1, -1) if (o, s) != (STRAIGHT, 1)])
def test_no_crossed_channels_look_straight_at_one_load_and_generating_at_another(
    order: tuple[int, ...], sign: int
) -> None:
    for machine in range(0, len(MACHINES), 2):
        found = [paired(machine, load, order, sign) for load in (0.02, 0.3, 0.8, 1.2, -0.1, -0.5, -1.2)]
        is_open = any(f.generator is not None and f.generator.is_named for f in found)
        assert not (is_open and any(is_straight_motor(f) for f in found)), MACHINES[machine][0]


def test_the_slip_tells_a_generator_that_shakes() -> None:
    driven = {
        "steady_load": {"constant_nm": -9.0, "per_speed_nms": 0.0},
        "loads": [{"kind": "compressor", "mean_nm": 0.8, "leak_mm2": [0.0, 0.0], "pressure_ratio": 4.0}],
    }
    recording, plate, truth = taken_with("running_compressor", 1, 8.0, driven)
    seen = seen_in(recording, plate)
    assert abs(seen.mean_speed_rad_per_s - truth["mean_speed_rad_per_s"]) < 4.0 * seen.mean_speed_std
    assert abs(seen.mean_torque_nm - truth["mean_torque_nm"]) < 3.0 * seen.mean_torque_std
    assert seen.mean_torque_nm < 0.0
    turned = seen_in(rewired(recording, (1, 0, 2, 3, 4, 5)), plate)
    assert turned.mean_torque_nm == pytest.approx(seen.mean_torque_nm, abs=seen.mean_torque_std)


@pytest.mark.parametrize("slip", [-0.05, -0.01, 0.03])
def test_the_slip_of_a_power_and_of_a_lag_is_negative_where_it_generates(slip: float) -> None:
    w, volts = PLATE.rated_frequency_rad_per_s, PLATE.rated_voltage_v * math.sqrt(2 / 3)
    impedance = stator_impedance(CIRCUIT, w, slip)
    power = 1.5 * volts**2 * (1 / impedance).real
    assert slip_at_power(CIRCUIT, w, volts, power) == pytest.approx(slip, rel=1e-6)
    assert slip_at_lag(CIRCUIT, w, float(np.angle(impedance))) == pytest.approx(slip, rel=1e-6)


LARGE = Nameplate(55e3, 400.0, 50.0, 95.7, 1480.0, 0.87, 2, "delta")
OF_LARGE = equal_leakages(InverseGamma(0.0348, 0.0305, 1.385e-3, 0.0201))


@pytest.mark.parametrize("slip", [1.0, 0.5, 0.25])
def test_no_sound_start_is_wired_otherwise(slip: float) -> None:
    """A large motor's start draws more amperes than it has volts: its columns were taken as exchanged, the wiring as crossed, and the steady
    stretch behind it as generating."""
    said = set()
    for plate, circuit in (*MACHINES, (LARGE, OF_LARGE)):
        t = np.arange(0.0, 0.4, 4e-4)
        volts = plate.rated_voltage_v * math.sqrt(2 / 3)
        drawn = volts / stator_impedance(circuit, plate.rated_frequency_rad_per_s, slip)
        u, v, w = (np.exp(1j * (plate.rated_frequency_rad_per_s * t - THIRD * k)) for k in range(3))
        currents = np.real(drawn * u), np.real(drawn * v), np.real(drawn * w)
        voltages = np.real(volts * u), np.real(volts * v), np.real(volts * w)
        said.add(wired_in(RunningRecording(t, currents, voltages, False, None, 4e-4), plate))
    assert said == {None, ((0, 1), (1, 1), (2, 1))}
