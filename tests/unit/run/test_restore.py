"""Restore writes only what its run found, and only over what its run found or wrote; a run folder is written as itself."""

import errno
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from commissioner.cli.screens import screen
from commissioner.cli.verbs.archived import deciding
from commissioner.cli.verbs.archived.deciding import restore_run
from commissioner.errors import (
    CommissionerError,
    DataRefused,
    IdentityMismatch,
    LinkUnreachable,
    UsageError,
    WriteBackFailed,
)
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from commissioner.records import SampleBlock, plain_name
from commissioner.report.run.standing import Held
from commissioner.run import restore as restoring
from commissioner.run.archive.blocks import read_blocks
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.summary import read_summary, summarise
from commissioner.service.routes.write import STEPS, step_of
from commissioner.settings import load_motor
from tests.support.archive.chained import rechain
from tests.support.archive.killed import die
from tests.support.archive.synthetic import make_run
from tests.support.scripted_port import PARAMETERS, ScriptedDrive

PROFILE = load_profile("simulated")
NEW = {"stator_resistance": 3.3, "rotor_resistance": 1.9, "leakage_inductance": 0.024, "magnetizing_inductance": 0.310}


class Drive(ScriptedDrive):
    def close(self):
        """As a port."""


class Bench:
    """A run that found the drive's values; `write` makes it write others."""

    def __init__(self, root, monkeypatch):
        self.drive = Drive()
        self.folder = RunFolder.create(root, "x")
        monkeypatch.setattr(restoring, "open_port", lambda *_, **__: self.drive)
        self.inverter = Inverter(self.drive, PROFILE, lambda i: self.folder.journal("about_to", i))
        self.snapshot = self.inverter.snapshot()
        plate = load_motor("motor_2kw2")
        self.folder.save("request.json", {"url": "tcp://127.0.0.1:1", "profile": "simulated", "nameplate": plate})
        self.folder.save("snapshot.json", self.snapshot)
        self.folder.journal("reply", {"command": "TakeSnapshot", "reply": self.snapshot})

    def write(self, values=NEW):
        return self.inverter.write_parameters(values, self.inverter.snapshot())

    def restore(self):
        """Once the run's process is gone."""
        die(self.folder)
        return restoring.restore(summarise(self.folder.path), None)

    def held(self):
        return self.inverter.snapshot().in_use

    def edit(self, change):
        path = self.folder.path / "snapshot.json"
        document = json.loads(path.read_text())
        change(document)
        path.write_text(json.dumps(document))


@pytest.fixture
def bench(tmp_path, monkeypatch):
    bench = Bench(tmp_path, monkeypatch)
    yield bench
    bench.folder.close()


def test_what_is_restored_is_told_with_register_unit_and_convention_as_the_table_that_was_agreed_to(bench):
    bench.write()
    die(bench.folder)
    with screen.out.capture() as shown:
        deciding.restore_run(bench.folder.path.parent, bench.folder.path.name, None, yes=True, as_json=False)
    said = set(shown.get().split())
    for name, value in bench.snapshot.in_use.items():
        item = PROFILE.item(name)
        assert {str(item.place), item.unit, f"{value:.6g}", *plain_name(name).split()} <= said
    assert {"register", "unit", "convention"} <= said


def test_what_the_run_wrote_is_taken_back(bench):
    bench.write()
    assert {row.name for row in bench.restore().written} == set(PARAMETERS)
    assert bench.held() == bench.snapshot.in_use


@pytest.mark.parametrize(("kind", "is_gone"), [("SIM-2K2", True), ("ACS880", False)])
def test_a_demos_drive_is_said_to_be_gone_with_it(bench, monkeypatch, kind, is_gone):
    def silent(*_, **__):
        raise LinkUnreachable("no connection", step="connect", remedy="check the cable")

    identity = replace(bench.snapshot.identity, drive_type=kind)
    snapshot = replace(bench.snapshot, identity=identity)
    monkeypatch.setattr(restoring, "_complete", lambda *_: snapshot)
    monkeypatch.setattr(restoring, "open_port", silent)
    with pytest.raises(LinkUnreachable) as caught:
        bench.restore()
    assert ("ends with the demo" in caught.value.remedy) == is_gone
    assert ("cable" in caught.value.remedy) != is_gone


