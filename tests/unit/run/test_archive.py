"""The run folder loses nothing that was written and shows where a kill tore the rest."""

import json
import math
import os
import platform
import re
import sqlite3
import stat
import struct
import threading
import zlib
from contextlib import closing, nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from commissioner.cli.screens import screen
from commissioner.encoding import plain
from commissioner.errors import DataRefused, UsageError
from commissioner.operations.archive import export_run
from commissioner.operations.history.runs import Archive as RunFolders
from commissioner.operations.history.runs import Wanted, find_runs, index_runs, show_run, write_runs
from commissioner.procedure.steps import Findings
from commissioner.recordings.table import read_table, to_standstill, write_table
from commissioner.records import SampleBlock
from commissioner.report.run.standing import Standing
from commissioner.run.archive import blocks, report
from commissioner.run.archive.blocks import follow_blocks, frame, read_blocks
from commissioner.run.archive.catalogue import find_run
from commissioner.run.archive.folder import RunFolder, write_recording
from commissioner.run.archive.follow import JournalFollower
from commissioner.run.archive.journal import read_journal
from commissioner.run.archive.origin import PERSON
from commissioner.run.archive.seal import read_key
from commissioner.run.archive.summary import NO_RESULT, summarise
from commissioner.run.archive.verify import verify
from commissioner.service.archive import Archive
from commissioner.service.runs.others import request_of
from tests.support.archive.killed import die
from tests.support.archive.synthetic import MACHINE, make_run, result_of


def _block(first: int, count: int = 29, *, lost: int = 0, with_w: bool = True) -> SampleBlock:
    k = first + np.arange(count, dtype=float)
    return SampleBlock(
        session=3,
        first_index=first,
        sample_period_s=2e-4,
        axis_deg=60.0,
        voltage_axis_v=np.sin(k),
        current_u_a=np.cos(k),
        current_v_a=-np.cos(k) / 2,
        current_w_a=-np.cos(k) / 2 if with_w else None,
        dc_link_v=540.0,
        lost_before=lost,
    )


@pytest.fixture
def folder(tmp_path):
    made = RunFolder.create(tmp_path / "runs", "test")
    yield made
    made.close()


def test_run_folder_is_readable_by_its_owner_only(folder):
    assert stat.S_IMODE(folder.path.stat().st_mode) == 0o700


def test_two_runs_in_one_second_get_two_folders(tmp_path):
    made = [RunFolder.create(tmp_path, "x") for _ in range(3)]
    assert len({m.path for m in made}) == 3
    for m in made:
        m.close()


def test_every_sample_comes_back_bit_for_bit(folder):
    folder.append(_block(0), 0)
    folder.append(_block(29, with_w=False), 0)
    blocks = list(read_blocks(folder.path / "blocks.bin"))
    assert [segment for segment, _ in blocks] == [0, 0]
    assert np.array_equal(blocks[0][1].current_u_a, _block(0).current_u_a)
    assert blocks[1][1].current_w_a is None


def test_what_a_drive_counted_is_kept_in_its_counts_and_comes_back_bit_for_bit(folder):
    unit_v, unit_a = 0.0171, 1e-3 / 3
    counts = np.array([-32768, -1, 0, 7, 32767]).repeat(6)
    signals = {"voltage_axis_v": counts * unit_v, **{f"current_{phase}_a": counts * unit_a for phase in "uvw"}}
    block = replace(_block(0, counts.size), **signals, unit_v=unit_v, unit_a=unit_a)
    other = replace(block, current_v_a=block.current_v_a + 1e-9)
    minus_zero = replace(block, current_v_a=np.copysign(block.current_v_a, -1.0))
    sizes = []
    for given in (block, other, minus_zero):
        folder.append(given, 0)
        sizes.append((folder.path / "blocks.bin").stat().st_size)
    for (_, read), given in zip(read_blocks(folder.path / "blocks.bin"), (block, other, minus_zero), strict=True):
        for name in signals:
            assert getattr(read, name).tobytes() == getattr(given, name).tobytes(), name
    assert sizes[0] < 0.25 * (sizes[1] - sizes[0])


