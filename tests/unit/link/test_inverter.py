"""The inverter against a drive in memory: set up, energise, steer, fetch, de-energise; a bad drive is found out."""

from contextlib import nullcontext

import numpy as np
import pytest

from commissioner.errors import (
    CheckFailed,
    DriveFault,
    ForeignMaster,
    IdentityMismatch,
    LinkUnreachable,
    ReplyMismatch,
    ReplyTimeout,
    RequestRefused,
    UsageError,
)
from commissioner.link.drive.facts import Action
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from tests.support.scripted_port import ScriptedDrive

PROFILE = load_profile("simulated")


class Bench:
    """A drive, an inverter on it, what it journalled and a clock that only sleeping moves."""

    def __init__(self) -> None:
        self.drive = ScriptedDrive()
        self.now = 0.0
        self.journal = []
        self.inverter = Inverter(self.drive, PROFILE, self.note, sleep=self.sleep, clock=lambda: self.now)

    def note(self, intent) -> None:
        self.journal.append((intent.action, dict(intent.values), len(self.drive.log)))

    def sleep(self, seconds) -> None:
        self.now += seconds

    def set_up(self, **changes) -> None:
        self.inverter.set_watchdog(500)
        self.inverter.set_limits(current_a=8.0, voltage_v=90.0, time_s=60.0)
        signal = {
            "axis_deg": 60.0,
            "tones": [(10.0, 1.0, 0.0), (5.0, 3.0, 1.5)],
            "bias_v": 0.0,
            "bias_ramp_v_per_s": 10.0,
            "scale": 0.1,
            "scale_ramp_per_s": 0.5,
            "duration_s": 10.0,
        }
        self.inverter.load_excitation(**signal | changes)


def timeout():
    return ReplyTimeout("no answer", step="test", value=None, limit=None, remedy="none")


@pytest.fixture
def bench():
    return Bench()


# --- who and how --------------------------------------------------------------------------------------------
def test_identity_is_read_in_si(bench):
    identity = bench.inverter.identify()
    assert (identity.drive_type, identity.serial_number, identity.firmware_version) == ("SIM-INV-7A", 4711, "1.2.3")
    assert identity.control_period_s == pytest.approx(2e-4)


@pytest.mark.parametrize(
    ("item", "value"),
    [
        ("magic", 1),
        ("map_version", 2),
        ("drive_type", "OTHER"),
        ("firmware_version", 0x00020000),
        ("firmware_version", 0x0000FFFF),
    ],
)
def test_another_drive_or_firmware_is_refused_by_name(bench, item, value):
    bench.drive.put(item, value)
    with pytest.raises(IdentityMismatch, match=item):
        bench.inverter.identify()


def test_status_names_state_interlocks_and_trip(bench):
    bench.drive.state = "fault"
    told = {"fault_code": 1, "trip_cause": 1, "trip_value": 9.5, "trip_limit": 8.0, "interlocks": 0b11110}
    for name, value in told.items():
        bench.drive.put(name, value)
    status = bench.inverter.read_status()
    assert (status.state, status.is_energised, status.fault_text) == ("fault", False, "over-current")
    assert (status.trip_text, status.trip_value, status.trip_limit) == ("over-current", 9.5, 8.0)
    assert status.trip_unit == "A"
    assert [name for name, holds in status.interlocks.items() if not holds] == ["sto_released"]
    assert np.isnan(status.winding_degc)


def test_the_nameplate_comes_by_the_contracts_keys(bench):
    plate = bench.inverter.read_nameplate()
    assert plate["rated_current_a"] == 5.0
    assert set(plate) == {
        "rated_power_w",
        "rated_voltage_v",
        "rated_frequency_hz",
        "rated_current_a",
        "rated_speed_rpm",
        "power_factor",
        "pole_pairs",
    }


# --- set up -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("time_ms", [0, 99, 2001])
def test_a_watchdog_the_drive_cannot_keep_is_refused_before_the_wire(bench, time_ms):
    with pytest.raises(CheckFailed, match="watchdog cannot be set"):
        bench.inverter.set_watchdog(time_ms)
    assert bench.drive.log == []


def test_a_watchdog_the_drive_refuses_is_a_failed_check(bench):
    bench.drive.refuses["watchdog_ms"] = 3
    with pytest.raises(CheckFailed, match="watchdog cannot be set"):
        bench.inverter.set_watchdog(500)


