"""RTU answers that come seconds late, alone and in the place of a later answer of equal length."""

import dataclasses
import time

import pytest
from pymodbus.client import ModbusSerialClient

from commissioner.errors import LinkError, ReplyMismatch, ReplyTimeout, RequestRefused
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.debts import LATEST_S, Debts
from commissioner.link.wire.modbus import ModbusPort, open_port
from commissioner.link.wire.trust import WATCH_S
from commissioner.link.wire.url import RtuUrl
from sim.scenario import load
from sim.wire.server import run_in_thread
from sim.wire.station import Options
from tests.support.raw_servers import Bank, RtuDevice, once_free, rtu_frame

BAUD = 921600
TIMEOUT_S = 0.1
HELD_S = 5.0


class Clock:
    """The real one, and what a test adds to it."""

    def __init__(self):
        self.ahead_s = 0.0

    def __call__(self):
        return time.monotonic() + self.ahead_s


class HeldBack:
    """Keeps the answer to a request for `held`; once `is_due` it comes first, alone, where the next of `due` is asked, and
    that one's own `own_s` later."""

    def __init__(self, held: bytes, due: bytes, own_s: float = 0.03):
        self.held, self.due, self.own_s, self.kept, self.is_due = held, due, own_s, b"", False

    def __call__(self, request, answer):
        if not self.kept and request[1 : 1 + len(self.held)] == self.held:
            self.kept = answer
            return []
        if self.is_due and request[1 : 1 + len(self.due)] == self.due:
            self.is_due = False
            return [self.kept, self.own_s, answer]
        return [answer]


def opened(device, clock=time.monotonic, **link):
    profile = load_profile("simulated")
    profile = dataclasses.replace(profile, link=dataclasses.replace(profile.link, turnaround_s=0.002, **link))
    port = ModbusPort(
        RtuUrl(device.path, BAUD, parity="N"), profile, reply_timeout_s=TIMEOUT_S, connect_timeout_s=1.0, clock=clock
    )
    port.read_retries = 0
    once_free(port.connect)
    return port


READ_100, READ_200 = b"\x03\x00\x64", b"\x03\x00\xc8"


@pytest.mark.parametrize("own_s", [0.03, 0.0])
@pytest.mark.parametrize("after_s", [WATCH_S + 0.5, 5.0, LATEST_S - 1.0])
def test_an_answer_of_equal_length_that_comes_seconds_late_is_not_believed(after_s, own_s):
    clock = Clock()
    with RtuDevice(Bank(has_exchange=False)) as device:
        device.script = HeldBack(READ_100, READ_200, own_s)
        port = opened(device, clock)
        with pytest.raises(ReplyTimeout):
            port.read(100, 1)
        assert port.read(300, 1) == (300,)
        clock.ahead_s += after_s
        device.script.is_due = True
        with pytest.raises(ReplyMismatch):
            port.read(200, 1)
        assert port.read(200, 1) == (200,)
        port.close()


def test_where_the_drive_can_the_question_is_asked_in_a_shape_that_is_not_owed():
    """So that a late answer shows even where ours is late, too, and the token in between came back."""
    clock = Clock()
    with RtuDevice(Bank()) as device:
        device.script = HeldBack(READ_100, b"\x17\x00\xc8")
        port = opened(device, clock)
        with pytest.raises(ReplyTimeout):
            port.read(100, 1)
        assert port.read(300, 1) == (300,)
        clock.ahead_s += 5.0
        device.script.is_due = True
        with pytest.raises(ReplyMismatch):
            port.read(200, 1)
        assert port.read(200, 1) == (200,)
        assert device.bank.count(0x17) == 2
        port.close()


def test_a_late_refusal_and_a_late_echo_of_a_write_are_not_believed_either():
    clock = Clock()
    for held, due, ask in (
        (b"\x10\x01\xf4", b"\x10\x01\xf4", lambda port: port.write(500, [2])),
        (b"\x03\xea\x60", READ_200, lambda port: port.read(200, 4)),
    ):
        with RtuDevice(Bank()) as device:
            script = HeldBack(held, due)
            device.script = script
            port = opened(device, clock)
            with pytest.raises(ReplyTimeout):
                port.write(500, [1]) if held[0] == 0x10 else port.read(60000, 1)
            if held[0] == 3:
                script.kept = rtu_frame(bytes([1, 0x83, 2]))
            assert port.read(300, 1) == (300,)
            clock.ahead_s += 5.0
            script.is_due = True
            with pytest.raises(ReplyMismatch):
                ask(port)
            port.close()


def requests_of(device, ask):
    before = len(device.bank.requests)
    ask()
    return len(device.bank.requests) - before


