"""The state of the recording, stretch by stretch, and means over whole carrier periods; truth from an independent machine model."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from commissioner.monitor.chain import Wishes
from commissioner.monitor.intake.audit import inspect
from commissioner.monitor.intake.carrier import means_over_carrier
from commissioner.monitor.intake.states.naming import named
from commissioner.monitor.intake.states.stretches import cut_out, states
from commissioner.monitor.intake.states.windows import Levels
from commissioner.monitor.intake.terminals import from_terminals
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import from_nameplate
from commissioner.operations.recordings.stretches import as_state, in_its_states
from commissioner.recordings.importers import read_running
from commissioner.recordings.plate import plate_of
from commissioner.records import RunningRecording

DATA = Path(__file__).parents[2] / "data" / "intake"
PLATE = Nameplate(2250.0, 400.0, 50.0, 4.86, 1436.0, 0.78, 2, "star")


def stretches(file):
    recording = read_running(DATA / file)
    plate = plate_of(recording.metadata, file, None)
    return recording, plate, states(recording, plate)


def test_off_start_step_and_coasting_are_told_with_their_times():
    """Off to 0.2 s, direct start to 0.29 s, 5 N m, step to 13 N m at 1.4 s, off at 2.3 s."""
    recording, plate, seen = stretches("off_start_step_off.csv.gz")
    assert [s.state for s in seen] == ["off", "start", "steady", "load step", "steady", "coast-down"]
    assert seen[1].start_s == pytest.approx(0.2, abs=0.04) and 0.29 <= seen[1].end_s < 0.45
    assert seen[3].start_s <= 1.42 <= seen[3].end_s and seen[5].start_s == pytest.approx(2.3, abs=0.04)
    for stretch, torque, speed in ((seen[2], 5.0, 155.05), (seen[4], 13.0, 151.39)):
        own = from_terminals(
            inspect(cut_out(recording, stretch, 0.06), plate, from_nameplate(plate)).fundamental, plate
        )
        assert own.torque_nm == pytest.approx(torque, abs=2.0 * own.torque_std_nm)
        assert own.speed_rad_per_s == pytest.approx(speed, abs=2.0 * own.speed_std_rad_per_s)


def test_a_start_at_the_head_of_a_recording_is_one():
    """Off to 0.05 s, direct start to 0.58 s: its current's plateau is not steady, and what precedes nothing is no dip."""
    _, _, seen = stretches("direct_start.csv.gz")
    assert [s.state for s in seen] == ["off", "start", "steady"]
    assert seen[0].end_s == pytest.approx(0.05, abs=0.005) and 0.58 <= seen[1].end_s < 0.75


def test_a_ramp_of_the_supply_is_told_from_the_steady_state_behind_it():
    """5 to 50 Hz in 1.5 s, then 50 Hz."""
    _, _, seen = stretches("ramp.csv.gz")
    assert [s.state for s in seen] == ["ramp", "steady"]
    assert 1.5 <= seen[1].start_s < 1.7


def switched(carrier_hz, rate_hz, seconds=1.0, f=40.0, spread=0.0, seed=0):
    """Line voltages of a sine-triangle inverter of 560 V, sampled instantly, and currents of their fundamental."""
    fine = 40
    t = np.arange(round(seconds * rate_hz) * fine) / (rate_hz * fine)
    random = np.random.default_rng(seed)
    wobble = np.interp(t, np.arange(0, seconds + 0.02, 0.01), random.standard_normal(int(seconds / 0.01) + 2))
    phase = np.cumsum(carrier_hz * (1 + spread * wobble)) / (rate_hz * fine)
    triangle = 4 * np.abs(phase % 1 - 0.5) - 1
    legs = [280 * np.sign(0.8 * np.cos(2 * np.pi * f * t - k * 2 * np.pi / 3) - triangle) for k in range(3)]
    lines = [(legs[k] - legs[(k + 1) % 3])[::fine] for k in range(3)]
    t = t[::fine]
    currents = tuple(4 * np.cos(2 * np.pi * f * t - k * 2 * np.pi / 3 - 0.6) for k in range(3))
    return RunningRecording(t, currents, tuple(lines), True, None, 1.0 / rate_hz)


