"""What the archive's verbs show on a narrow terminal."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from commissioner.cli.screens import screen
from commissioner.cli.verbs.archived import runs, verify
from commissioner.errors import DataRefused
from commissioner.report.run.standing import Standing
from commissioner.run import write_accepted
from commissioner.run.archive.catalogue import find_run
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.replay import apart
from commissioner.text import counted, did_you_mean
from tests.support.archive.killed import die
from tests.support.archive.synthetic import MACHINE, make_run, result_of


@pytest.mark.parametrize(
    "standing",
    ["commissioned", "accepted, not written", "commissioned, restored since", "commissioned, old or new", "faulted"],
)
def test_no_word_of_a_list_of_runs_is_broken_at_80_columns(monkeypatch, standing):
    row = SimpleNamespace(
        run="20261129-043338-simulated-3d243a", standing=standing, motor="", plate="2.2 kW, 400 V, 5 A, 1436 1/min",
        drive="SIM-INV-7A #20250117", person="root", holds="",
    )  # fmt: skip
    monkeypatch.setattr(runs, "find_runs", lambda *_: SimpleNamespace(rows=[row], total=1))
    monkeypatch.setattr(screen.out, "width", 80)
    with screen.out.capture() as shown:
        runs.list_runs(None, as_json=False, wanted=None)
    wanted = f"{standing} {row.plate} {row.drive}".replace(
        "commissioned, ", "commissioned "
    ).split()  # a new line instead
    assert set(wanted) <= set(shown.get().split())


@pytest.mark.parametrize("width", [50, 80, 120])
@pytest.mark.parametrize(
    "run", ["20261129-043338-schneider_atv_process-3d243a-12", "20261129-043338-danfoss_fc302-3d243a"]
)
def test_a_long_id_stays_whole_and_so_do_the_words_beside_it(monkeypatch, run, width):
    facts = {
        "plate": "2.2 kW, 400 V, 5 A, 1436 1/min",
        "drive": "FC-302 #20250117",
        "person": "anna-katharina",
        "holds": "new",
    }
    row = SimpleNamespace(run=run, standing="commissioned, old or new", motor="", **facts)
    monkeypatch.setattr(runs, "find_runs", lambda *_: SimpleNamespace(rows=[row], total=1))
    monkeypatch.setattr(screen.out, "width", width)
    with screen.out.capture() as shown:
        runs.list_runs(None, as_json=False, wanted=None)
    assert {run, *" ".join(facts.values()).split()} <= set(shown.get().replace(";", " ").split())


def test_what_holds_for_every_run_is_said_once(monkeypatch):
    one = SimpleNamespace(
        run="a", state="intact", usable="all", losses=(), seal="none", remarks=("no seal",), is_whole=True
    )
    monkeypatch.setattr(verify.archive, "verify_runs", lambda *_: [one, one])
    with screen.out.capture() as shown:
        verify.verify_runs(Path("runs"), None, everything=True, seal=None, as_json=False)
    assert shown.get().count("intact") == 2
    assert shown.get().count("no seal") == 1


def test_a_verdict_names_parameters_as_the_table_below_it_does():
    reason = "observer and batch fit disagree on leakage_inductance_h at axis 60 deg"
    with screen.out.capture() as shown:
        screen.result({"outcome": "rejected", "reason": reason, "energised_s": 1.0})
    assert "disagree on leakage inductance L_σ at axis 60°" in " ".join(shown.get().split())


def test_one_is_no_plural():
    assert (counted(0, "run"), counted(1, "run"), counted(2, "run")) == ("0 runs", "1 run", "2 runs")


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("acuracy", "; did you mean 'accuracy'?"),
        ("ACCURACY", "; did you mean 'accuracy'?"),
        ("form", ""),
        ("x", ""),
        ("", ""),
    ],
)
def test_only_one_name_that_is_near_is_asked_back(asked, said):
    assert did_you_mean(asked, ("accuracy", "formats", "formulas")) == said


def test_a_decision_that_comes_out_otherwise_is_told_at_the_place_that_differs():
    archived = {"kind": "result", "record": {"outcome": "commissioned", "remarks": ["a", "b"]}}
    replayed = {"kind": "result", "record": {"outcome": "commissioned", "remarks": ["a", "c", "d"]}}
    assert apart(replayed, archived) == ("record.remarks.1", "c", "b")
    assert apart({"x": [1]}, {"x": [1, 2]}) == ("x.1", None, 2)
    assert apart("c", "b") == ("", "c", "b")
    assert apart({"x": 1}, {}) == ("x", 1, None)


@pytest.mark.parametrize("last", ["about_to", "parameters_written", "snapshot_restored"])
def test_what_a_run_is_shown_as_follows_what_was_written_since(tmp_path, last):
    """A write-back that was killed stood there as `commissioned`, and beside it that the drive still holds its old values."""
    name = "20260101-000000-simulated-abcdef"
    folder = make_run(tmp_path, name, result=result_of(name, MACHINE))
    assert find_run(tmp_path, "last").standing == Standing.ACCEPTED
    writing = RunFolder(folder)
    writing.journal("about_to", {"action": "commit", "values": {}}, durable=True)
    if last != "about_to":
        writing.journal(last, {"is_stored": True}, durable=True)
    die(writing)
    run = find_run(tmp_path, "last")
    wanted = {
        "about_to": Standing.UNSURE,
        "parameters_written": "commissioned",
        "snapshot_restored": Standing.RESTORED_SINCE,
    }
    assert run.standing == wanted[last] and wanted[last] in list(Standing)
    with screen.out.capture() as shown:
        runs.show_run(tmp_path, "last", as_json=False)
    assert "still holds its old values" not in shown.get()
    assert ("old or new" in shown.get()) == (last == "about_to")
    if last == "about_to":
        with pytest.raises(DataRefused, match="did not end") as refused:
            write_accepted._circuit(run)
        assert f"commissioner restore {name}" in refused.value.remedy
