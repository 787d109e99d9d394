"""Runs to a service: only with an account that may, only what it lacks, whole or not at all."""

import hashlib
import shutil
import socket
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from unittest import mock

import httpx
import numpy as np
import pytest

from commissioner.errors import CommissionerError, UsageError
from commissioner.operations.history.send import LOGGED_OUT, Account, _Service, send
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


def test_a_run_that_the_service_does_not_take_holds_up_no_other(service, run, tmp_path):
    make_run(run.parent, "renamed").rename(run.parent / "pump7")
    with_photo = make_run(run.parent, "photo")
    (with_photo / "plate of pump 7.jpg").write_bytes(b"jpg")
    told = {moved.run: (moved.what, moved.why) for moved in send(run.parent, service.url, account=OTTO)}
    assert told[run.name][0] == "copied"
    assert told["pump7"][0] == told[with_photo.name][0] == "left: not taken"
    assert "another name" in told["pump7"][1] and "plate of pump 7.jpg" in told[with_photo.name][1]


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


def pieces(files):
    """(name, start, piece) of all files in the order of a push."""
    for name in sorted(files):
        for start in range(0, len(files[name]) or 1, 500_000):
            yield name, start, files[name][start : start + 500_000]


def test_two_pushes_of_one_run_at_once_take_nothing_from_each_other(service, tmp_path):
    """The second begins from the start when the first has sent everything, and is overtaken."""
    run = make_run(tmp_path / "laptop", "both", 2500)
    files = content(run)
    path, names = f"/api/incoming/{run.name}", {"files": sorted(files)}
    with logged_in(service) as first, logged_in(service) as second:

        def put(client, name, start, piece):
            return client.put(f"{path}/{name}?start={start}", content=piece)

        assert all(put(first, *one).status_code == 200 for one in pieces(files))
        held = put(second, *next(pieces(files))).json()
        assert (held["file"], held["bytes"]) == ("blocks.bin", len(files["blocks.bin"]))
        assert first.post(path, json=names).json()["what"] == "copied"
        overtaken = put(second, "blocks.bin", 500_000, files["blocks.bin"][500_000:1_000_000])
        assert (overtaken.status_code, overtaken.json()["limit"]) == (409, 0)
        assert put(second, "journal.jsonl", 0, files["journal.jsonl"]).status_code == 200
        half = second.post(path, json=names)
        assert half.status_code == 409 and "blocks.bin" in half.json()["value"]
        assert "push it again" in overtaken.json()["remedy"] and "push it again" in half.json()["remedy"]
    assert content(service.runs / run.name) == files
    assert push(service, run).what == "there already"


def test_two_states_of_a_killed_run_at_once_never_mix(service, tmp_path):
    """The chain of the older one ends before what the other sent; only the digest tells that it is not the older one's."""
    older = RunFolder.create(tmp_path / "older", "states")
    samples = np.ones(29)
    older.append(SampleBlock(1, 0, 2e-4, 0.0, samples, samples, -samples, None, 540.0), 0)
    older.journal("job", {"a": 1})
    older.close()
    later = tmp_path / "later" / older.path.name
    shutil.copytree(older.path, later)
    with (later / "blocks.bin").open("ab") as file:
        file.write((older.path / "blocks.bin").read_bytes())
    files, path = content(older.path), f"/api/incoming/{later.name}"
    digests = {name: hashlib.sha256(held).hexdigest() for name, held in files.items()}
    with logged_in(service) as client:
        for name in sorted(files):
            assert client.put(f"{path}/{name}", content=files[name]).status_code == 200
        assert client.put(f"{path}/blocks.bin", content=(later / "blocks.bin").read_bytes()).status_code == 200
        mixed = client.post(path, json={"files": sorted(files), "sha256": digests})
    assert (mixed.status_code, mixed.json()["value"]) == (409, "blocks.bin")
    assert "push it again" in mixed.json()["remedy"] and not (service.runs / later.name).exists()
    assert push(service, older.path).what == "copied"
    assert content(service.runs / later.name) == content(older.path)


