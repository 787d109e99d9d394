"""The drive's firmware asked through its registers, without a wire."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from sim.drive.drive_map import load_map
from sim.drive.firmware import Firmware
from sim.drive.memory import Memory
from sim.drive.registers import Registers
from sim.drive.states import Answer, Setup, State, Trip
from sim.physics import layout as at
from sim.physics.machine import Effect, Plant, PowerStage, Sensors
from tests.sim.client import crc_bytes, floats

MAP = load_map()
FACTORY = [3.2, 1.8, 26.0, 200.0]


def drive(plant: Plant | None = None, setup: Setup | None = None, memory: Memory | None = None) -> Firmware:
    return Firmware(plant or Plant(), MAP, setup or Setup(), memory or Memory(None, list(FACTORY)), 3)


def put(firmware: Firmware, name: str, value: object) -> Answer:
    item = MAP.items[name]
    return Registers(firmware).write(item.address, item.encode(value))


def get(firmware: Firmware, name: str):
    item = MAP.items[name]
    return item.decode(Registers(firmware).read(item.address, item.words))


def ready(firmware: Firmware, **changes: object) -> Firmware:
    settings = {
        "watchdog_ms": 500,
        "current_limit_a": 9.0,
        "test_time_limit_s": 30.0,
        "voltage_limit_v": 100.0,
        "mode": 1,
        "dc_bias_v": 5.0,
        "bias_ramp_v_per_s": 100.0,
        "amplitude_scale": 1.0,
        "scale_ramp_per_s": 10.0,
        "duration_s": 1.0,
        "tone_count": 1,
        "tones": [6.0, 10.0, 0.0, *[0.0] * 21],
    } | changes
    for name, value in settings.items():
        assert put(firmware, name, value) is Answer.DONE
    return firmware


def switch_on(firmware: Firmware) -> Firmware:
    for word in (0x06, 0x07, 0x0F):
        put(firmware, "control_word", word)
    return firmware


def test_control_words_walk_the_cia402_states():
    firmware = ready(drive())
    seen = []
    for word in (0x06, 0x07, 0x0F, 0x07, 0x06, 0x00):
        put(firmware, "control_word", word)
        seen.append(firmware.state)
    assert seen == [
        State.READY,
        State.SWITCHED_ON,
        State.ENABLED,
        State.SWITCHED_ON,
        State.READY,
        State.SWITCH_ON_DISABLED,
    ]


@pytest.mark.parametrize(
    ("state", "pattern", "mask"),
    [
        ((), 0x40, 0x4F),
        ((6,), 0x21, 0x6F),
        ((6, 7), 0x23, 0x6F),
        ((6, 7, 15), 0x27, 0x6F),
    ],
)
def test_status_word_has_the_patterns_of_the_standard(state, pattern, mask):
    firmware = ready(drive())
    for word in state:
        put(firmware, "control_word", word)
    assert get(firmware, "status_word") & mask == pattern


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"watchdog_ms": 0}, "watchdog not set"),
        ({"mode": 0}, "mode is not 1"),
        ({"current_limit_a": 0.0}, "no current limit"),
        ({"test_time_limit_s": 0.0}, "no test time limit"),
        ({"duration_s": 0.0}, "no duration"),
    ],
)
def test_output_stays_off_while_something_is_missing(change, reason):
    firmware = switch_on(ready(drive(), **change))
    assert firmware.state is State.SWITCHED_ON
    assert firmware.refuses_enable() == reason


def test_open_interlock_keeps_the_output_off():
    firmware = switch_on(ready(drive(setup=Setup(interlocks={"sto_released": False}))))
    assert not firmware.is_energised
    assert get(firmware, "interlocks") == 0b11110


def test_watchdog_coasts_within_its_time_and_says_so():
    firmware = switch_on(ready(drive(), duration_s=20.0, watchdog_ms=300))
    firmware.advance(0.29)
    assert firmware.is_energised
    for _ in range(4):
        firmware.advance(0.005)
    assert firmware.state is State.FAULT
    assert get(firmware, "trip_cause") == Trip.WATCHDOG
    assert get(firmware, "trip_value") == pytest.approx(300.0, abs=10.0)


def test_only_a_changed_heartbeat_feeds_the_watchdog():
    firmware = switch_on(ready(drive(), duration_s=20.0, watchdog_ms=200))
    for beat in range(1, 6):
        put(firmware, "heartbeat", beat)
        firmware.advance(0.1)
    assert firmware.is_energised
    for _ in range(3):
        put(firmware, "heartbeat", 5)
        firmware.advance(0.1)
    assert firmware.fault is Trip.WATCHDOG


def test_watchdog_time_below_the_minimum_is_refused():
    assert put(drive(), "watchdog_ms", 50) is Answer.BAD_VALUE
    assert put(drive(), "watchdog_ms", 2001) is Answer.BAD_VALUE


def test_fault_reset_needs_a_rising_edge_and_cause_outlives_it():
    firmware = switch_on(ready(drive()))
    firmware.trip(Trip.EARTH_FAULT, 1.4, 0.5)
    put(firmware, "control_word", 0x0F)
    assert firmware.state is State.FAULT
    put(firmware, "control_word", 0x80)
    assert firmware.state is State.SWITCH_ON_DISABLED
    assert get(firmware, "fault_code") == 0
    assert get(firmware, "trip_cause") == Trip.EARTH_FAULT
    assert get(firmware, "trip_limit") == pytest.approx(0.5)


def test_current_limit_trips_at_the_sample_that_passes_it():
    firmware = switch_on(ready(drive(), current_limit_a=0.6, dc_bias_v=15.0))
    firmware.advance(0.5)
    assert firmware.fault is Trip.OVERCURRENT
    assert 0.6 < get(firmware, "trip_value") < 0.8
    last = firmware.samples.ring[firmware.produced - 1, 1:] * firmware.current_scale_a
    before = firmware.samples.ring[firmware.produced - 2, 1:] * firmware.current_scale_a
    assert np.abs(last).max() > 0.6 - firmware.plant.sensors.lsb_a
    assert np.abs(before).max() <= 0.6 + firmware.plant.sensors.lsb_a


def test_a_coarse_converter_reads_the_same_current_in_coarse_steps():
    """It read a seventh of the current: samples were counted in its step and told in the usual converter's."""
    step_a, seen = 0.1, []
    for effects in ((), (Effect("quantization", step_a),)):
        firmware = switch_on(ready(drive(Plant(effects=effects)), dc_bias_v=15.0, current_limit_a=20.0))
        firmware.advance(0.3)
        seen.append(firmware.samples.ring[firmware.produced - 1, 1] * get(firmware, "current_scale_a"))
    assert seen[0] > 5.0 * step_a and abs(seen[1] - seen[0]) < step_a
    assert seen[1] / step_a == pytest.approx(round(seen[1] / step_a), abs=1e-3)