@pytest.mark.parametrize(
    "item",
    ["watchdog_ms", "current_limit_a", "voltage_limit_v", "test_time_limit_s", "axis_deg", "tones", "decimation"],
)
def test_a_drive_that_acknowledges_and_does_not_do_it_is_found(bench, item):
    bench.drive.put("decimation", 50)
    bench.drive.deaf_to.add(item)
    with pytest.raises(DriveFault, match=f"acknowledged {item}"):
        bench.set_up()


def test_the_test_signal_arrives_as_the_map_says(bench):
    bench.set_up(tones=[(10.0, 1.0, 0.0), (5.0, 3.0, 1.5)], decimation=2, axis_deg=120.0)
    drive = bench.drive
    assert (drive.get("axis_deg"), drive.get("tone_count"), drive.get("decimation")) == (120.0, 2, 2)
    start = drive.items["tones"]["address"]
    second = np.array(drive.words[start + 6 : start + 12], ">u2").tobytes()
    np.testing.assert_array_equal(np.frombuffer(second, ">f4"), np.float32([5.0, 3.0, 1.5]))
    assert drive.get("channel_mask") == 0b0111


@pytest.mark.parametrize(
    "change", [{"tones": [(1, 1, 1)] * 9}, {"decimation": 0}, {"scale": 1.5}, {"bias_v": float("nan")}]
)
def test_a_signal_the_map_cannot_hold_is_refused_before_the_wire(bench, change):
    with pytest.raises(UsageError):
        bench.set_up(**change)
    assert bench.drive.written("axis_deg") == []


# --- energise -----------------------------------------------------------------------------------------------
def test_enable_follows_the_states_and_opens_a_session(bench):
    bench.set_up()
    cursor = bench.inverter.enable()
    assert bench.drive.written("control_word") == ["0006", "0007", "000f"]
    assert bench.drive.state == "enabled"
    assert (cursor.stream.session, cursor.next_index, cursor.stream.axis_deg) == (101, 0, 60.0)
    assert cursor.stream.sample_period_s == pytest.approx(2e-4)


def test_energising_is_journalled_before_the_drive_hears_of_it(bench):
    bench.set_up()
    bench.inverter.enable()
    position = next(at for action, _, at in bench.journal if action is Action.ENERGISE)
    assert ("control_word", "000f") not in bench.drive.log[:position]
    assert ("control_word", "000f") in bench.drive.log[position:]


def test_a_journal_that_cannot_write_keeps_the_motor_dead(bench):
    bench.set_up()

    def full(intent):
        if intent.action is Action.ENERGISE:
            raise OSError("no space left on device")

    bench.inverter.journal = full
    with pytest.raises(OSError, match="no space"):
        bench.inverter.enable()
    assert "000f" not in bench.drive.written("control_word")


def open_interlock(drive):
    drive.put("interlocks", 0b11110)


def present_fault(drive):
    drive.put("fault_code", 3)


def lost_watchdog(drive):
    drive.put("watchdog_ms", 0)


def other_limit(drive):
    drive.put("current_limit_a", 50.0)


def already_on(drive):
    drive.state = "enabled"


def slow_link(drive):
    drive.reply_timeout_s = 0.5


@pytest.mark.parametrize(
    ("spoil", "what"),
    [
        (open_interlock, "interlock sto_released is open"),
        (present_fault, "the drive reports: earth fault"),
        (already_on, "energised already"),
        (slow_link, "outlast the watchdog"),
    ],
)
def test_nothing_is_energised_unless_everything_holds(bench, spoil, what):
    bench.set_up()
    spoil(bench.drive)
    with pytest.raises(CheckFailed, match=what):
        bench.inverter.enable()
    assert bench.drive.written("control_word") == []


def test_a_drive_that_was_not_set_up_is_not_energised(bench):
    with pytest.raises(CheckFailed, match="not set up"):
        bench.inverter.enable()
    bench.inverter.set_watchdog(500)
    with pytest.raises(CheckFailed, match="not set up"):
        bench.inverter.enable()