@pytest.mark.parametrize("place", [1, 4, 9, 30])
def test_a_flipped_bit_in_a_block_of_counts_costs_that_block_alone(folder, place):
    blocks = [replace(_block(29 * n), **_counted(29 * n), unit_v=0.02, unit_a=1e-3) for n in range(3)]
    ends = []
    for block in blocks:
        folder.append(block, 0)
        ends.append((folder.path / "blocks.bin").stat().st_size)
    path = folder.path / "blocks.bin"
    assert [end for end, _ in follow_blocks(path, 0, 9)] == ends
    assert [end for end, _ in follow_blocks(path, ends[0], 1)] == ends[1:2]
    data = bytearray(path.read_bytes())
    data[ends[0] + place] ^= 1
    path.write_bytes(data)
    damage = []
    read = [block for _, block in read_blocks(path, damage)]
    assert [(b.first_index, b.lost_before) for b in read] == [(0, 0), (58, 29)]
    assert [(d.offset, d.size) for d in damage] == [(ends[0], ends[1] - ends[0])]


def _counted(first):
    k = np.arange(first, first + 29)
    return {"voltage_axis_v": k * 0.02, **{f"current_{phase}_a": k % 7 * 1e-3 for phase in "uvw"}}


def _framed(mark, payload):
    return struct.pack("<4sII", mark, len(payload), zlib.crc32(payload)) + payload


def _no_blocks():
    """Whole frames, by name, that hold no block."""
    counted = frame(replace(_block(29), **_counted(29), unit_v=0.02, unit_a=1e-3), 0)[12:]
    yield "deflates nothing", _framed(b"BLKZ", b"no deflated block")
    yield "cut short", _framed(b"BLKZ", counted[:-1])
    yield "something behind", _framed(b"BLKZ", counted + b"behind it")
    yield "swells", _framed(b"BLKZ", zlib.compress(bytes(900 << 10), wbits=-15))
    yield "too short", _framed(b"BLK1", b"short")
    yield "a mean over nothing", _framed(b"BLK1", frame(replace(_block(29), averaged=7), 0)[12:-2] + bytes(2))
    for broken in (
        {"sample_period_s": 0.0},
        {"sample_period_s": math.nan},
        {"sample_period_s": -1.0},
        {"axis_deg": math.inf},
    ):
        yield f"{broken}", frame(replace(_block(29), **broken), 0)


@pytest.mark.parametrize("name", [name for name, _ in _no_blocks()])
def test_a_whole_frame_that_holds_no_block_costs_that_frame_alone(folder, name):
    """An export divided by a period of none; by one frame that deflates to nothing all behind it was lost, by --salvage too."""
    parts = [frame(_block(0), 0), dict(_no_blocks())[name], frame(_block(58), 0)]
    path = folder.path / "blocks.bin"
    path.write_bytes(b"".join(parts))
    damage = []
    assert [(b.first_index, b.lost_before) for _, b in read_blocks(path, damage)] == [(0, 0), (58, 29)]
    assert [(d.offset, d.size, d.after) for d in damage] == [(len(parts[0]), len(parts[1]), (0, 29))]
    assert [b.first_index for _, (_, b) in follow_blocks(path, 0, 9)] == [0]


def test_a_mark_that_claims_more_than_any_block_has_costs_no_check_sum(folder, monkeypatch):
    """Each of so many false marks was summed over a megabyte: 3 MB of them took two minutes."""
    summed = []
    monkeypatch.setattr(blocks.zlib, "crc32", lambda data: summed.append(len(data)) or 0)
    (folder.path / "blocks.bin").write_bytes(struct.pack("<4sII", b"BLK1", 900_000, 7) * 90_000)
    assert list(read_blocks(folder.path / "blocks.bin")) == []
    assert not summed


@pytest.mark.parametrize("cut", [1, 5, 12, 40, 300, 900])
def test_a_torn_last_block_is_left_out_and_the_rest_is_whole(folder, cut):
    for n in range(3):
        folder.append(_block(29 * n), 0)
    path = folder.path / "blocks.bin"
    path.write_bytes(path.read_bytes()[:-cut])
    assert [b.first_index for _, b in read_blocks(path)] == [0, 29]


