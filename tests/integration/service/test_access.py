"""Who may do what: hosts, origins, tokens, roles, passwords, and the audit. The application alone, without a drive."""

import asyncio
import contextlib
import json
import re
import stat
import time
from collections import Counter
from concurrent.futures import CancelledError, ThreadPoolExecutor
from pathlib import Path

import httpx
import pytest
from argon2 import PasswordHasher
from filelock import FileLock
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from commissioner.errors import UsageError
from commissioner.run.archive.folder import RunFolder
from commissioner.service import parts as service_parts
from commissioner.service.access.accounts import Role
from commissioner.service.access.sessions import Sessions
from commissioner.service.access.throttle import Throttle
from commissioner.service.application import create_app
from commissioner.service.audit import Audit, verify
from commissioner.service.configuration import DriveTable, ServiceFile, Settings, TlsTable, check_may_listen
from tests.support.command_line import call

PASSWORDS = {"vera": "watching 1234", "otto": "operating 1234", "ada": "administering 1234"}
ROLES = {"vera": Role.VIEWER, "otto": Role.OPERATOR, "ada": Role.ADMINISTRATOR}
BASE = "http://127.0.0.1:8321"
RUN = {"drive": "simulator", "motor": "motor_2kw2", "confirm": True}


class Clock:
    """Monotonic seconds that a test moves."""

    def __init__(self):
        self.s = 100.0

    def __call__(self):
        return self.s


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture(scope="module")
def app(tmp_path_factory):
    """Its lifetime is never begun: no child, no task."""
    folder = tmp_path_factory.mktemp("app")
    return create_app(service_parts.make_parts(Settings(folder / "runs", folder / "data")))


@pytest.fixture
def parts(app, tmp_path, clock, monkeypatch):
    cheap = PasswordHasher(time_cost=1, memory_cost=64, parallelism=1)
    monkeypatch.setattr("commissioner.service.access.accounts.PasswordHasher", lambda: cheap)
    made = service_parts.make_parts(Settings(tmp_path / "runs", tmp_path / "data"))
    made.sessions = Sessions(1800.0, clock)
    made.login_tries = Throttle(service_parts.LOGIN_TRIES, service_parts.LOGIN_WITHIN_S, clock)
    app.state.parts = made
    return made


@pytest.fixture
def accounts(parts):
    for name, role in ROLES.items():
        parts.accounts.add(name, role, PASSWORDS[name])


@pytest.fixture
def client(app, parts):
    return TestClient(app, base_url=BASE)


@contextlib.contextmanager
def socket_of(client, path="/api/control", **headers):
    """A page's line; its end in the midst of a message is how pages go."""
    with (
        contextlib.suppress(CancelledError),
        client.websocket_connect(path, headers={"host": "127.0.0.1:8321"} | headers) as made,
    ):
        yield made


def log_in(client, name):
    """The token that requests of this session carry."""
    client.cookies.clear()
    answer = client.post("/api/login", json={"name": name, "password": PASSWORDS[name]})
    assert answer.status_code == 200, answer.text
    return {"x-csrf-token": answer.json()["csrf"]}


def refused(answer, status):
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert problem["title"] and problem["step"] and problem["remedy"]
    return problem


# --- where it listens ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.0.7", "::", "panel.local"])
def test_another_host_needs_tls_and_accounts(tmp_path, host):
    tls = TlsTable(certificate="c.pem", key="k.pem")
    plain = Settings(tmp_path, tmp_path, host)
    sealed = Settings(tmp_path, tmp_path, host, file=ServiceFile(tls=tls))
    for settings, has_accounts, missing in (
        (plain, False, ("tls", "account")),
        (plain, True, ("tls",)),
        (sealed, False, ("account",)),
    ):
        with pytest.raises(UsageError) as error:
            check_may_listen(settings, has_accounts)
        assert all(word in error.value.remedy for word in missing)
    check_may_listen(sealed, True)
    check_may_listen(Settings(tmp_path, tmp_path, "127.0.0.1"), False)


def test_one_service_at_a_time_works_in_a_folder(tmp_path):
    """Two would break the chain of one audit."""
    (tmp_path / ".service").mkdir()
    with FileLock(tmp_path / ".service" / "service.lock"):
        answer = call("serve", "--port", "0", "--runs", str(tmp_path), "--json")
    assert answer.code == 2 and "another service works in" in answer.stdout + answer.stderr
    assert not (tmp_path / ".service" / "audit.jsonl").exists()