@pytest.mark.parametrize(
    ("spoil", "what"),
    [(lost_watchdog, "watchdog_ms from 500 to 0"), (other_limit, "current_limit_a from 8 to 50")],
)
@pytest.mark.parametrize("counts", [True, False])
def test_another_master_is_named_with_what_it_changed_before_anything_is_energised(bench, spoil, what, counts):
    bench.set_up()
    bench.inverter.read_status()
    spoil(bench.drive)
    if counts:
        bench.drive.put("settings_count", bench.drive.get("settings_count") + 1)
    else:
        bench.inverter._items.watched.look_again()
    with pytest.raises(ForeignMaster, match=f"another master wrote to the drive: it changed {what}"):
        bench.inverter.enable()
    assert bench.drive.written("control_word") == []


def test_a_drive_that_does_not_follow_is_a_fault_within_the_deadline(bench):
    bench.set_up()
    bench.drive.deaf_to.add("control_word")
    with pytest.raises(DriveFault, match="does not reach 'ready to switch on'"):
        bench.inverter.enable()
    assert bench.now < 2.0


def test_a_trip_while_enabling_is_told_with_value_and_limit(bench):
    bench.set_up()

    def trip(name, words):
        if name == "control_word" and words == (0x0F,):
            bench.drive.state = "fault"
            bench.drive.put("trip_cause", 1)
            bench.drive.put("trip_value", 9.0)
            bench.drive.put("trip_limit", 8.0)

    bench.drive.on_write = trip
    with pytest.raises(DriveFault, match="over-current") as caught:
        bench.inverter.enable()
    assert (caught.value.value, caught.value.limit) == (9.0, 8.0)


# --- stream and steer ---------------------------------------------------------------------------------------
def running(bench, count=100):
    bench.set_up()
    cursor = bench.inverter.enable()
    bench.drive.samples = [(k, 2 * k, 3 * k) for k in range(count)]
    return cursor


def test_the_stream_comes_whole_and_every_fetch_feeds_the_watchdog(bench):
    cursor = running(bench)
    beats = len(bench.drive.written("heartbeat"))
    received = []
    while (window := bench.inverter.fetch(cursor)).block is not None:
        received.append(window.block.current_u_a)
        cursor = window.cursor
    np.testing.assert_allclose(np.concatenate(received), 0.002 * np.arange(100))
    heartbeats = bench.drive.written("heartbeat")[beats:]
    assert len(heartbeats) == len(set(heartbeats)) == 4


def test_a_lost_answer_costs_no_sample_and_no_heartbeat_is_sent_twice(bench):
    cursor = running(bench)
    bench.drive.failures.append(timeout())
    window = bench.inverter.fetch(cursor)
    assert (window.block.first_index, window.block.lost_before) == (0, 0)
    beats = bench.drive.written("heartbeat")
    assert len(beats) == len(set(beats))


def test_two_lost_answers_in_a_row_end_the_stream(bench):
    cursor = running(bench)
    bench.drive.failures.extend([timeout(), timeout()])
    with pytest.raises(ReplyTimeout):
        bench.inverter.fetch(cursor)


def test_the_window_of_another_session_is_never_taken(bench):
    cursor = running(bench)
    bench.drive.put("session_id", 55)
    with pytest.raises(ReplyMismatch, match="another session") as caught:
        bench.inverter.fetch(cursor)
    assert (caught.value.value, caught.value.limit) == (55, 101)


def test_overrun_samples_are_counted(bench):
    cursor = running(bench)
    bench.drive.first_kept = 30
    window = bench.inverter.fetch(cursor)
    assert (window.block.first_index, window.block.lost_before, window.is_overrun) == (30, 30, True)


def test_the_end_of_the_session_is_told(bench):
    cursor = running(bench, count=10)
    bench.drive.has_ended = True
    window = bench.inverter.fetch(cursor)
    assert window.has_ended and window.block.count == 10


def test_steering_is_journalled_first_and_read_back(bench):
    running(bench)
    bench.inverter.set_scale(0.5)
    bench.inverter.set_bias(-3.0)
    assert (bench.drive.get("amplitude_scale"), bench.drive.get("dc_bias_v")) == (0.5, -3.0)
    assert [values for action, values, _ in bench.journal if action is Action.STEER] == [
        {"amplitude_scale": 0.5},
        {"dc_bias_v": -3.0},
    ]
    bench.drive.deaf_to.add("amplitude_scale")
    with pytest.raises(DriveFault, match="acknowledged amplitude_scale"):
        bench.inverter.set_scale(0.6)


