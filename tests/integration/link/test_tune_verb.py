"""`tune` as a user calls it: the command line, TCP, an emulated drive in its own process, and its answer key afterwards."""

import json
import socket
import subprocess
import sys
import time
from contextlib import closing

import pytest

from commissioner.run.stopping.stop_file import ask_to_stop
from commissioner.service.runs.feed import Feed
from tests.support.command_line import call
from tests.support.preloaded import PreloadedProcess
from tests.support.vendor_process import Vendor


def tune(drive, runs, *more, profile="schneider_atv340"):
    return call(
        "tune", "--drive", drive.url, "--profile", profile, "--motor", "motor_2kw2", "--runs", str(runs), "--pause", "0",
        "--yes", "--json", *more,
    )  # fmt: skip


def test_an_ordinary_drive_serves_without_a_keypad():
    """A build server's standard input is /dev/null, which epoll does not take."""
    command = [sys.executable, "-m", "sim.vendors.serve", "danfoss_fc302"]
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, encoding="utf-8"
    ) as drive:
        assert drive.stdout is not None
        port = int(drive.stdout.readline().rpartition(":")[2])
        with socket.create_connection(("127.0.0.1", port), timeout=20) as line:
            line.sendall(bytes.fromhex("000100000006010304000001"))
            assert line.recv(64)[:2] == b"\x00\x01"
        drive.terminate()
        answer_key = json.loads(drive.stdout.read().splitlines()[-1])
    assert answer_key["tunings"] == []


def test_a_remote_tuning_is_kept_and_taken_back_by_restore(tmp_path):
    """Over a serial line, as most drives of this kind are spoken to; the others here over TCP."""
    with Vendor("schneider_atv340", "--tuning-s", "0.6", "--rtu", "pty") as drive:
        answer = tune(drive, tmp_path, "--hardwired-stop", "--write-back")
        exported = call(
            "runs", "export", "last", str(tmp_path / "p.json"), "--form", "json", "--runs", str(tmp_path), "--json"
        )
        restored = call("restore", "last", "--runs", str(tmp_path), "--yes", "--json")
    assert answer.code == 0, answer.stdout
    result = answer.json
    assert result["outcome"] == "commissioned" and len(result["tune"]["repeats"]) == 3
    assert result["tune"]["in_the_drive"].startswith("new")
    assert "tuning: proved on no physical drive yet" in result["remarks"]
    assert exported.code == 3 and exported.json["error"]["value"] == "commissioned, no parameters"
    assert result["energised_s"] is None  # the drive did it, and does not say how long
    assert restored.code == 0 and restored.json["outcome"] == "restored"
    assert [t["end"] for t in drive.truth["tunings"]] == ["done"] * 3
    assert drive.truth["held"]["stator_resistance"] == result["tune"]["rows"][0]["before"]
    assert "The drive&#39;s own tuning" in (tmp_path / result["run"] / "report.html").read_text("utf-8")


@pytest.mark.parametrize(("how", "code"), [("fails", 5), ("keypad", 4)])
def test_a_tuning_that_goes_wrong_ends_with_its_exit_code_and_the_old_values(tmp_path, how, code):
    with Vendor("schneider_atv340", "--tuning-s", "0.6", "--tuning", how) as drive:
        answer = tune(drive, tmp_path, "--hardwired-stop")
    assert answer.code == code
    assert answer.json["tune"]["in_the_drive"] == "as before, read back"
    assert drive.truth["is_energised"] is False


def test_what_cannot_be_is_one_clear_refusal_before_anything_is_sent(tmp_path):
    with Vendor("schneider_atv340") as drive:
        unsupervised = tune(drive, tmp_path)
        assisted = tune(drive, tmp_path, profile="danfoss_fc302")
        keypad = tune(drive, tmp_path, profile="siemens_v20")
    assert (unsupervised.code, assisted.code, keypad.code) == (3, 2, 2)
    assert "--hardwired-stop" in unsupervised.json["error"]["remedy"]
    assert "nobody can be asked" in assisted.json["error"]["what"]
    assert "keypad" in keypad.json["error"]["remedy"]
    assert drive.truth["tunings"] == []


def test_stop_from_the_page_ends_a_tuning_that_the_command_line_began(tmp_path):
    """By the file in its folder; the service's fold over its journal says energised while the drive tunes itself."""
    with Vendor("schneider_atv340", "--tuning-s", "20") as drive:
        arguments = ["tune", "--drive", drive.url, "--profile", "schneider_atv340", "--motor", "motor_2kw2",
                     "--runs", str(tmp_path), "--pause", "0", "--yes", "--json", "--hardwired-stop"]  # fmt: skip
        with closing(PreloadedProcess("commissioner", arguments)) as process:
            end = time.monotonic() + 120
            while not (found := list(tmp_path.glob("*/journal.jsonl"))) or '"tune"' not in found[0].read_text("utf-8"):
                assert time.monotonic() < end
                time.sleep(0.05)
            feed = Feed(found[0].parent)
            while feed.poll():
                pass
            assert (feed.state.output, feed.state.phase) == ("on", "tuning")
            ask_to_stop(found[0].parent, "otto", "seen on the page")
            code = process.wait(60.0)
            document = json.loads(process.stdout)
        while feed.poll():
            pass
        feed.close()
    assert code == 4
    assert document["error"]["value"] == "seen on the page (otto)"
    assert document["tune"]["in_the_drive"] == "as before, read back"
    assert feed.state.is_over and feed.state.stop["person"] == "otto"
    assert drive.truth["is_energised"] is False
