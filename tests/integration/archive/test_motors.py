"""Motors as things: named by a person, borne out by parameters, followed over years, and what moved explained."""

from __future__ import annotations

import datetime as dt
import json
from dataclasses import replace

import numpy as np
import pytest

from commissioner.cli.screens import screen
from commissioner.cli.verbs.archived import motors
from commissioner.errors import DataRefused, UsageError
from commissioner.history.series import FALSE_ALARM
from commissioner.identify.estimate.axes import Identity
from commissioner.operations.history.compare import compare_runs
from commissioner.operations.history.motors import judge_motor, list_motors, name_motor, runs_of
from commissioner.operations.history.runs import Archive, Wanted, find_runs
from commissioner.operations.history.trend import trend, trend_of_indicators
from commissioner.report.history import figures
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.verify import verify
from commissioner.run.index.years import over_years
from tests.support.archive.killed import die
from tests.support.archive.synthetic import MACHINE, make_run, result_of
from tests.unit.cli.test_failures import leave

COPPER = 234.5


def add(root, number, machine=MACHINE, tag="", **result):
    when = dt.datetime(2020, 1, 1, tzinfo=dt.UTC) + dt.timedelta(days=120 * number)
    name = f"{when.strftime('%Y%m%d-%H%M%S')}-simulated-abcdef"
    make_run(root, name, result=result_of(name, machine, **result), origin={"motor_tag": tag} if tag else None)
    return name


def scaled(**factors):
    return {name: value * factors.get(name, 1.0) for name, value in MACHINE.items()}


def noisy(seed):
    chance = np.random.default_rng(seed)
    return scaled(**{name: float(np.exp(0.004 * chance.standard_normal())) for name in MACHINE})


def test_a_run_is_named_afterwards_kept_in_its_chain_and_found(tmp_path):
    archive, run = Archive(tmp_path), add(tmp_path, 0)
    (nobody,) = list_motors(archive)
    assert nobody.motor == "" and nobody.runs == 1
    named = name_motor(archive, run, tag="PUMP-3", serial="SN 77")
    assert named.person
    assert verify(tmp_path / run).state == "intact"
    assert [row.run for row in find_runs(archive, Wanted(motor="pump-3")).rows] == [run]
    assert [row.run for row in find_runs(archive, Wanted(serial="sn 77")).rows] == [run]
    assert [row.run for row in runs_of(archive, "SN 77")] == [run]
    assert [(one.motor, one.serial, one.runs) for one in list_motors(archive)] == [("PUMP-3", "SN 77", 1)]


def test_another_motor_does_not_get_the_name_unless_a_person_confirms_it(tmp_path):
    archive = Archive(tmp_path)
    add(tmp_path, 0, tag="PUMP-3")
    other = add(tmp_path, 1, scaled(leakage_inductance_h=1.4, magnetizing_inductance_h=0.6, rotor_resistance_ohm=1.5))
    with pytest.raises(DataRefused, match="another motor"):
        name_motor(archive, other, tag="PUMP-3")
    assert name_motor(archive, other, tag="PUMP-3", confirm=True).likeness.comparison.verdict is Identity.OTHER
    assert len(runs_of(archive, "PUMP-3")) == 2


def test_a_run_is_judged_beside_every_named_motor_of_its_plate(tmp_path):
    archive = Archive(tmp_path)
    add(tmp_path, 0, scaled(leakage_inductance_h=1.4, magnetizing_inductance_h=0.6), tag="FAN-1")
    add(tmp_path, 1, noisy(1), tag="PUMP-3")
    run = add(tmp_path, 2, noisy(2))
    first, second = judge_motor(archive, run)
    assert (first.motor, first.comparison.verdict) == ("PUMP-3", Identity.SAME)
    assert (second.motor, second.comparison.verdict) == ("FAN-1", Identity.OTHER)


def test_a_run_that_goes_on_or_a_motor_without_name_is_refused(tmp_path):
    make_run(tmp_path, "20260101-000000-x-abcdef", closed=False)
    with pytest.raises(UsageError, match="not been closed"):
        name_motor(Archive(tmp_path), "last", tag="A")
    with pytest.raises(UsageError, match="tag or a serial"):
        name_motor(Archive(tmp_path), "last", tag=" ")
    with pytest.raises(UsageError, match="no run was made"):
        trend(Archive(tmp_path), "A")


def test_a_run_whose_restore_was_killed_can_still_be_named(tmp_path):
    folder = make_run(tmp_path, "20260101-000000-x-abcdef")
    killed = RunFolder(folder)
    killed.journal("about_to", {"action": "stage", "values": {}}, durable=True)
    die(killed)
    assert name_motor(Archive(tmp_path), "last", tag="A").motor_tag == "A"