@pytest.mark.parametrize("scale", [-0.1, 1.0001, float("nan")])
def test_a_scale_outside_the_fraction_never_reaches_the_wire(bench, scale):
    running(bench)
    before = len(bench.drive.log)
    with pytest.raises(UsageError):
        bench.inverter.set_scale(scale)
    assert len(bench.drive.log) == before


def test_while_energised_no_read_is_repeated_and_afterwards_as_before(bench):
    bench.drive.read_retries = 1
    bench.inverter = Inverter(bench.drive, PROFILE, sleep=bench.sleep, clock=lambda: bench.now)
    patient_s = bench.drive.patience_s
    assert patient_s > 2 * bench.drive.reply_timeout_s
    running(bench)
    assert (bench.drive.read_retries, bench.drive.patience_s) == (0, 0.0)
    assert bench.inverter.disarm().is_confirmed
    assert (bench.drive.read_retries, bench.drive.patience_s) == (1, patient_s)


# --- de-energise --------------------------------------------------------------------------------------------
def test_disarm_is_confirmed_by_the_drives_own_status(bench):
    running(bench)
    report = bench.inverter.disarm()
    assert report.is_confirmed and bench.drive.state == "disabled"
    assert not report.waited_for_watchdog
    assert bench.inverter.disarm().is_confirmed


def test_disarm_is_legal_before_anything_else(bench):
    assert bench.inverter.disarm().is_confirmed


@pytest.mark.parametrize("lost", [1, 2, 3, 4])
def test_disarm_goes_on_over_lost_answers(bench, lost):
    running(bench)
    bench.drive.failures.extend([timeout()] * lost)
    assert bench.inverter.disarm().is_confirmed
    assert bench.drive.state in ("disabled", "ready")


def test_a_drive_deaf_to_one_word_is_stopped_by_another(bench):
    running(bench)
    original = bench.drive._command
    bench.drive._command = lambda word: original(word) if word == 0x02 else None
    report = bench.inverter.disarm()
    assert report.is_confirmed and bench.drive.state == "disabled"
    assert [a.path for a in report.attempts if a.path != "read the status"][:2] == ["disable voltage", "quick stop"]


def test_a_drive_deaf_to_all_is_left_to_its_watchdog_and_the_report_says_what_was_seen(bench):
    running(bench)
    bench.drive.deaf_to |= {"control_word", "mode"}
    report = bench.inverter.disarm()
    assert report.waited_for_watchdog and not report.is_confirmed
    assert bench.now >= 0.5
    assert {"disable voltage", "quick stop", "shut down", "leave the test mode"} <= {a.path for a in report.attempts}


def test_the_watchdogs_work_is_confirmed_when_the_drive_is_back(bench):
    running(bench)
    bench.drive.deaf_to |= {"control_word", "mode"}
    original = bench.sleep

    def bite(seconds):
        bench.drive.state = "fault" if seconds > 0.4 else bench.drive.state
        original(seconds)

    bench.inverter.sleep = bite
    report = bench.inverter.disarm()
    assert report.is_confirmed and report.waited_for_watchdog


def test_a_dead_link_never_makes_disarm_raise(bench):
    running(bench)
    gone = LinkUnreachable("no connection", step="test", value=None, limit=None, remedy="none")
    bench.drive.failures.extend([gone] * 50)
    report = bench.inverter.disarm()
    assert not report.is_confirmed
    assert all(attempt.outcome == "no connection" for attempt in report.attempts)


def test_a_status_word_that_no_table_explains_confirms_nothing(bench):
    running(bench)
    bench.drive._refresh = lambda: bench.drive.put("status_word", 0x0001)
    assert not bench.inverter.disarm().is_confirmed


def test_a_refused_stop_is_reported_and_the_next_path_taken(bench):
    running(bench)
    bench.drive.refuses["control_word"] = 4
    report = bench.inverter.disarm()
    assert "exception 4" in report.attempts[0].outcome
    with pytest.raises(RequestRefused):
        bench.drive.write(bench.drive.items["control_word"]["address"], [0])


