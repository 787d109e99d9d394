"""Runs to a share and back: whole or not at all, resumed, and nothing whole is ever lost to something changed."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import time

import numpy as np
import pytest

from commissioner.errors import UsageError
from commissioner.operations.history import share
from commissioner.records import SampleBlock
from commissioner.run.archive.catalogue import read_runs
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.verify import verify
from commissioner.run.index.index import Wanted, find, refresh
from tests.support.archive.synthetic import make_archive


def block(first):
    k = first + np.arange(29.0)
    return SampleBlock(1, first, 2e-4, 0.0, np.sin(k), np.cos(k), -np.cos(k) / 2, None, 540.0)


@pytest.fixture
def root(tmp_path):
    made = tmp_path / "laptop"
    for _ in range(3):
        folder = RunFolder.create(made, "test")
        for n in range(400):
            folder.append(block(29 * n), 0)
        folder.journal("run_ended", {"outcome": "aborted", "reason": "x", "energised_s": 1.0})
        folder.save("result.json", {"a": 1})
        folder.close()
    return made


def content(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def names(root):
    return sorted(path.name for path in root.iterdir() if (path / "journal.jsonl").is_file())


def test_runs_go_to_the_share_and_back_bit_for_bit(root, tmp_path):
    done = share.push(root, str(tmp_path / "share"))
    assert {one.what for one in done} == {"copied"} and names(tmp_path / "share") == names(root)
    assert {one.what for one in share.push(root, str(tmp_path / "share"))} == {"there already"}
    share.pull(tmp_path / "other", str(tmp_path / "share"))
    for name in names(root):
        assert content(tmp_path / "other" / name) == content(root / name)
        assert verify(tmp_path / "other" / name).state == "intact"


def test_one_run_by_the_start_of_its_id(root, tmp_path):
    share.push(root, str(tmp_path / "share"), ["last"])
    assert names(tmp_path / "share") == [names(root)[-1]]


def test_what_was_added_since_follows_and_an_older_state_never_wins(root, tmp_path):
    share.push(root, str(tmp_path / "share"))
    run = names(root)[0]
    folder = RunFolder(root / run)
    folder.journal("snapshot_restored", {})
    folder.close()
    assert [one.what for one in share.push(root, str(tmp_path / "share"), [run])] == ["updated"]
    assert content(tmp_path / "share" / run) == content(root / run)
    folder = RunFolder(tmp_path / "share" / run)
    folder.journal("snapshot_restored", {"again": 1})
    folder.close()
    newest = content(tmp_path / "share" / run)
    assert [one.what for one in share.push(root, str(tmp_path / "share"), [run])] == ["newer there"]
    folder = RunFolder(root / run)
    folder.journal("snapshot_restored", {"other": 1})
    folder.close()
    (conflict,) = share.push(root, str(tmp_path / "share"), [run])
    assert conflict.what == "conflict" and not conflict.is_good
    assert content(tmp_path / "share" / run) == newest


def test_a_damaged_run_is_left_and_a_spoilt_copy_is_mended(root, tmp_path):
    share.push(root, str(tmp_path / "share"))
    bad, spoilt, _ = names(root)
    for path in (root / bad / "blocks.bin", tmp_path / "share" / spoilt / "blocks.bin"):
        data = bytearray(path.read_bytes())
        data[5000] ^= 1
        path.write_bytes(data)
    before = content(tmp_path / "share" / bad)
    what = {one.run: one.what for one in share.push(root, str(tmp_path / "share"))}
    assert what[bad] == "left: damaged" and what[spoilt] == "updated"
    assert content(tmp_path / "share" / bad) == before
    assert content(tmp_path / "share" / spoilt) == content(root / spoilt)


@pytest.mark.parametrize("tail", [4096 * b"\0", b'{"n": 402, "ki'])
def test_what_a_power_loss_left_behind_the_journal_neither_spoils_nor_follows_the_run(root, tmp_path, tail):
    """`verify` called it whole and `push` damaged; whatever is added to the run later is no other way than the copy's."""
    folder = root / names(root)[0]
    before = content(folder)
    with (folder / "journal.jsonl").open("ab") as journal:
        journal.write(tail)
    seen = verify(folder)
    assert seen.is_whole and any("torn" in remark and "copy leaves it out" in remark for remark in seen.remarks)
    there = tmp_path / "share" / folder.name
    assert [share.push(root, str(tmp_path / "share"), [folder.name])[0].what for _ in range(2)] == [
        "copied",
        "there already",
    ]
    assert content(there) == before
    RunFolder(folder).close()
    assert share.push(root, str(tmp_path / "share"), [folder.name])[0].what == "updated"