@pytest.mark.parametrize(("carrier", "rate"), [(4000, 50e3), (4000, 100e3), (2500, 40e3), (5000, 53e3)])
def test_the_carrier_is_found_and_means_are_the_fundamental(carrier, rate):
    recording = switched(carrier, rate)
    means, finding = means_over_carrier(recording)
    assert finding.code == "carrier_means" and finding.value == pytest.approx(carrier, rel=0.02)
    u = means.voltages_v[0]
    true = 0.8 * 280 * np.sqrt(3) * np.cos(2 * np.pi * 40 * means.time_s + np.pi / 6)
    # instants locked to the carrier see an edge to one sample: a mean is a tenth off at ten a period, and no mean helps
    assert np.std(u - true) < max(0.08, 1.3 * carrier / rate) * np.std(true)
    assert means.sample_period_s == pytest.approx(np.median(np.diff(means.time_s)))


def test_too_slow_a_recording_is_refused_with_the_rate_that_would_do():
    _, finding = means_over_carrier(switched(4000, 20e3))
    assert finding.stops and "40" in str(finding.limit)


@pytest.mark.parametrize(("carrier", "rate"), [(4000, 40e3), (5000, 50e3), (4000, 48e3)])
def test_samples_locked_to_the_carrier_are_refused_with_the_rates_that_would_do(carrier, rate):
    _, finding = means_over_carrier(switched(carrier, rate))
    assert finding.stops and "locked" in finding.what
    assert f"{16 * carrier / 1e3:.3g} kHz" in finding.remedy
    off = (round(rate / carrier) + 0.5) * carrier
    _, other = means_over_carrier(switched(carrier, off))
    assert other.code == "carrier_means"


def test_sine_voltages_are_left_alone():
    recording = switched(4000, 20e3)
    sine = tuple(300 * np.cos(2 * np.pi * 40 * recording.time_s - k * 2 * np.pi / 3) for k in range(3))
    recording = replace(recording, voltages_v=sine)
    assert means_over_carrier(recording) == (recording, None)
    assert [s.state for s in states(recording, PLATE)] == ["steady"]


def levels(seconds=4.0, hop_s=0.02, **changed) -> Levels:
    count = round(seconds / hop_s)
    plain = {"current_a": 5.8, "voltage_v": 230.0, "frequency_hz": 50.0, "sense": 1.0}
    columns = {name: np.full(count, value) for name, value in plain.items()}
    for name, (begin_s, end_s, value) in changed.items():
        columns[name][round(begin_s / hop_s) : round(end_s / hop_s)] = value
    return Levels(np.arange(count) * hop_s, hop_s=hop_s, **columns)


def runs_of(names: list[str], hop_s=0.02) -> list[tuple[str, float, float]]:
    edges = [0, *(k for k in range(1, len(names)) if names[k] != names[k - 1]), len(names)]
    return [(names[a], round(a * hop_s, 2), round(b * hop_s, 2)) for a, b in pairwise(edges)]


def test_a_dip_of_the_voltage_parts_two_steady_stretches():
    dip = levels(voltage_v=(2.0, 2.2, 140.0), current_a=(2.0, 2.3, 11.0))
    assert [s[0] for s in runs_of(named(dip, PLATE))] == ["steady", "voltage dip", "steady"]
    (_, begin_s, end_s) = runs_of(named(dip, PLATE))[1]
    assert begin_s == pytest.approx(2.0, abs=0.1) and end_s == pytest.approx(2.3, abs=0.1)


def test_a_voltage_that_stays_lower_or_falls_with_its_frequency_is_no_dip():
    stays = levels(voltage_v=(2.0, 4.0, 180.0))
    assert {s[0] for s in runs_of(named(stays, PLATE))} == {"steady"}


def test_nothing_is_steady_while_the_order_of_the_phases_is_reversed():
    reversal = named(levels(sense=(2.0, 4.0, -1.0), current_a=(2.0, 2.15, 28.0)), PLATE)
    (ramp,) = [s for s in runs_of(reversal) if s[0] == "ramp"]
    assert ramp[1] <= 1.9 and ramp[2] >= 2.15
    assert [s[0] for s in runs_of(reversal)] == ["steady", "ramp", "steady"]


def test_a_switching_off_is_no_ramp_of_the_coasting_machines_frequency():
    """A window over it has current yet, and the frequency of a shaft that a large load stops within a tenth of a second."""
    off = levels(current_a=(3.0, 4.0, 0.0), voltage_v=(3.0, 4.0, 60.0), frequency_hz=(2.94, 4.0, 40.0))
    steady, coasting = runs_of(named(off, PLATE))
    assert (steady[0], coasting[0]) == ("steady", "coast-down") and steady[2] == pytest.approx(3.0, abs=0.1)


