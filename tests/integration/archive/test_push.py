"""Runs to a service: only with an account that may, only what it lacks, whole or not at all."""

import shutil
from contextlib import contextmanager

import httpx
import numpy as np
import pytest

from commissioner.errors import CommissionerError, UsageError
from commissioner.operations.history.send import Account, send
from commissioner.records import SampleBlock
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.verify import verify
from commissioner.service.access.accounts import Accounts, Role
from tests.support.command_line import call
from tests.support.service.service_process import ServiceProcess

OTTO, VERA = Account("otto", "operating 1234"), Account("vera", "watching 1234")


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    folder = tmp_path_factory.mktemp("workshop")
    accounts = Accounts(folder / "runs" / ".service" / "accounts.json")
    accounts.add(OTTO.name, Role.OPERATOR, OTTO.password)
    accounts.add(VERA.name, Role.VIEWER, VERA.password)
    with ServiceProcess(folder) as made:
        yield made


def make_run(root, label, blocks=30):
    """A run on a laptop, ended and closed."""
    folder = RunFolder.create(root, label)
    k = np.arange(29.0)
    for n in range(blocks):
        folder.append(SampleBlock(1, 29 * n, 2e-4, 0.0, np.sin(k + n), np.cos(k), -np.cos(k) / 2, None, 540.0), 0)
    folder.journal("run_ended", {"outcome": "aborted", "reason": "x", "energised_s": 1.0})
    folder.save("result.json", {"a": 1})
    folder.save("empty.txt", "")
    folder.close()
    return folder.path


@pytest.fixture
def run(tmp_path):
    return make_run(tmp_path / "laptop", tmp_path.name[-20:].replace("_", "-"))