@pytest.mark.parametrize("place", ["mark", "length", "check sum", "samples"])
def test_a_flipped_bit_costs_one_block_and_its_samples_are_counted_as_lost(folder, place):
    for n in range(4):
        folder.append(_block(29 * n), 0)
    path = folder.path / "blocks.bin"
    data = bytearray(path.read_bytes())
    data[len(data) // 4 + {"mark": 1, "length": 4, "check sum": 9, "samples": 400}[place]] ^= 1
    path.write_bytes(data)
    damage = []
    blocks = [block for _, block in read_blocks(path, damage)]
    assert [block.first_index for block in blocks] == [0, 58, 87]
    assert [block.lost_before for block in blocks] == [0, 29, 0]
    assert [(d.offset, d.size, d.after, d.lost_samples, d.is_tail) for d in damage] == [
        (len(data) // 4, len(data) // 4, (0, 29), 29, False)
    ]


def test_lost_samples_are_missing_rows_in_the_recording(folder):
    folder.append(_block(0, 10), 0)
    folder.append(_block(15, 10, lost=5), 0)
    folder.append(_block(0, 10), 1)
    target = write_recording(folder.path, {"sample_period_s": 2e-4, "connection": "star"})
    recording = to_standstill(read_table(target))
    steps = np.round(np.diff(recording.time_s) / 2e-4).astype(int)
    assert steps.tolist() == [1] * 9 + [6] + [1] * 19
    assert recording.segment.tolist() == [0] * 20 + [1] * 10


def test_journal_survives_a_torn_line(folder):
    folder.journal("a", {"x": 1.0}, durable=True)
    folder.journal("b", {"x": float("nan")})
    path = folder.path / "journal.jsonl"
    path.write_text(path.read_text() + '{"n": 2, "ki')
    records = read_journal(path)
    assert [r["kind"] for r in records] == ["run_started", "a", "b"]
    assert records[2]["record"] == {"x": None}


def test_json_never_holds_nan_or_arrays():
    assert (
        json.dumps(plain({"a": np.array([1.0, np.inf]), "b": np.float64(2)}), allow_nan=False)
        == '{"a": [1.0, null], "b": 2.0}'
    )


def test_what_is_added_after_a_torn_line_can_be_read(folder):
    folder.journal("a", 1)
    folder.close()
    path = folder.path / "journal.jsonl"
    path.write_text(path.read_text() + '{"n": 1, "ki')
    again = RunFolder(folder.path)
    again.journal("b", 2)
    again.close()
    kinds = ["run_started", "a", "folder_closed", "b", "folder_closed"]
    assert [(r["n"], r["kind"]) for r in read_journal(path)] == list(enumerate(kinds))


@pytest.mark.parametrize("said", ["M\udcfcller", "M\udcc3\udcbcller", "M\xfcller"])
def test_who_ran_it_is_told_by_the_letters_that_the_system_has_as_bytes(tmp_path, monkeypatch, said):
    """A name of a computer that is not set to UTF-8 lost its letters, and nobody found the run by it."""
    monkeypatch.setenv(PERSON, said)
    monkeypatch.setattr(platform, "node", lambda: said)
    with closing(RunFolder.create(tmp_path, "x")) as made:
        pass
    told = summarise(made.path)
    assert (told.person, told.host) == ("M\xfcller", "M\xfcller")
    assert find_runs(RunFolders(tmp_path), Wanted(person="m\xfcller")).total == 1


def intent(action):
    return {"action": action, "values": {}}


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ([], "as before"),
        ([("about_to", intent("energise"))], "as before"),
        ([("about_to", intent("stage"))], "old or new"),
        ([("about_to", intent("commit")), ("parameters_written", {})], "new"),
        ([("about_to", intent("store")), ("snapshot_restored", {})], "as before (restored)"),
        ([("about_to", intent("store")), ("parameters_written", {}), ("about_to", intent("stage"))], "old or new"),
        ([("parameters_written", {}), ("about_to", intent("stage")), ("snapshot_restored", {})], "as before (rest"),
        (
            [("about_to", intent("tune")), ("snapshot_restored", {}), ("run_ended", {})],
            "as before, read back",
        ),  # by itself
        ([("run_ended", {}), ("about_to", intent("stage")), ("snapshot_restored", {})], "as before (rest"),
        (
            [("parameters_written", {"store_count_after": 18, "endurance_writes": 100000})],
            "new, read back and stored; 18 of 100000 writes",
        ),
    ],
)
def test_the_last_word_of_the_journal_says_which_parameters_the_drive_holds(folder, lines, says):
    for kind, record in lines:
        folder.journal(kind, record)
    assert summarise(folder.path).written.startswith(says)