def test_the_plateau_of_a_long_start_is_never_steady():
    """Seconds of five times the rated current, at its end still or not."""
    never = levels(current_a=(0.0, 4.0, 5.2 * PLATE.rated_current_a))
    assert runs_of(named(never, PLATE)) == [("start", 0.0, 4.0)]
    late = levels(current_a=(0.0, 2.5, 5.2 * PLATE.rated_current_a))
    assert [s[0] for s in runs_of(named(late, PLATE))] == ["start", "steady"]
    assert runs_of(named(late, PLATE))[1][1] == pytest.approx(2.5, abs=0.1)


@pytest.mark.parametrize("edges_s", [(2.0, 4.0), (2.0, 4.0, 6.0), (1.5, 2.6, 5.0, 6.5)])
def test_a_load_that_steps_up_and_back_is_told_each_time(edges_s):
    """No single cut leaves two level sides: each side is looked at for a second."""
    seen = levels(8.0)
    for k, edge_s in enumerate(edges_s):
        seen.current_a[round(edge_s / 0.02) :] = 8.8 if k % 2 == 0 else 5.8
    found = runs_of(named(seen, PLATE))
    assert [s[0] for s in found] == ["steady", *["load step", "steady"] * len(edges_s)]
    for edge_s, step in zip(edges_s, found[1::2], strict=True):
        assert step[1] <= edge_s <= step[2]


@pytest.mark.parametrize("swing_hz", [0.1, 0.2, 0.35, 0.5, 1.0, 2.2])
def test_a_load_that_swings_has_no_steps(swing_hz):
    seen = levels(20.0)
    seen.current_a[:] += 2.0 * np.sin(2 * np.pi * swing_hz * seen.time_s)
    assert set(named(seen, PLATE)) == {"steady"}


@pytest.mark.parametrize("plate", [PLATE, None])
@pytest.mark.parametrize("has_volts", [True, False])
def test_one_steady_state_says_its_own_current_and_frequency(plate, has_volts):
    """0 A and the plate's frequency had stood there."""
    t = np.arange(8000) * 5e-4
    turns = [2 * np.pi * 41.3 * t - 2 * np.pi / 3 * k for k in range(3)]
    currents = tuple(3.2 * np.sqrt(2.0) * np.cos(x - 0.6) for x in turns)
    volts = tuple(270.0 * np.cos(x) if has_volts else np.full(t.size, np.nan) for x in turns)
    recording = RunningRecording(t, currents, volts, False, None, 5e-4)
    (one,) = states(recording, plate)
    state = as_state(one, used=True)
    assert (state["state"], state["used"]) == ("steady", True)
    assert state["current_a"] == pytest.approx(3.2, rel=1e-3)
    assert state["frequency_hz"] == pytest.approx(41.3, abs=1e-3)


@pytest.mark.parametrize("scale", [5.0, 20.0, 1000.0])
def test_a_current_of_a_start_all_along_is_asked_for_its_unit(scale):
    t = np.arange(2400) / 1000.0
    waves = [np.cos(2 * np.pi * 50 * t - k * 2 * np.pi / 3) for k in range(3)]
    currents, volts = (tuple(a * w for w in waves) for a in (scale * 4.0 * np.sqrt(2.0), 326.6))
    seen, _, states_seen = in_its_states(RunningRecording(t, currents, volts, False, None, 1e-3), PLATE, Wishes())
    assert (
        seen.reason.code == "current_level"
        and "ampere" in seen.reason.remedy
        and "starts so long" in seen.reason.remedy
    )
    assert seen.reason.value == pytest.approx(scale * 4.0 / PLATE.rated_current_a, rel=0.02)
    assert [s["state"] for s in states_seen] == ["start"]


def test_a_motor_without_volts_and_amperes_is_off_and_one_of_small_currents_is_not():
    assert set(named(levels(current_a=(0.0, 4.0, 0.01), voltage_v=(0.0, 4.0, 0.1)), PLATE)) == {"off"}
    assert set(named(levels(current_a=(0.0, 4.0, 0.01)), PLATE)) == {"steady"}