def test_test_ends_by_itself_with_a_ramp_down():
    firmware = switch_on(ready(drive(), duration_s=0.5, watchdog_ms=2000))
    firmware.advance(1.5)
    assert firmware.state is State.SWITCH_ON_DISABLED
    u = firmware.samples.ring[: firmware.produced, 0] * 0.01
    assert np.abs(u[2480:2500]).max() > 4.0
    assert abs(u[-1]) < 0.2
    assert firmware.produced == pytest.approx(2500 + 500, abs=60)


def test_time_limit_ends_an_endless_test_as_a_trip():
    firmware = switch_on(ready(drive(), duration_s=60.0, test_time_limit_s=0.4, watchdog_ms=2000))
    firmware.advance(1.0)
    assert firmware.fault is Trip.TIME_LIMIT


def test_excitation_is_the_published_formula_and_flags_its_clamp():
    firmware = switch_on(
        ready(drive(), tones=[40.0, 10.0, 0.4, *[0.0] * 21], voltage_limit_v=30.0, current_limit_a=12.0)
    )
    firmware.advance(0.4)
    t = np.arange(firmware.produced) * 2e-4
    bias = np.minimum(5.0, 100.0 * (t + 2e-4))
    scale = np.minimum(1.0, 10.0 * (t + 2e-4))
    wanted = bias + scale * 40.0 * np.cos(2.0 * math.pi * 10.0 * t + 0.4)
    np.testing.assert_allclose(firmware.samples.ring[: t.size, 0] * 0.01, np.clip(wanted, -30.0, 30.0), atol=0.006)
    clamped = firmware.samples.flags[: t.size] & MAP.flags["voltage_clamped"] != 0
    np.testing.assert_array_equal(clamped, np.abs(wanted) > 30.0)