def test_a_killed_run_of_which_a_file_is_missing_has_not_arrived(service, tmp_path):
    """No closing record covers its files: that they were named is all that is known of them."""
    folder = RunFolder.create(tmp_path / "laptop", "killed")
    folder.journal("job", {"a": 1})
    folder.save("snapshot.json", {"a": 1})
    folder.close()
    (folder.path / "summary.json").unlink(missing_ok=True)
    files = content(folder.path)
    path = f"/api/incoming/{folder.path.name}"
    with logged_in(service) as client:
        assert client.put(f"{path}/journal.jsonl", content=files["journal.jsonl"]).status_code == 200
        answer = client.post(path, json={"files": sorted(files)})
        assert (answer.status_code, answer.json()["value"]) == (
            409,
            ", ".join(sorted(files.keys() - {"journal.jsonl"})),
        )
    assert not (service.runs / folder.path.name).exists()


def test_many_pushes_of_one_run_at_once_leave_it_whole(service, tmp_path):
    run = make_run(tmp_path / "laptop", "many", 2500)

    def told(_):
        try:
            return push(service, run).what
        except CommissionerError as refused:
            assert refused.remedy.startswith("push it again"), vars(refused)
            return "again"

    with ThreadPoolExecutor(4) as pool:
        what = list(pool.map(told, range(4)))
    assert set(what) <= {"copied", "there already", "again"} and "copied" in what
    assert content(service.runs / run.name) == content(run)


def test_what_an_earlier_push_left_behind_the_end_of_a_file_goes(service, run):
    with logged_in(service) as client:
        longer = content(run)["result.json"] + b"more"
        assert client.put(f"/api/incoming/{run.name}/result.json", content=longer).status_code == 200
    assert push(service, run).what == "copied"
    assert content(service.runs / run.name) == content(run)


def test_who_is_taken_off_the_list_in_mid_push_is_refused_and_another_goes_on(service, tmp_path):
    run = make_run(tmp_path / "laptop", "revoked", 2500)
    accounts = Accounts(service.runs / ".service" / "accounts.json")
    accounts.add("gone", Role.OPERATOR, "operating 5678")
    ask, puts = _Service.ask, []

    def asking(self, method, *more):
        puts.extend([method] if method == "PUT" else [])
        if len(puts) == 2 and "gone" in {one.name for one in accounts.all()}:
            accounts.remove("gone")
        return ask(self, method, *more)

    with mock.patch.object(_Service, "ask", asking), pytest.raises(CommissionerError) as refused:
        push(service, run, Account("gone", "operating 5678"))
    assert (refused.value.step, refused.value.remedy) == ("access", LOGGED_OUT)
    with pytest.raises(CommissionerError, match="name or password is wrong"):
        push(service, run, Account("gone", "operating 5678"))
    assert not (service.runs / run.name).exists()
    moved = push(service, run)
    assert moved.what == "copied" and moved.bytes < sum(map(len, content(run).values()))


def test_a_piece_whose_line_broke_is_not_kept_and_nobody_sees_a_traceback(service, run):
    with logged_in(service) as client:
        cookie = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
        head = (f"PUT /api/incoming/{run.name}/journal.jsonl HTTP/1.1\r\nHost: 127.0.0.1:{service.port}\r\nCookie: {cookie}\r\n"
                f"x-csrf-token: {client.headers['x-csrf-token']}\r\nContent-Length: 100000\r\n\r\n")  # fmt: skip
        with socket.create_connection(("127.0.0.1", service.port)) as line:
            line.sendall(head.encode() + b"{" * 5000)
        assert client.get(f"/api/incoming/{run.name}").json()["begun"] == {}
    assert push(service, run).what == "copied"


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
    assert (answer.status_code, answer.json()["limit"]) == (409, "journal.jsonl and every file named")


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
