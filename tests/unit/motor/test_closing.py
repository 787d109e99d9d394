"""All currents late alike: the closing of a contactor at rest tells it, and torque and parameters are then those of the motor; the simulator's key."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.monitor.chain import Wishes
from commissioner.monitor.intake.findings import Fundamental
from commissioner.monitor.intake.levels import late_currents
from commissioner.monitor.intake.terminals import from_terminals
from commissioner.motor.channels.closing import currents_behind
from commissioner.motor.channels.faults import currents_on_time
from commissioner.operations.recordings.stretches import in_its_states, said_by_terminals
from commissioner.running.identification import identify
from sim.motoring.machine import Effect
from tests.running_effects.cases import Case, as_plate, as_recording, record, taken

SHAFT_NM = (18.1, 75.4, 129.0)
"""Air-gap torque of the three loads of case 5000."""


def late_start(late_s, seed=5000, seconds=3.0, stratum="null"):
    scenario = Case(seed, stratum).scenario()
    course = replace(scenario.course, duration_s=seconds)
    effects = (*scenario.effects, Effect("sampling_delay", late_s)) if late_s else scenario.effects
    recording, plate, _ = taken(replace(scenario, course=course, effects=effects), seed)
    return recording, plate


def behind(late_s, **case):
    recording, plate = late_start(late_s, seconds=0.4, **case)
    return currents_behind(recording, np.sqrt(2 / 3) * plate.rated_voltage_v)


@pytest.mark.parametrize("late_s", [1e-4, 4e-4, -3e-4])
@pytest.mark.parametrize("seed", [5000, 5003, 5005])
def test_a_closing_tells_by_how_much_all_currents_are_late(late_s, seed):
    seen = behind(late_s, seed=seed)
    assert seen.is_told and abs(seen.late_s - late_s) < 2.5 * seen.std_s < 1.5e-4


@pytest.mark.parametrize(
    ("seed", "stratum"),
    [(5002, "null"), (5008, "null"), (6000, "one"), (6006, "one"), (6025, "one"), (6037, "one"), (7015, "two"), (8003, "absent"), (8008, "absent")],
)  # fmt: skip
def test_neither_a_healthy_motor_nor_one_that_saturates_nor_a_gain_that_drifts_has_late_currents(seed, stratum):
    seen = behind(0.0, seed=seed, stratum=stratum)
    assert seen is None or not seen.is_told


def test_what_has_no_closing_from_rest_tells_no_delay():
    recording, plate = late_start(4e-4, seconds=1.0)
    volts = np.sqrt(2 / 3) * plate.rated_voltage_v
    assert currents_behind(recording, volts).is_told
    for part in (slice(600, None), slice(0, 300)):
        i, v = (tuple(x[part] for x in g) for g in (recording.currents_a, recording.voltages_v))
        cut = replace(recording, time_s=recording.time_s[part], currents_a=i, voltages_v=v)
        assert currents_behind(cut, volts) is None
    ramp = Case(5007, "null", "ramp").scenario()
    columns, metadata, _ = record(replace(ramp, course=replace(ramp.course, duration_s=1.0)), 5007)
    assert currents_behind(as_recording(columns, metadata), as_plate(metadata).rated_voltage_v) is None


def test_voltages_between_lines_two_currents_and_a_supply_that_is_there_before_the_closing_tell_it_too():
    recording, plate = late_start(3e-4, seconds=0.4)
    volts = np.sqrt(2 / 3) * plate.rated_voltage_v
    u, v, w = recording.voltages_v
    lines = replace(recording, voltages_v=(u - v, v - w, w - u), voltages_are_line_to_line=True)
    two = replace(recording, currents_a=(*recording.currents_a[:2], np.full(u.size, np.nan)), voltages_v=(u, v, w))
    on = int(np.argmax(np.abs(u) > 0.2 * volts))
    turn = 2 * np.pi * 50.0 * recording.sample_period_s * (np.arange(on) - on)
    angle = np.angle(u[on + 2] + np.exp(2j * np.pi / 3) * v[on + 2] + np.exp(-2j * np.pi / 3) * w[on + 2])
    before = (volts * np.cos(turn + angle - k * 2 * np.pi / 3) for k in range(3))
    fed = tuple(np.concatenate([b, x[on:]]) for b, x in zip(before, (u, v, w), strict=True))
    for one in (lines, two, replace(recording, voltages_v=fed)):
        seen = currents_behind(one, volts)
        assert seen.is_told and seen.late_s == pytest.approx(3e-4, abs=3e-5)


@pytest.mark.parametrize("late_s", [0.0, 4e-4, -2e-4])
def test_the_torque_of_a_recording_with_late_currents_is_the_motors(late_s):
    """63.8 +- 3.0 N m were said of 75.4, and no word."""
    recording, plate = late_start(late_s)
    seen, _, stretches = in_its_states(recording, plate, Wishes())
    told = said_by_terminals(seen, stretches, plate)
    assert abs(told.torque_nm.value - SHAFT_NM[1]) < 0.3 * told.torque_nm.std < 1.0
    notes = [f.what for f in seen.findings if f.code == "late_channel"]
    assert len(notes) == (late_s != 0.0)
    if notes:
        assert f"{'behind' if late_s > 0 else 'before'} the voltages" in notes[0] and "shifted back" in notes[0]


def test_what_a_delay_would_do_that_nothing_tells_is_in_the_torques_error():
    recording, plate = late_start(2e-4)
    part = slice(6000, 10000)
    i, v = (tuple(x[part] for x in g) for g in (recording.currents_a, recording.voltages_v))
    steady = replace(recording, time_s=recording.time_s[part], currents_a=i, voltages_v=v)
    seen, _, stretches = in_its_states(steady, plate, Wishes())
    told = said_by_terminals(seen, stretches, plate)
    assert abs(told.torque_nm.value - SHAFT_NM[1]) < 2.0 * told.torque_nm.std
    seen = Fundamental(50.0, 325 + 0j, 30 - 30j, 0j, 0j, 14600.0, 14600.0, False)
    still, open_ = (from_terminals(seen, plate, 0.0, skew) for skew in (0.0, 1e-4))
    late_nm = 14600.0 * 314.16 * 1e-4 / (314.16 / plate.pole_pairs)
    assert np.hypot(still.torque_std_nm, late_nm) == pytest.approx(open_.torque_std_nm, rel=1e-3)


def test_a_delay_that_the_fit_put_right_is_said_from_what_sensors_usually_are_apart():
    assert late_currents(9e-5, 1e-6) == () and late_currents(-3e-4, 1e-4) == ()
    (said,) = late_currents(-3e-4, 1e-5)
    assert "300 us before the voltages" in said.what and said.kind == "corrected"


def test_four_parameters_are_found_behind_late_currents():
    """A delay of more than a row had no machine near the plate's values."""
    recording, plate = late_start(2.5e-4, seconds=1.9)
    late = identify([recording], plate)
    true, told = Case(5000, "null").scenario().machine.stator_resistance_ohm, late.parameters["stator_resistance_ohm"]
    assert abs(told.value - true) < 2.5 * told.std < 0.02 * true
    assert "behind the voltages" in late.remarks[0]
    mended, _ = currents_on_time(recording, np.sqrt(2 / 3) * plate.rated_voltage_v, by_whole_rows=True)
    rows = mended.time_s.size
    assert rows == recording.time_s.size - 1
    np.testing.assert_array_equal(mended.currents_a[0], recording.currents_a[0][1:])