def test_only_answers_like_the_lost_one_cost_more_and_only_until_it_was_seen_or_is_too_old():
    clock = Clock()
    with RtuDevice(Bank(has_exchange=False)) as device:
        script = HeldBack(READ_100, READ_200)
        device.script = script
        port = opened(device, clock, has_read_write_multiple=False)
        with pytest.raises(ReplyTimeout):
            port.read(100, 1)
        port.read(300, 4)
        clock.ahead_s += WATCH_S + 0.5
        assert requests_of(device, lambda: port.read(300, 4)) == 1
        assert requests_of(device, lambda: port.read(300, 1)) == 3
        assert port.stats.resynchronisations == 2
        device.inject(script.kept)  # seen between two requests
        time.sleep(0.01)
        port.read(300, 4)
        clock.ahead_s += WATCH_S + 0.5
        assert requests_of(device, lambda: port.read(300, 1)) == 1
        script.kept = b""
        with pytest.raises(ReplyTimeout):
            port.read(100, 1)
        port.read(300, 4)
        clock.ahead_s += LATEST_S
        assert requests_of(device, lambda: port.read(300, 1)) == 1
        port.close()


def test_a_window_of_an_older_question_is_told_to_the_line():
    clock = Clock()
    with RtuDevice(Bank()) as device:
        port = opened(device, clock)
        port.read(100, 4)
        assert port.stats.resynchronisations == 1
        port.exchange(500, [1], 600, 10, proves_itself=True)
        port.doubt()
        port.read(100, 4)
        assert port.stats.resynchronisations == 2
        port.close()


def test_a_refusal_in_the_tokens_place_is_no_proof():
    with RtuDevice(Bank()) as device:
        refusals = [rtu_frame(bytes([1, 0x86, 4]))]
        device.script = lambda request, answer: [refusals.pop() if request[1] == 6 and refusals else answer]
        port = opened(device)
        assert port.read(100, 4) == (100, 101, 102, 103)
        device.script = lambda request, answer: [rtu_frame(bytes([1, 0x86, 4])) if request[1] == 6 else answer]
        port.doubt()
        with pytest.raises(LinkError) as caught:
            port.read(100, 4)
        assert not isinstance(caught.value, RequestRefused)
        port.close()


def test_debts_are_paid_by_their_shape_alone():
    debts = Debts(lambda: 0.0)
    debts.owe((3, 2))
    debts.owe((16, 100, 1))
    debts.pay([rtu_frame(b"\x01\x03\x04" + bytes(4)), rtu_frame(b"\x01\x10\x00\x64\x00\x02")])
    assert debts.may_be_late(rtu_frame(b"\x01\x03\x02" + bytes(2)))
    assert debts.may_be_late(rtu_frame(b"\x01\x90\x04"))
    assert not debts.may_be_late(rtu_frame(b"\x01\x97\x04"))
    debts.pay([rtu_frame(b"\x01\x03\x02" + bytes(2)), rtu_frame(b"\x01\x90\x04")])
    assert not debts.may_be_late(rtu_frame(b"\x01\x03\x02" + bytes(2)))
    assert not debts.may_be_late(rtu_frame(b"\x01\x10\x00\x64\x00\x01"))


@pytest.mark.parametrize("client", ["naive", "ours"])
def test_the_simulated_drive_holds_an_answer_back_for_five_seconds(client):
    """It arrives while a later request of equal length waits for its own: the naive client takes it, ours does not."""
    begun = time.monotonic()
    held = {"naive": 1, "ours": 6}[client]  # behind two tokens and the first read
    faults = (f"late:{HELD_S}@{held}", f"late:0.4@{HELD_S - 0.2}s")
    with run_in_thread(load("default"), Options(speed=1.0, rtu="pty", faults=faults)) as running:
        path, drive = running.addresses["rtu"], running.drive
        magic, version = 0x434D, 1
        if client == "naive":
            port = ModbusSerialClient(path, baudrate=115200, timeout=0.2, retries=0)
            port.connect()
            port.comm_params.timeout_connect = 0.2
            with pytest.raises(Exception, match="No response"):
                port.read_holding_registers(0, count=1, device_id=1)
            lost_at = time.monotonic()
            assert port.read_holding_registers(2, count=1, device_id=1).registers == [version]
            port.comm_params.timeout_connect = 1.0
            _wait_until(drive, lost_at - 0.2 + HELD_S - 0.1)
            assert port.read_holding_registers(2, count=1, device_id=1).registers == [magic]
        else:
            port = open_port(RtuUrl(path, parity="N"), load_profile("simulated"), reply_timeout_s=0.2)
            port.read_retries = 0
            assert port.read(2, 1) == (version,)
            with pytest.raises(ReplyTimeout):
                port.read(0, 1)
            lost_at = time.monotonic() - port.reply_timeout_s
            assert port.read(2, 1) == (version,)
            port.reply_timeout_s = 1.0
            _wait_until(drive, lost_at + HELD_S - 0.1)
            with pytest.raises(ReplyMismatch):
                port.read(2, 1)
            port.read_retries = 2  # the drive may be late with what was asked meanwhile
            assert port.read(2, 1) == (version,)
        port.close()
    assert time.monotonic() - begun > HELD_S


def _wait_until(drive, wall):
    time.sleep(max(0.0, wall - time.monotonic()))
    assert drive.firmware.t > HELD_S - 0.2
