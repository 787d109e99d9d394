"""Over TCP: each fault of the far end is one error of the tree, nothing is repeated, and the next request is right."""

import socket
import struct
import subprocess
import sys
import time
from contextlib import closing
from unittest.mock import Mock

import pytest
from pymodbus import exceptions as pymodbus_exceptions

from commissioner.errors import LinkError, LinkUnreachable, ReplyMismatch, ReplyTimeout, RequestRefused
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.modbus import ModbusPort, open_port
from commissioner.link.wire.url import TcpUrl
from tests.support.raw_servers import Bank, TcpDevice

PROFILE = load_profile("simulated")


def connect(device: TcpDevice, timeout_s: float = 0.1) -> ModbusPort:
    port = open_port(TcpUrl("127.0.0.1", device.port), PROFILE, reply_timeout_s=timeout_s)
    port.read_retries = 0
    return port


def is_about(request: bytes, address: int) -> bool:
    return request[8:10] == struct.pack(">H", address)


def test_reads_writes_and_exchanges_do_what_they_say():
    with TcpDevice(Bank()) as device:
        port = connect(device)
        port.write(1000, [7, 8, 9])
        assert port.read(999, 5) == (999, 7, 8, 9, 1003)
        assert port.exchange(1001, [0xFFFF], 1000, 3) == (7, 0xFFFF, 9)
        port.write_coil(64, True)
        port.close()
    assert device.bank.requests[-1] == bytes([5, 0, 64, 0xFF, 0])
    assert port.stats.requests == 4
    assert 0 < port.stats.latency_s(0.5) <= port.stats.latency_s(1.0) < 0.1


def test_nobody_at_the_address_is_unreachable_and_says_why():
    with socket.create_server(("127.0.0.1", 0)) as probe:
        free = probe.getsockname()[1]
    with pytest.raises(LinkUnreachable) as caught:
        open_port(TcpUrl("127.0.0.1", free), PROFILE)
    assert "refused" in str(caught.value.value).lower()
    assert caught.value.remedy


@pytest.mark.parametrize(
    ("name", "damage", "error"),
    [
        ("lost", lambda frame: [], ReplyTimeout),
        ("truncated", lambda frame: [frame[:-2]], ReplyTimeout),
        ("wrong unit", lambda frame: [frame[:6] + b"\x07" + frame[7:]], ReplyTimeout),
        ("wrong transaction", lambda frame: [b"\x77\x77" + frame[2:]], ReplyTimeout),
        ("no transaction", lambda frame: [b"\x00\x00" + frame[2:]], ReplyMismatch),
        ("wrong protocol", lambda frame: [frame[:2] + b"\x00\x01" + frame[4:]], ReplyTimeout),
        ("stray bytes before", lambda frame: [b"\xff\x55" + frame], (ReplyTimeout, ReplyMismatch)),
        ("other function", lambda frame: [frame[:7] + b"\x04" + frame[8:]], ReplyMismatch),
        ("unknown function", lambda frame: [frame[:7] + b"\x61" + frame[8:]], ReplyMismatch),
        ("shorter than asked", lambda frame: [frame[:5] + b"\x05" + frame[6:8] + b"\x02" + frame[9:11]], ReplyMismatch),
        ("byte count lies", lambda frame: [frame[:8] + b"\x60" + frame[9:]], ReplyMismatch),
        ("byte count too small", lambda frame: [frame[:8] + b"\x02" + frame[9:]], ReplyMismatch),
        ("refused", lambda frame: [frame[:5] + b"\x03" + frame[6:7] + b"\x83\x02"], RequestRefused),
        ("refused without code", lambda frame: [frame[:5] + b"\x02" + frame[6:7] + b"\x83"], (LinkError)),
    ],
)
def test_each_damaged_answer_is_one_error_of_the_tree_and_the_next_is_right(name, damage, error):
    with TcpDevice(Bank()) as device:
        port = connect(device)
        device.script = lambda request, frame: damage(frame) if is_about(request, 100) else [frame]
        with pytest.raises(error):
            port.read(100, 4)
        assert port.read(200, 4) == (200, 201, 202, 203)
        port.close()
    assert sum(is_about(b"\0" * 7 + pdu, 100) for pdu in device.bank.requests) == 1


def test_late_answer_is_not_taken_for_the_next_one():
    held = []

    def late(request, frame):
        if is_about(request, 100):
            held.append(frame)
            return []
        return [*held, frame]

    with TcpDevice(Bank()) as device:
        port = connect(device)
        device.script = late
        with pytest.raises(ReplyTimeout):
            port.read(100, 4)
        assert [port.read(address, 4)[0] for address in (200, 300)] == [200, 300]
        port.close()


@pytest.mark.parametrize("function", ["write", "exchange", "write_coil"])
def test_a_write_without_answer_reached_the_drive_once_and_is_not_repeated(function):
    calls = {
        "write": lambda port: port.write(500, [5]),
        "exchange": lambda port: port.exchange(500, [5], 600, 2),
        "write_coil": lambda port: port.write_coil(64, True),
    }
    with TcpDevice(Bank()) as device:
        port = connect(device)
        port.read_retries = 5
        device.script = lambda request, frame: []
        with pytest.raises(ReplyTimeout):
            calls[function](port)
        port.close()
    assert len(device.bank.requests) == 1


