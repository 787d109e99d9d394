"""The emulated vendors: each wears the face of its file, and behaves behind it as its family does."""

import os
import socket
import struct
import time

import pytest

from sim.vendors.drive import BAD_ADDRESS, BAD_FUNCTION, BAD_VALUE, Habits, VendorDrive
from sim.vendors.face import faces, read_face
from sim.vendors.lines import SILENCE_S, RtuLine
from sim.wire.crc import crc_bytes
from tests.support.vendor_process import MADE_UP, Vendor

MAILBOX, LOCKED = MADE_UP


class Clock:
    t = 0.0

    def __call__(self):
        return self.t


def drive_of(name, **habits):
    clock = Clock()
    return VendorDrive(read_face(name), clock, habits=Habits(**habits)), clock


def read(drive, address, count=1):
    reply = drive.answer(struct.pack(">BHH", 3, address, count))
    return reply[1] if reply[0] & 0x80 else list(struct.unpack(f">{count}H", reply[2:]))


def write(drive, address, *words):
    return drive.answer(struct.pack(f">BHHB{len(words)}H", 16, address, len(words), 2 * len(words), *words))


@pytest.mark.parametrize("name", [*faces(), *MADE_UP], ids=lambda name: name.rpartition("/")[2])
def test_every_face_answers_for_its_registers_and_for_no_others(name):
    from commissioner.link.drive.items import Items
    from commissioner.link.files.drive_file import load_profile
    from tests.campaigns.tunings.bench import JumpingClock, VendorPort

    clock = JumpingClock()
    drive = VendorDrive(read_face(name), clock.now)
    profile = load_profile(name)
    assert set(profile.items) == set(drive.face.cells)
    seen = Items(VendorPort(drive, clock), profile, clock.sleep, clock.now).read(profile.items)
    for item, value in seen.items():
        assert value == pytest.approx(drive.value(item)), item
    assert read(drive, 0xFFF0) == BAD_ADDRESS
    assert drive.answer(b"\x2b\x0e\x01\x00\x00")[1] == BAD_FUNCTION
    assert read(drive, 0, drive.face.longest_read + 1) == BAD_VALUE


def test_a_value_is_in_use_after_an_enter_and_lasting_after_a_store():
    drive, _ = drive_of("yaskawa_a1000", needs_enter=True)
    write(drive, 0x312, 8000)
    assert read(drive, 0x312) != [8000]
    write(drive, 0x910, 0)
    assert read(drive, 0x312) == [8000]
    drive.power_cycle()
    assert read(drive, 0x312) != [8000]
    write(drive, 0x312, 8000)
    write(drive, 0x900, 0)
    drive.power_cycle()
    assert read(drive, 0x312) == [8000]


def test_a_coil_says_whether_a_write_is_lasting():
    drive, _ = drive_of("danfoss_fc302")
    write(drive, 1299, 0, 40000)
    drive.power_cycle()
    assert read(drive, 1299, 2) != [0, 40000]
    drive.answer(struct.pack(">BHH", 5, 64, 0xFF00))
    write(drive, 1299, 0, 40000)
    drive.power_cycle()
    assert read(drive, 1299, 2) == [0, 40000]
    assert drive.coils == {64: False}


def test_a_plate_typed_in_makes_it_compute_its_circuit_anew():
    drive, _ = drive_of("danfoss_fc302")
    before = drive.value("stator_resistance")
    drive.set_plate(rated_current_a=6.0)
    assert drive.value("rated_current_a") == 6.0
    assert drive.value("stator_resistance") != before


def test_a_plate_written_over_the_bus_makes_it_compute_its_circuit_anew_a_moment_later():
    drive, clock = drive_of(LOCKED)
    before = drive.value("stator_resistance")
    write(drive, 0x4001, 0x55AA)
    write(drive, 9630, 600, 0)
    assert drive.value("rated_current_a") == 6.0 and drive.value("stator_resistance") == before
    clock.t += 0.5
    read(drive, 9642)
    assert drive.value("stator_resistance") != before


def test_half_a_value_of_two_registers_is_not_taken():
    drive, _ = drive_of("danfoss_fc302")
    assert write(drive, 1299, 5)[1] == BAD_VALUE


def test_a_tuning_starts_only_where_it_is_enabled_with_halt_and_clearing_halt_turns_the_shaft():
    drive, clock = drive_of("schneider_atv340")
    cell = drive.face.cells
    assert write(drive, cell["tune_command"].address, 1)[0] & 0x80
    for word in (6, 7, 0x10F):
        write(drive, cell["command"].address, word)
    assert write(drive, cell["tune_command"].address, 1)[0] == 16
    clock.t += 5.0
    assert read(drive, cell["tune_status"].address) == [4]
    assert drive.truth()["turned"] is False
    other, _ = drive_of("schneider_atv340")
    for word in (6, 7, 0x0F):
        write(other, cell["command"].address, word)
    assert other.truth()["turned"] is True


def test_a_starved_watchdog_stops_a_tuning():
    drive, clock = drive_of("schneider_atv340", watchdog_s=1.0)
    for word in (6, 7, 0x10F):
        write(drive, drive.face.cells["command"].address, word)
    write(drive, drive.face.cells["tune_command"].address, 1)
    clock.t += 1.5
    assert drive.truth()["tunings"][0]["end"] == "stopped"


def test_repeats_warm_the_winding_and_a_pause_cools_it():
    hot, clock = drive_of("yaskawa_a1000")
    for _ in range(6):
        hot.press_tune()
        clock.t += 5.0
        hot.truth()
    values = [t["found"]["stator_resistance"] for t in hot.truth()["tunings"]]
    assert values[-1] > 1.03 * values[0]
    clock.t += 3000.0
    hot.truth()
    hot.press_tune()
    clock.t += 5.0
    assert hot.truth()["tunings"][-1]["found"]["stator_resistance"] < 1.02 * values[0]