@pytest.mark.parametrize(
    ("change", "names"),
    [
        (lambda d: d["in_use"].update(stator_resistance=60.0), "in_use.stator_resistance = 60"),
        (lambda d: d["stored"].update(stator_resistance=60.0), "stored.stator_resistance = 60"),
        (lambda d: d["in_use"].pop("stator_resistance"), "in_use.stator_resistance"),
        (lambda d: d.update(in_use={}, stored={}), "in_use"),
        (lambda d: d["identity"].update(serial_number=1), "serial_number"),
    ],
)
def test_a_changed_snapshot_is_refused_by_its_key(bench, change, names):
    bench.write()
    held = bench.held()
    bench.edit(change)
    with pytest.raises(DataRefused, match=r"snapshot\.json") as caught:
        bench.restore()
    assert names in str(caught.value.value) and caught.value.remedy
    assert bench.held() == held


def forge(bench, name, value):
    """Snapshot and journal agree on the value."""
    bench.edit(lambda d: [d[which].update({name: value}) for which in ("in_use", "stored")])

    def change(line):
        if line["kind"] == "reply":
            for which in ("in_use", "stored"):
                line["record"]["reply"][which][name] = value
        return line

    return change


@pytest.mark.parametrize(("name", "value"), [("stator_resistance", 42.0), ("magnetizing_inductance", 9.0)])
def test_a_value_that_no_motor_of_the_plate_has_is_refused_whatever_the_chain_says(bench, name, value):
    bench.write()
    held = bench.held()
    rechain(bench.folder.path / "journal.jsonl", forge(bench, name, value))
    with pytest.raises(DataRefused, match=rf"snapshot\.json holds a {name} that no motor of this plate has") as caught:
        bench.restore()
    assert f"in_use.{name} = {value:g}" in caught.value.value and "..." in caught.value.limit
    assert bench.held() == held


def test_a_likely_value_put_into_snapshot_and_journal_is_refused_by_the_chain(bench):
    bench.write()
    held = bench.held()
    change = forge(bench, "stator_resistance", 2.9)
    path = bench.folder.path / "journal.jsonl"
    lines = [change(json.loads(line)) for line in path.read_text().splitlines()]
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    with pytest.raises(DataRefused, match=r"journal\.jsonl is not as the run left it") as caught:
        bench.restore()
    assert "was changed" in caught.value.value
    assert bench.held() == held


def test_an_incomplete_snapshot_is_refused_also_where_the_journal_has_no_copy(bench):
    path = bench.folder.path / "journal.jsonl"
    path.write_text("")
    bench.edit(lambda d: d["in_use"].pop("stator_resistance"))
    with pytest.raises(DataRefused, match=r"snapshot\.json") as caught:
        bench.restore()
    assert "stator_resistance is missing" in caught.value.value


def test_values_that_somebody_else_wrote_are_not_overwritten(bench):
    bench.write()
    other = Inverter(bench.drive, PROFILE)
    other.write_parameters({"rotor_resistance": 1.5}, other.snapshot())
    held = bench.held()
    with pytest.raises(IdentityMismatch, match="holds a rotor resistance that") as caught:
        bench.restore()
    assert (caught.value.unit, str(caught.value.limit).count(" ohm")) == ("ohm", 2)
    assert caught.value.exit_code == 5 and "newest run" in caught.value.remedy
    assert bench.held() == held


@pytest.mark.parametrize("new", [set(), {"stator_resistance"}, {"rotor_resistance", "leakage_inductance"}])
def test_any_mixture_of_old_and_announced_values_is_taken_back(bench, new):
    """A kill in a drive without staging leaves some of the values written."""
    bench.folder.journal("about_to", {"action": "commit", "values": NEW})
    other = Inverter(bench.drive, PROFILE)
    other.write_parameters({name: NEW[name] for name in new}, other.snapshot())
    bench.restore()
    assert bench.held() == bench.snapshot.in_use