def content(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def push(service, run, account=OTTO):
    (moved,) = send(run.parent, service.url, [run.name], account=account)
    return moved


@contextmanager
def logged_in(service):
    with httpx.Client(base_url=service.url) as client:
        client.headers["x-csrf-token"] = client.post("/api/login", json=vars(OTTO)).json()["csrf"]
        yield client


def add_to(folder, **record):
    opened = RunFolder(folder)
    opened.journal("snapshot_restored", record)
    opened.close()


def test_a_run_arrives_bit_for_bit_and_a_second_push_sends_nothing(service, run):
    moved = push(service, run)
    assert (moved.what, moved.files) == ("copied", len(content(run)))
    there = service.runs / run.name
    assert content(there) == content(run) and verify(there).state == "intact"
    again = push(service, run)
    assert (again.what, again.bytes) == ("there already", 0)
    with logged_in(service) as client:
        assert run.name in {row["run"] for row in client.get("/api/runs").json()["runs"]}
        told = [entry for entry in client.get("/api/audit").json()["entries"] if entry.get("run") == run.name]
    assert [(entry["person"], entry["what"]) for entry in told] == [("otto", "took in a pushed run")]


def test_what_a_power_loss_left_behind_the_journal_stays_at_home(service, run):
    before = content(run)
    with (run / "journal.jsonl").open("ab") as journal:
        journal.write(4096 * b"\0")
    assert [push(service, run).what for _ in range(2)] == ["copied", "there already"]
    assert content(service.runs / run.name) == before


def test_the_command_line_reads_the_password_from_a_file(service, run, tmp_path):
    secret = tmp_path / "password"
    secret.write_text(OTTO.password + "\n", encoding="utf-8")
    done = call("runs", "push", service.url, run.name, "--runs", str(run.parent), "--account", "otto",
                "--password-file", str(secret), "--json")  # fmt: skip
    assert done.code == 0, done.stdout + done.stderr
    assert [one["what"] for one in done.json["runs"]] == ["copied"]


@pytest.mark.parametrize(
    ("account", "words"),
    [(None, "give --account"), (VERA, "ask somebody whose account"), (Account("otto", "guess"), "try again")],
)
def test_whoever_may_not_is_refused_in_the_services_words(service, run, account, words):
    with pytest.raises(CommissionerError) as refused:
        push(service, run, account)
    assert words in refused.value.remedy and refused.value.step
    assert not (service.runs / run.name).exists()


def test_what_broke_off_goes_on_and_what_is_not_ours_is_sent_anew(service, tmp_path):
    run = make_run(tmp_path / "laptop", "long", 2500)
    blocks, journal = (run / "blocks.bin").read_bytes(), (run / "journal.jsonl").read_bytes()
    half = len(blocks) // 2
    assert len(blocks) > 1_100_000
    with logged_in(service) as client:
        for start in range(0, half, 500_000):
            path = f"/api/incoming/{run.name}/blocks.bin?start={start}"
            assert client.put(path, content=blocks[start : min(half, start + 500_000)]).status_code == 200
        assert client.put(f"/api/incoming/{run.name}/journal.jsonl", content=b"another").status_code == 200
        assert client.put(f"/api/incoming/{run.name}/left-over.txt", content=b"from before").status_code == 200
        gap = client.put(f"/api/incoming/{run.name}/blocks.bin?start={len(blocks)}", content=b"x")
        assert (gap.status_code, gap.json()["limit"]) == (409, half)
    moved = push(service, run)
    assert moved.what == "copied" and len(journal) < moved.bytes < sum(map(len, content(run).values())) - half + 1
    assert content(service.runs / run.name) == content(run)


def test_a_copy_that_is_not_what_was_read_never_gets_into_the_archive(service, run):
    with logged_in(service) as client:
        files = content(run)
        files["journal.jsonl"] = files["journal.jsonl"].replace(b"aborted", b"commiss")
        for name, text in files.items():
            for start in range(0, len(text) or 1, 500_000):
                path = f"/api/incoming/{run.name}/{name}?start={start}"
                assert client.put(path, content=text[start : start + 500_000]).status_code == 200
        answer = client.post(f"/api/incoming/{run.name}", json={"files": sorted(files)}).json()
    assert answer["what"] == "left: damaged"
    assert not (service.runs / run.name).exists()
    shutil.copytree(run, run.parent.parent / "spoilt" / run.name)
    spoilt = run.parent.parent / "spoilt" / run.name
    (spoilt / "blocks.bin").write_bytes((spoilt / "blocks.bin").read_bytes()[:-1] + b"!")
    assert push(service, spoilt).what == "left: damaged"


@pytest.mark.parametrize(("letter", "count"), [("a", 150), ("ä", 117), ("ä", 150), ("\U00010400", 150)])
def test_a_name_that_no_disk_takes_is_a_name_too_long_and_no_full_disk(service, letter, count):
    """A letter beyond ASCII takes two bytes or more of the 255 that a file's name may have."""
    run = f"20260101-010101-{letter * count}"
    fits = len(run.encode()) <= 255
    with logged_in(service) as client:
        answers = [
            client.get(f"/api/incoming/{run}"),
            client.put(f"/api/incoming/{run}/journal.jsonl", content=b"{}"),
            client.put(f"/api/incoming/20260101-010101-b/a{letter * min(count, 99)}", content=b"{}"),
        ]
    assert [answer.status_code for answer in answers[:2]] == [200 if fits else 422] * 2
    assert {answer.json()["title"] for answer in answers if answer.status_code == 422} <= {
        "a name is too long for a file"
    }
    assert {answer.status_code for answer in answers} <= {200, 422}


def test_without_its_journal_a_run_has_not_arrived(service):
    with logged_in(service) as client:
        assert client.put("/api/incoming/20260101-010101-c/blocks.bin", content=b"{}").status_code == 200
        answer = client.post("/api/incoming/20260101-010101-c", json={"files": ["blocks.bin"]})
    assert (answer.status_code, answer.json()["limit"]) == (409, "journal.jsonl")


def test_a_later_state_follows_an_older_never_wins_and_two_ways_are_told(service, run, tmp_path):
    push(service, run)
    older = shutil.copytree(run, tmp_path / "older" / run.name)
    add_to(run)
    assert push(service, run).what == "updated"
    assert push(service, older).what == "newer there"
    add_to(older, other=1)
    assert push(service, older).what == "conflict"
    assert content(service.runs / run.name) == content(run)


@pytest.mark.parametrize("name", ["..%2F..%2Fx", ".hidden", "a%00b", "x" * 200])
def test_no_file_name_leads_out_of_its_folder(service, run, name):
    with logged_in(service) as client:
        assert client.put(f"/api/incoming/{run.name}/{name}", content=b"x").status_code in (404, 422)
        assert client.put(f"/api/incoming/{name}/journal.jsonl", content=b"x").status_code in (404, 422)


def test_no_password_goes_over_an_open_line_and_no_other_address_is_taken(run):
    for url in (
        "http://192.168.0.9:8321",
        "ftp://host",
        "http://",
        "http://host:port",
        "http://host:99999",
        "http://otto:secret@127.0.0.1:1",
    ):
        with pytest.raises(UsageError) as error:
            send(run.parent, url, account=OTTO)
        assert "secret" not in str(vars(error.value))
    with pytest.raises(CommissionerError) as nobody:
        send(run.parent, "http://127.0.0.1:9", [run.name])
    assert "does not answer" in nobody.value.what