@pytest.mark.parametrize("mark", [": ", ":", " = ", "="])
def test_a_comment_with_an_equals_sign_is_a_value_too(tmp_path, mark):
    path = tmp_path / "a.csv"
    path.write_text(
        f"# rated_current_a{mark}5.2\n# note{mark}at 20:15, R=3\n# nothing\ntime_s,current_u_a\n0,1\n0.001,2\n"
    )
    metadata = read_table(path).metadata
    assert metadata["rated_current_a"] == 5.2 and metadata["note"] == "at 20:15, R=3"


@pytest.mark.parametrize(
    ("written", "seen"),
    [
        ('{"outcome": "commissioned", "parameters": {"stator_res', "not readable"),
        ('{"outcome": 7, "parameters": [1], "reason": {"a": []}, "checks": 3}', "outcome: .* not 7"),
        ('{"outcome": "rejected", "parameters": [1]}', r"parameters.*: .* not \[1\]"),
        ('{"outcome": "rejected", "remarks": "x"}', "remarks: .* not 'x'"),
        ('{"outcome": "rejected", "checks": [{"name": [], "has_passed": 1}]}', r"checks\.0\.name: .* not \[\]"),
        ("[" * 100_000, "not readable"),
    ],
)
def test_a_damaged_result_is_refused_by_name_and_hides_no_other_run(tmp_path, written, seen):
    good, bad = "20260101-000000-simulated-abcdef", "20260102-000000-simulated-abcdef"
    result = result_of(good, MACHINE)
    make_run(tmp_path, good, result=result)
    (make_run(tmp_path, bad, result=result) / "result.json").write_text(written)
    assert show_run(tmp_path, good).summary.result == Archive(tmp_path).result(good) == result
    for read in (show_run, lambda root, run: Archive(root).result(run)):
        with pytest.raises(DataRefused, match=r"result\.json is damaged") as refusal:
            read(tmp_path, bad)
        assert refusal.value.value and re.match(seen, str(refusal.value.value))
    assert find_run(tmp_path, bad).result is None
    assert [entry.run for entry in Archive(tmp_path).entries()] == [bad, good]


def test_a_result_of_an_older_version_is_shown(tmp_path):
    run = "20250101-000000-simulated-abcdef"
    make_run(tmp_path, run, result={"outcome": "rejected", "energised_s": None, "parameters": {}})
    assert show_run(tmp_path, run).summary.result == {"outcome": "rejected", "energised_s": None, "parameters": {}}


def test_a_run_that_was_cut_off_says_no_energised_time(tmp_path):
    """0.0 s would say that the motor was never energised."""
    run = "20260101-000000-simulated-abcdef"
    make_run(tmp_path, run, closed=False)
    shown = show_run(tmp_path, run)
    assert (shown.summary.outcome, shown.summary.energised_s, shown.losses) == ("cut off", None, ())