def test_every_enable_is_a_new_session_from_sample_zero():
    firmware = switch_on(ready(drive()))
    first = get(firmware, "session_id")
    firmware.advance(0.1)
    put(firmware, "control_word", 0)
    switch_on(firmware)
    assert get(firmware, "session_id") == first + 1
    assert get(firmware, "samples_produced") == 0


def check_window(words: list[int]) -> None:
    """CRC-16/MODBUS with code of the test's own, over header without CRC, then data."""
    channels = bin(words[4]).count("1")
    payload = words[:7] + words[8 : 8 + words[3] * channels]
    raw = b"".join(w.to_bytes(2, "big") for w in payload)
    assert words[7] == int.from_bytes(crc_bytes(raw), "little")


def test_window_header_data_and_check_sum_are_as_published():
    firmware = switch_on(ready(drive()))
    firmware.advance(0.1)
    put(firmware, "window_index", 17)
    words = Registers(firmware).read(256, 125)
    assert words[:5] == [firmware.session, 0, 17, 29, 0b1111]
    assert words[5] == MAP.flags["running"]
    assert words[6] * 0.02 == pytest.approx(540.0, rel=0.02)
    check_window(words)
    data = np.array(words[8 : 8 + 116], np.uint16).view(np.int16).reshape(29, 4)
    np.testing.assert_array_equal(data, firmware.samples.ring[17:46])


def test_asking_again_gives_the_same_words():
    firmware = switch_on(ready(drive()))
    firmware.advance(0.2)
    put(firmware, "window_index", 100)
    once = Registers(firmware).read(256, 125)
    put(firmware, "window_index", 200)
    Registers(firmware).read(256, 125)
    put(firmware, "window_index", 100)
    again = Registers(firmware).read(256, 125)
    assert once[8:] == again[8:]
    assert once[:6] == again[:6]


def test_a_short_read_gets_a_window_that_fits_it():
    firmware = switch_on(ready(drive(), channel_mask=0b0110))
    firmware.advance(0.1)
    words = Registers(firmware).read(256, 8 + 10)
    assert (words[3], words[4], len(words)) == (5, 0b0110, 18)
    check_window(words)


def test_overwritten_samples_are_flagged_and_counted():
    firmware = switch_on(ready(drive(setup=Setup(ring_capacity=1000)), duration_s=20.0, watchdog_ms=2000))
    firmware.advance(0.3)
    words = Registers(firmware).read(256, 125)
    assert words[1] << 16 | words[2] == 500
    assert words[5] & MAP.flags["overrun"]
    assert get(firmware, "overruns") == 500


def test_last_window_says_that_nothing_follows():
    firmware = switch_on(ready(drive(), duration_s=0.1, watchdog_ms=2000))
    firmware.advance(1.0)
    put(firmware, "window_index", firmware.produced - 3)
    words = Registers(firmware).read(256, 125)
    assert words[3] == 3
    assert words[5] & MAP.flags["ended"]
    assert not words[5] & MAP.flags["running"]


def test_clipped_sensor_is_flagged():
    plant = replace(Plant(), sensors=replace(Sensors(), full_scale_a=0.8))
    firmware = switch_on(ready(drive(plant), dc_bias_v=15.0))
    firmware.advance(0.3)
    firmware.values["window_index"] = firmware.produced - 20
    assert Registers(firmware).read(256, 125)[5] & MAP.flags["clipped"]


