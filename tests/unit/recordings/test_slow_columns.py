"""A value that stands for several rows, or lies on a line between two, was not measured there."""

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.recordings.reading.slow_columns import Pace, pace_of
from commissioner.recordings.table import Table, to_currents, to_running, to_standstill

ROWS, PERIOD_S = 4000, 5e-4
TIME = PERIOD_S * np.arange(ROWS)
RNG = np.random.default_rng(7)
MEASURED = 5.0 * np.cos(2.0 * np.pi * 41.3 * TIME) + 0.01 * RNG.standard_normal(ROWS)


def held(values, every, first=0):
    return values[np.maximum((np.arange(values.size) - first) // every * every + first, 0)]


def on_lines(values, every):
    return np.interp(np.arange(values.size), np.arange(0, values.size, every), values[::every])


@pytest.mark.parametrize(("every", "first"), [(2, 0), (2, 1), (5, 3)])
@pytest.mark.parametrize("step", [0.0, 0.001, 0.0073])
def test_a_held_value_and_an_interpolated_one_tell_their_pace(every, first, step):
    column = MEASURED if step == 0.0 else step * np.round(MEASURED / step)
    assert pace_of(held(column, every, first)) == Pace(every, (first % every,), "stand")
    assert pace_of(on_lines(column, every)) == Pace(every, (0,), "lie on straight lines")
    assert pace_of(np.round(on_lines(column, every), 3)) == Pace(every, (0,), "lie on straight lines")
    significant = np.array([float(f"{x:.6g}") for x in on_lines(column, every)])
    assert pace_of(significant) == Pace(every, (0,), "lie on straight lines")


def test_a_clock_between_two_rows_is_told_as_uneven():
    newest = np.ceil(2.5 * np.floor(np.arange(ROWS) / 2.5)).astype(int)
    seen = pace_of(MEASURED[newest])
    assert seen is not None and seen.between == "stand" and not seen.first
    with pytest.raises(DataRefused, match="or one more or less"):
        to_currents(running(lambda x: x[newest]))


@pytest.mark.parametrize(
    "column",
    [
        MEASURED,
        0.1 * np.round(MEASURED / 0.1),
        0.5 * np.round(0.01 * MEASURED / 0.5),
        np.cos(2.0 * np.pi * 0.3 * TIME),
        np.where(TIME < 1.5, 2.0, np.cos(2.0 * np.pi * 20.0 * TIME)),
        np.round(TIME * 40.0),
        300.0 * np.sign(np.cos(2.0 * np.pi * 50.0 * TIME + 0.1)),
        270.0 * (np.round(np.arange(ROWS) / 10.0) % 6),
        np.zeros(ROWS),
        np.where(np.arange(ROWS) % 7 == 3, np.nan, MEASURED),
        held(MEASURED, 5)[:90],
    ],
    ids=["own", "coarse", "coarser_than_noise", "slow_exact", "rest_first", "ramp_in_steps", "square", "six_steps", "zero", "hole", "short"],
)  # fmt: skip
def test_what_is_coarse_slow_still_or_switched_has_its_own_value_in_every_row(column):
    assert pace_of(column) is None


def running(change, names=("current_u_a", "current_v_a", "current_w_a"), **metadata):
    phase = [41.3 * 2.0 * np.pi * TIME - 2.0 * np.pi / 3.0 * k for k in range(3)]
    columns = {"time_s": TIME} | {
        f"{what}_{p}_{unit}": size * np.cos(phase[k]) + 0.01 * RNG.standard_normal(ROWS)
        for what, unit, size in (("current", "a", 5.0), ("voltage", "v", 300.0)) for k, p in enumerate("uvw")
    }  # fmt: skip
    columns |= {name: change(columns[name]) for name in names}
    return Table(columns, metadata, "file.csv")


@pytest.mark.parametrize("read", [to_running, to_currents])
def test_of_a_running_motor_the_measured_rows_are_left(read):
    table = running(lambda x: held(x, 4), sample_period_s=PERIOD_S)
    seen = read(table)
    assert seen.sample_period_s == pytest.approx(4 * PERIOD_S) and seen.time_s.size == ROWS // 4
    assert np.array_equal(seen.currents_a[1], table.columns["current_v_a"][::4])
    assert "every 4 rows" in seen.notes[-1].what
    assert read(running(lambda x: on_lines(x, 4))).sample_period_s == pytest.approx(4 * PERIOD_S)
    blank = np.where(np.arange(ROWS) % 3 == 1, 1.0, np.nan)
    assert read(running(lambda x: x * blank)).currents_a[0].size == np.count_nonzero(np.isfinite(blank))
    assert read(running(lambda x: x)).time_s.size == ROWS


def test_columns_of_unlike_clocks_are_refused():
    table = running(lambda x: held(x, 4))
    two = {**table.columns, "current_v_a": held(running(lambda x: x).columns["current_v_a"], 3)}
    with pytest.raises(DataRefused, match="every 4 rows") as refusal:
        to_running(Table(two, {}, "file.csv"))
    assert "current_v_a: every 3 rows" in str(refusal.value.value)
    assert refusal.value.remedy == "export every column at one rate, each row measured"


def standing(command_every, current_every):
    segment = np.repeat([0.0, 1.0], [ROWS // 2 + 1, ROWS // 2 - 1])
    shifted = np.concatenate([held(x, current_every) for x in np.split(MEASURED, [ROWS // 2 + 1])])
    columns = {
        "time_s": TIME, "segment": segment, "axis_deg": np.zeros(ROWS), "current_u_a": shifted, "current_v_a": -0.5 * shifted,
        "voltage_axis_v": np.concatenate([held(x, command_every) for x in np.split(10.0 * MEASURED, [ROWS // 2 + 1])]),
    }  # fmt: skip
    return Table(columns, {}, "file.csv")


def test_at_standstill_they_are_left_where_the_command_stands_between_them_too():
    seen = to_standstill(standing(4, 4))
    assert seen.sample_period_s == pytest.approx(4 * PERIOD_S)
    assert seen.current_u_a.size == -(-(ROWS // 2 + 1) // 4) + -(-(ROWS // 2 - 1) // 4)
    assert to_standstill(standing(4, 1)).current_u_a.size == ROWS
    for command_every in (1, 2, 8):
        with pytest.raises(DataRefused, match="every 4 rows"):
            to_standstill(standing(command_every, 4))


LINES = ("voltage_uv_v", "voltage_vw_v", "voltage_wu_v")


def fed(kind="uv_v", **changed):
    """A motor's currents and voltages; `changed`: what a channel shows instead, by its name."""
    turns = [np.cos(2.0 * np.pi * 50.0 * TIME - k * 2.0 * np.pi / 3.0) for k in range(3)]
    volts = LINES if kind == "uv_v" else ("voltage_u_v", "voltage_v_v", "voltage_w_v")
    columns = {f"current_{p}_a": 4.0 * x for p, x in zip("uvw", turns, strict=True)}
    columns |= {name: 325.0 * x for name, x in zip(volts, turns, strict=True)}
    return Table({"time_s": TIME, **columns, **changed}, {}, "fed.csv")


FROM = np.arange(ROWS) >= 2500


@pytest.mark.parametrize("channel", ["current_v_a", "voltage_vw_v"])
def test_what_a_channel_shows_once_it_stands_still_is_no_value(channel):
    whole = fed().columns[channel]
    seen = to_running(fed(**{channel: np.where(FROM, whole[2500], whole)}))
    shown = (seen.currents_a if "current" in channel else seen.voltages_v)[1]
    assert np.array_equal(np.isnan(shown), FROM)
    assert np.array_equal(shown[~FROM], whole[~FROM])
    (note,) = [n.what for n in seen.notes if n.code == "still_channel"]
    assert channel in note and "from 1.25 s on, 1500 rows" in note


def test_a_channel_that_stood_still_all_along_follows_from_two_or_is_refused():
    assert np.isnan(to_running(fed(current_w_a=np.full(ROWS, 2.9))).currents_a[2]).all()
    with pytest.raises(DataRefused, match="voltage_u_v stands at 312"):
        to_running(fed("u_v", voltage_u_v=np.full(ROWS, 312.0)))


@pytest.mark.parametrize(
    "changed",
    [
        {"current_u_a": np.zeros(ROWS)},  # an open line: no current flows
        {"current_u_a": np.clip(4.0 * np.cos(2.0 * np.pi * 50.0 * TIME), -3.0, 3.0)},
        {
            name: 270.0 * np.round(np.clip(2.0 * np.cos(2.0 * np.pi * (5.0 * TIME - k / 3.0)), -1.0, 1.0))
            for k, name in enumerate(LINES)
        },
        {name: np.where(FROM, 1.0, fed().columns[name]) for name in ("current_u_a", "current_v_a", "current_w_a")},
        {
            name: np.where(FROM, fed().columns[name], k * 0.3 * (np.arange(ROWS) % 7 < 3))
            for k, name in enumerate(LINES)
        },
    ],
    ids=["open", "clipped", "six_steps", "all_three", "before_it_is_fed"],
)
def test_what_stands_as_motors_and_inverters_make_it_is_measured(changed):
    seen = to_running(fed(**changed))
    assert not [n for n in seen.notes if n.code == "still_channel"]
    assert np.isfinite([*seen.currents_a, *seen.voltages_v]).all()


def test_at_standstill_a_current_that_stands_still_to_the_end_is_named_and_one_at_its_end_is_not():
    third = 1.3 * np.cos(2.0 * np.pi * 20.0 * TIME)
    columns = {
        "time_s": TIME, "segment": np.zeros(ROWS), "axis_deg": np.zeros(ROWS), "voltage_axis_v": 10.0 * MEASURED,
        "current_u_a": MEASURED, "current_v_a": third, "current_w_a": -MEASURED - third,
    }  # fmt: skip
    clipped = {**columns, "current_v_a": np.where(TIME < 0.5, 1.9, third)}
    assert to_standstill(Table(clipped, {}, "file.csv")).current_u_a.size == ROWS
    for still, since in ((np.full(ROWS, 2.0), "0 s"), (np.where(FROM, 2.0, third), "1.25 s")):
        with pytest.raises(DataRefused, match=f"current_v_a stands at 2 A from {since} to the end"):
            to_standstill(Table({**columns, "current_v_a": still}, {}, "file.csv"))


def test_rows_that_run_backwards_are_turned_and_rows_that_were_never_filled_left_out():
    speed = np.full(ROWS, 150.0) + 0.01 * RNG.standard_normal(ROWS)
    whole = fed(speed_rad_per_s=speed)
    turned = to_running(Table({name: x[::-1] for name, x in whole.columns.items()}, {}, "fed.csv"))
    assert np.array_equal(turned.time_s, TIME) and np.array_equal(turned.currents_a[1], whole.columns["current_v_a"])
    assert [n.code for n in turned.notes] == ["backwards"]
    unfilled = {name: x if name == "time_s" else np.where(TIME < 1.5, x, 0.0) for name, x in whole.columns.items()}
    seen = to_running(Table(unfilled, {}, "fed.csv"))
    assert seen.time_s.size == 3000 and [n.what for n in seen.notes] == [
        "the last 1000 rows hold nothing but zeros: left out"
    ]
    coasted = {**unfilled, "speed_rad_per_s": np.where(TIME < 1.5, np.maximum(150.0 - 100.0 * TIME, 0.0), 0.0)}
    assert to_running(Table(coasted, {}, "fed.csv")).time_s.size == ROWS
