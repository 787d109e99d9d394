"""Every fault knob does what its name says, seen from the other end of the wire."""

from __future__ import annotations

import time

import pytest

from sim.drive.drive_map import load_map
from sim.drive.samples import SampleRing
from sim.physics import layout as at
from sim.scenario import load
from sim.wire.faults import DRIVE, SERVER, WIRE, FaultError, parse
from sim.wire.server import run_in_thread
from sim.wire.station import Options
from tests.sim.client import Refused, RtuClient, Silent, TcpClient, crc_bytes, floats

SCENARIO = load("default")
MAGIC = [0x434D, 0x5352]


class Both:
    """A running drive with a client on TCP and one on RTU."""

    def __init__(self, running) -> None:
        self.drive = running.drive
        self.address = running.addresses["tcp"]
        self.tcp = TcpClient(running.addresses["tcp"], 0.3)
        self.rtu = RtuClient(running.addresses["rtu"], 0.3)

    def close(self) -> None:
        self.tcp.close()
        self.rtu.close()


@pytest.fixture
def with_faults(request):
    with run_in_thread(SCENARIO, Options(tcp_port=0, rtu="pty", faults=tuple(request.param))) as running:
        both = Both(running)
        yield both
        both.close()


def faults(*texts: str):
    return pytest.mark.parametrize("with_faults", [texts], indirect=True, ids=",".join)


@faults("late:0.4@1")
def test_late_reply_comes_after_the_client_gave_up_and_fools_a_naive_one(with_faults):
    rtu = with_faults.rtu
    with pytest.raises(Silent):
        rtu.read(0, 2)
    time.sleep(0.2)
    rtu.timeout_s = 1.0
    assert rtu.read(3, 2) == MAGIC  # asked for the firmware version, got the late magic: the trap


@faults("gateway:6@1", "gateway:11@2")
def test_a_gateway_refuses_for_the_drive_or_after_it(with_faults):
    """Busy: the drive never got the request. Target failed: it did."""
    tcp, drive = with_faults.tcp, with_faults.drive.firmware
    for code, echoed in ((6, 0), (11, 78)):
        with pytest.raises(Refused) as caught:
            tcp.write_one(21, 78)
        assert caught.value.code == code
        assert drive.values["echo"] == echoed


@faults("drops_bytes:0.05@1+")
def test_a_line_that_loses_bytes_leaves_frames_short(with_faults):
    """Of 9-byte answers 0.95^9 = 0.63 arrive whole."""
    rtu, whole = with_faults.rtu, 0
    rtu.timeout_s = 0.02
    for _ in range(40):
        try:
            whole += rtu.read(0, 2) == MAGIC
        except (Silent, AssertionError):
            continue
    assert 12 <= whole <= 37


@faults("lost@1")
def test_lost_reply_is_silence_but_the_request_was_executed(with_faults):
    with pytest.raises(Silent):
        with_faults.tcp.write_one(21, 77)
    assert with_faults.drive.firmware.values["echo"] == 77


@faults("lost_request@1")
def test_lost_request_is_silence_and_nothing_was_executed(with_faults):
    with pytest.raises(Silent):
        with_faults.tcp.write_one(21, 77)
    assert with_faults.drive.firmware.values["echo"] == 0


@faults("repeated@1")
def test_repeated_reply_arrives_twice(with_faults):
    assert with_faults.tcp.read(0, 2) == MAGIC
    assert with_faults.tcp.receive()[2:6] == b"CMSR"


@faults("truncated:3@1")
def test_truncated_reply_never_completes(with_faults):
    with pytest.raises(Silent) as silent:
        with_faults.rtu.read(0, 2)
    assert len(silent.value.received) == 9 - 3


@faults("corrupted@1")
def test_corrupted_reply_fails_its_check_sum(with_faults):
    with pytest.raises(Silent) as silent:
        with_faults.rtu.read(0, 2)
    assert len(silent.value.received) == 9
    assert crc_bytes(silent.value.received[:-2]) != silent.value.received[-2:]


@faults("reordered@1")
def test_reordered_replies_swap_places(with_faults):
    tcp = with_faults.tcp
    tcp.send(bytes([3, 0, 0, 0, 2]))
    with pytest.raises(Silent):
        tcp.receive()
    tcp.send(bytes([3, 0, 2, 0, 1]))
    first = (tcp.receive(), tcp.last_header[:2])
    second = (tcp.receive(), tcp.last_header[:2])
    assert first[1] == b"\0\2"
    assert second == (bytes([3, 4]) + b"CMSR", b"\0\1")