def test_a_set_that_lay_staged_before_the_run_is_known_by_its_check_sum(bench):
    bench.write()
    path = bench.folder.path / "journal.jsonl"

    def only_the_check_sum(line):
        if line["kind"] == "about_to" and line["record"]["action"] == "stage":
            line["record"]["values"] = {"staged_crc": line["record"]["values"]["staged_crc"]}
        return line

    rechain(path, only_the_check_sum)
    bench.restore()
    assert bench.held() == bench.snapshot.in_use


def test_restore_with_json_asks_for_yes(bench):
    with pytest.raises(UsageError, match="--json"):
        restore_run(bench.folder.path.parent, "last", None, yes=False, as_json=True)


@pytest.mark.parametrize("name", ["journal.jsonl", "blocks.bin"])
def test_a_link_in_a_run_folder_is_not_written_through(bench, tmp_path, name):
    victim = tmp_path / "victim"
    victim.write_text("one\nprecious")
    (bench.folder.path / name).unlink()
    (bench.folder.path / name).symlink_to(victim)
    with pytest.raises(DataRefused, match=name):
        RunFolder(bench.folder.path)
    assert victim.read_text() == "one\nprecious"


@pytest.mark.parametrize("make", [Path.mkdir, pytest.param(os.mkfifo, id="pipe")])
def test_what_is_no_file_in_a_run_folder_is_not_waited_for(bench, make):
    """A restore once hung at a pipe, the drive taken."""
    (bench.folder.path / "blocks.bin").unlink()
    make(bench.folder.path / "blocks.bin")
    with pytest.raises(DataRefused, match=r"blocks\.bin is damaged"):
        bench.restore()


def test_a_pipe_where_a_file_is_being_made_is_not_waited_for(bench):
    os.mkfifo(bench.folder.path / "result.json.part")
    with pytest.raises(OSError, match="No such device"):
        bench.folder.save("result.json", {})


def test_a_block_that_is_written_short_leaves_no_torn_record(bench):
    signal = np.arange(29.0)
    block = SampleBlock(
        session=1, first_index=0, sample_period_s=2e-4, axis_deg=0.0, voltage_axis_v=signal, current_u_a=signal,
        current_v_a=signal, current_w_a=None, dc_link_v=540.0, lost_before=0,
    )  # fmt: skip
    whole = bench.folder._blocks
    bench.folder.append(block, 0)

    class Short:
        fileno = whole.fileno

        def write(self, data):
            return whole.write(data[:50])

    bench.folder._blocks = Short()
    with pytest.raises(OSError) as caught:
        bench.folder.append(replace(block, first_index=29), 0)
    bench.folder._blocks = whole
    assert caught.value.errno == errno.ENOSPC
    bench.folder.append(replace(block, first_index=58), 0)
    assert [b.first_index for _, b in read_blocks(bench.folder.path / "blocks.bin")] == [0, 58]


@pytest.mark.parametrize("full_at", ["writing_began", "stage"])
def test_on_a_disk_that_is_full_before_anything_was_sent_nothing_is_said_to_be_in_doubt(bench, monkeypatch, full_at):
    report = bench.write()
    bench.folder.journal("parameters_written", report)
    journal = RunFolder.journal

    def filling(folder, kind, record, *, durable=False):
        if kind == full_at or (kind == "about_to" and record.action.name.lower() == full_at):
            raise OSError(errno.ENOSPC, "No space left on device")
        journal(folder, kind, record, durable=durable)

    monkeypatch.setattr(RunFolder, "journal", filling)
    before, count = bench.held(), len(bench.drive.log)
    with pytest.raises(CommissionerError, match="No space left on device; nothing was written into the drive"):
        bench.restore()
    assert bench.held() == before and not {"commit", "store"} & {name for name, _ in bench.drive.log[count:]}
    assert summarise(bench.folder.path).held is Held.NEW


