"""RTU has no transaction number. The line's truth is tested over a pty, byte by byte."""

import dataclasses
import itertools

import pytest
import serial
from pymodbus.client import ModbusSerialClient

from commissioner.errors import LinkError, ReplyMismatch, ReplyTimeout, RequestRefused
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.modbus import ModbusPort, open_port
from commissioner.link.wire.url import RtuUrl
from tests.support.raw_servers import Bank, RtuDevice, once_free, rtu_frame

BAUD = 921600
TIMEOUT_S = 0.1


def quick_profile(**changes):
    profile = load_profile("simulated")
    return dataclasses.replace(profile, link=dataclasses.replace(profile.link, turnaround_s=0.002, **changes))


def connect(device: RtuDevice, profile=None, timeout_s: float = TIMEOUT_S, **changes) -> ModbusPort:
    profile = profile or quick_profile(**changes)
    return once_free(lambda: open_port(RtuUrl(device.path, BAUD, parity="N"), profile, reply_timeout_s=timeout_s))


class Late:
    """Holds back the answer to the `nth` request and sends it `after` requests later, just before theirs."""

    def __init__(self, nth: int, after: int = 1) -> None:
        self.nth, self.release = nth, nth + after
        self.seen = 0
        self.held = b""

    def __call__(self, request: bytes, answer: bytes) -> list[bytes]:
        self.seen += 1
        if self.seen == self.nth:
            self.held = answer
            return []
        if self.seen == self.release:
            return [self.held + answer]
        return [answer]


class Shifted:
    """From the `nth` request on every answer comes one request late, for good."""

    def __init__(self, nth: int) -> None:
        self.nth, self.seen, self.held = nth, 0, b""

    def __call__(self, request: bytes, answer: bytes) -> list[bytes]:
        self.seen += 1
        if self.seen < self.nth:
            return [answer]
        late, self.held = self.held, answer
        return [late]


def test_a_naive_client_takes_the_late_answer_for_the_next_one():
    """The trap exists: without this the tests below would prove nothing."""
    with RtuDevice(Bank()) as device:
        device.script = Shifted(nth=1)
        client = ModbusSerialClient(device.path, baudrate=BAUD, timeout=TIMEOUT_S, retries=0)
        client.connect()
        with pytest.raises(Exception, match="No response"):
            client.read_holding_registers(100, count=4, device_id=1)
        fooled = [client.read_holding_registers(address, count=4, device_id=1).registers[0] for address in (200, 300)]
        client.close()
    assert fooled == [100, 200]


@pytest.mark.parametrize("answers_after_s", [0.002, 0.01])
def test_an_adapter_that_gives_back_what_it_sends_is_named(answers_after_s):
    with RtuDevice(Bank()) as device:
        device.script = lambda request, answer: [request, answers_after_s, answer]
        port = connect(device)
        with pytest.raises(ReplyTimeout) as caught:
            port.read(100, 4)
        port.close()
    assert "gives back what this host sends" in caught.value.what
    assert "echo" in caught.value.remedy


def test_a_line_that_stays_out_of_step_without_an_echo_is_called_so():
    with RtuDevice(Bank()) as device:
        device.script = lambda request, answer: [answer + answer]
        port = connect(device)
        with pytest.raises(ReplyTimeout, match="does not come into step"):
            port.read(100, 4)
        port.close()


@pytest.mark.parametrize("after", [1, 2, 3, 4, 5])
def test_late_reply_is_not_taken_for_the_next_one(after):
    with RtuDevice(Bank()) as device:
        port = connect(device)
        port.read_retries = 0
        port.read(10, 4)
        asked = len(device.bank.requests)
        device.script = Late(nth=1, after=after)
        with pytest.raises(ReplyTimeout):
            port.read(100, 4)
        answers = []
        for address in (200, 300, 400, 500):
            try:
                answers.append((address, port.read(address, 4)[0]))
            except ReplyMismatch:
                answers.append((address, None))
        port.close()
        assert len(device.bank.requests) > asked
    assert all(word in (address, None) for address, word in answers), answers
    assert answers[-1] == (500, 500)


@pytest.mark.parametrize("after", [1, 2, 3, 4, 5])
def test_retried_reads_survive_a_late_reply_unharmed(after):
    with RtuDevice(Bank()) as device:
        port = connect(device)
        port.read_retries = 2
        port.read(10, 4)
        device.script = Late(nth=1, after=after)
        answers = [port.read(address, 4)[0] for address in (100, 200, 300, 400)]
        port.close()
        asked = [int.from_bytes(pdu[1:3]) for pdu in device.bank.requests if pdu[0] == 3 and pdu[4] == 4][1:]
    assert answers == [100, 200, 300, 400]
    assert asked[:2] == [100, 100]  # its answer was held back; what a busy host asks twice besides stays in order
    assert [address for address, _ in itertools.groupby(asked)] == [100, 200, 300, 400]
    assert port.stats.requests == len(device.bank.requests)