@pytest.mark.parametrize(
    ("kinds", "says"),
    [
        ([], "before it connected"),
        (["drive_identified"], "after it connected"),
        (["drive_identified", "tuning_began"], "while the drive tuned itself"),
        (["drive_identified", "tuning_began", "tuned_once"], "while the drive tuned itself"),
        (["drive_identified", "tuning_began", "tuning_ended"], "after the drive had tuned itself"),
        (["drive_identified", "tuning_began", "tuned_once", "tunings_judged"], "after the drive had tuned itself"),
        (["drive_identified", "state_entered", "parameters_written"], "after the parameters had been written back"),
    ],
)
def test_a_run_that_was_cut_off_says_how_far_it_came(folder, kinds, says):
    for kind in kinds:
        folder.journal(kind, {"drive_type": "X"})
    assert says in summarise(folder.path).reason


def test_a_list_says_that_a_run_which_was_cut_off_had_written(folder):
    """Its outcome alone reads as if the drive held what it held before."""
    folder.journal("about_to", {"action": "commit"})
    assert summarise(folder.path).holds == "old or new"
    folder.journal("about_to", {"action": "commit", "values": {"stator_resistance": 3.2, "leakage_inductance": 0.02}})
    assert (
        summarise(folder.path).written.startswith("old or new, or some of each:") and summarise(folder.path).is_unknown
    )
    folder.journal("about_to", {"action": "commit", "values": {"commit": 0xC0DE}})
    assert summarise(folder.path).written.startswith("old or new:")
    folder.journal("parameters_written", {"is_stored": True})
    assert (summarise(folder.path).outcome, summarise(folder.path).holds) == ("cut off", "new")
    folder.journal("run_ended", {"outcome": "commissioned"})
    assert summarise(folder.path).holds == ""


def test_a_result_that_is_still_to_be_kept_is_not_told_as_lost(folder):
    """A list that looks while the run writes its result."""
    folder.journal("run_ended", {"outcome": "commissioned", "reason": "good"})
    assert (summarise(folder.path).standing, summarise(folder.path).reason) == (Standing.ACCEPTED, "good")
    die(folder)
    assert summarise(folder.path).standing is Standing.NOT_KEPT and NO_RESULT in summarise(folder.path).reason


def test_whoever_shows_an_edited_run_says_so(tmp_path, capsys):
    run = "20260101-000000-simulated-abcdef"
    path = make_run(tmp_path, run, result=result_of(run, MACHINE)) / "result.json"
    assert show_run(tmp_path, run).losses == ()
    path.write_text(path.read_text("utf-8").replace("46.9", "46.8"), "utf-8")
    assert [(loss.file, loss.what) for loss in show_run(tmp_path, run).losses] == [
        ("result.json", "its content was changed")
    ]
    screen.losses(run, show_run(tmp_path, run).losses)
    assert "damaged result.json: its content was changed" in " ".join(capsys.readouterr().err.split())


def test_samples_are_not_exported_past_a_damaged_journal(tmp_path):
    """The journal's chain is what proves the samples."""
    run = "20260101-000000-simulated-abcdef"
    journal = make_run(tmp_path, run) / "journal.jsonl"
    journal.write_text(journal.read_text("utf-8").replace("anna", "bert"), "utf-8")
    with pytest.raises(DataRefused, match=r"journal\.jsonl is not as the run left it"):
        export_run(tmp_path, run, tmp_path / "out.csv")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="a system without named pipes")
def test_a_pipe_in_a_files_place_is_not_waited_for(tmp_path):
    """The service follows what lies in its archive: one such folder stopped it for good, also for SIGTERM."""
    for name in ("journal.jsonl", "request.json"):
        os.mkfifo(tmp_path / name)
    assert JournalFollower(tmp_path / "journal.jsonl").new() == []
    assert request_of(tmp_path) == {}


def test_a_request_that_is_no_text_is_none(tmp_path):
    (tmp_path / "request.json").write_bytes(b"\xff\xfe\x80")
    assert request_of(tmp_path) == {}


def test_samples_added_to_a_closed_run_are_no_samples_of_it(folder):
    folder.append(_block(0), 0)
    folder.close()
    assert verify(folder.path).losses == ()
    path = folder.path / "blocks.bin"
    size = path.stat().st_size
    path.write_bytes(2 * path.read_bytes())
    assert [(loss.file, loss.what) for loss in verify(folder.path).losses] == [
        ("blocks.bin", f"{size} bytes of samples behind the {size} that the run had written")
    ]


