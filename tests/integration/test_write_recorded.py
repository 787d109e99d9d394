"""A drive without a test mode: checked, written from a recording, read back and restored, as registers over a wire."""

import pytest

from commissioner.link.files.drive_file import DRIVES_FOLDER
from tests.support.command_line import call
from tests.support.raw_servers import Bank, TcpDevice
from tests.support.service.described import judge

STATUS_WORD, STATOR_RESISTANCE = 50199, 1299
READY, RUNNING, TRIPPED = 0x0202, 0x0A02, 0x020A


def fc302() -> Bank:
    """What a Danfoss FC 302 set up for `motor_2kw2` shows in the registers its file names; R_s 3.0 ohm."""
    bank = Bank()
    for address, words in {
        STATUS_WORD: [READY], 16299: [540], 1199: [0, 220], 1219: [400], 1229: [50], 1239: [0, 500], 1249: [1436],
        1389: [4], 8029: [0, 10], STATOR_RESISTANCE: [0, 30000],
    }.items():  # fmt: skip
        bank.words[address : address + len(words)] = words
    return bank


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("recorded") / "scope.parquet"
    made = call(
        "simulate",
        "motor_2kw2",
        "--out",
        str(path),
        "--seconds",
        "4",
        "--axes",
        "0,60,120",
        "--noise-a",
        "0.01",
        "--json",
    )
    assert made.code == 0
    return path


@pytest.fixture
def drive():
    with TcpDevice(fc302()) as device:
        yield device


@pytest.fixture
def danfoss(tmp_path):
    """Its file, with a pause of its own after a write that a test can wait for; 5 s are in the one that is shipped."""
    path = tmp_path / "danfoss.toml"
    text = (DRIVES_FOLDER / "danfoss_fc302.toml").read_text("utf-8")
    assert "settle_s = 5.0" in text
    path.write_text(text.replace("settle_s = 5.0", "settle_s = 0.2"), "utf-8")
    return str(path)


def write(recording, drive, runs, profile="danfoss_fc302"):
    return call(
        "identify", str(recording), "--write-back", "--drive", f"tcp://127.0.0.1:{drive.port}", "--profile", profile,
        "--yes", "--runs", str(runs), "--json",
    )  # fmt: skip


def held(drive):
    high, low = drive.bank.words[STATOR_RESISTANCE : STATOR_RESISTANCE + 2]
    return 1e-4 * (high << 16 | low)


def test_an_accepted_recording_is_written_in_the_drives_terms_and_restored_from_the_run(
    recording, drive, danfoss, tmp_path
):
    answer = write(recording, drive, tmp_path, danfoss)
    assert (answer.code, answer.json["outcome"]) == (0, "commissioned")
    found = answer.json["parameters"]["stator_resistance_ohm"]["value"]
    assert held(drive) == pytest.approx(found, abs=1e-4)
    assert [row["before"] for row in answer.json["written"]] == [pytest.approx(3.0)]
    shown = call("runs", "show", "last", "--runs", str(tmp_path), "--json").json
    assert shown["summary"]["written"].startswith("new, read back and stored")
    restored = call("restore", "last", "--runs", str(tmp_path), "--yes", "--json")
    assert (restored.code, held(drive)) == (0, pytest.approx(3.0))
    planned = call("write-back", "last", "--plan", "--runs", str(tmp_path), "--json")
    judge("write_plan", planned.json)
    again = call("write-back", "last", "--yes", "--runs", str(tmp_path), "--json")
    assert (again.code, held(drive)) == (0, pytest.approx(found, abs=1e-4)), again.stdout
    judge("write_back", again.json)


@pytest.mark.parametrize("status", [RUNNING, TRIPPED])
def test_a_running_or_tripped_drive_is_not_written(recording, drive, tmp_path, status):
    drive.bank.words[STATUS_WORD] = status
    answer = write(recording, drive, tmp_path)
    assert (answer.code, answer.json["error"]["step"]) == (3, "check")
    assert drive.bank.count(0x10) == drive.bank.count(0x06) == drive.bank.count(0x05) == 0


def test_a_drive_set_up_for_another_motor_is_not_written(recording, drive, tmp_path):
    drive.bank.words[1249] = 2900
    answer = write(recording, drive, tmp_path)
    assert answer.code == 3 and "rated_speed_rpm" in answer.json["reason"]
    assert drive.bank.count(0x10) == 0


def test_a_drive_whose_units_no_source_shows_is_refused_before_anything_is_sent(recording, drive, tmp_path):
    answer = write(recording, drive, tmp_path, "schneider_altivar")
    assert answer.code == 2 and "keypad" in answer.json["error"]["remedy"]
    assert not drive.bank.requests


def test_such_a_drive_is_checked_by_what_its_file_describes_and_never_run(drive):
    url = f"tcp://127.0.0.1:{drive.port}"
    arguments = ("--drive", url, "--profile", "danfoss_fc302", "--motor", "motor_2kw2", "--json")
    assert call("check", *arguments).code == 0
    refused = call("run", *arguments, "--yes")
    assert refused.code == 2 and "cannot excite" in refused.json["reason"]