@pytest.mark.parametrize("full_at", ["commit", "store", "snapshot_restored"])
def test_a_disk_that_fills_up_while_restoring_says_what_the_drive_may_hold(bench, monkeypatch, full_at):
    bench.write()
    journal = RunFolder.journal

    def filling(folder, kind, record, *, durable=False):
        if kind == full_at or (kind == "about_to" and record.action.name.lower() == full_at):
            raise OSError(errno.ENOSPC, "No space left on device")
        journal(folder, kind, record, durable=durable)

    monkeypatch.setattr(RunFolder, "journal", filling)
    if full_at == "snapshot_restored":
        assert bench.restore().written
        assert bench.held() == bench.snapshot.in_use
    else:
        with pytest.raises(WriteBackFailed, match="old or its new parameters"):
            bench.restore()
    assert summarise(bench.folder.path).written.startswith("old or new")


@pytest.mark.parametrize(("had_written", "says"), [(True, Held.NEW), (False, Held.OLD_OR_NEW)])
def test_a_restore_that_failed_and_left_the_drive_as_it_was_leaves_what_was_known_of_it(bench, had_written, says):
    """Where a write-back was killed before, nothing was known, and nothing is."""
    report = bench.write()
    if had_written:
        bench.folder.journal("parameters_written", report)
    since = summarise(bench.folder.path).held_utc
    bench.drive.commit_result = 4
    with pytest.raises(WriteBackFailed, match="held before this restore, verified"):
        bench.restore()
    told = summarise(bench.folder.path)
    assert (told.held, told.written.startswith(says.value)) == (says, True)
    assert (told.held_utc == since) == had_written
    bench.drive.commit_result = 2
    assert bench.restore().written and summarise(bench.folder.path).held is Held.RESTORED


def test_how_the_drive_stands_is_kept_as_a_record_and_read_from_the_sentence_of_earlier_versions_alone(tmp_path):
    folder = make_run(tmp_path, "20260101-000000-simulated-abcdef")
    writing = RunFolder(folder)
    writing.journal("about_to", {"action": "commit", "values": {}})
    writing.close()
    path, size = folder / "summary.json", (folder / "journal.jsonl").stat().st_size
    kept = json.loads(path.read_text())
    assert kept["summary"]["held"] == "old or new"
    kept["summary"]["written"] = "in words that begin otherwise"
    path.write_text(json.dumps(kept))
    assert read_summary(folder, size).held is Held.OLD_OR_NEW
    del kept["summary"]["held"]
    path.write_text(json.dumps(kept))
    assert read_summary(folder, size).held is Held.NOT_KNOWN
    kept["summary"]["written"] = "new, read back and stored"
    path.write_text(json.dumps(kept))
    assert read_summary(folder, size).held is Held.NEW
    kept["summary"]["held"] = "something else"
    path.write_text(json.dumps(kept))
    assert read_summary(folder, size) is None


def test_the_steps_of_a_restore_are_told_by_its_records_as_they_come(bench, monkeypatch):
    """A page that only span for the ten seconds of a proof told nobody whether the drive was being written."""
    bench.write()
    die(bench.folder)
    journal, told = bench.folder.path / "journal.jsonl", []
    offset, write = journal.stat().st_size, RunFolder.journal
    told.append(step_of(journal, offset))

    def told_of(folder, *record, **how):
        write(folder, *record, **how)
        told.append(step_of(journal, offset))

    monkeypatch.setattr(RunFolder, "journal", told_of)
    said = []
    restoring.restore(summarise(bench.folder.path), None, observe=deciding._telling(said.append))
    assert [words.split(" ")[0] for words in said] == ["comparing", "staging", "bringing", "storing"]
    assert list(dict.fromkeys(told)) == list(STEPS)
    assert step_of(journal.parent / "gone.jsonl", offset) == STEPS[0]
