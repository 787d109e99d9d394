"""A run beside what its drive holds, and beside recordings."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from commissioner.cli.verbs.archived.comparing import compare_drive
from commissioner.errors import DataRefused, IdentityMismatch, UsageError
from commissioner.identify.estimate.axes import Identity
from commissioner.operations.history.compare import SetBy, compare_runs, compare_with_drive, compare_with_recordings
from commissioner.operations.history.runs import Archive
from commissioner.operations.history.trend import trend
from commissioner.operations.recordings import identify
from commissioner.run import write_accepted
from tests.support.archive.synthetic import MACHINE, make_run, result_of
from tests.unit.cli.test_failures import leave
from tests.unit.run.test_restore import Bench

NAMES = {
    "stator_resistance": "stator_resistance_ohm", "rotor_resistance": "rotor_resistance_ohm",
    "leakage_inductance": "leakage_inductance_h", "magnetizing_inductance": "magnetizing_inductance_h",
}  # fmt: skip


@pytest.fixture
def bench(tmp_path, monkeypatch):
    made = Bench(tmp_path, monkeypatch)
    monkeypatch.setattr(write_accepted, "open_port", lambda *_, **__: made.drive)
    return made


def close_with(bench, machine):
    bench.folder.save("result.json", result_of(bench.folder.path.name, machine))
    bench.folder.journal("run_ended", {"outcome": "commissioned", "reason": "x", "energised_s": 1.0})
    bench.folder.close()
    return bench.folder.path


def test_a_drive_that_holds_other_values_is_said_with_each_of_them(bench, capsys):
    path = close_with(bench, MACHINE)
    held = bench.held()
    seen = compare_with_drive(path.parent, "last")
    assert seen.holds == "other values"
    assert {row.parameter: row.drive for row in seen.rows} == {NAMES[name]: held[name] for name in NAMES}
    for row in seen.rows:
        assert row.run == MACHINE[row.parameter]
        assert row.sigmas == pytest.approx(abs(row.drive - row.run) / row.std)
    assert bench.held() == held
    code, document = leave(capsys, "runs", "compare", "last", "--held", "--runs", path.parent)
    assert (code, document["holds"]) == (0, "other values")


def test_a_drive_that_holds_the_runs_values_in_single_precision_holds_them(bench):
    held = bench.held()
    path = close_with(bench, {NAMES[name]: held[name] * (1 + 3e-8) for name in NAMES})
    assert compare_with_drive(path.parent, "last").holds == "the run's values"


def test_at_which_flux_the_drives_inductance_holds_is_said_where_another_run_set_it(bench, capsys):
    """L_M at two levels differs by saturation alone: a bare change would be read as another motor."""
    held = {NAMES[name]: value for name, value in bench.held().items()}
    path = close_with(bench, MACHINE)
    assert (seen := compare_with_drive(path.parent, "last")).set_by is None
    assert seen.holds_for_stator_flux_wb == 0.716
    assert leave_text(capsys, path.parent).count("not known: saturation alone moves them") == 1
    before = "20200101-000000-simulated-abcdef"
    make_run(path.parent, before, result=result_of(before, held, flux_wb=0.63))
    assert compare_with_drive(path.parent, path.name).set_by == SetBy(before, 0.63)
    assert f"at 0.630 Wb: `commissioner runs compare {before} {path.name}`" in leave_text(capsys, path.parent)


def leave_text(capsys, runs):
    """What the verb tells a person, its lines joined."""
    compare_drive(runs, "last", None, as_json=False)
    return " ".join(capsys.readouterr().out.split())


def test_another_drive_is_not_compared(bench):
    path = close_with(bench, MACHINE)
    bench.drive.put("serial_number", 4712)
    with pytest.raises(IdentityMismatch):
        compare_with_drive(path.parent, "last")


def test_recordings_beside_a_run(tmp_path, monkeypatch):
    """The estimators have tests of their own; here only what becomes of their answer."""
    make_run(tmp_path, "20260101-000000-x-abcdef", result=result_of("a", MACHINE), origin={"motor_tag": "A"})
    after = result_of("b", MACHINE | {"rotor_resistance_ohm": 1.15 * MACHINE["rotor_resistance_ohm"]})
    monkeypatch.setattr(identify, "identify", lambda request: SimpleNamespace(document=after))
    done = compare_with_recordings(tmp_path, "last", (Path("after.csv"),))
    assert done.comparison.verdict is Identity.CHANGED and done.after == "after.csv"
    assert [one.cause for one in done.explained_by] == ["rotor"]


def test_a_run_without_result_or_beside_itself_is_refused(tmp_path):
    make_run(tmp_path, "20260101-000000-x-abcdef", result=result_of("a", MACHINE))
    make_run(tmp_path, "20260102-000000-x-abcdef", outcome="aborted")
    with pytest.raises(DataRefused, match="identified nothing"):
        compare_runs(tmp_path, "20260101", "last")
    with pytest.raises(UsageError, match="with itself"):
        compare_runs(tmp_path, "20260101", "20260101")


def test_a_result_that_somebody_changed_is_neither_compared_nor_part_of_a_trend(tmp_path):
    """A changed file would be told as a changed motor."""
    for number in (1, 2, 3):
        folder = make_run(
            tmp_path,
            f"2026010{number}-000000-x-abcdef",
            result=result_of(f"{number}", MACHINE),
            origin={"motor_tag": "A"},
        )
    path = folder / "result.json"
    path.write_text(path.read_text("utf-8").replace("3.716", "3.916"), "utf-8")
    with pytest.raises(DataRefused, match=r"result\.json is not as the run left it"):
        compare_runs(tmp_path, "20260101", "last")
    assert compare_runs(tmp_path, "20260101", "20260102").comparison.verdict is not Identity.CHANGED
    told = trend(Archive(tmp_path), "A")
    assert told.left_out == (f"{folder.name}: result.json is not as the run left it",)