def test_decimated_samples_are_means_over_the_periods():
    plain, coarse = switch_on(ready(drive())), switch_on(ready(drive(), decimation=10))
    for firmware in (plain, coarse):
        firmware.advance(0.2)
    means = plain.samples.ring[:1000].reshape(100, 10, 4).mean(axis=1)
    np.testing.assert_allclose(coarse.samples.ring[:100], means, atol=0.51)


@pytest.mark.parametrize(
    "name", ["axis_deg", "tones", "watchdog_ms", "current_limit_a", "staged_crc", "commit", "decimation"]
)
def test_what_needs_a_stop_is_refused_while_energised(name):
    firmware = switch_on(ready(drive()))
    item = MAP.items[name]
    before = firmware.values[name]
    assert Registers(firmware).write(item.address, item.encode(before)) is Answer.BUSY
    assert firmware.values[name] == before


def test_read_only_unknown_and_half_written_items_are_refused():
    firmware = drive()
    assert put(firmware, "magic", 1) is Answer.NO_SUCH_ADDRESS
    assert Registers(firmware).write(96 - 1, [1]) is Answer.NO_SUCH_ADDRESS
    assert Registers(firmware).read(77, 2) is Answer.NO_SUCH_ADDRESS
    assert Registers(firmware).write(MAP.items["current_limit_a"].address, [1]) is Answer.NO_SUCH_ADDRESS
    assert Registers(firmware).write(MAP.items["axis_deg"].address, floats(math.nan)) is Answer.BAD_VALUE


def test_a_refused_request_changes_none_of_its_items():
    firmware = drive()
    assert Registers(firmware).write(96, [400, *floats(7.0), *floats(math.inf)]) is Answer.BAD_VALUE
    assert firmware.values["watchdog_ms"] == 0
    assert firmware.values["current_limit_a"] == 0


def stage(firmware: Firmware, values: list[float], crc: int | None = None) -> None:
    words = floats(*values)
    raw = b"".join(w.to_bytes(2, "big") for w in words)
    right = int.from_bytes(crc_bytes(raw), "little")
    assert Registers(firmware).write(592, [*words, right if crc is None else crc]) is Answer.DONE
    put(firmware, "commit", 0xC0DE)


def test_commit_then_store_survives_the_mains_and_counts_the_write(tmp_path):
    memory = Memory(tmp_path / "nvm.json", list(FACTORY))
    firmware = drive(memory=memory)
    stage(firmware, [3.7, 2.1, 21.0, 224.0])
    assert get(firmware, "commit_result") == 1
    firmware.advance(0.1)
    assert get(firmware, "commit_result") == 2
    assert get(firmware, "leakage_inductance") == pytest.approx(21.0)
    assert get(firmware, "stored_leakage_inductance") == pytest.approx(26.0)
    put(firmware, "store", 0x570E)
    firmware.advance(0.1)
    assert (get(firmware, "store_result"), get(firmware, "store_count")) == (2, 1)
    again = drive(memory=Memory(tmp_path / "nvm.json", list(FACTORY)))
    assert get(again, "magnetizing_inductance") == pytest.approx(224.0)
    assert get(again, "store_count") == 1


@pytest.mark.parametrize(
    ("values", "crc", "result"), [([3.7, 2.1, 21.0, 224.0], 1, 3), ([3.7, 2.1, 0.0, 224.0], None, 4)]
)
def test_bad_check_sum_and_impossible_value_leave_the_old_parameters(values, crc, result):
    firmware = drive()
    stage(firmware, values, crc)
    firmware.advance(0.1)
    assert get(firmware, "commit_result") == result
    assert get(firmware, "stator_resistance") == pytest.approx(3.2)


def test_staged_and_committed_values_are_lost_with_the_mains_when_not_stored():
    firmware = drive()
    stage(firmware, [3.7, 2.1, 21.0, 224.0])
    firmware.advance(0.1)
    firmware.power_cycle()
    assert get(firmware, "stator_resistance") == pytest.approx(3.2)
    assert get(firmware, "watchdog_ms") == 0


