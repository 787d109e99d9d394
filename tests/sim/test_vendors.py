"""The emulated vendors: each wears the face of its file, and behaves behind it as its family does."""

import struct

import pytest

from sim.vendors.drive import BAD_ADDRESS, BAD_FUNCTION, BAD_VALUE, Habits, VendorDrive
from sim.vendors.face import faces, read_face


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


@pytest.mark.parametrize("name", faces())
def test_every_face_answers_for_its_registers_and_for_no_others(name):
    from commissioner.link.drive.items import Items
    from commissioner.link.files.drive_file import load_profile
    from tests.campaigns.tunings.bench import JumpingClock, VendorPort

    drive, _ = drive_of(name)
    profile = load_profile(name)
    assert set(profile.items) == set(drive.face.cells)
    seen = Items(VendorPort(drive, JumpingClock()), profile).read(profile.items)
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