@faults("stray_before:00ff@1", "stray_after:7f@2")
def test_stray_bytes_stand_before_and_after_the_frame(with_faults):
    rtu = with_faults.rtu
    rtu.send(bytes([3, 0, 0, 0, 2]))
    assert rtu.receive()[:3] == b"\0\xff\1"
    rtu.send(bytes([3, 0, 0, 0, 2]))
    assert rtu.receive()[-1:] == b"\x7f"


@faults("wrong_unit:7@1", "wrong_function@2", "short_reply:1@3")
def test_well_formed_lies_have_a_good_check_sum(with_faults):
    rtu = with_faults.rtu
    seen = []
    for _ in range(3):
        rtu.send(bytes([3, 0, 0, 0, 2]))
        frame = rtu.receive()
        assert crc_bytes(frame[:-2]) == frame[-2:]
        seen.append((frame[0], frame[1], frame[2]))
    assert seen == [(7, 3, 4), (1, 4, 4), (1, 3, 2)]


@faults("wrong_transaction@1")
def test_wrong_transaction_number_comes_back(with_faults):
    with_faults.tcp.read(0, 2)
    assert with_faults.tcp.last_header[:2] != b"\0\1"


@faults("stall:0.6@2")
def test_stalled_server_answers_nothing_for_a_while(with_faults):
    tcp = with_faults.tcp
    tcp.read(0, 2)
    started = time.monotonic()
    with pytest.raises(Silent):
        tcp.read(0, 2)
    tcp.socket.settimeout(2.0)
    assert tcp.receive()[2:6] == b"CMSR"
    assert time.monotonic() - started > 0.5


@faults("restart:0.3@2")
def test_restarted_server_drops_the_line_and_comes_back_on_its_port(with_faults):
    tcp = with_faults.tcp
    tcp.read(0, 2)
    with pytest.raises(ConnectionError):
        tcp.read(0, 2)
    deadline = time.monotonic() + 3.0
    while time.monotonic() < deadline:
        try:
            again = TcpClient(with_faults.address)
            break
        except OSError:
            time.sleep(0.05)
    assert again.read(0, 2) == MAGIC
    again.close()


@faults("half_open@2")
def test_half_open_line_stays_open_and_dead(with_faults):
    tcp = with_faults.tcp
    tcp.read(0, 2)
    for _ in range(2):
        with pytest.raises(Silent):
            tcp.read(0, 2)


@faults("other_map:100")
def test_other_firmware_has_its_registers_elsewhere(with_faults):
    assert with_faults.tcp.read(0, 2) == MAGIC
    with pytest.raises(Refused):
        with_faults.tcp.read(48, 1)
    assert with_faults.tcp.read(148, 1)[0] & 0x6F == 0x40


@faults("overrun:100@e0.1s")
def test_overrun_loses_samples_and_says_so(with_faults):
    tcp, drive = with_faults.tcp, with_faults.drive.firmware
    tcp.prepare(duration_s=20.0)
    tcp.enable()
    windows = tcp.stream(until=1000)
    assert any(w[5] & 4 for w in windows)
    assert drive.samples.overruns > 0


@faults("sample_gap:5@e0.1s")
def test_sample_gap_shows_as_a_window_that_begins_later_than_asked(with_faults):
    tcp = with_faults.tcp
    tcp.prepare(duration_s=0.5)
    tcp.enable()
    asked, late = 0, []
    for k in range(1, 40):
        window = tcp.window(asked, k)
        begins = window[1] << 16 | window[2]
        if begins != asked:
            late.append(begins - asked)
        asked = begins + window[3]
    assert late == [5]


@pytest.mark.parametrize("length", [5, 40, 200])
def test_behind_a_gap_longer_than_a_window_samples_go_on(length):
    """Windows at and in a gap of more than a window's samples stayed empty for good, which ended every run as a drive that sends none."""
    ring = SampleRing(load_map(), 1024, 0b1111, 1)
    ring.has_ended = False
    ring.c[at.C_PRODUCED], ring.gaps = 500, [(100, length)]
    asked, seen = 0, []
    while asked < 500:
        window = ring.window(asked, 29, 1, 0, is_running=True)
        begins = window[1] << 16 | window[2]
        assert window[3] > 0
        seen += range(begins, begins + window[3])
        asked = begins + window[3]
    assert seen == [*range(100), *range(100 + length, 500)]