def test_reads_are_repeated_as_often_as_allowed_and_no_more():
    with TcpDevice(Bank()) as device:
        port = connect(device, timeout_s=0.03)
        port.read_retries = 2
        device.script = lambda request, frame: []
        with pytest.raises(ReplyTimeout):
            port.read(100, 1)
        port.close()
    assert len(device.bank.requests) == 3
    assert port.stats.timeouts == 3


def test_a_refusal_is_an_answer_and_is_not_repeated():
    with TcpDevice(Bank()) as device:
        port = connect(device)
        port.read_retries = 5
        device.script = lambda request, frame: [refusal(request, frame, 2)]
        with pytest.raises(RequestRefused, match="illegal data address") as caught:
            port.read(100, 1)
        port.close()
    assert "--profile" in caught.value.remedy and "drives list" in caught.value.remedy
    assert len(device.bank.requests) == 1


def refusal(request: bytes, frame: bytes, code: int) -> bytes:
    return frame[:5] + b"\x03" + frame[6:7] + bytes([request[7] | 0x80, code])


class Busy:
    """Refuses the first requests with an exception, then answers."""

    def __init__(self, code: int, times: int) -> None:
        self.code, self.left = code, times

    def __call__(self, request: bytes, frame: bytes) -> list[bytes]:
        self.left -= 1
        return [refusal(request, frame, self.code)] if self.left >= 0 else [frame]


@pytest.mark.parametrize("code", [5, 6, 10, 11])
def test_a_drive_or_gateway_that_is_busy_for_a_moment_is_waited_for(code):
    with TcpDevice(Bank()) as device:
        port = connect(device)
        device.script = Busy(code, 3)
        assert port.read(100, 2) == (100, 101)
        device.script = Busy(code, 3)
        assert port.exchange(200, [7], 200, 1) == (7,)
        port.close()
    assert port.stats.waits == 6


@pytest.mark.parametrize(("code", "writes"), [(6, 4), (10, 4), (5, 1), (11, 1)])
def test_a_write_is_repeated_only_where_it_was_surely_not_carried_out(code, writes):
    with TcpDevice(Bank()) as device:
        port = connect(device)
        device.script = Busy(code, 3)
        if writes > 1:
            port.write(100, [1])
        else:
            with pytest.raises(RequestRefused):
                port.write(100, [1])
        port.close()
    assert device.bank.count(0x10) == writes


@pytest.mark.parametrize(("code", "word"), [(6, "busy"), (11, "gateway")])
def test_a_drive_that_stays_busy_is_waited_for_as_long_as_an_answer_may_take(code, word):
    with TcpDevice(Bank()) as device:
        port = connect(device, timeout_s=0.1)
        device.script = lambda request, frame: [refusal(request, frame, code)]
        began = time.monotonic()
        with pytest.raises(RequestRefused) as caught:
            port.read(100, 1)
        port.close()
    assert time.monotonic() - began < 0.5
    assert word in caught.value.remedy


def test_an_answer_of_another_device_is_named():
    """A gateway whose table is wrong."""
    with TcpDevice(Bank()) as device:
        port = connect(device)
        device.script = lambda request, frame: [frame[:6] + b"\x11" + frame[7:]]
        with pytest.raises(ReplyTimeout) as caught:
            port.read(100, 1)
        assert "device 17" in str(caught.value.value) and "?device=17" in caught.value.remedy
        device.script = lambda request, frame: []
        with pytest.raises(ReplyTimeout) as silent:
            port.read(100, 1)
        assert "nothing" in str(silent.value.value) and "device=1" in silent.value.remedy
        port.close()


def test_a_port_of_something_else_than_modbus_is_told():
    with TcpDevice(Bank()) as device, closing(connect(device)) as port:
        device.script = lambda request, frame: [b"HTTP/1.1 400 Bad Request\r\n\r\n"]
        with pytest.raises(LinkError) as failure:
            port.read(100, 1)
    assert failure.value.value == "28 bytes that are no Modbus answer to it"
    assert "see that Modbus TCP, and nothing else" in failure.value.remedy


@pytest.mark.parametrize(
    ("damage", "seen"),
    [
        (lambda frame: frame[:-1], "10 of the answer's 11 bytes in 0.1 s"),
        (lambda frame: frame[:7], "7 of the answer's 11 bytes in 0.1 s"),
        (lambda frame: b"\x7f\xff" + frame[2:], "an answer to transaction 32767, not 1 in 0.1 s"),
    ],
)
def test_an_answer_that_trickles_or_is_another_requests_is_no_other_protocol(damage, seen):
    with TcpDevice(Bank()) as device, closing(connect(device)) as port:
        device.script = lambda request, frame: [damage(frame)]
        with pytest.raises(LinkError) as failure:
            port.read(100, 1)
    assert failure.value.value == seen
    assert "nothing else" not in failure.value.remedy
    assert "reply=SECONDS" in failure.value.remedy