def test_samples_of_a_run_that_was_killed_may_be_ahead_of_its_journal(folder):
    folder.append(_block(0), 0)
    assert (verify(folder.path).state, verify(folder.path).losses) == ("cut off", ())


def test_a_journal_whose_digests_were_all_taken_out_is_of_no_older_version(folder):
    folder.close()
    path = folder.path / "journal.jsonl"
    bare = [{**json.loads(line), "previous": None, "blocks": None} for line in path.read_text("utf-8").splitlines()]
    kept = [{key: value for key, value in line.items() if value is not None} for line in bare]
    path.write_text("".join(json.dumps(line) + "\n" for line in kept), "utf-8")
    found = verify(folder.path)
    assert (found.state, found.losses[0].what) == ("damaged", "record 0 has lost its digest")


@pytest.mark.parametrize(("name", "files"), [("snapshot.json", ["snapshot.json"]), ("report.html", [])])
def test_a_closing_record_without_the_key_covers_no_other_file_than_the_sealed_one(tmp_path, name, files):
    key = b"a key of thirty-two bytes or so."
    with closing(RunFolder.create(tmp_path, "sealed", key)) as sealed:
        sealed.journal("run_ended", {"outcome": "commissioned"})
        sealed.save("snapshot.json", {"in_use": {"stator_resistance": 3.2}})
        sealed.save_text("report.html", "<p>3.2</p>")
    assert (verify(sealed.path, key).seal, verify(sealed.path, key).losses) == ("valid", ())
    with closing(RunFolder(sealed.path)) as forged:
        forged.save_text(name, '{"in_use": {"stator_resistance": 3.3}}')
    assert [loss.file for loss in verify(sealed.path, key).losses] == files
    assert verify(sealed.path).losses == ()


@pytest.mark.parametrize("is_saved", [False, True])
@pytest.mark.parametrize("name", ["report.html", "result.json"])
def test_a_session_killed_while_it_replaced_a_covered_file_leaves_the_run_intact(tmp_path, monkeypatch, name, is_saved):
    key = b"a key of thirty-two bytes or so."
    with closing(RunFolder.create(tmp_path, "killed", key)) as first:
        first.journal("run_ended", {"outcome": "commissioned"})
        first.save_text(name, "written as the run ended")
    again = RunFolder(first.path, key)
    with monkeypatch.context() as killed:
        if not is_saved:
            killed.setattr("commissioner.run.archive.folder.whole_file", lambda _target: 1 / 0)
        with nullcontext() if is_saved else pytest.raises(ZeroDivisionError):
            again.save_text(name, "written a day later")
        killed.setattr(again, "cover", lambda: None)
        again.close()
    found = verify(first.path)
    assert found.losses == () and any(name in remark for remark in found.remarks)
    unsealed = [loss.file for loss in verify(first.path, key).losses]
    assert unsealed == (["result.json"] if is_saved and name == "result.json" else [])
    (first.path / name).write_text("written by another")
    assert [loss.file for loss in verify(first.path).losses] == [name]
    (first.path / name).write_text("written a day later" if is_saved else "written as the run ended")
    RunFolder(first.path, key).close()
    assert (verify(first.path, key).losses, verify(first.path, key).seal) == ((), "valid")
    assert not any(name in remark for remark in verify(first.path).remarks)


def test_of_sessions_killed_one_behind_the_other_each_may_have_put_its_file_in_place(tmp_path):
    with closing(RunFolder.create(tmp_path, "killed_twice")) as first:
        first.journal("run_ended", {"outcome": "commissioned"})
        first.save_text("report.html", "as the run ended")
    for text in ("by the first", "by the second"):
        killed = RunFolder(first.path)
        killed.save_text("report.html", text)
        die(killed)
        assert verify(first.path).losses == ()
    for text in ("as the run ended", "by the first"):
        (first.path / "report.html").write_text(text)
        assert verify(first.path).losses == ()
    (first.path / "report.html").write_text("by nobody")
    assert [loss.file for loss in verify(first.path).losses] == ["report.html"]