def test_serve_refuses_another_host_before_it_listens(tmp_path):
    done = call("serve", "--host", "0.0.0.0", "--port", "0", "--runs", str(tmp_path), "--json")
    assert done.code == 2
    assert done.json["error"]["value"] == "0.0.0.0"


# --- whose page ---------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "localhost.evil", ""])
def test_a_foreign_host_name_is_refused(client, host):
    refused(client.get("/api/health", headers={"host": host}), 400)
    with pytest.raises(WebSocketDisconnect) as closed, client.websocket_connect("/api/control", headers={"host": host}):
        pass
    assert closed.value.code == 4403


@pytest.mark.parametrize("origin", ["https://evil.example", "null", "http://127.0.0.1:1", "http://localhost:8321"])
def test_a_foreign_origin_changes_nothing_and_gets_no_socket(client, origin):
    for method, path in (
        ("post", "/api/runs"),
        ("post", "/api/stop"),
        ("post", "/stop"),
        ("post", "/appearance"),
        ("delete", "/api/accounts/x"),
    ):
        refused(getattr(client, method)(path, headers={"origin": origin}), 403)
    with (
        pytest.raises(WebSocketDisconnect) as closed,
        socket_of(client, origin=origin),
    ):
        pass
    assert closed.value.code == 4403
    refused(client.post("/api/stop", headers={"sec-fetch-site": "cross-site"}), 403)


def test_its_own_origin_is_served(client):
    assert client.post("/api/stop", headers={"origin": BASE}).status_code == 200
    with socket_of(client, origin=BASE) as socket:
        assert "band" in json.loads(socket.receive_text())


def test_every_answer_is_under_a_policy_without_inline(client):
    for path in (
        "/",
        "/runs",
        "/audit",
        "/login",
        "/drives/simulator",
        "/runs/none",
        "/api/health",
        "/static/js/page.js",
        "/api/none",
    ):
        answer = client.get(path, headers={"accept": "text/html"})
        policy = answer.headers["content-security-policy"]
        assert policy.startswith("default-src 'none'") and "unsafe" not in policy and "frame-ancestors 'none'" in policy
        assert answer.headers["x-content-type-options"] == "nosniff"
        if answer.headers["content-type"].startswith("text/html"):
            assert not re.search(r"<[^>]+\s(?:style|on\w+)=", answer.text)
            assert not re.search(r"<script(?![^>]*\ssrc=)(?![^>]*application/json)", answer.text)
            assert not re.search(r"""(?:src|href|action)=["']?(?:https?:)?//""", answer.text)


def test_a_body_larger_than_any_request_needs_is_refused(client):
    refused(client.post("/api/checks", content=b"x" * 1_000_001, headers={"content-type": "application/json"}), 413)
    refused(client.post("/api/checks", content=iter([b"{}"]), headers={"content-type": "application/json"}), 413)


# --- tokens and sessions ------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("name", "status"), [("", 401), ("vera", 403)])
@pytest.mark.parametrize("path", ["/api/recordings", "/recordings"])
def test_an_upload_is_refused_before_it_is_read_where_the_role_is_not_enough(client, accounts, name, status, path):
    """A body is stored before a route is asked: whoever is not known could fill the disk."""
    token = log_in(client, name) if name else {}
    sent = []

    def pieces():
        for _ in range(50):
            sent.append(1)
            yield b"0" * 1_000_000

    answer = client.post(
        path, content=pieces(), headers=token | {"content-length": "50000000", "content-type": "multipart/form-data; boundary=b"}
    )  # fmt: skip
    refused(answer, status)


def test_an_upload_has_a_size_and_an_end(client, accounts):
    token = log_in(client, "otto")
    for headers in ({"content-length": "1000000001"}, {"transfer-encoding": "chunked"}):
        problem = refused(client.post("/api/recordings", content=b"", headers=token | headers), 413)
        assert "say how much" in problem["remedy"]


def test_a_session_without_its_token_changes_nothing(client, accounts):
    token = log_in(client, "ada")
    for headers in ({}, {"x-csrf-token": "another"}):
        refused(client.post("/api/runs", json=RUN, headers=headers), 403)
        refused(
            client.post(
                "/api/accounts", json={"name": "eve", "password": "long enough", "role": "viewer"}, headers=headers
            ),
            403,
        )
        refused(
            client.post(
                "/drives", data={"name": "x", "url": "tcp://127.0.0.1:9", "profile": "simulated"}, headers=headers
            ),
            403,
        )
        refused(client.post("/api/logout", headers=headers), 403)
    assert client.get("/api/accounts").status_code == 200
    assert client.post("/api/logout", headers=token).status_code == 200
    refused(client.get("/api/accounts"), 401)


