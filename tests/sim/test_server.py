"""The drive over real lines: TCP, TLS and a pseudo terminal, at the reader's pace and at the wall's."""

from __future__ import annotations

import contextlib
import datetime
import ipaddress
import json
import os
import pty
import ssl
import subprocess
import sys
import time
import tty
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

from sim.scenario import load
from sim.wire.server import run_in_thread
from sim.wire.station import Options
from tests.sim.client import Client, Refused, RtuClient, Silent, TcpClient, as_float

SCENARIO = load("default")


def index_of(window: list[int]) -> int:
    return window[1] << 16 | window[2]


@pytest.fixture
def tcp():
    with run_in_thread(SCENARIO, Options(tcp_port=0)) as running, TcpClient(running.addresses["tcp"]) as client:
        client.drive = running.drive
        yield client


def test_identity_and_nameplate_are_served_where_the_map_says(tcp):
    assert tcp.read(0, 3) == [0x434D, 0x5352, 1]
    assert bytes(b for w in tcp.read(7, 8) for b in w.to_bytes(2, "big")).rstrip(b"\0") == b"SIM-INV-7A"
    assert as_float(tcp.read(546, 2)) == 400.0
    assert tcp.read(17, 2) == [200_000 >> 16, 200_000 & 0xFFFF]


def test_exceptions_say_why(tcp):
    for action, code in (
        (lambda: tcp.read(110, 1), 2),
        (lambda: tcp.write(0, [1, 2]), 2),
        (lambda: tcp.write(96, [3]), 3),
    ):
        with pytest.raises(Refused) as refused:
            action()
        assert refused.value.code == code


def test_another_unit_is_answered_as_a_gateway_would(tcp):
    tcp.unit = 9
    with pytest.raises(Refused) as refused:
        tcp.read(0, 1)
    assert refused.value.code == 11


def test_read_write_multiple_writes_first(tcp):
    assert tcp.write_read(21, 1, 21, [0x1234]) == [0x1234]
    assert tcp.write_one(21, 0x4321) == [21, 0x4321]
    assert tcp.read(21, 1) == [0x4321]


def test_at_max_a_window_moves_time_just_as_far_as_it_needs(tcp):
    tcp.prepare()
    tcp.enable()
    tcp.window(0, 1)
    assert tcp.drive.firmware.produced == 29 + 0
    tcp.window(29, 2, 8 + 40)
    assert tcp.drive.firmware.produced == 39
    tcp.window(0, 3)
    assert tcp.drive.firmware.produced == 39
    tcp.read(48, 1)
    assert tcp.drive.firmware.produced == 44


def run_once(seed: int) -> list[list[int]]:
    with (
        run_in_thread(SCENARIO, Options(tcp_port=0, seed=seed)) as running,
        TcpClient(running.addresses["tcp"]) as client,
    ):
        client.prepare(duration_s=0.5)
        client.enable()
        return client.stream()


def test_at_max_the_same_seed_gives_the_same_words():
    first = run_once(5)
    assert run_once(5) == first
    assert run_once(6) != first
    assert first[-1][5] & 16


def test_a_dead_client_leaves_a_dead_drive(tmp_path):
    log = tmp_path / "state.jsonl"
    with run_in_thread(SCENARIO, Options(tcp_port=0, state_log=log)) as running:
        with TcpClient(running.addresses["tcp"]) as client:
            client.prepare(duration_s=30.0, watchdog_ms=200)
            client.enable()
            client.stream(until=290)
        deadline = time.monotonic() + 3.0
        while running.drive.firmware.is_energised and time.monotonic() < deadline:
            time.sleep(0.01)
        assert not running.drive.firmware.is_energised
    events = [json.loads(line) for line in log.read_text().splitlines()]
    off = next(e for e in events if e["event"] == "de_energised")
    assert off["why"] == "trip 6"
    assert (
        0.2 <= off["since_heartbeat_s"] < 0.3 + 0.5
    )  # the machine the test runs on may be late, the drive's clock is its own
    assert next(e for e in events if e["event"] == "peaks")["stator_flux_wb"] > 0.0


def test_at_speed_n_time_passes_by_itself():
    with (
        run_in_thread(SCENARIO, Options(tcp_port=0, speed=20.0)) as running,
        TcpClient(running.addresses["tcp"]) as client,
    ):
        client.prepare(duration_s=0.5, watchdog_ms=2000)
        client.enable()
        time.sleep(0.2)
        assert client.status() & 0x6F == 0x40
        assert running.drive.firmware.produced > 2500
        assert client.window(running.drive.firmware.produced, 1)[3] == 0