def test_what_is_added_behind_the_seal_without_the_key_is_not_told_as_sealed(tmp_path):
    key = b"a key of thirty-two bytes or so."
    with closing(RunFolder.create(tmp_path, "sealed", key)) as sealed:
        sealed.journal("run_ended", {"outcome": "commissioned"})
    assert verify(sealed.path, key).seal == "valid"
    stranger = RunFolder(sealed.path)
    stranger.journal("parameters_written", {"is_stored": True})
    die(stranger)
    assert verify(sealed.path, key).seal == "valid up to record 2; what was added after it has none"


def test_two_who_write_into_one_run_take_turns_and_its_chain_stays_whole(tmp_path, monkeypatch):
    with closing(RunFolder.create(tmp_path, "two")) as first:
        first.journal("run_ended", {"outcome": "commissioned"})
    diagnosing, waited = RunFolder(first.path), []

    def restoring():
        with closing(RunFolder(first.path)) as second:
            second.journal("snapshot_restored", {})

    other = threading.Thread(target=restoring)
    other.start()
    diagnosing.journal("diagnosed", {}, durable=True)
    waited.append(other.is_alive())
    diagnosing.close()
    other.join(20)
    assert waited == [True] and verify(first.path).losses == ()
    assert [line["kind"] for line in read_journal(first.path / "journal.jsonl")][-3:] == [
        "folder_closed",
        "snapshot_restored",
        "folder_closed",
    ]
    assert not (first.path / ".lock.part").exists()
    monkeypatch.setattr("commissioner.run.archive.folder.LOCK_S", 0.0)
    with closing(RunFolder(first.path)), pytest.raises(UsageError, match="another process writes into"):
        RunFolder(first.path)


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_run_whose_name_is_no_line_of_text_is_written_into_tables(tmp_path, ending):
    name = os.fsdecode(b"20260101-\xff\n1,2")
    make_run(tmp_path, name, result=result_of(name, MACHINE))
    assert write_runs(RunFolders(tmp_path), Wanted(), tmp_path / f"runs.{ending}").runs == 1
    target = tmp_path / f"recording.{ending}"
    write_table(target, {"time_s": np.array([0.0, 1e-3]), "x": np.array([1.0, 2.0])}, {"run": name})
    read = read_table(target)
    assert read.metadata["run"] == r"20260101-\udcff\n1,2" and read.columns["time_s"].size == 2


def test_an_outcome_that_no_run_has_is_refused(tmp_path):
    with pytest.raises(UsageError, match="no run ends like this"):
        find_runs(RunFolders(tmp_path), Wanted(outcome="nonsense"))


@pytest.mark.parametrize(
    "since", ["2026", "2026-11", "2026-1", "2026-11-3", "2026-11-25T1", "2026-11-25T10:17:45Z", ""]
)
def test_as_much_of_a_date_as_one_likes_is_one(tmp_path, since):
    assert not find_runs(RunFolders(tmp_path), Wanted(since=since)).rows


@pytest.mark.parametrize("until", ["foo", "05.11.2026", "2026-13", "2026-02-31", "2026-11-25T25", "26", "２０２６"])
def test_a_date_that_is_none_is_refused_and_no_empty_list(tmp_path, until):
    with pytest.raises(UsageError, match="until is no date"):
        find_runs(RunFolders(tmp_path), Wanted(until=until))


@pytest.mark.parametrize(
    ("name", "path"),
    [
        ("summary.json", ("summary", "energised_s")),
        ("summary.json", ("summary", "motor", "rated_power_w")),
        ("summary.json", ("summary", "parameters", "stator_resistance_ohm")),
        ("request.json", ("nameplate", "rated_power_w")),
    ],
)
def test_a_number_beyond_any_float_hides_no_run(tmp_path, name, path):
    good, bad = "20260101-000000-simulated-abcdef", "20260102-000000-simulated-abcdef"
    make_run(tmp_path, good, result=result_of(good, MACHINE))
    folder = make_run(tmp_path, bad, result=result_of(bad, MACHINE))
    document = place = json.loads((folder / name).read_text("utf-8"))
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = 10**400
    (folder / name).write_text(json.dumps(document), "utf-8")
    if name != "summary.json":
        (folder / "summary.json").unlink()
    assert [row.run for row in find_runs(RunFolders(tmp_path)).rows] == [bad, good]
    assert write_runs(RunFolders(tmp_path), Wanted(), tmp_path / "runs.csv").runs == 2