def test_damaged_memory_is_a_fault_at_power_up(tmp_path):
    path = tmp_path / "nvm.json"
    Memory(path, list(FACTORY)).power_up()
    saved = json.loads(path.read_text())
    saved["content"]["parameters"][0] = 9.9
    path.write_text(json.dumps(saved))
    assert drive(memory=Memory(path, list(FACTORY))).fault is Trip.MEMORY


def test_hot_winding_trips_and_reports_its_temperature():
    plant = replace(Plant(), heating=replace(Plant().heating, stator_per_min=3.0))
    firmware = switch_on(
        ready(drive(plant, Setup(winding_degc=119.5)), dc_bias_v=15.0, duration_s=20.0, watchdog_ms=2000)
    )
    for beat in range(1, 100):
        put(firmware, "heartbeat", beat)
        firmware.advance(0.1)
    assert firmware.fault is Trip.WINDING
    assert get(firmware, "trip_value") > 120.0
    assert firmware.x[at.X_HEAT_A] > 0.0


def test_event_happens_at_its_control_period():
    firmware = switch_on(ready(drive()))
    start = firmware.t
    firmware.at(start + 0.0501, lambda: firmware.trip(Trip.STO, 0.0, 1.0))
    firmware.advance(0.2)
    assert firmware.produced == math.ceil(0.0501 / 2e-4)


def test_same_seed_same_samples_however_time_is_cut():
    whole, cut = switch_on(ready(drive())), switch_on(ready(drive()))
    whole.advance(0.3)
    for _ in range(300):
        cut.advance(0.001)
    np.testing.assert_array_equal(whole.samples.ring, cut.samples.ring)


@pytest.mark.parametrize(
    ("nominal_v", "step_v"), [(325.0, 0.02), (540.0, 0.02), (565.0, 0.02), (650.0, 0.04), (975.0, 0.04)]
)
def test_no_links_word_wraps(nominal_v, step_v):
    """A 690 V drive's link is 975 V: at 0.02 V per count of a signed word it read -336 V."""
    power_stage = replace(Plant().power_stage, link_v=nominal_v)
    firmware = drive(Plant(power_stage=power_stage))
    firmware.x[at.X_LINK] = 1.1 * nominal_v
    words = Registers(firmware).read(MAP.window_address, MAP.window_header_words)
    counts = int(np.array(words[-2], np.uint16).view(np.int16))
    assert get(firmware, "dc_link_scale_v") == pytest.approx(step_v)
    assert counts * step_v == pytest.approx(1.1 * nominal_v, abs=step_v)


@pytest.mark.parametrize(
    ("cut", "settled_a"), [("lost_voltage", 0.8), ("most_voltage_v", 3.0 / 5.0), ("most_current_a", None)]
)
def test_what_a_drive_cuts_off_silently_is_missing_in_the_motor_and_not_in_the_samples(cut, settled_a):
    """A DC bias settles where the volts that are left drive it, and at the ceiling of a current folded back; an ideal inverter."""
    sizes = {"lost_voltage": 0.2, "most_voltage_v": 3.0, "most_current_a": 0.5}
    stage = PowerStage(dead_time_s=0.0, threshold_v=0.0, slope_ohm=0.0)
    plant = Plant(power_stage=stage)
    whole_a = 5.0 / plant.machine.stator_resistance_ohm
    bent = switch_on(
        ready(drive(plant, Setup(**{cut: sizes[cut]})), tone_count=0, duration_s=20.0, test_time_limit_s=30.0)
    )
    bent.advance(8.0)
    ring, newest = bent.samples, bent.produced - 1
    assert ring.ring[newest % ring.capacity, 0] == round(5.0 / 0.01)
    seen_a = bent.samples.largest_count() * bent.current_scale_a
    if settled_a is not None:
        assert seen_a == pytest.approx(settled_a * whole_a, rel=0.03)
    else:
        assert 0.5 <= seen_a < 0.7 < whole_a
