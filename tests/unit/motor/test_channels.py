"""What channels get wrong by themselves is put right or named, and what they do right is left alone."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from commissioner.errors import DataRefused
from commissioner.estimation.record import prepare, scales_of
from commissioner.motor.channels.clock import of_speed_gain, off_mains, turn_a_row
from commissioner.motor.channels.ends import clipped, runs_into, unwrapped
from commissioner.motor.channels.faults import no_lines, put_on_time, put_right, put_right_at_rest
from commissioner.motor.channels.late import late, shifted
from commissioner.motor.channels.rows import written_twice
from commissioner.motor.channels.spikes import without_spikes
from commissioner.motor.computed import is_negative_sum
from commissioner.records import StandstillRecording
from sim.motoring.recording import record
from tests.running_effects.cases import Case, as_plate, as_recording, taken

AT_MOTOR = Case(5000, "null").scenario()


@pytest.fixture(scope="module")
def start():
    recording, plate, _ = taken(AT_MOTOR, 5000)
    return recording, plate


@pytest.fixture(scope="module")
def without_noise():
    """The same start at 40 kHz as sensors without noise would see it: what a converter takes late is in it."""
    fine = replace(
        AT_MOTOR, course=replace(AT_MOTOR.course, duration_s=1.0, rate_hz=40e3),
        sensors=replace(AT_MOTOR.sensors, current_noise_a=0.0, voltage_noise_v=0.0),
    )  # fmt: skip
    columns, metadata, _ = record(fine, 5000)
    return as_recording(columns, metadata), as_plate(metadata)


def with_channel(recording, kind, k, change):
    """`change` of the three channels stands in the place of channel k."""
    group = list(getattr(recording, kind))
    group[k] = change(*group)
    return replace(recording, **{kind: tuple(group)})


def seen_of(recording):
    return {n.code: n.what for n in put_right(recording).notes}


def peaks(plate):
    scales = scales_of(plate)
    return scales.current_a, scales.voltage_v


@pytest.mark.parametrize(
    ("kind", "k", "change", "says"),
    [
        ("currents_a", 1, lambda u, v, w: u, "currents u and v are one and the same"),
        ("currents_a", 2, lambda u, v, w: 10.0 * w, "current w is 10 times what the other two leave for it"),
        ("currents_a", 0, lambda u, v, w: 1.6 * u, "current u is 1.6 times"),
        ("currents_a", 0, lambda u, v, w: -0.5 * u, "(its sign is turned)"),
        ("currents_a", 0, lambda u, v, w: np.abs(u), "one of them at least is something else"),
        ("currents_a", 1, lambda u, v, w: 0.02 * np.random.default_rng(1).standard_normal(u.size), "something else"),
        ("voltages_v", 0, lambda u, v, w: v, "voltages u and v are one and the same"),
        ("voltages_v", 2, lambda u, v, w: 0.1 * w, "voltage w is 0.1 times what the other two leave for it"),
    ],
)
def test_channels_that_are_no_lines_of_one_motor_are_named(start, kind, k, change, says):
    recording, plate = start
    assert no_lines(recording, *peaks(plate)) is None
    with pytest.raises(DataRefused) as refused:
        prepare([with_channel(recording, kind, k, change)], plate)
    assert says in refused.value.what and "add up to zero" in refused.value.what


def test_a_gain_that_a_cause_can_name_and_an_offset_are_left_to_the_causes(start):
    recording, plate = start
    noise = 0.02 * np.random.default_rng(2).standard_normal((3, recording.time_s.size))
    for one in (
        with_channel(recording, "currents_a", 1, lambda u, v, w: 1.2 * v + 3.0),
        with_channel(recording, "voltages_v", 1, lambda u, v, w: 1.2 * v),
        with_channel(recording, "currents_a", 2, lambda u, v, w: np.full(u.size, np.nan)),
        replace(recording, currents_a=tuple(noise)),
    ):
        assert no_lines(one, *peaks(plate)) is None
        assert put_right(one).notes == ()


def test_single_samples_that_stand_out_are_as_their_neighbours_tell_and_a_closing_contactor_makes_none(start):
    recording, _ = start
    assert put_right(recording) == recording
    rng = np.random.default_rng(3)
    at = np.sort(rng.choice(np.arange(50, recording.time_s.size - 50, 10), 12, replace=False))

    def hit(u, v, w):
        out = v.copy()
        out[at] += rng.choice([-1.0, 1.0], at.size) * 40.0
        return out

    mended = put_right(with_channel(recording, "currents_a", 1, hit))
    assert "12 samples stand out" in mended.notes[0].what
    off = mended.currents_a[1] - recording.currents_a[1]
    assert np.flatnonzero(off).tolist() == at.tolist()
    assert np.abs(off).max() < 0.02 * np.abs(recording.currents_a[1]).max()
    noisy = with_channel(recording, "currents_a", 1, lambda u, v, w: v + 40.0 * (rng.random(v.size) < 0.05))
    assert "spikes" not in seen_of(noisy)


def taken_at(recording, kind, late_rows, every=8, noise=0.0):
    """Every eighth row (5 kHz), each channel so many rows of 25 us late, and white noise."""
    rng = np.random.default_rng(5)
    rows = np.arange(64, recording.time_s.size, every)
    group = [x[rows - k] for x, k in zip(getattr(recording, kind), late_rows, strict=True)]
    other = "voltages_v" if kind == "currents_a" else "currents_a"
    return replace(
        recording, time_s=recording.time_s[rows], sample_period_s=every * recording.sample_period_s, speed_rad_per_s=recording.speed_rad_per_s[rows],
        **{kind: tuple(x + noise * rng.standard_normal(x.size) for x in group), other: tuple(x[rows] for x in getattr(recording, other))},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "noise", "late_rows", "told_us"),
    [
        ("currents_a", 0.2, (0, 0, 0), None),
        ("currents_a", 0.2, (0, 0, 8), (0.0, 0.0, 200.0)),
        ("currents_a", 0.2, (0, 0, 40), (0.0, 0.0, 1000.0)),
        ("currents_a", 0.2, (0, 1, 2), (0.0, 25.0, 50.0)),
        ("currents_a", 0.2, (4, 0, 4), (0.0, -100.0, 0.0)),
        ("voltages_v", 0.7, (0, 3, 6), (0.0, 75.0, 150.0)),
    ],
)
def test_channels_taken_one_after_another_are_told_to_a_microsecond_and_shifted_back(
    without_noise, kind, noise, late_rows, told_us
):
    recording, _ = without_noise
    one = taken_at(recording, kind, late_rows, noise=noise)
    seen = late(getattr(one, kind), one.sample_period_s)
    if told_us is None:
        assert seen is None
        return
    assert seen is not None
    np.testing.assert_allclose([1e6 * s for s in seen.late_s], told_us, atol=1.0)
    mended = put_right(one)
    assert [n.code for n in mended.notes] == ["late_channel"]
    first = getattr(mended, kind)
    rest = np.abs(np.sum(first, axis=0))  # but where the contactor closes between two samples
    assert np.median(rest) < 1.1 * 0.6745 * np.sqrt(3.0) * noise
    assert late(first, one.sample_period_s) is None


def test_a_delay_is_told_beside_unlike_gains_and_these_are_not_told_as_one(without_noise):
    recording, _ = without_noise
    gains = (1.01, 1.0, 0.99)
    for late_rows, expected in (((0, 0, 0), None), ((0, 1, 2), [0.0, 25.0, 50.0])):
        one = taken_at(recording, "currents_a", late_rows, noise=0.2)
        seen = late([g * x + 0.3 for g, x in zip(gains, one.currents_a, strict=True)], one.sample_period_s)
        if expected is None:
            assert seen is None
        else:
            np.testing.assert_allclose([1e6 * s for s in seen.late_s], expected, atol=5.0)


def test_a_shift_by_part_of_a_sample_leaves_the_noise_as_it_is():
    """Interpolated by half a sample it had 0.5 of its power, sixth differences 0.2 of theirs: a healthy motor was called unexplained."""
    x = np.random.default_rng(6).standard_normal(20_000)
    out = shifted(x, 0.5)
    there = np.isfinite(out)
    assert np.count_nonzero(~there) <= 10
    assert np.std(out[there]) == pytest.approx(1.0, abs=0.04)
    assert np.std(np.diff(out[there], 6)) == pytest.approx(np.sqrt(924.0), rel=0.04)
    turn = 0.4 * np.arange(200)
    assert np.nanmax(np.abs(shifted(np.sin(turn), 0.3) - np.sin(turn + 0.12))) < 3e-4


def wrapped(x, end, bits=16):
    """As a converter counts that has no end: 2^bits steps from -end to end, then from -end again."""
    half = 2 ** (bits - 1)
    return ((np.round(x * half / end).astype(int) + half) % (2 * half) - half) * end / half


@pytest.mark.parametrize(("kind", "end"), [("currents_a", 300.0), ("currents_a", 100.0), ("voltages_v", 250.0)])
def test_what_ran_over_its_range_is_put_back(start, kind, end):
    recording, _ = start
    one = with_channel(recording, kind, 0, lambda u, v, w: wrapped(u, end))
    mended = put_right(one)
    assert [n.code for n in mended.notes] == ["wrapped"]
    assert f"({2 * end:.4g} " in mended.notes[0].what
    np.testing.assert_allclose(getattr(mended, kind)[0], getattr(recording, kind)[0], atol=end / 32768)


def test_pulses_and_steps_of_a_voltage_neither_ran_over_nor_are_cut_off(start):
    recording, _ = start
    turn = 314.0 * recording.time_s
    pulses = 280.0 * np.where(np.sin(turn) > np.sin(40.3 * turn), 1.0, -1.0)
    assert unwrapped(pulses)[2] == 0
    six = 200.0 * (np.sign(np.sin(turn)) + 0.5 * np.sign(np.sin(turn + 2.0)))
    assert not runs_into(six, clipped(six)[0])


def test_a_clipped_current_is_left_out_by_name_and_what_has_nothing_left_is_refused(start):
    recording, plate = start
    cut = replace(recording, currents_a=tuple(np.clip(x, -250.0, 250.0) for x in recording.currents_a))
    prepared = prepare([cut], plate)
    assert any("current u is clipped" in r and "250 A" in r for r in prepared.remarks)
    assert not prepared.has_start and max(np.abs(w.current[:, 0]).max() for w in prepared.windows) < 260.0
    with pytest.raises(DataRefused, match="voltage v is clipped") as refused:
        prepare([with_channel(recording, "voltages_v", 1, lambda u, v, w: np.clip(v, -280.0, 280.0))], plate)
    assert "larger range" in refused.value.remedy


def test_one_turned_sensor_is_turned_back_and_an_order_that_makes_no_motor_is_refused(start):
    recording, plate = start
    mended = put_right(with_channel(recording, "currents_a", 1, lambda u, v, w: -v))
    assert mended.currents_a[1] is not recording.currents_a[1] and np.array_equal(
        mended.currents_a[1], recording.currents_a[1]
    )
    assert "current v is minus" in mended.notes[0].what
    u, v, w = recording.currents_a
    for currents, says in (
        ((-u, -v, -w), "all turned round"),
        ((v, w, u), "w, u, v as u, v, w"),
        ((w, u, v), "v, w, u as u, v, w"),
    ):
        with pytest.raises(DataRefused, match="which no motor's do") as refused:
            prepare([replace(recording, currents_a=currents)], plate)
        assert says in refused.value.remedy


def without_rows(recording, kept, *, shows):
    """These rows alone; `shows`: whether the time tells of the others."""
    time = recording.time_s[kept] if shows else recording.sample_period_s * np.arange(kept.size)
    currents, voltages = (tuple(x[kept] for x in g) for g in (recording.currents_a, recording.voltages_v))
    return replace(
        recording,
        time_s=time,
        currents_a=currents,
        voltages_v=voltages,
        speed_rad_per_s=recording.speed_rad_per_s[kept],
    )


def test_lost_rows_are_neither_wraps_nor_hidden_by_a_time_that_does_not_show_them(start):
    recording, _ = start
    rows = np.arange(recording.time_s.size)
    kept = np.concatenate([rows[:6000], rows[6150:]])
    assert put_right(without_rows(recording, kept, shows=True)).notes == ()
    mended = put_right(without_rows(recording, kept, shows=False))
    assert [n.code for n in mended.notes] == ["lost_rows"]
    assert np.diff(mended.time_s)[5999] == pytest.approx(
        51 * recording.sample_period_s
    )  # one of the 1.5 periods cannot be seen


def test_rows_that_stand_still_are_left_out_and_rows_written_twice_are_refused(start):
    recording, _ = start
    rows = np.arange(recording.time_s.size)
    still = np.where((rows >= 6000) & (rows < 6040), 6000, rows)
    held = put_right(replace(without_rows(recording, still, shows=False), time_s=recording.time_s))
    assert [n.code for n in held.notes] == ["held_rows"]
    assert np.flatnonzero(~np.isfinite(held.currents_a[0])).tolist() == list(range(6001, 6040))
    twice = np.concatenate([rows[:6000], rows[5800:]])
    with pytest.raises(DataRefused, match="rows 6001 to 6200 repeat rows 5801 to 6000"):
        put_right(without_rows(recording, twice, shows=False))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda r: {"time_s": 1e3 * r.time_s, "sample_period_s": 1e3 * r.sample_period_s}, "the time is in milliseconds"),
        (lambda r: {"time_s": r.time_s + 8e-5 * np.random.default_rng(8).standard_normal(r.time_s.size)}, "stamps wander"),
        (lambda r: {"currents_a": tuple(1e3 * x for x in r.currents_a)}, "times the rated one"),
        (lambda r: {"voltages_are_line_to_line": True}, "root three too small"),
        (lambda r: {"voltages_v": tuple(a - b for a, b in zip(r.voltages_v, np.roll(r.voltages_v, -1, axis=0), strict=True))}, "too large"),
    ],
)  # fmt: skip
def test_another_unit_is_named_for_what_it_is(start, change, says):
    recording, plate = start
    with pytest.raises(DataRefused, match=says):
        prepare([replace(recording, **change(recording))], plate)


def test_a_supply_that_is_off_the_mains_is_said_and_one_of_an_inverter_is_not(start):
    """The mains of this start turn at 50.0285 Hz (by a window's line)."""
    recording, plate = start
    by = 1.01 * 50.0285 / 50.0
    slow = replace(recording, time_s=by * recording.time_s, sample_period_s=by * recording.sample_period_s)
    assert any("if it is the mains, the sample period is 1.0 % too long" in r for r in prepare([slow], plate).remarks)
    driven = replace(slow, metadata={**slow.metadata, "switching_frequency_hz": 4000.0})
    assert not any("mains" in r for r in prepare([driven], plate).remarks)
    assert off_mains(50.1) is None and off_mains(45.0) is None and "too short" in (off_mains(60.6) or "")


def test_a_supply_is_told_beside_its_harmonics_whichever_way_it_turns():
    """By its turning from sample to sample 2 % of a fifth made it 0.2 % too slow."""
    turn = 2.0 * np.pi * 49.87 * 2e-4 * np.arange(5000)
    forward = np.exp(1j * turn) + 0.03 * np.exp(-1j * turn) + 0.03 * np.exp(-5j * turn + 1j) + 0.02 * np.exp(7j * turn)
    for vector in (forward, forward.conj()):
        assert abs(turn_a_row(vector)) / (2.0 * np.pi * 2e-4) == pytest.approx(49.87, abs=2e-3)


@pytest.mark.parametrize(
    ("supply_hz", "gain", "whose"),
    [
        (49.505, 0.0099, "period"), (60.6, -0.01, "period"), (50.01, 0.01, "sensor"), (60.05, -0.05, "sensor"), (49.85, 0.003, "either"),
        (50.02, 0.001, "either"), (49.5, 0.03, "either"), (33.0, 0.01, "either"), (None, 0.01, "either"),
    ],
)  # fmt: skip
def test_a_gain_of_the_speed_is_the_sample_periods_where_the_mains_say_so(supply_hz, gain, whose):
    assert of_speed_gain(supply_hz, gain) == whose


def with_drift(recording, kind, k, by, time_s=0.0):
    """The offset of channel k drifts by so much, along a line or exponentially in `time_s`."""
    share = recording.time_s / recording.time_s[-1]
    if time_s:
        share = (1.0 - np.exp(-recording.time_s / time_s)) / (1.0 - np.exp(-recording.time_s[-1] / time_s))
    return with_channel(recording, kind, k, lambda *three: three[k] + by * share)


@pytest.mark.parametrize(
    ("kind", "by", "time_s"), [("currents_a", 0.5, 0.0), ("currents_a", -2.5, 1.0), ("voltages_v", 3.3, 0.0)]
)
def test_an_offset_that_drifts_is_taken_off_and_said(start, kind, by, time_s):
    """1 % of the rated peak ended as `unexplained`, or as a gain, a bad line and channels 8 us late."""
    recording, _ = start
    mended = put_right(with_drift(recording, kind, 1, by, time_s))
    (note,) = mended.notes
    assert (
        note.code == "drifting_offset"
        and f"drifts by {'-' if by < 0.0 else '+'}" in note.what
        and "taken off" in note.what
    )
    off = getattr(mended, kind)[1] - getattr(recording, kind)[1]
    assert np.ptp(off) < 0.12 * abs(by) and ("exponentially" in note.what) == (time_s > 0.0)


def test_what_a_motor_or_a_ramp_or_a_voltage_that_drives_it_does_is_no_drift(start):
    recording, _ = start
    decays = 5.0 * np.exp(-recording.time_s / 0.5)
    u, v, w = recording.currents_a
    assert put_right(replace(recording, currents_a=(u + decays, v - 0.5 * decays, w - 0.5 * decays))).notes == ()
    direct = with_drift(with_drift(recording, "voltages_v", 0, 3.0), "currents_a", 0, 20.0)
    assert all("voltage" not in n.what for n in put_right(direct).notes)
    ramp, _, _ = taken(Case(5101, "null", "ramp").scenario(), 5101)
    assert put_right(ramp).notes == ()


def test_a_third_current_that_was_computed_stays_so_where_another_drifts_and_two_are_enough(start):
    recording, _ = start
    u, v = (np.round(x, 3) for x in with_drift(recording, "currents_a", 1, 1.0).currents_a[:2])
    mended = put_right(replace(recording, currents_a=(u, v, np.round(-(u + v), 3))))
    assert [n.code for n in mended.notes] == ["drifting_offset"] * 2 and is_negative_sum(*mended.currents_a)
    two = put_right(replace(recording, currents_a=(u, v, np.full(u.size, np.nan))))
    assert [n.what.split(" drifts")[0] for n in two.notes] == ["the offset of current v"]


def test_harmonics_and_unbalance_do_not_move_the_supply_off_its_frequency(start):
    """From row to row 5 % of a 5th (EN 50160 allows 6) and 3 % of unbalance turn the vector 1.7 % less: a healthy motor's time column was blamed."""
    recording, plate = start
    turned, size = 100 * np.pi * recording.time_s, np.sqrt(2.0 / 3.0) * plate.rated_voltage_v
    is_fed = np.abs(recording.voltages_v).max(axis=0) > 0.05 * size
    bent = tuple(
        v + is_fed * size * (0.05 * np.cos(5 * turned + k * 2 * np.pi / 3) + 0.03 * np.cos(turned + k * 2 * np.pi / 3))
        for k, v in enumerate(recording.voltages_v)
    )
    assert not any("mains" in r for r in prepare([replace(recording, voltages_v=bent)], plate).remarks)


@pytest.mark.parametrize("hz", [50.0, -49.3, 61.0])
def test_what_turns_a_row_is_the_fundamental_alone(hz):
    """5 % of a 5th and 3 % of the other sequence, 4 kHz: neighbours alone tell 1.6 % less."""
    turned = 2.0 * np.pi * hz / 4000.0 * np.arange(400)
    vector = np.exp(1j * turned) + 0.05 * np.exp(1j - 5j * turned) + 0.03 * np.exp(-1j * turned)
    assert turn_a_row(vector) == pytest.approx(turned[1], rel=4e-4)
    assert turn_a_row(vector[:120]) != pytest.approx(turned[1], rel=4e-3)


def test_without_a_speed_the_rest_of_a_start_is_not_used(start):
    """At which speed it begins nothing tells: a healthy motor was called unexplained."""
    recording, plate = start
    part = replace(without_rows(recording, np.arange(1000, 15000), shows=True), speed_rad_per_s=None)
    prepared = prepare([part], plate)
    assert any("begins in a start" in r for r in prepared.remarks)
    assert np.hypot(*prepared.windows[0].current[:200, :2].T).max() < 2.0 * prepared.scales.current_a


def test_currents_at_standstill_that_were_taken_one_after_another_are_shifted_back():
    period, rng = 2e-4, np.random.default_rng(9)
    time = period * np.arange(9000)
    wave = np.sin(50.0 * time) + 0.4 * np.sin(400.0 * time) + 0.1 * np.sin(1700.0 * time)
    axis = np.repeat([0.0, 60.0, 120.0], 3000)
    turns = np.deg2rad(axis[:, None] - [0.0, 120.0, 240.0])
    u, v, w = (wave * np.cos(turn) + 1e-3 * rng.standard_normal(time.size) for turn in turns.T)
    segment = np.repeat([0, 1, 2], 3000)
    late_w = np.concatenate([np.concatenate([[0.0], part[:-1]]) for part in np.split(w, 3)])
    one = StandstillRecording(time, segment, axis, wave, u, v, late_w, None, period)
    mended = put_on_time(one)
    assert "current w is 200 us behind the two others" in mended.notes[0].what
    assert mended.time_s.size == time.size - 3  # the last row of each segment
    np.testing.assert_array_equal(mended.current_w_a, np.delete(w, [2999, 5999, 8999]))
    assert put_on_time(replace(one, current_w_a=w)).notes == ()


def test_samples_too_far_apart_tell_no_delay():
    time_s = np.arange(4000) * 7e-4
    lines = [np.sin(314.0 * (time_s - late_s) - k * 2.0944) for k, late_s in enumerate((0.0, 4.6e-5, 3.5e-5))]
    lines = [
        x + 0.05 * np.sin(5 * 314.0 * (time_s - late_s) + k * 2.0944)
        for k, (x, late_s) in enumerate(zip(lines, (0.0, 4.6e-5, 3.5e-5), strict=True))
    ]
    assert late(lines, 4e-4) is not None
    assert late(lines, 7e-4) is None


def test_the_other_half_of_a_period_is_no_copy():
    time_s = np.arange(600) / 5000.0
    lines = [np.cos(2.0 * np.pi * 50.0 * time_s - k * 2.0944) for k in range(6)]
    half = [np.where(time_s < 0.01, x, -np.roll(x, 50)) for x in lines]  # to the bit, as no noise would leave it
    assert written_twice([x[:100] for x in half], np.ones(100, bool)) is None


@pytest.fixture
def at_rest():
    """Tones along three axes in turn at 5 kHz; one channel carries next to nothing along the first."""
    period, rng = 2e-4, np.random.default_rng(9)
    time = period * np.arange(9000)
    wave = 2.0 * np.sin(50.0 * time) + 0.8 * np.sin(400.0 * time) + 0.2 * np.sin(1700.0 * time)
    axis = np.repeat([90.0, 30.0, 150.0], 3000)
    turns = np.deg2rad(axis[:, None] - [0.0, 120.0, 240.0])
    u, v, w = (np.round(wave * np.cos(turn) + 1e-3 * rng.standard_normal(time.size), 3) for turn in turns.T)
    return StandstillRecording(time, np.repeat([0, 1, 2], 3000), axis, wave, u, v, w, None, period)


def test_spikes_wraps_and_a_turned_sensor_at_standstill_are_put_right_as_of_a_running_motor(at_rest):
    assert put_right_at_rest(at_rest) is at_rest
    spiked, rows = at_rest.current_v_a.copy(), np.array([700, 4100, 8200])
    spiked[rows] += 5.0
    for changed, code, close in (
        ({"current_v_a": spiked}, "spikes", 0.02),
        ({"current_w_a": wrapped(at_rest.current_w_a, 2.0)}, "wrapped", 1e-3),
        ({"current_u_a": -at_rest.current_u_a}, "polarity", 0.0),
    ):
        for one in (at_rest, replace(at_rest, current_w_a=None)):
            if one.current_w_a is None and code != "spikes":
                continue
            mended = put_right_at_rest(replace(one, **changed))
            assert [n.code for n in mended.notes] == [code]
            (name,) = changed
            np.testing.assert_allclose(getattr(mended, name), getattr(at_rest, name), atol=close)
    assert put_right_at_rest(replace(at_rest, averaged=np.ones(9000, dtype=int), current_v_a=spiked)).notes == ()


def test_a_converters_step_in_a_channel_without_current_is_no_spike():
    x = np.zeros(5000)
    x[::300] = 0.01
    assert without_spikes(x)[1] == 0
    x[1000:1003] = (0.0, 5.0, 0.0)
    assert without_spikes(x)[1] == 1


def low_passed(x, time_s, period_s):
    """First order, by its exponential (the trapezoidal rule between samples of 25 us)."""
    a = np.exp(-period_s / time_s)
    return lfilter([0.5 * (1.0 - a)] * 2, [1.0, -a], x)


@pytest.mark.parametrize(
    ("time_s", "filtered", "noise", "says"),
    [
        (4e-4, True, 0.02, "passes a low pass of"), (4e-4, False, 0.02, "taken one after another)"), (1e-4, True, 0.4, "or a low pass)"),
        (1e-4, False, 0.4, "or a low pass)"),
    ],
)  # fmt: skip
def test_a_low_pass_in_one_channel_is_told_from_a_delay_where_noise_does_not_hide_what_they_differ_by(
    without_noise, time_s, filtered, noise, says
):
    recording, _ = without_noise
    period = recording.sample_period_s
    if filtered:
        one = with_channel(recording, "currents_a", 1, lambda u, v, w: low_passed(v, time_s, period))
        one = taken_at(one, "currents_a", (0, 0, 0), noise=noise)
    else:
        one = taken_at(recording, "currents_a", (0, round(time_s / period), 0), noise=noise)
    (note,) = put_right(one).notes
    assert says in note.what and note.what.endswith(": shifted back")