def test_the_whole_exchange_runs_over_a_pseudo_terminal():
    with run_in_thread(SCENARIO, Options(rtu="pty")) as running:
        client = RtuClient(running.addresses["rtu"])
        client.prepare(duration_s=0.2)
        assert client.enable() & 0x6F == 0x27
        windows = client.stream()
        assert windows[-1][5] & 16
        assert index_of(windows[1]) == windows[0][3] == 29
        client.unit = 3
        client.timeout_s = 0.1
        with pytest.raises(Silent):
            client.read(0, 1)
        client.close()


def _certificate(name: str, issuer, issuer_key, *, is_ca: bool = False):
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    now = datetime.datetime.now(datetime.UTC)
    builder = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer or subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(hours=1))
        .not_valid_after(now + datetime.timedelta(hours=1))
        .add_extension(x509.BasicConstraints(ca=is_ca, path_length=None), critical=True)
        .add_extension(
            x509.SubjectAlternativeName([x509.DNSName("localhost"), x509.IPAddress(ipaddress.ip_address("127.0.0.1"))]),
            False,
        )
    )
    return builder.sign(issuer_key or key, hashes.SHA256()), key


def _files(folder: Path, name: str, certificate, key) -> tuple[Path, Path]:
    cert_file, key_file = folder / f"{name}.pem", folder / f"{name}.key"
    cert_file.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
    key_file.write_bytes(
        key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    )
    return cert_file, key_file


def test_tls_takes_a_client_of_its_authority_and_no_other(tmp_path):
    authority, authority_key = _certificate("authority", None, None, is_ca=True)
    ca_file, _ = _files(tmp_path, "ca", authority, authority_key)
    server = _files(tmp_path, "server", *_certificate("drive", authority.subject, authority_key))
    client = _files(tmp_path, "client", *_certificate("service", authority.subject, authority_key))
    stranger = _files(tmp_path, "stranger", *_certificate("stranger", None, None, is_ca=True))
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH, cafile=str(ca_file))
    context.verify_mode = ssl.CERT_REQUIRED
    context.load_cert_chain(*server)
    with run_in_thread(SCENARIO, Options(tls_port=0, tls_context=context)) as running:
        address = running.addresses["tls"]
        with TcpClient(address, context=_client_context(ca_file, client)) as good:
            assert good.read(0, 2) == [0x434D, 0x5352]
        with pytest.raises((ssl.SSLError, ConnectionError)):  # noqa: SIM117
            with TcpClient(address, context=_client_context(ca_file, stranger)) as bad:
                bad.read(0, 2)


def _client_context(ca_file: Path, files: tuple[Path, Path]) -> ssl.SSLContext:
    context = ssl.create_default_context(cafile=str(ca_file))
    context.load_cert_chain(*files)
    return context


def test_command_line_serves_and_prints_where(tmp_path):
    command = [
        sys.executable,
        "-m",
        "sim",
        "--tcp",
        "0",
        "--rtu",
        "pty",
        "--speed",
        "max",
        "--nvm",
        str(tmp_path / "nvm"),
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            lines = [process.stdout.readline().split() for _ in range(2)]
            assert [line[:2] for line in lines] == [["listening", "tcp"], ["listening", "rtu"]]
            with TcpClient(lines[0][2]) as client:
                assert client.read(0, 2) == [0x434D, 0x5352]
            ready = [process.stderr.readline().strip() for _ in range(2)]
            assert ready == [
                f'ready: --drive "tcp://{lines[0][2]}?device=1"',
                f'ready: --drive "rtu://{lines[1][2]}?baud=921600&parity=N&device=1"',
            ]
        finally:
            process.terminate()
        assert process.wait(10) == 0


def test_streaming_needs_no_more_than_one_request_per_window(tcp: Client):
    tcp.prepare(duration_s=1.0, mask=0b0110)
    tcp.enable()
    windows = tcp.stream()
    assert all(w[3] == 58 for w in windows[:-1])
    ends = [index_of(w) + w[3] for w in windows]
    assert [index_of(w) for w in windows[1:]] == ends[:-1]


def test_an_existing_serial_device_is_served_and_comes_back_after_a_restart():
    master, slave = pty.openpty()
    for descriptor in (master, slave):
        tty.setraw(descriptor)
    options = Options(rtu=os.ttyname(slave), faults=("restart:0.2@2",))
    with run_in_thread(SCENARIO, options):
        client = RtuClient.__new__(RtuClient)
        client.descriptor, client.timeout_s = master, 0.5
        assert client.read(0, 2) == [0x434D, 0x5352]
        with pytest.raises(Silent):
            client.read(0, 2)
        deadline = time.monotonic() + 3.0
        while time.monotonic() < deadline:
            with contextlib.suppress(Silent):
                assert client.read(0, 2) == [0x434D, 0x5352]
                break
        else:
            pytest.fail("the drive did not come back")
    os.close(slave)
    client.close()