def test_a_run_of_a_clock_centuries_off_is_listed(tmp_path):
    run = "20260101-000000-simulated-abcdef"
    folder = make_run(tmp_path, run)
    os.utime(folder / "journal.jsonl", (13_569_465_600, 13_569_465_600))
    assert [row.run for row in find_runs(RunFolders(tmp_path)).rows] == [run]


@pytest.mark.parametrize("made", ["DROP TABLE runs", "ALTER TABLE runs RENAME COLUMN motor TO engine"])
def test_an_index_with_another_table_is_made_anew(tmp_path, made):
    run = "20260101-000000-simulated-abcdef"
    make_run(tmp_path, run)
    index_runs(RunFolders(tmp_path))
    with closing(sqlite3.connect(tmp_path / "index.sqlite")) as index:
        index.execute(made)
    assert index_runs(RunFolders(tmp_path), rebuild=True).read == 1
    assert find_runs(RunFolders(tmp_path)).indexed == "index.sqlite"


@pytest.mark.parametrize("form", ["{0}/{1}", "{0}/{1}/", "{0}/../{2}/{1}"])
def test_a_run_is_found_by_the_path_that_a_shell_completes(tmp_path, form):
    run = make_run(tmp_path, "20261128-225054-simulated-3d243a").name
    assert find_run(tmp_path, form.format(tmp_path, run, tmp_path.name)).run == run


def test_a_run_of_another_archive_is_not_this_ones_and_the_remedy_says_how(tmp_path):
    run = make_run(tmp_path / "theirs", "20261128-225054-simulated-3d243a").name
    (tmp_path / "ours").mkdir()
    with pytest.raises(UsageError, match="no runs match") as caught:
        find_run(tmp_path / "ours", str(tmp_path / "theirs" / run))
    assert "with --runs the folder around it" in caught.value.remedy


def test_words_that_are_no_text_find_nothing(tmp_path):
    """What a terminal of another encoding hands over."""
    make_run(tmp_path, "20260101-000000-simulated-abcdef")
    assert not find_runs(RunFolders(tmp_path), Wanted(text="\udcff", motor="\udcff")).rows


def test_more_runs_than_there_can_be_are_all(tmp_path):
    run = "20260101-000000-simulated-abcdef"
    make_run(tmp_path, run)
    assert [row.run for row in find_runs(RunFolders(tmp_path), Wanted(limit=10**30)).rows] == [run]


@pytest.mark.parametrize(("size", "what"), [(15, "too short"), (70_000, "too long")])
def test_a_key_has_an_end(tmp_path, size, what):
    (tmp_path / "key").write_bytes(b"k" * size)
    with pytest.raises(UsageError, match=what):
        read_key(tmp_path / "key")


def test_a_report_made_again_tells_step_value_limit_and_remedy(tmp_path, monkeypatch):
    error = {
        "kind": "Aborted",
        "what": "the flux rose",
        "step": "multitone",
        "value": 0.93,
        "limit": 0.9,
        "remedy": "check it",
        "unit": "Wb",
    }
    path = make_run(
        tmp_path, "20240105-081500-simulated-000abc", outcome="aborted", reason="the flux rose", closed=False
    )
    with closing(RunFolder(path)) as folder:
        folder.journal("error", error, durable=True)
    told = []
    job = SimpleNamespace(parameter_names=(), parameter_factors={})
    monkeypatch.setattr(report, "learn_again", lambda _path: (job, Findings()))
    monkeypatch.setattr(report, "_page", lambda _path, result, *_more: told.append(result["error"]) or "")
    report.make_report(summarise(path))
    assert told == [error]