def test_the_cookie_is_out_of_reach_for_scripts_and_other_sites(client, accounts):
    answer = client.post("/api/login", json={"name": "vera", "password": PASSWORDS["vera"]})
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie and "samesite=strict" in cookie


def test_an_idle_session_ends_and_a_busy_one_after_a_working_day(client, accounts, clock):
    log_in(client, "vera")
    clock.s += 1799
    assert client.get("/api/runs").status_code == 200
    clock.s += 1801
    refused(client.get("/api/runs"), 401)
    log_in(client, "vera")
    for _ in range(25):
        clock.s += 1790
        client.get("/api/runs")
    refused(client.get("/api/runs"), 401)
    page = client.get("/runs", headers={"accept": "text/html"}, follow_redirects=False)
    assert page.headers["location"] == "/login?next=/runs"


def test_a_log_in_is_a_new_session(client, accounts):
    log_in(client, "vera")
    first = dict(client.cookies)
    client.post("/api/login", json={"name": "otto", "password": PASSWORDS["otto"]})
    assert dict(client.cookies) != first
    client.cookies.clear()
    client.cookies.update(first)
    refused(client.get("/api/runs"), 401)


def test_wrong_passwords_are_slowed_by_name_and_by_address(client, accounts, clock):
    for _ in range(5):
        refused(client.post("/api/login", json={"name": "ada", "password": "guess"}), 401)
    late = client.post("/api/login", json={"name": "ada", "password": PASSWORDS["ada"]})
    refused(late, 429)
    assert int(late.headers["retry-after"]) > 0
    refused(client.post("/api/login", json={"name": "vera", "password": PASSWORDS["vera"]}), 429)
    clock.s += 61
    assert log_in(client, "ada")


def test_only_wrong_passwords_are_counted_also_where_they_come_at_once(app, parts, accounts):
    """Six people at one panel log in; then a machine guesses as fast as it can."""

    async def all_at_once(client, password, most):
        tries = (client.post("/api/login", json={"name": "ada", "password": password}) for _ in range(most))
        return Counter(answer.status_code for answer in await asyncio.gather(*tries))

    async def both():
        transport = httpx.ASGITransport(app, client=("192.0.2.7", 1))
        async with httpx.AsyncClient(transport=transport, base_url=BASE) as client:
            return await all_at_once(client, PASSWORDS["ada"], 6), await all_at_once(client, "guess", 12)

    with ThreadPoolExecutor(1) as apart:  # a browser's tests before this one keep a loop in the main thread
        assert apart.submit(asyncio.run, both()).result() == ({200: 6}, {401: 5, 429: 7})


def test_a_page_that_only_lies_open_keeps_no_log_in(client, parts, accounts, clock):
    log_in(client, "otto")
    cookie = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
    with socket_of(client, cookie=cookie) as line:
        clock.s += 1000
        line.send_json({"stop": "somebody is there"})
        while "stopped" not in line.receive_json():
            pass
        clock.s += 1000
        while "not logged in" not in str(line.receive_json()):
            clock.s += 100
            assert clock.s < 5000
    refused(client.get("/api/runs"), 401)


def test_the_redirect_after_a_log_in_stays_here(client, accounts):
    for wanted in ("https://evil.example", "//evil.example", "/\\evil.example", "javascript:alert(1)"):
        form = {"name": "vera", "password": PASSWORDS["vera"], "next": wanted}
        assert client.post("/login", data=form, follow_redirects=False).headers["location"] == "/"


# --- roles --------------------------------------------------------------------------------------------------------
LOOKS = ("/api/runs", "/api/drives", "/api/motors", "/api/procedures")
ACTS = (("/api/runs", RUN), ("/api/checks", {"drive": "simulator", "motor": "motor_2kw2"}), ("/api/simulator", {"scenario": "default"}),
        ("/api/drives", {"id": "lab", "name": "Lab", "url": "tcp://127.0.0.1:9"}), ("/api/runs/x/write-back", {"token": "x"}),
        ("/api/runs/x/restore", {"token": "x"}), ("/api/drives/simulator/control", {"do": "ask"}))  # fmt: skip