def test_a_commercial_drive_is_never_energised():
    drive = ScriptedDrive()
    inverter = Inverter(drive, load_profile("danfoss_fc302"))
    with pytest.raises(UsageError, match="cannot excite"):
        inverter.enable()
    with pytest.raises(CheckFailed, match="watchdog cannot be set"):
        inverter.set_watchdog(500)
    assert inverter.disarm().is_confirmed
    assert drive.log == []


@pytest.mark.parametrize("error", [ValueError("a defect"), OSError(5, "Input/output error"), TypeError("a defect")])
def test_what_breaks_one_path_of_disarm_does_not_keep_it_from_the_next(bench, error, monkeypatch):
    whole, calls = bench.inverter.port.write, []

    def broken_once(address, values):
        calls.append(values)
        if len(calls) == 1:
            raise error
        whole(address, values)

    monkeypatch.setattr(bench.inverter.port, "write", broken_once)
    report = bench.inverter.disarm()
    assert report.is_confirmed and len(calls) > 1
    assert type(error).__name__ in report.attempts[0].outcome


# --- an answer that was lost, a drive that is still at work -----------------------------------------------------
def test_a_write_whose_answer_was_lost_is_looked_at_and_not_repeated(bench):
    bench.drive.fails_after_acting = True
    bench.drive.failures.append(timeout())
    bench.inverter.set_watchdog(500)
    assert bench.drive.get("watchdog_ms") == 500
    assert len(bench.drive.written("watchdog_ms")) == 1


def test_a_write_that_was_lost_on_the_way_is_the_error_that_it_is(bench):
    bench.drive.failures.append(timeout())
    with pytest.raises(ReplyTimeout):
        bench.inverter.set_watchdog(500)


def test_steering_whose_answer_was_lost_goes_on_where_the_drive_took_it(bench):
    bench.set_up()
    bench.drive.fails_after_acting = True
    bench.drive.failures.append(timeout())
    bench.inverter.set_scale(0.5)
    assert bench.drive.get("amplitude_scale") == 0.5
    bench.drive.fails_after_acting = False
    bench.drive.failures.append(timeout())
    with pytest.raises(ReplyTimeout):
        bench.inverter.set_scale(0.7)


@pytest.mark.parametrize("was_done", [True, False])
@pytest.mark.parametrize("name", ["limits", "stop"])
def test_a_write_of_ours_whose_answer_was_lost_is_no_other_masters(bench, name, was_done):
    running(bench)
    if name == "limits":
        bench.inverter.disarm()
    bench.drive.fails_after_acting = was_done
    bench.drive.failures.append(timeout())
    if name == "stop":
        assert bench.inverter.disarm().is_confirmed
    else:
        with nullcontext() if was_done else pytest.raises(ReplyTimeout):
            bench.inverter.set_limits(current_a=5.0, voltage_v=90.0, time_s=60.0)
    bench.inverter.read_status()
    other_limit(bench.drive)
    bench.drive.put("settings_count", bench.drive.get("settings_count") + 1)
    with pytest.raises(ForeignMaster, match=r"changed current_limit_a from [58] to 50"):
        bench.inverter.read_status()


def test_a_setting_whose_first_writes_answer_was_lost_is_watched_all_the_same(bench):
    bench.inverter.set_watchdog(500)
    bench.drive.fails_after_acting = True
    bench.drive.failures.append(timeout())
    bench.inverter.set_limits(current_a=8.0, voltage_v=90.0, time_s=60.0)
    bench.inverter.read_status()
    other_limit(bench.drive)
    bench.drive.put("settings_count", bench.drive.get("settings_count") + 1)
    with pytest.raises(ForeignMaster, match="changed current_limit_a from 8 to 50"):
        bench.inverter.read_status()


@pytest.mark.parametrize("code", [5, 11])
def test_a_write_that_may_be_carried_out_is_judged_by_what_the_drive_holds(bench, code):
    bench.drive.refuses["test_time_limit_s"] = code
    with pytest.raises(DriveFault, match="acknowledged test_time_limit_s"):
        bench.inverter.set_limits(current_a=8.0, voltage_v=90.0, time_s=60.0)
    bench.drive.refuses["test_time_limit_s"] = 3
    with pytest.raises(RequestRefused):
        bench.inverter.set_limits(current_a=8.0, voltage_v=90.0, time_s=60.0)