@pytest.mark.parametrize(
    ("with_faults", "cause"),
    [
        ((f"{name}@e0.05s",), cause)
        for name, cause in (
            ("overcurrent", 1),
            ("heatsink", 2),
            ("earth_fault", 3),
            ("sto", 4),
            ("undervoltage", 5),
            ("winding", 8),
        )
    ],
    indirect=["with_faults"],
)
def test_trips_strike_while_energised_at_their_time(with_faults, cause):
    tcp = with_faults.tcp
    tcp.prepare(duration_s=1.0)
    tcp.enable()
    windows = tcp.stream()
    assert windows[-1][5] & 16
    assert sum(w[3] for w in windows) == 250
    assert tcp.read(49, 2) == [cause, cause]
    assert tcp.status() & 0x4F == 0x08
    assert tcp.read(57, 1)[0] & 1 == (cause != 4)


def commit(tcp: TcpClient, ohm: float = 3.7) -> None:
    words = floats(ohm, 2.1, 21.0, 224.0)
    crc = int.from_bytes(crc_bytes(b"".join(w.to_bytes(2, "big") for w in words)), "little")
    tcp.write(592, [*words, crc])
    tcp.write_one(601, 0xC0DE)


def settled(tcp: TcpClient, address: int, tries: int = 30) -> int:
    for _ in range(tries):
        result = tcp.read(address, 1)[0]
        if result != 1:
            break
    return result


@faults("stuck_commit")
def test_stuck_commit_stays_busy(with_faults):
    commit(with_faults.tcp)
    assert settled(with_faults.tcp, 603) == 1


@faults("store_fails")
def test_failing_store_says_so_and_wears_the_memory(with_faults):
    tcp = with_faults.tcp
    commit(tcp)
    assert settled(tcp, 603) == 2
    tcp.write_one(602, 0x570E)
    assert settled(tcp, 604) == 3
    assert tcp.read(605, 2) == [0, 1]


@faults("power_cycle@commit")
def test_power_cycle_between_stage_and_commit_loses_what_was_staged(with_faults):
    tcp = with_faults.tcp
    commit(tcp)
    assert tcp.read(603, 1) == [0]
    assert with_faults.drive.firmware.parameters.in_use[0] == pytest.approx(3.2)
    assert with_faults.drive.firmware.memory.content["power_ups"] == 2


@faults("ignore:commit")
def test_a_drive_may_acknowledge_and_not_do_it(with_faults):
    commit(with_faults.tcp)
    assert settled(with_faults.tcp, 603) == 2
    assert with_faults.drive.firmware.parameters.in_use[0] == pytest.approx(3.2)


@faults("heartbeat_ignored")
def test_ignored_heartbeat_ends_in_the_watchdog(with_faults):
    tcp = with_faults.tcp
    tcp.prepare(duration_s=30.0, watchdog_ms=150)
    tcp.enable()
    deadline = time.monotonic() + 3.0
    beat = 0
    while tcp.status() & 0x4F != 0x08 and time.monotonic() < deadline:
        beat += 1
        tcp.write_one(34, beat)
    assert tcp.read(50, 1) == [6]


@faults("runs_away@e0.05s")
def test_a_runaway_drive_heeds_neither_commands_nor_silence(with_faults):
    tcp = with_faults.tcp
    tcp.prepare(duration_s=30.0, watchdog_ms=150)
    tcp.enable()
    for beat in range(100):
        tcp.write_one(34, beat + 1)
    for word in (0x00, 0x02, 0x06):
        tcp.write_one(32, word)
    time.sleep(0.3)
    assert tcp.status() & 0x6F == 0x27


@faults("refuse:watchdog_ms")
def test_refused_item_is_an_exception(with_faults):
    with pytest.raises(Refused) as refused:
        with_faults.tcp.write(96, [500])
    assert refused.value.code == 3


def test_a_fault_among_writes_counts_only_requests_that_write():
    second, from_there, plain = parse("lost@w2"), parse("lost@w2+"), parse("lost@2")
    assert [second.hits(request, write) for request, write in ((2, None), (3, 1), (9, 2), (10, 3))] == [0, 0, 1, 0]
    assert [from_there.hits(request, write) for request, write in ((2, None), (9, 2), (10, 3))] == [0, 1, 1]
    assert [plain.hits(request, write) for request, write in ((2, None), (2, 1), (9, 2))] == [1, 1, 0]


@pytest.mark.parametrize(
    "text", ["nonsense", "late:x", "lost@", "lost@soon", "lost@w", "lost@w2s", "stray_before:zz", "Late", "late:1@2x"]
)
def test_unclear_fault_texts_are_refused(text):
    with pytest.raises(FaultError):
        parse(text)


@pytest.mark.parametrize("name", [*WIRE, *SERVER, *DRIVE])
def test_every_knob_has_a_default_and_takes_every_time(name):
    for when in ("", "@3", "@3+", "@3x2", "@w3", "@w3+", "@w3x2", "@1.5s", "@e0.5s", "@commit"):
        assert parse(name + when).name == name