def test_a_line_shifted_for_good_never_yields_a_wrong_value():
    with RtuDevice(Bank()) as device:
        port = connect(device)
        port.read(10, 4)
        device.script = Shifted(nth=1)
        for address in (100, 200, 300):
            with pytest.raises(LinkError):
                port.read(address, 4)
        port.close()


def test_an_answer_left_over_from_before_we_opened_the_line_is_not_ours():
    with RtuDevice(Bank()) as device:
        stale = rtu_frame(bytes([1, 3, 8]) + bytes(8))
        device.script = lambda request, answer: [stale + answer] if request[1] == 3 and request[3] == 100 else [answer]
        port = connect(device)
        port.read_retries = 0
        with pytest.raises(ReplyMismatch):
            port.read(100, 4)
        port.close()


@pytest.mark.parametrize("junk", [b"\x00", b"\xff", b"\x7f", b"\x00\xff", b"\x55\xaa\x55"])
@pytest.mark.parametrize("where", ["before", "after"])
def test_stray_bytes_around_a_frame_change_no_value(junk, where):
    with RtuDevice(Bank()) as device:
        port = connect(device)
        device.script = lambda request, answer: [junk + answer if where == "before" else answer + junk]
        assert [port.read(address, 5)[0] for address in (100, 200, 300)] == [100, 200, 300]
        port.close()


def test_a_frame_in_pieces_is_one_frame():
    with RtuDevice(Bank()) as device:
        port = connect(device)
        device.script = lambda request, answer: [
            part for k in range(0, len(answer), 7) for part in (answer[k : k + 7], 0.0005)
        ]
        assert port.read(40, 20) == tuple(range(40, 60))
        port.close()


def _flip(answer: bytes) -> bytes:
    return answer[:4] + bytes([answer[4] ^ 0x10]) + answer[5:]


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("truncated", lambda answer: answer[:-3]),
        ("corrupted", _flip),
        ("other device", lambda answer: rtu_frame(b"\x02" + answer[1:-2])),
        ("shorter than asked", lambda answer: rtu_frame(bytes([1, 3, 4]) + answer[3:7])),
        ("other function", lambda answer: rtu_frame(bytes([1, 4]) + answer[2:-2])),
        ("nothing", lambda answer: b""),
    ],
)
def test_a_damaged_answer_is_a_typed_error_and_then_the_line_is_in_step(name, damage):
    with RtuDevice(Bank()) as device:
        port = connect(device)
        port.read_retries = 0
        device.script = lambda request, answer: [damage(answer)] if request[2:4] == b"\x00\x64" else [answer]
        with pytest.raises((ReplyTimeout, ReplyMismatch)):
            port.read(100, 4)
        assert port.read(200, 4) == (200, 201, 202, 203)
        port.close()


def test_no_write_is_sent_twice_whatever_becomes_of_its_answer():
    with RtuDevice(Bank()) as device:
        port = connect(device)
        device.script = lambda request, answer: [] if request[1] == 0x10 else [answer]
        with pytest.raises(ReplyTimeout):
            port.write(500, [1, 2, 3])
        with pytest.raises(ReplyTimeout):
            port.write(510, [4])
        port.close()
    assert device.bank.count(0x10) == 2


def test_a_lost_answer_to_an_exchange_is_not_repeated():
    with RtuDevice(Bank()) as device:
        port = connect(device)
        device.script = lambda request, answer: [] if request[1] == 0x17 else [answer]
        with pytest.raises(ReplyTimeout):
            port.exchange(500, [7], 600, 3)
        port.close()
    assert device.bank.count(0x17) == 1
    assert device.bank.words[500] == 7


def test_a_refusal_carries_the_code_and_its_meaning():
    with RtuDevice(Bank(has_exchange=False)) as device:
        device.script = lambda request, answer: [rtu_frame(bytes([1, 0x83, 6]))] if request[2] == 9 else [answer]
        port = connect(device)
        with pytest.raises(RequestRefused, match="device busy") as caught:
            port.read(9 * 256, 1)
        assert caught.value.value == 6
        assert port.read(5, 1) == (5,)
        port.close()


@pytest.mark.parametrize("claims_exchange", [True, False])
def test_without_fc23_the_exchange_is_a_write_and_a_read(claims_exchange):
    with RtuDevice(Bank(has_exchange=False)) as device:
        port = connect(device, has_read_write_multiple=claims_exchange)
        assert port.exchange(500, [7, 8], 499, 4) == (499, 7, 8, 502)
        assert port.exchange(500, [9, 8], 499, 4) == (499, 9, 8, 502)
        port.close()
    assert device.bank.count(0x17) == (1 if claims_exchange else 0)
    assert device.bank.count(0x10) == 2