def test_nobody_sees_and_does_nothing_but_stop(client, accounts):
    for path in (*LOOKS, "/api/audit", "/api/accounts"):
        refused(client.get(path), 401)
    for path, wish in ACTS:
        refused(client.post(path, json=wish), 401)
    assert client.post("/api/stop", json={"reason": "smoke"}).status_code == 200
    assert client.post("/stop", data={"run": ""}, follow_redirects=False).status_code == 303
    with socket_of(client) as socket:
        socket.send_text('{"stop": "smoke"}')
        while "stopped" not in (said := json.loads(socket.receive_text())):
            pass
    assert said["stopped"] == []
    told = [entry for entry in client.app.state.parts.audit.newest(10) if entry["what"] == "STOP"]
    assert {entry["by"] for entry in told} == {"POST", "form", "WebSocket"}
    assert {entry["person"] for entry in told} == {"somebody at a page"}


def test_a_viewer_looks_and_an_operator_acts(client, accounts):
    token = log_in(client, "vera")
    for path in LOOKS:
        assert client.get(path).status_code == 200
    for path, wish in ACTS:
        assert refused(client.post(path, json=wish, headers=token), 403)["value"] == "role viewer"
    refused(client.get("/api/audit"), 403)
    page = client.get("/drives/simulator", headers={"accept": "text/html"})
    assert page.status_code == 403 and "Take its plate" not in page.text
    token = log_in(client, "otto")
    assert client.get("/api/audit").status_code == 200
    assert refused(client.post("/api/runs", json=RUN, headers=token), 409)["title"] == "the simulator is not running"
    for answer in (client.get("/api/accounts"), client.delete("/api/accounts/vera", headers=token)):
        assert refused(answer, 403)["limit"] == "role administrator"


def test_a_page_that_stays_open_is_asked_each_time_who_it_is(client, parts, accounts):
    """Its account may be gone since."""

    def answered(line):
        line.send_json({"control": "ask"})
        line.send_json({"stop": "to see that it hears"})
        said = list[dict]()
        while not said or "stopped" not in said[-1]:
            said.append(line.receive_json())
        return [message for message in said if "control" in message]

    log_in(client, "otto")
    cookie = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
    with socket_of(client, path="/api/control?drive=simulator", cookie=cookie) as line:
        assert answered(line)[0]["control"]["you"] is True
        parts.accounts.remove("otto")
        assert answered(line) == []


def test_an_administrator_adds_and_removes_accounts(client, accounts):
    token = log_in(client, "ada")
    wish = {"name": "eve", "password": "long enough", "role": "viewer"}
    assert client.post("/api/accounts", json=wish, headers=token).status_code == 201
    refused(client.post("/api/accounts", json=wish, headers=token), 422)
    refused(client.post("/api/accounts", json=wish | {"name": "short", "password": "short"}, headers=token), 422)
    assert "password" not in json.dumps(client.get("/api/accounts").json())
    other = TestClient(client.app, base_url=BASE)
    assert other.post("/api/login", json={"name": "eve", "password": "long enough"}).status_code == 200
    assert other.get("/api/runs").status_code == 200
    assert client.delete("/api/accounts/eve", headers=token).status_code == 200
    refused(other.get("/api/runs"), 401)
    refused(client.delete("/api/accounts/eve", headers=token), 422)


def test_the_last_administrator_stays(client, accounts):
    token = log_in(client, "ada")
    refused(client.delete("/api/accounts/ada", headers=token), 409)
    wish = {"name": "eve", "password": "long enough", "role": "administrator"}
    assert client.post("/api/accounts", json=wish, headers=token).status_code == 201
    assert client.delete("/api/accounts/ada", headers=token).status_code == 200
    refused(client.get("/api/accounts"), 401)


def test_whoever_sits_at_the_computer_is_operator_until_there_is_an_account(client, parts):
    assert client.get("/api/audit").status_code == 200
    refused(client.get("/api/accounts"), 403)
    parts.accounts.add("ada", Role.ADMINISTRATOR, PASSWORDS["ada"])
    refused(client.get("/api/audit"), 401)


