"""What a recording shows before any model: limits, steps, holes, axes; poor ones are masked or refused with a reason."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.diagnose.intake.audit import excited_lines, prepare
from tests.unit.diagnose.conftest import recording


def measured(noise=0.01, seed=3, **about):
    """A recording whose currents follow the command through a resistance along each axis, with noise."""
    blank = recording(**about)
    random = np.random.default_rng(seed)
    shape = np.cos(np.deg2rad(np.array([[0.0], [120.0], [240.0]]) - blank.axis_deg))
    rows = 0.1 * shape * blank.voltage_axis_v + noise * random.standard_normal((3, blank.time_s.size))
    return replace(blank, current_u_a=rows[0], current_v_a=rows[1], current_w_a=rows[2])


def limited(source, limit):
    return replace(source, current_u_a=np.clip(source.current_u_a, -limit, limit))


def test_a_hard_limit_is_found_to_the_last_digit_and_its_samples_are_masked():
    record, audit = prepare([limited(measured(), 4.0)])
    assert audit.clipped["limit_a"] == 4.0
    bad = sum(int((~s.is_good).sum()) for s in record.segments)
    assert bad == audit.clipped["samples"] == (np.abs(limited(measured(), 4.0).current_u_a) >= 4.0).sum()


@pytest.mark.parametrize("seed", range(8))
def test_an_unlimited_current_is_not_called_clipped(seed):
    assert prepare([measured(noise=0.02 / 2**seed, seed=seed)])[1].clipped == {}


def test_a_current_resting_under_a_constant_command_is_not_called_clipped():
    source = measured(noise=0.0)
    still = np.repeat(source.voltage_axis_v[::1500], 1500)[: source.time_s.size]
    assert prepare([replace(source, voltage_axis_v=still, current_u_a=np.round(0.1 * still, 2))])[1].clipped == {}


def test_coarse_converter_steps_are_measured():
    source = measured()
    rows = [np.round(c / 0.05) * 0.05 for c in (source.current_u_a, source.current_v_a, source.current_w_a)]
    _, audit = prepare([replace(source, current_u_a=rows[0], current_v_a=rows[1], current_w_a=rows[2])])
    assert audit.step_a == pytest.approx((0.05, 0.05, 0.05), rel=1e-3)
    assert prepare([source])[1].step_a == (0.0, 0.0, 0.0)


def cut(source, gone):
    keep = np.setdiff1d(np.arange(source.time_s.size), gone)
    names = (
        "time_s",
        "segment",
        "axis_deg",
        "voltage_axis_v",
        "current_u_a",
        "current_v_a",
        "current_w_a",
        "dc_link_v",
    )
    return replace(source, **{n: getattr(source, n)[keep] for n in names})


def test_a_short_hole_is_bridged_with_masked_samples_and_a_long_one_starts_a_new_stretch():
    record, audit = prepare([cut(measured(), np.arange(2000, 2003))])
    assert len(record.segments) == 3 and audit.holes[0][2] == 3
    assert sum(int((~s.is_good).sum()) for s in record.segments) == 3
    record, audit = prepare([cut(measured(), np.arange(2000, 2100))])
    assert len(record.segments) == 4 and audit.holes[0][2] == 100
    assert any("missing" in sentence for sentence in audit.sentences)


def test_one_tone_is_said_to_carry_little():
    source = measured()
    t = source.time_s
    one = replace(source, voltage_axis_v=20.0 * np.sin(2 * np.pi * 30.0 * t))
    assert any("single tone" in sentence for sentence in prepare([one])[1].sentences)


def test_of_a_long_rest_before_the_first_command_the_last_second_is_kept_and_parts_begin_with_the_command():
    source = measured(seconds=2.4)
    period, starts = source.sample_period_s, np.r_[True, np.diff(source.segment) != 0]
    since = np.arange(source.segment.size) - np.flatnonzero(starts)[np.cumsum(starts) - 1]
    silent = np.where(source.segment == source.segment[0], since * period < 1.3, since == 0)
    record, _ = prepare([replace(source, voltage_axis_v=np.where(silent, 0.0, source.voltage_axis_v + 1e-9))])
    assert [s.idle for s in record.segments] == [round(1.0 / period), *(1 for _ in record.segments[1:])]
    part = record.first(100)
    assert [s.count for s in part.segments] == [s.idle + 100 for s in record.segments]
    assert [s.count for s in record.first(part.commanded).segments] == [s.count for s in part.segments]


def test_a_random_binary_command_has_no_tones_and_tones_beside_it_keep_theirs():
    """Thousands of lines are no tones: any two of them make every ripple's frequency, and looking at them all took minutes."""
    tones, random = recording(seconds=6.0), np.random.default_rng(3)
    levels = np.repeat(random.choice([-30.0, 30.0], tones.time_s.size // 4 + 1), 4)[: tones.time_s.size]
    assert excited_lines(prepare([replace(tones, voltage_axis_v=levels)])[0]) == []
    one = np.where(tones.segment == 1, 0.3 * levels, tones.voltage_axis_v)
    assert excited_lines(prepare([replace(tones, voltage_axis_v=one)])[0]) == pytest.approx([2.3, 41.9, 331.7], abs=0.1)


def test_what_carries_nothing_is_refused_with_the_reason():
    source = measured()
    zero = np.zeros(source.time_s.size)
    assert "zero" in prepare([replace(source, current_u_a=zero, current_v_a=zero, current_w_a=zero)])[1].refusal.what
    assert "constant" in prepare([replace(source, voltage_axis_v=zero)])[1].refusal.what
    rows = [np.clip(c, -0.5, 0.5) for c in (source.current_u_a, source.current_v_a, source.current_w_a)]
    most = replace(source, current_u_a=rows[0], current_v_a=rows[1], current_w_a=rows[2])
    assert "clipped" in prepare([most])[1].refusal.what
    assert prepare([source])[1].refusal is None


@pytest.mark.parametrize(
    ("volts", "amps", "said"),
    [(1.0, 1000.0, "times the rated peak"), (1e-3, 1.0, "rated impedance"), (1.0, 1e-3, "rated impedance")],
)
def test_units_that_no_motor_of_the_nameplate_has_are_refused(volts, amps, said):
    source = measured()
    rows = {f"current_{p}_a": amps * getattr(source, f"current_{p}_a") for p in "uvw"}
    _, audit = prepare([replace(source, voltage_axis_v=volts * source.voltage_axis_v, **rows)])
    assert said in audit.refusal.what and "unit" in audit.refusal.remedy


def test_of_a_long_record_the_first_part_of_every_segment_is_used(monkeypatch):
    monkeypatch.setattr("commissioner.diagnose.intake.audit.MOST_SAMPLES", 9000)
    record, audit = prepare([measured()])
    assert [s.count - s.idle for s in record.segments] == [3000] * 3
    assert any("first 0.6 s of every segment" in sentence for sentence in audit.sentences)
