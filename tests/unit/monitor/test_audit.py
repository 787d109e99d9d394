"""The audit says what is wrong with a recording, puts right what has one explanation, and refuses the rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from commissioner.monitor.chain import Refused, Wishes, observe
from commissioner.monitor.intake.audit import inspect, measure_fundamental
from commissioner.monitor.intake.clock import hidden_jitter, whole_stretch
from commissioner.monitor.intake.findings import Findings
from commissioner.monitor.signals.supply import follow_supply
from commissioner.motor.channels.ends import clipped
from commissioner.motor.running import from_nameplate
from commissioner.operations.recordings.stretches import in_its_states
from commissioner.records import RunningRecording
from tests.support.running import refused_in, rewired, seen_in, taken, taken_with, without

SHORT = 8.0


def audited(recording: RunningRecording):
    plate = taken("running_compressor", 1, SHORT)[1]
    return inspect(recording, plate, from_nameplate(plate))


def codes(found) -> set[tuple[str, str]]:
    return {(finding.kind, finding.code) for finding in found.findings}


@pytest.mark.parametrize(
    ("order", "signs", "code"),
    [
        ((1, 0, 2, 3, 4, 5), (1,) * 6, "crossed_channels"),
        ((1, 2, 0, 3, 4, 5), (1,) * 6, "crossed_channels"),
        ((2, 1, 0, 3, 4, 5), (1,) * 6, "crossed_channels"),
        ((0, 1, 2, 4, 3, 5), (1,) * 6, "crossed_channels"),
        ((0, 1, 2, 5, 3, 4), (1,) * 6, "crossed_channels"),
        ((3, 1, 2, 0, 4, 5), (1,) * 6, "crossed_channels"),
        ((0, 1, 2, 3, 4, 5), (-1, -1, -1, 1, 1, 1), "polarity"),
        ((0, 1, 2, 3, 4, 5), (1, -1, 1, 1, 1, 1), "polarity"),
        ((0, 1, 2, 3, 4, 5), (1, 1, 1, 1, 1, -1), "polarity"),
        ((0, 2, 1, 3, 5, 4), (1,) * 6, "phase_order"),
    ],
)
def test_miswired_channels_are_put_right_and_reported(order, signs, code) -> None:
    recording, *_ = taken("running_compressor", 1, SHORT)
    right, found = audited(recording), audited(rewired(recording, order, signs))
    assert found.refusal is None
    assert ("corrected", code) in codes(found)
    assert found.fundamental.power_w == pytest.approx(right.fundamental.power_w, rel=2e-3)
    assert found.fundamental.reactive_var == pytest.approx(right.fundamental.reactive_var, rel=2e-3)


def test_a_right_recording_is_left_alone() -> None:
    found = audited(taken("running_compressor", 1, SHORT)[0])
    assert found.findings == ()
    assert found.fundamental.voltage_unbalance == pytest.approx(0.03, abs=0.002)
    assert found.fundamental.frequency_hz == pytest.approx(50.0, abs=0.06)


@pytest.mark.parametrize("order", [(0, 1, 2, 3, 4, 5), (0, 2, 1, 3, 4, 5), (0, 1, 2, 4, 5, 3)])
def test_line_to_line_voltages_are_paired_as_well(order) -> None:
    recording, plate, _ = taken_with("running_compressor", 1, SHORT, {"sensing": {"line_to_line": True}})
    found = inspect(rewired(recording, order), plate, from_nameplate(plate))
    right = audited(taken("running_compressor", 1, SHORT)[0])
    assert found.refusal is None
    assert found.fundamental.power_w == pytest.approx(right.fundamental.power_w, rel=5e-3)


def test_one_phase_measured_twice_is_refused() -> None:
    recording, plate, _ = taken("running_compressor", 1, SHORT)
    assert refused_in(rewired(recording, (0, 0, 2, 3, 4, 5)), plate).reason.code == "phase_spacing"


def test_a_dead_channel_is_refused_by_name() -> None:
    recording, plate, _ = taken("running_compressor", 1, SHORT)
    v = recording.voltages_v
    reason = refused_in(replace(recording, voltages_v=(v[0], np.zeros(v[0].size), v[2])), plate).reason
    assert reason.code == "dead_channel" and "voltage channel v" in reason.what


def test_a_third_current_follows_from_two() -> None:
    recording, plate, _ = taken("running_compressor", 1, SHORT)
    i = recording.currents_a
    seen = inspect(
        replace(recording, currents_a=(i[0], np.full(i[0].size, np.nan), i[2])), plate, from_nameplate(plate)
    )
    whole = inspect(recording, plate, from_nameplate(plate))
    assert [f.code for f in seen.findings if f.kind == "corrected"] == ["third_current"]
    assert abs(seen.fundamental.current_a / whole.fundamental.current_a - 1) < 1e-3


@pytest.mark.parametrize("factor", [1000.0, 0.05])
def test_currents_that_this_motor_cannot_draw_are_refused(factor: float) -> None:
    recording, plate, _ = taken("running_compressor", 1, SHORT)
    i = recording.currents_a
    scaled = replace(recording, currents_a=(factor * i[0], factor * i[1], factor * i[2]))
    assert refused_in(scaled, plate).reason.code == "current_level"


def test_phase_voltages_under_line_to_line_names_are_refused() -> None:
    recording, plate, _ = taken("running_compressor", 1, SHORT)
    assert refused_in(replace(recording, voltages_are_line_to_line=True), plate).reason.code == "voltage_level"


def test_milliseconds_read_as_seconds_are_refused() -> None:
    recording, plate, _ = taken("running_compressor", 1, SHORT)
    slow = replace(recording, time_s=1000 * recording.time_s, sample_period_s=0.125)
    assert refused_in(slow, plate).reason.code == "sample_rate"


@pytest.mark.parametrize("rows", [0, 1, 20])
def test_a_handful_of_rows_is_refused(rows: int) -> None:
    recording, plate, _ = taken("running_compressor", 1, SHORT)
    few = without(recording, np.arange(recording.time_s.size) < rows)
    assert refused_in(few, plate).reason.code == "too_short"


def test_time_that_stands_still_is_refused() -> None:
    recording, plate, _ = taken("running_compressor", 1, SHORT)
    assert refused_in(replace(recording, time_s=0 * recording.time_s), plate).reason.code == "time_order"


@pytest.mark.parametrize("group", ["currents_a", "voltages_v"])
def test_clipped_channels_are_refused(group) -> None:
    recording, plate, _ = taken("running_compressor", 1, SHORT)
    signals = getattr(recording, group)
    limit = 0.97 * max(float(np.abs(s).max()) for s in signals)
    cut = tuple(np.clip(s, -0.9 * limit, 0.9 * limit) for s in signals)
    assert refused_in(replace(recording, **{group: cut}), plate).reason.code == "clipped_channel"


def test_a_coarse_converter_is_not_taken_for_clipping() -> None:
    sine = np.sin(2 * np.pi * 50 * np.arange(80000) / 8000)
    assert clipped(np.round(sine * 100) / 100)[1] < 0.002
    assert clipped(np.clip(sine, -0.95, 0.95))[1] > 0.1


def test_scattered_lost_samples_are_refused_and_counted() -> None:
    recording, plate, _ = taken("running_compressor", 1, SHORT)
    keep = np.random.default_rng(3).uniform(size=recording.time_s.size) > 0.01
    reason = refused_in(without(recording, keep), plate).reason
    assert reason.code == "missing_samples"


def test_one_hole_leaves_the_longer_whole_part_and_is_reported() -> None:
    recording, plate, truth = taken("running_compressor", 1, 30.0)
    keep = np.abs(recording.time_s - 10.0) > 0.2
    seen = seen_in(without(recording, keep), plate)
    assert ("note", "missing_samples") in {(f.kind, f.code) for f in seen.findings}
    assert seen.audited.start_s > 10.0
    assert seen.mean_speed_rad_per_s == pytest.approx(truth["mean_speed_rad_per_s"], rel=1e-3)


def test_samples_that_are_no_numbers_count_as_missing() -> None:
    recording, *_ = taken("running_compressor", 1, SHORT)
    current = recording.currents_a[1].copy()
    current[5000:5010] = np.nan
    found = audited(replace(recording, currents_a=(recording.currents_a[0], current, recording.currents_a[2])))
    assert ("note", "missing_samples") in codes(found)
    assert found.first_sample == 5010


def test_wandering_time_stamps_are_refused() -> None:
    recording, plate, _ = taken("running_compressor", 1, SHORT)
    stamps = recording.time_s + 2e-5 * np.random.default_rng(5).standard_normal(recording.time_s.size)
    assert refused_in(replace(recording, time_s=np.sort(stamps)), plate).reason.code == "clock_jitter"


def test_printed_digits_are_not_taken_for_jitter() -> None:
    recording, *_ = taken("running_compressor", 1, SHORT)
    found = audited(replace(recording, time_s=np.round(recording.time_s, 4)))
    assert found.refusal is None
    assert not any(code == "clock_jitter" for _, code in codes(found))
    assert found.sample_period_s == pytest.approx(1.25e-4, rel=1e-6)


def test_jitter_behind_regular_stamps_is_measured() -> None:
    recording, plate, _ = taken_with("running_compressor", 1, SHORT, {"sensing": {"clock_jitter_s": 25e-6}})
    found = inspect(recording, plate, from_nameplate(plate))
    note = next(f for f in found.findings if f.code == "clock_jitter")
    assert note.kind == "note"
    assert note.value == pytest.approx(0.2, abs=0.05)  # 25 us of 125 us


@pytest.mark.parametrize(("jitter", "said"), [(0.0, 0.0), (0.2, 0.2)])
def test_harmonics_of_the_mains_are_no_jitter(jitter, said):
    """A fifth and a seventh that turn the vector together, at 35 samples a period."""
    period, noise = 1 / 2100, np.random.default_rng(3)
    t = np.arange(12000) * period
    at = 120 * np.pi * (t + jitter * period * noise.standard_normal(t.size))
    v = 300.0 * (np.exp(1j * at) + 0.05 * np.exp(-5j * at) - 0.05 * np.exp(7j * at)) + noise.standard_normal(
        (2, t.size)
    ).T @ [0.5, 0.5j]
    supply = follow_supply(v, period, 60.0)
    fundamental = measure_fundamental(v, v, supply, period, backwards=False)
    findings = Findings()
    hidden_jitter(v, supply, fundamental, period, findings)
    assert sum(f.value for f in findings) == pytest.approx(said, rel=0.1)


def test_too_short_a_recording_is_refused_but_its_fundamental_is_reported() -> None:
    recording, plate, _ = taken("running_compressor", 1, SHORT)
    refused = refused_in(without(recording, recording.time_s < 0.5), plate)
    assert refused.reason.code == "too_short"
    assert refused.audited.fundamental.frequency_hz == pytest.approx(50.0, abs=0.1)


def test_an_inverter_with_a_moving_set_point_is_refused() -> None:
    recording, plate, _ = taken("running_inverter_varying", 1, 30.0)
    assert refused_in(recording, plate).reason.code == "frequency_wander"


def test_a_switched_voltage_is_refused() -> None:
    recording, plate, _ = taken_with("running_inverter", 1, SHORT, {"sensing": {"pwm_ripple": 0.5}})
    assert refused_in(recording, plate).reason.code == "switched_voltage"


def test_line_to_line_voltages_under_phase_names_are_refused() -> None:
    recording, plate, _ = taken("running_compressor", 1, SHORT)
    u, v, w = recording.voltages_v
    assert refused_in(replace(recording, voltages_v=(u - v, v - w, w - u)), plate).reason.code in {
        "voltage_level",
        "pairing",
    }


def test_peak_values_for_rms_ones_are_refused_of_voltages_and_said_of_currents() -> None:
    recording, plate, _ = taken("running_compressor", 1, SHORT)
    u, v, w = (np.sqrt(2.0) * x for x in recording.voltages_v)
    reason = refused_in(replace(recording, voltages_v=(u, v, w)), plate).reason
    assert reason.code == "voltage_level" and "peak for rms" in reason.what
    u, v, w = (np.sqrt(2.0) * x for x in recording.currents_a)
    said = {f.code: f.what for f in seen_in(replace(recording, currents_a=(u, v, w)), plate).audited.findings}
    assert "a peak value taken for an rms one" in said["plate_doubt"]
    assert ("note", "plate_doubt") not in codes(seen_in(recording, plate).audited)


@pytest.mark.parametrize("factor", [1e3, 1e6])
def test_times_in_other_units_are_refused_however_far_apart_the_samples_are(factor) -> None:
    recording, plate, _ = taken("running_compressor", 1, SHORT)
    slow = replace(
        recording, time_s=factor * np.asarray(recording.time_s), sample_period_s=factor * recording.sample_period_s,
        metadata={},
    )  # fmt: skip
    seen, _, _ = in_its_states(slow, plate, Wishes())
    assert isinstance(seen, Refused) and seen.reason.code == "sample_rate"


def test_noise_without_a_motor_is_refused_not_answered() -> None:
    recording, plate, _ = taken("running_compressor", 1, SHORT)
    rng = np.random.default_rng(1)
    noise = [rng.standard_normal(recording.time_s.size) for _ in range(6)]
    silent = replace(recording, currents_a=tuple(noise[:3]), voltages_v=tuple(noise[3:]))
    assert refused_in(silent, plate).reason.kind == "refused"


@pytest.mark.parametrize("scale", [0.005, 0.05, 1.0])
def test_a_voltage_that_no_such_motor_is_run_at_is_named_where_nothing_turns(scale) -> None:
    recording, plate, *_ = taken("running_compressor", 1, SHORT)
    time = np.asarray(recording.time_s)
    rng = np.random.default_rng(3)

    def waves(size: float, lag: float) -> tuple[np.ndarray, ...]:
        noise = 1e-3 * size * rng.standard_normal((3, time.size))
        turns = [2 * np.pi * (50.0 * time - k / 3) - lag for k in range(3)]
        return tuple(size * np.cos(turn) + noise[k] for k, turn in enumerate(turns))

    still = replace(
        recording, currents_a=waves(plate.rated_current_a, 0.6),
        voltages_v=waves(scale * plate.rated_voltage_v * np.sqrt(2 / 3), 0.0), speed_rad_per_s=None,
    )  # fmt: skip
    code = "no_period" if scale == 1.0 else "plate_contradiction"
    assert observe(still, plate).reason.code == code


@pytest.mark.parametrize(("phase", "factor"), [(0, 2.0), (2, 0.5), (1, 1.6)])
def test_a_current_of_another_range_is_refused_by_its_name_and_factor(phase, factor) -> None:
    recording = taken("running_compressor", 1, SHORT)[0]
    currents = tuple(factor * i if k == phase else i for k, i in enumerate(recording.currents_a))
    (found,) = [f for f in audited(replace(recording, currents_a=currents)).findings if f.code == "open_sum"]
    assert found.stops and f"current {'uvw'[phase]} is" in found.what
    assert found.value == pytest.approx(factor, rel=0.02)


@pytest.mark.parametrize(("samples", "is_enough"), [(1000, True), (999, True), (990, False)])
def test_two_seconds_are_two_seconds_to_a_sample(samples: int, is_enough: bool) -> None:
    """A period of printed times had made 1.99999999999978 s of them: "holds 2 s ... at least 2 s"."""
    period = 2e-3 * (1.0 - 1e-13)
    time = np.arange(samples) * period
    waves = tuple(np.cos(314.0 * time - 2.0 * k) for k in range(3))
    findings = Findings()
    whole_stretch(RunningRecording(time, waves, waves, False, None, period), findings)
    assert ([f.code for f in findings] == []) == is_enough
    assert is_enough or "holds 1.98 s" in findings[0].what