def test_a_connection_closed_by_the_drive_is_reported_and_reopened_by_the_next_request():
    with TcpDevice(Bank()) as device:
        port = connect(device)
        port.read(1, 1)
        device.script = lambda request, frame: (_ for _ in ()).throw(OSError("the drive restarts"))
        with pytest.raises(ReplyTimeout):
            port.read(100, 1)
        device.script = lambda request, frame: [frame]
        assert port.read(200, 1) == (200,)
        port.close()
    assert port.stats.connections == 2


def test_a_drive_that_stays_away_is_unreachable():
    with TcpDevice(Bank()) as device:
        port = connect(device)
        port.read(1, 1)
    with pytest.raises(LinkError):
        port.read(1, 1)
    with pytest.raises(LinkUnreachable):
        port.read(1, 1)
    port.close()
    port.close()


def test_an_interrupt_in_the_middle_of_a_request_leaves_no_answer_for_the_next(monkeypatch):
    with TcpDevice(Bank()) as device:
        port = connect(device)
        original = port._client.recv

        def interrupted(size):
            monkeypatch.setattr(port._client, "recv", original)
            raise KeyboardInterrupt

        monkeypatch.setattr(port._client, "recv", interrupted)
        with pytest.raises(KeyboardInterrupt):
            port.read(100, 4)
        assert port.read(200, 4)[0] == 200
        port.close()
    assert port.stats.connections == 2


PYMODBUS_ERRORS = [
    getattr(pymodbus_exceptions, name)
    for name in pymodbus_exceptions.__all__
    if issubclass(getattr(pymodbus_exceptions, name), pymodbus_exceptions.ModbusException)
]


def test_the_list_of_pymodbus_errors_is_complete():
    defined = {
        value
        for value in vars(pymodbus_exceptions).values()
        if isinstance(value, type) and issubclass(value, pymodbus_exceptions.ModbusException)
    }
    assert defined - {pymodbus_exceptions.ModbusException} == set(PYMODBUS_ERRORS)


@pytest.mark.parametrize("kind", [*PYMODBUS_ERRORS, pymodbus_exceptions.ModbusException], ids=lambda k: k.__name__)
def test_every_pymodbus_error_becomes_one_of_ours(kind, monkeypatch):
    with TcpDevice(Bank()) as device:
        port = connect(device)
        monkeypatch.setattr(port._client, "read_holding_registers", Mock(side_effect=kind("made by a test")))
        with pytest.raises(LinkError) as caught:
            port.read(100, 1)
        assert isinstance(caught.value.__cause__, kind)
        assert caught.value.step and caught.value.remedy and "made by a test" in str(caught.value.value)
        port.close()


@pytest.mark.parametrize("kind", [OSError, ConnectionResetError, ValueError, struct.error, TypeError])
def test_errors_that_pymodbus_lets_through_become_ours(kind, monkeypatch):
    with TcpDevice(Bank()) as device:
        port = connect(device)
        monkeypatch.setattr(port._client, "read_holding_registers", Mock(side_effect=kind("made by a test")))
        with pytest.raises(LinkError):
            port.read(100, 1)
        port.close()


LISTEN_TO_NOBODY = """
import sys
from commissioner.errors import ReplyTimeout
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.modbus import open_port
from commissioner.link.wire.url import TcpUrl

port = open_port(TcpUrl("127.0.0.1", int(sys.argv[1])), load_profile("simulated"), reply_timeout_s=0.05)
try:
    port.read(100, 1)
except ReplyTimeout as error:
    print(error.what)
"""


def test_the_library_writes_nothing_to_the_terminal():
    with TcpDevice(Bank()) as device:
        device.script = lambda request, frame: []
        run = subprocess.run(
            [sys.executable, "-c", LISTEN_TO_NOBODY, str(device.port)], capture_output=True, text=True, check=True
        )
    assert run.stdout == "no answer to 'read 1 register at 100'\n"
    assert run.stderr == ""


def test_how_long_this_host_did_not_ask_is_kept():
    with TcpDevice(Bank()) as device:
        port = connect(device)
        device.script = lambda request, frame: [0.03, frame]
        port.read(100, 1)
        port.stats.longest_gap_s = 0.0
        port.read(100, 1)
        assert port.stats.longest_gap_s < 0.03  # waiting for an answer is none of it
        time.sleep(0.06)
        port.read(100, 1)
        port.close()
    assert port.stats.longest_gap_s >= 0.06


def test_a_host_that_slept_while_it_waited_is_no_slow_link():
    slept_s = 0.0

    def answer(_request, frame):
        nonlocal slept_s
        slept_s = 5.0
        return [frame]

    with TcpDevice(Bank()) as device:
        url = TcpUrl("127.0.0.1", device.port)
        clock = lambda: time.monotonic() + slept_s  # noqa: E731
        port = ModbusPort(url, PROFILE, reply_timeout_s=0.25, connect_timeout_s=1.0, clock=clock)
        port.read(100, 1)
        device.script = answer
        port.read(100, 1)
        port.close()
    assert port.stats.longest_gap_s >= 5.0
    assert port.stats.latency_s(1.0) < 0.25