def test_a_profile_without_echo_register_proves_the_line_by_answers_of_two_lengths():
    commercial = load_profile("simulated")
    items = {name: commercial.items[name] for name in ("magic", "map_version")}
    profile = dataclasses.replace(
        commercial, items=items, link=dataclasses.replace(commercial.link, turnaround_s=0.002)
    )
    with RtuDevice(Bank()) as device:
        port = connect(device, profile)
        port.read(10, 4)
        device.script = Shifted(nth=1)
        for address in (100, 200):
            with pytest.raises(LinkError):
                port.read(address, 2)
        port.close()


@pytest.mark.parametrize("has_echo", [True, False])
def test_a_drive_that_is_busy_after_each_write_is_waited_out_where_the_line_is_proved(has_echo):
    """Exception 6 in the token's place is no other answer: the line is proved once the drive answers again."""
    busy = itertools.chain([True] * 3, itertools.repeat(False))
    is_after_write = False

    def script(request: bytes, answer: bytes) -> list[bytes]:
        nonlocal is_after_write
        if is_after_write and next(busy):
            return [rtu_frame(bytes((request[0], request[1] | 0x80, 6)))]
        is_after_write = is_after_write or request[2:4] == bytes((0, 200))
        return [answer]

    with RtuDevice(Bank()) as device:
        device.script = script
        profile = quick_profile(write_functions=(6,), has_read_write_multiple=False)
        if not has_echo:
            profile = dataclasses.replace(profile, items={n: i for n, i in profile.items.items() if n != "echo"})
        port = connect(device, profile, 1.0)
        port.write(200, [7])
        assert port.read(200, 1) == (7,)
        assert port.stats.waits == 3
        port.close()
    assert [r[:3] for r in device.bank.requests].count(bytes((6, 0, 200))) == 1


@pytest.mark.parametrize("asked", ["in doubt", "watched"])
def test_an_adapter_pulled_out_while_the_line_is_drained_is_a_typed_error(asked, monkeypatch):
    def gone():
        raise serial.SerialException("Could not configure port: (5, 'Input/output error')")

    with RtuDevice(Bank()) as device:
        port = connect(device)
        port.read(10, 4)
        if asked == "in doubt":
            port._trust.doubt()
        monkeypatch.setattr(port._client, "drain", gone)
        with pytest.raises(ReplyTimeout) as caught:
            port.write(10, [4])
        assert "Could not configure port" in str(caught.value.value)
        port.close()


def test_a_line_that_vanishes_is_a_typed_error():
    with RtuDevice(Bank()) as device:
        port = connect(device)
        port.read(10, 4)
    with pytest.raises(LinkError):
        port.read(10, 4)
    with pytest.raises(LinkError):
        port.read(10, 4)
    port.close()


@pytest.mark.parametrize(
    ("answer", "value", "remedy"),
    [
        (lambda frame: [], "nothing in", f"{BAUD} Bd, parity N"),
        (lambda frame: [bytes(byte ^ 0x80 for byte in frame)], "bytes that are no Modbus answer", "parity"),
        (lambda frame: [rtu_frame(b"\x07" + frame[1:-2])], "an answer of device 7", "?device=7"),
    ],
)
def test_wrong_parity_or_device_number_is_named_with_what_to_set(answer, value, remedy):
    with RtuDevice(Bank()) as device:
        port = connect(device)
        device.script = lambda request, frame: answer(frame)
        with pytest.raises(ReplyTimeout) as caught:
            port.read(100, 1)
        port.close()
    assert value in str(caught.value.value)
    assert remedy in caught.value.remedy


@pytest.mark.parametrize(
    ("garbled", "said"), [(True, "line is disturbed"), (False, "check the drive's supply, the cable and its plugs")]
)
def test_settings_that_have_proved_right_are_not_asked_for_again(garbled, said):
    """Before the first answers they may be wrong; then it is the line, or the drive."""
    with RtuDevice(Bank()) as device:
        port = connect(device)
        for answered in (0, 30):
            device.script = lambda request, answer: [answer]
            for _ in range(answered):
                port.read(100, 1)
            device.script = lambda request, answer: [b"\x33\x44\x55\x66"] if garbled else []
            with pytest.raises(LinkError) as caught:
                port.read(100, 1)
            assert (said in caught.value.remedy) is (answered > 0)
            assert (f"{BAUD} Bd" in caught.value.remedy) is (answered == 0)
        port.close()