def ask(drive, clock, *words):
    """A request through the mailbox at 600, waited for; the whole answer."""
    assert write(drive, 600, *words)[0] == 16
    assert read(drive, 600, 3) == [1, 0x2F00, 4]
    clock.t += 0.1
    return read(drive, 600, 8)


def test_a_mailbox_answers_once_it_is_ready_with_the_frames_that_the_manual_prints():
    drive, clock = drive_of("siemens_g120")
    seen = ask(drive, clock, 1, 0x2F0A, 0x8001, 0x0101, 0x1001, 1121, 0)
    assert seen[:5] == [2, 0x2F0A, 0x8001, 0x0101, 0x0801]
    assert struct.unpack(">f", struct.pack(">2H", *seen[5:7]))[0] == drive.value("ramp_down")
    assert ask(drive, clock, 1, 0x2F0A, 0x8101, 0x0101, 0x1001, 1120, 0)[:6] == [2, 0x2F08, 0x8181, 0x0101, 0x4401, 0]
    assert ask(drive, clock, 1, 0x2F0A, 0x8201, 0x0101, 0x1001, 1121, 7)[5] == 3
    assert ask(drive, clock, 1, 0x2F0C, 0x8301, 0x0101, 0x1001, 1121, 0)[:3] == [2, 0x2F00, 1]
    assert ask(drive, clock, 1, 0x2E0A, 0x8401, 0x0101, 0x1001, 1121, 0)[:3] == [2, 0x2F00, 3]


def test_what_stands_behind_a_mailbox_is_written_there_in_its_own_format_and_is_volatile():
    drive, clock = drive_of(MAILBOX)
    new = struct.unpack(">2H", struct.pack(">f", 3.9))
    assert ask(drive, clock, 1, 0x2F10, 0x0102, 0x0101, 0x1001, 1350, 0, 0x0801, *new)[:4] == [
        2,
        0x2F04,
        0x0102,
        0x0101,
    ]
    assert drive.value("stator_resistance") == pytest.approx(3.9)
    assert ask(drive, clock, 1, 0x2F10, 0x0202, 0x0101, 0x1001, 1350, 0, 0x4301, *new)[2:6] == [
        0x0282,
        0x0101,
        0x4401,
        5,
    ]
    assert ask(drive, clock, 1, 0x2F0E, 0x0302, 0x0101, 0x1001, 1304, 0, 0x0601, 400)[5] == 1
    drive.power_cycle()
    assert drive.value("stator_resistance") != pytest.approx(3.9)


@pytest.mark.parametrize("ignores", [False, True])
def test_a_locked_drive_takes_parameters_only_between_its_unlock_and_its_lock(ignores):
    drive, _ = drive_of(LOCKED, ignores_when_locked=ignores)
    before = drive.value("stator_resistance")
    assert (write(drive, 9642, 0x0D9C, 1)[0] == 16) is ignores
    assert drive.value("stator_resistance") == before
    write(drive, 0x4001, 0x55AA)
    write(drive, 9642, 0x0D9C, 1)
    assert drive.value("stator_resistance") == pytest.approx(6.902), "low word first"
    write(drive, 0x4001, 0)
    write(drive, 9642, 0x0001, 1)
    assert drive.value("stator_resistance") == pytest.approx(6.902)
    drive.power_cycle()
    assert drive.is_locked


def test_a_drive_that_is_busy_after_a_write_says_so_by_the_code_of_its_file():
    drive, clock = drive_of("yaskawa_a1000", busy_s=0.1)
    assert write(drive, 0x312, 8000)[0] == 16
    assert write(drive, 0x312, 8100)[1] == 0x24
    clock.t += 0.2
    assert write(drive, 0x312, 8100)[0] == 16


def test_an_answer_takes_the_turnaround_of_the_file_unless_told_otherwise():
    def took(turnaround_s):
        with Vendor("yaskawa_a1000", turnaround_s=turnaround_s) as drive:
            host, port = drive.url.removeprefix("tcp://").split(":")
            with socket.create_connection((host, int(port))) as line:
                began = time.monotonic()
                line.sendall(bytes.fromhex("000100000006010300200001"))
                line.recv(64)
                return time.monotonic() - began

    assert took(None) >= read_face("yaskawa_a1000").turnaround_s
    assert took(0.0) < 0.05


def test_a_serial_line_answers_its_own_number_and_whole_requests_alone():
    """By what a terminal's other end hears: a request in two pieces, one damaged, one to another drive, one to all, half of one."""
    drive, _ = drive_of("yaskawa_a1000")
    line = RtuLine("pty", 115200, "N", 7)
    master = os.open(line.address, os.O_RDWR | os.O_NONBLOCK | os.O_NOCTTY)

    def said_to(*pieces):
        for piece in pieces:
            os.write(master, piece)
            line.serve(drive.answer, 0.0)
        try:
            return os.read(master, 64)
        except BlockingIOError:
            return b""

    request = bytes.fromhex("07030020000185a6")
    answer = said_to(request[:3], request[3:])
    assert answer[:3] == bytes.fromhex("070302") and len(answer) == 7
    assert said_to(request[:-1] + b"\0") == b""
    assert said_to(bytes.fromhex("080300200001") + bytes.fromhex("8559")) == b""
    to_all = bytes.fromhex("000300200001")
    assert said_to(to_all + crc_bytes(to_all)) == b""
    assert said_to(request[:4]) == b""
    time.sleep(2 * SILENCE_S)
    assert said_to(request) == answer
    os.close(master)
    line.close()
    assert not line.serve(drive.answer, 0.0)
    assert line.fileno() < 0