# --- what is written down -----------------------------------------------------------------------------------------
def test_the_audit_is_a_chain_that_only_grows(tmp_path):
    path = tmp_path / "audit.jsonl"
    audit = Audit(path)
    for number in range(5):
        audit.write("ada", "127.0.0.1", f"did {number}")
    Audit(path).write("ada", "127.0.0.1", "after a restart")
    whole = path.read_bytes()
    assert verify(path).is_intact and verify(path).lines == 6
    lines = whole.decode("utf-8").splitlines(keepends=True)
    for broken, at in (
        (lines[:2] + lines[3:], 2),
        ([*lines[:2], lines[2].replace("did 2", "did 9"), *lines[3:]], 2),
        ([*lines[:2], lines[3], lines[2], *lines[4:]], 2),
        ([*lines[:2], lines[2], lines[2], *lines[3:]], 3),
    ):
        path.write_text("".join(broken), encoding="utf-8")
        assert verify(path).broken_at == at
    path.write_bytes(whole[:-20])
    Audit(path).write("ada", "", "after a power loss")
    assert verify(path).broken_at == 5


def test_no_route_takes_anything_from_the_audit(client):
    paths = client.get("/openapi.json").json()["paths"]
    assert set(paths["/api/audit"]) == {"get"}


def test_secrets_are_nowhere_but_hashed(client, accounts, parts, tmp_path):
    token = log_in(client, "ada")
    client.post("/api/accounts", json={"name": "eve", "password": "a secret of eve", "role": "viewer"}, headers=token)
    client.post("/api/login", json={"name": "ada", "password": "a wrong secret"})
    client.get("/audit", headers={"accept": "text/html"})
    secrets = [
        *PASSWORDS.values(),
        "a secret of eve",
        "a wrong secret",
        token["x-csrf-token"],
        *dict(client.cookies).values(),
    ]
    for path in Path(tmp_path).rglob("*"):
        if path.is_file():
            text = path.read_text("utf-8", "replace")
            assert not [secret for secret in secrets if secret in text], path
    file = tmp_path / "data" / "accounts.json"
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert file.read_text("utf-8").count("$argon2id$") == 4


def test_an_unknown_name_takes_as_long_as_a_wrong_password(parts, accounts):
    def seconds(name):
        began = time.process_time()
        for _ in range(3):
            assert parts.accounts.verify(name, "wrong password") is None
        return time.process_time() - began

    seconds("ada")
    assert seconds("nobody") > 0.2 * seconds("ada")


@pytest.mark.parametrize(("more", "is_alarm"), [((), True), (("tuning_ended",), False)])
def test_a_tuning_that_was_cut_off_is_not_said_to_be_ended_by_a_watchdog(client, parts, more, is_alarm):
    """An ordinary drive goes on with it."""
    path = parts.settings.runs / "20260101-010101-a"
    path.mkdir(parents=True)
    folder = RunFolder(path)
    for kind in ("run_started", "drive_identified", "tuning_began"):
        folder.journal(kind, {})
    folder.journal("about_to", {"action": "tune", "values": {}})
    for kind in more:
        folder.journal(kind, {})
    folder.close()
    page = client.get("/runs/20260101-010101-a", headers={"accept": "text/html"}).text
    assert ("the drive may go on with its tuning" in page) is is_alarm
    assert ("watchdog switched the output off" in page) is not is_alarm
    assert ("Take the motor as live" in page or "without the drive’s word" in page) is is_alarm


# --- what a drive offers --------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("profile", "tunes"), [("schneider_atv340", True), ("eaton_dc1", False)])
def test_the_page_of_a_drive_without_a_test_mode_says_what_can_be_done(client, parts, profile, tunes):
    table = DriveTable(id="pump", name="Pump", url="tcp://127.0.0.1:9?device=1", profile=profile)
    parts.library.add_drive(table)
    checks = [{"name": "no fault", "value": "none", "limit": "none", "has_passed": True, "remedy": ""}]
    parts.checks["pump motor_2kw2"] = {
        "outcome": "passed",
        "checks": checks,
        "limits": None,
        "checked_utc": "2026-11-25T10:00:00",
    }
    for language in ("en", "de"):
        client.cookies.set("language", language)
        page = client.get("/drives/pump/checks?motor=motor_2kw2", headers={"accept": "text/html"})
        call = "commissioner tune --drive &#39;tcp://127.0.0.1:9?device=1&#39; --profile schneider_atv340 --motor motor_2kw2"
        assert page.status_code == 200 and (call in page.text) is tunes
        assert {"en": "It has no test mode", "de": "Er hat keinen Prüfbetrieb"}[language] in page.text
        assert "/energise" not in page.text
