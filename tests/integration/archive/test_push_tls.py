"""Runs to a service that speaks https: whom the laptop believes, and what it says where it does not."""

import ssl
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from commissioner.run.archive.verify import verify
from commissioner.service.access.accounts import Accounts, Role
from tests.integration.archive.test_push import OTTO, content, make_run
from tests.support.command_line import call
from tests.support.service.authority import Authority
from tests.support.service.service_process import ServiceProcess


@pytest.fixture(scope="module")
def authority(tmp_path_factory):
    return Authority(tmp_path_factory.mktemp("authority"), "workshop-ca")


@pytest.fixture(scope="module")
def service(authority, tmp_path_factory):
    folder = tmp_path_factory.mktemp("workshop")
    certificate, key = authority.issue("service", ["127.0.0.1"])
    Accounts(folder / "runs" / ".service" / "accounts.json").add(OTTO.name, Role.OPERATOR, OTTO.password)
    more = f'[tls]\ncertificate = "{certificate}"\nkey = "{key}"\n'
    with ServiceProcess(folder, more=more) as made:
        yield made


@pytest.fixture
def push(tmp_path):
    """The verb, called as a technician would, of one run; and that run."""
    run = make_run(tmp_path / "laptop", "over-tls")
    (tmp_path / "password").write_text(OTTO.password, "utf-8")

    def pushed(url, *more):
        account = ("--account", OTTO.name, "--password-file", tmp_path / "password")
        return call("runs", "push", url, *map(str, (*account, *more)), "--runs", str(run.parent), "--json")

    return pushed, run


def test_a_run_arrives_whole_at_a_service_that_the_given_authority_vouches_for(service, authority, push):
    pushed, run = push
    assert service.url.startswith("https://127.0.0.1:")
    done = pushed(service.url, "--ca", authority.file)
    assert done.code == 0, done.stdout + done.stderr
    arrived = service.runs / run.name
    assert content(arrived) == content(run)
    assert verify(arrived).state == "intact"


@pytest.mark.parametrize(
    ("whose", "host", "why"),
    [("", "127.0.0.1", "issuer"), ("another", "127.0.0.1", "signature|issuer"), ("mine", "localhost", "mismatch")],
)
def test_nothing_is_sent_to_a_service_nobody_vouches_for(service, authority, push, tmp_path, whose, host, why):
    pushed, _ = push
    files = {"mine": authority.file, "another": Authority(tmp_path, "another-ca").file}
    done = pushed(service.url.replace("127.0.0.1", host), *(("--ca", files[whose]) if whose else ()))
    error = done.json["error"]
    assert done.code == 5, error
    assert error["what"].startswith("the service's certificate is not trusted: ")
    assert any(word in error["what"] for word in why.split("|")), error
    assert "--ca FILE" in error["remedy"]


def test_a_certificate_that_is_out_of_date_is_said_so(authority, push):
    pushed, _ = push
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(*authority.issue("yesterdays", ["127.0.0.1"], days=-1))
    with HTTPServer(("127.0.0.1", 0), BaseHTTPRequestHandler, bind_and_activate=True) as late:
        late.socket = context.wrap_socket(late.socket, server_side=True)
        threading.Thread(target=late.handle_request, daemon=True).start()
        done = pushed(f"https://127.0.0.1:{late.server_port}", "--ca", authority.file)
    assert done.code == 5 and "expired" in done.json["error"]["what"]
    assert "out of date" in done.json["error"]["remedy"] and "--ca" not in done.json["error"]["remedy"]


def test_a_file_that_is_no_certificate_is_a_usage_error(service, push, tmp_path):
    pushed, _ = push
    (tmp_path / "no.pem").write_text("nothing", "utf-8")
    done = pushed(service.url, "--ca", tmp_path / "no.pem")
    assert done.code == 2
    assert "holds no certificate" in done.json["error"]["what"]