def test_an_unchanged_motor_has_no_trend_whatever_its_temperature_and_flux(tmp_path):
    """Measured between 15 and 60 degrees and at two flux levels of one curve: at common ground nothing has moved."""
    curve = ((0.4, 0.34), (0.716, 0.3091), (0.9, 0.28))
    for k in range(8):
        degc, flux_wb = (15.0, 60.0, 30.0)[k % 3], (0.716, 0.9)[k % 2]
        machine = noisy(k)
        heat = (COPPER + degc) / (COPPER + 25.0)
        machine = machine | {name: machine[name] * heat for name in ("stator_resistance_ohm", "rotor_resistance_ohm")}
        if flux_wb == 0.9:
            machine["magnetizing_inductance_h"] *= 0.28 / 0.3091
        add(tmp_path, k, machine, tag="PUMP-3", degc=degc, flux_wb=flux_wb, curve=curve)
    found = trend(Archive(tmp_path), "PUMP-3").found
    assert found.false_alarm == FALSE_ALARM
    assert (found.common.stator_flux_wb, found.common.temperature_degc) == (0.716, 15.0)
    for one in found.trends:
        assert not one.steps and not one.is_sloping and not one.is_alarm, one
        assert one.widening < 1.5
    levels = {one.name: one.level for one in found.trends}
    assert levels["magnetizing_inductance_h"] == pytest.approx(0.3091, rel=0.006)
    assert levels["stator_resistance_ohm"] == pytest.approx(3.716 * (COPPER + 15) / (COPPER + 25), rel=0.006)
    assert "nothing has changed beyond error" in found.sentences


def test_a_trend_of_nothing_says_so(tmp_path, capsys):
    code, document = leave(capsys, "runs", "trend", "--runs", tmp_path)
    assert (code, document["error"]["value"]) == (2, "neither")


@pytest.mark.parametrize(("runs", "is_told"), [(1, False), (2, False), (3, True)])
def test_fewer_than_three_runs_are_no_verdict_on_a_change(tmp_path, runs, is_told):
    for k in range(runs):
        add(tmp_path, k, noisy(k), tag="PUMP-3")
    sentences = trend(Archive(tmp_path), "PUMP-3").found.sentences
    assert ("nothing has changed beyond error" in sentences) == is_told
    assert any("fewer than 3 points" in said for said in sentences) != is_told


def test_a_rotor_that_breaks_is_a_step_of_its_resistance_alone_with_picture(tmp_path, capsys):
    for k in range(10):
        machine = noisy(k)
        machine["rotor_resistance_ohm"] *= 1.12 if k >= 6 else 1.0
        add(tmp_path, k, machine, tag="PUMP-3")
    picture = tmp_path / "trend.svg"
    done = trend(Archive(tmp_path), "PUMP-3", picture)
    assert [(one.name, len(one.steps)) for one in done.found.trends if one.steps] == [("rotor_resistance_ohm", 1)]
    (step,) = done.found.trends[1].steps
    assert step.run == done.found.trends[1].points[6].run
    assert abs(step.relative_change - 0.12) < 4 * step.relative_std
    assert picture.read_text().count("<svg") == 1
    code, document = leave(capsys, "runs", "trend", "PUMP-3", "--runs", tmp_path)
    assert code == 0 and json.dumps(document, allow_nan=False)
    assert document["found"]["trends"][1]["steps"][0]["run"] == step.run


def test_a_trend_is_shown_in_the_names_and_units_of_every_other_table(tmp_path):
    for k in range(3):
        add(tmp_path, k, noisy(k), tag="PUMP-3")
    done = trend(Archive(tmp_path), "PUMP-3")
    with screen.out.capture() as shown:
        motors._show(done)
    row = next(line for line in shown.get().splitlines() if "L_M" in line)
    henry = next(one.level for one in done.found.trends if one.name == "magnetizing_inductance_h")
    assert row.split()[:3] == ["magnetizing", "inductance", "L_M"] and row.split()[7] == "mH"
    assert float(row.split()[4]) == pytest.approx(1e3 * henry, rel=0.01)
    assert figures.over_years("PUMP-3", done.found).axes[2].get_ylabel() == "L_σ / mH"


def test_runs_without_result_or_temperature_are_said(tmp_path):
    add(tmp_path, 0, tag="A", degc=None)
    add(tmp_path, 1, tag="A")
    make_run(tmp_path, "20250101-000000-x-abcdef", outcome="aborted", origin={"motor_tag": "A"})
    done = trend(Archive(tmp_path), "A")
    assert len(done.left_out) == 1
    assert any("1 of 2 runs know no winding temperature" in sentence for sentence in done.found.common.sentences)
    assert done.found.trends[0].points[0].std > 10 * done.found.trends[0].points[1].std