def test_a_copy_that_broke_off_goes_on_where_it_was(root, tmp_path):
    run = names(root)[0]
    half = tmp_path / "share" / share.INCOMING / run
    half.mkdir(parents=True)
    data = (root / run / "blocks.bin").read_bytes()
    (half / "blocks.bin").write_bytes(data[:200_000])
    (half / "journal.jsonl").write_bytes(b"nothing of ours")
    (half / "left over").write_bytes(b"x")
    (done,) = share.push(root, str(tmp_path / "share"), [run])
    everything = sum(path.stat().st_size for path in (root / run).iterdir())
    assert done.what == "copied" and done.bytes == everything - 200_000
    assert content(tmp_path / "share" / run) == content(root / run)
    assert not (tmp_path / "share" / share.INCOMING).exists()


def _push(root, target):
    share.push(root, target)


def test_killed_in_the_middle_nothing_half_is_ever_in_the_list(root, tmp_path):
    target = tmp_path / "share"
    context = multiprocessing.get_context("fork")
    for delay in (0.002, 0.01, 0.03, 0.06, 0.1):
        pushing = context.Process(target=_push, args=(root, str(target)))
        pushing.start()
        time.sleep(delay)
        os.kill(pushing.pid, signal.SIGKILL)
        pushing.join()
        for name in names(target) if target.is_dir() else []:
            assert content(target / name) == content(root / name)
    share.push(root, str(target))
    assert names(target) == names(root)


def test_the_shares_index_knows_what_came(root, tmp_path):
    target = tmp_path / "share"
    make_archive(target, 3)
    refresh(target)
    share.push(root, str(target))
    assert [row.run for row in find(target, Wanted()).rows] == [run.run for run in read_runs(target)]


@pytest.mark.parametrize("target", ["https://host/runs", "same", "a file"])
def test_a_target_that_is_none_is_one_clear_failure(root, tmp_path, target):
    file = tmp_path / "file.txt"
    file.touch()
    with pytest.raises(UsageError):
        share.push(root, {"same": str(root), "a file": str(file)}.get(target, target))


def test_links_are_not_followed(root, tmp_path):
    run = names(root)[0]
    secret = tmp_path / "secret"
    secret.write_text("x")
    (root / run / "link").symlink_to(secret)
    share.push(root, str(tmp_path / "share"), [run])
    assert not (tmp_path / "share" / run / "link").exists()
    shutil.rmtree(tmp_path / "share")


@pytest.mark.parametrize("step", ["_copy_file", "_put_in_place"])
def test_a_mover_that_another_one_overtakes_takes_nothing_away(root, tmp_path, monkeypatch, step):
    """The other one is through between two steps of this one, over an older state that lay there."""
    target, run = tmp_path / "share", names(root)[0]
    share.push(root, str(target), [run])
    folder = RunFolder(root / run)
    folder.journal("snapshot_restored", {})
    folder.close()
    original = getattr(share, step)

    def overtaken(*more):
        monkeypatch.setattr(share, step, original)
        assert [one.what for one in share.push(root, str(target), [run])] == ["updated"]
        return original(*more)

    monkeypatch.setattr(share, step, overtaken)
    assert [one.what for one in share.push(root, str(target), [run])] == ["there already"]
    assert content(target / run) == content(root / run)