def test_indicators_of_monitor_have_the_same_trend(tmp_path):
    from commissioner.monitor.trend.trend import Entry, History
    from commissioner.recordings.baseline import write

    chance = np.random.default_rng(2)
    entries = [
        Entry(f"{k}.csv", 150.0, 10.0, 50.0, {"speed_ripple_rad_per_s": (0.5 + (k > 7) * 0.2 + 0.01 * chance.standard_normal(), 0.01)},
              f"2025-{1 + k:02d}-01T00:00:00+00:00")
        for k in range(12)
    ]  # fmt: skip
    elsewhere = Entry(
        "other.csv", 100.0, 10.0, 50.0, {"speed_ripple_rad_per_s": (9.0, 0.01)}, "2024-01-01T00:00:00+00:00"
    )
    write(tmp_path / "fan.json", History(tuple(entries[:6]), (elsewhere, *entries[6:])))
    done = trend_of_indicators(tmp_path / "fan.json", tmp_path / "fan.png")
    (one,) = done.found.trends
    assert [step.run for step in one.steps] == ["8.csv"] and one.unit == "rad/s"
    assert one.steps[0].relative_change == pytest.approx(0.2 / 0.7, rel=0.1)
    assert len(done.left_out) == 1 and (tmp_path / "fan.png").stat().st_size > 5000
    ahead = replace(elsewhere, source="ahead.csv", utc="2999-01-01T00:00:00+00:00")
    write(tmp_path / "fan.json", History(tuple(entries[:6]), (elsewhere, ahead, *entries[6:])))
    later = trend_of_indicators(tmp_path / "fan.json")
    assert later.found == done.found and "ahead.csv: its time has not come yet" in later.left_out[-1]
    write(tmp_path / "fan.json", History((ahead,)))
    with pytest.raises(DataRefused, match="dated in the future"):
        trend_of_indicators(tmp_path / "fan.json")


CAUSES = [
    ({"stator_resistance_ohm": 1.2}, {"degc": 25.0}, "cable"),
    ({"rotor_resistance_ohm": 1.12}, {"degc": 25.0}, "rotor"),
    (dict.fromkeys(MACHINE, 1.08), {"degc": 25.0}, "sensor scale"),
    ({"stator_resistance_ohm": 1.45, "rotor_resistance_ohm": 1.45}, {"degc": None}, "temperature"),
    ({"magnetizing_inductance_h": 0.9}, {"degc": 25.0}, "flux"),
    ({"leakage_inductance_h": 1.15}, {"degc": 25.0}, "leakage"),
    (
        {"leakage_inductance_h": 1.4, "magnetizing_inductance_h": 0.6, "rotor_resistance_ohm": 1.5},
        {"degc": 25.0},
        "another motor",
    ),
]


@pytest.mark.parametrize(("factors", "facts", "cause"), CAUSES)
def test_what_moved_is_explained_by_what_moved_it(tmp_path, factors, facts, cause):
    before, after = add(tmp_path, 0, noisy(1), degc=facts["degc"]), add(tmp_path, 1, {
        name: value * factors.get(name, 1.0) for name, value in noisy(2).items()
    }, degc=facts["degc"])  # fmt: skip
    done = compare_runs(tmp_path, before, after)
    assert done.comparison.verdict is (Identity.OTHER if cause == "another motor" else Identity.CHANGED)
    names = [one.cause for one in done.explained_by]
    assert cause in names
    sized = {one.cause: one.size for one in done.explained_by}
    if cause != "another motor":
        assert sized[cause] == pytest.approx(next(iter(factors.values())) - 1.0, abs=0.02)
        others = {"rotor", "leakage", "flux", "sensor scale", "temperature"} - {cause}
        assert not others & set(names)


def test_the_same_motor_needs_no_explanation(tmp_path):
    before, after = add(tmp_path, 0, noisy(1)), add(tmp_path, 1, noisy(2))
    assert compare_runs(tmp_path, before, after).explained_by == ()


def test_a_runs_report_knows_the_earlier_runs_of_its_motor_and_no_later_or_other_ones(tmp_path):
    runs = [add(tmp_path, k, noisy(k), tag="PUMP-3") for k in range(4)]
    add(tmp_path, 1.5, tag="FAN-1")
    unnamed = add(tmp_path, 5)
    found = over_years(tmp_path / runs[2])
    assert [point.run for point in found.trends[0].points] == runs[:3]
    assert over_years(tmp_path / runs[0]) is None
    assert over_years(tmp_path / unnamed) is None
