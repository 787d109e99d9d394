"""What is said of an ordinary drive is true: seen on a server of libmodbus, which shares no Modbus code with us."""

import math
import time
import tomllib
from contextlib import closing, contextmanager

import pytest

from commissioner.errors import (
    CheckFailed,
    ConfigurationError,
    IdentityMismatch,
    LinkError,
    UsageError,
    WriteBackFailed,
)
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import DRIVES_FOLDER, build, load_profile
from commissioner.link.wire.modbus import open_port
from commissioner.link.wire.url import parse_url
from commissioner.motor.circuit import InverseGamma
from commissioner.operations.check import CheckRequest, check
from commissioner.registers.convention import our_values
from commissioner.run.archive.catalogue import find_run
from commissioner.run.job import names_of
from commissioner.run.restore import restore
from commissioner.settings import load_motor
from tests.campaigns.tunings.bench import try_tune
from tests.support.libmodbus.drive import LibmodbusDrive, needs_libmodbus

pytestmark = needs_libmodbus

PLATE = load_motor("motor_2kw2")
NEW = InverseGamma(3.7, 2.18, 0.0215, 0.307)
READY = 1 << 1 | 1 << 9
"""Danfoss' status word: drive ready, bus control."""
DANFOSS = (
    "--set", f"50199={READY}", "--set", "16299=565", "--set", "1199=0,220", "--set", "1219=400", "--set", "1229=50",
    "--set", "1239=0,500", "--set", "1249=1436", "--set", "1389=4", "--set", "8029=0,10", "--set", "1299=0,36000",
)  # fmt: skip
YASKAWA = (
    "--set", "0x20=4", "--set", "0x80=0", "--set", "0x31=565", "--set", "0x311=4", "--set", "0x312=7200",
    "--set", "0x900=0", "--set", "0x910=0",
)  # fmt: skip


def variant(name, **changes):
    """A shipped drive file with keys changed: `items__stator_resistance__type="u16"`."""
    document = tomllib.loads((DRIVES_FOLDER / f"{name}.toml").read_text("utf-8"))
    for path, value in changes.items():
        *way, last = path.split("__")
        table = document
        for step in way:
            table = table.setdefault(step, {})
        table[last] = value
    return build(document, f"{name}.toml")


@contextmanager
def inverter(drive, profile, query="", **settings):
    with closing(open_port(parse_url(drive.url + query), profile, **settings)) as port:
        yield Inverter(port, profile)


def checked(drive, profile):
    return check(CheckRequest(drive.url, profile, "motor_2kw2"))


def test_a_drive_that_was_not_asked_anything_has_not_passed():
    with LibmodbusDrive() as drive:
        done = checked(drive, "hitachi_sj700")
    assert drive.truth["requests"] == []
    assert done.outcome == "rejected"
    assert done.failure.what == "check failed: a drive answers"
    assert "every check passed" not in done.reason


def test_what_a_file_cannot_check_is_listed_as_not_checked():
    with LibmodbusDrive(*YASKAWA) as drive:
        done = checked(drive, "yaskawa_a1000")
    assert done.outcome == "passed"
    names = " | ".join(row.name for row in done.not_checked)
    assert "nothing in its registers tells two of this type apart" in names
    assert "rated_current_a in the drive" in names and "watchdog" in names
    assert f"{len(done.not_checked)} could not be made" in done.reason
    assert "whether this is a Yaskawa A1000: compare the label" in done.reason


def test_what_is_not_known_of_a_drive_is_shown_as_unknown_and_never_as_0():
    with LibmodbusDrive(*DANFOSS) as drive, inverter(drive, load_profile("danfoss_fc302")) as danfoss:
        identity, status, found = danfoss.identify(), danfoss.read_status(), danfoss.snapshot()
    assert (identity.serial_number, identity.map_version, identity.firmware_version) == (None, None, "")
    assert identity.words == "Danfoss VLT FC 302, serial number unknown"
    assert status.fault_code is None and math.isnan(status.heatsink_degc)
    assert found.store_count is None


def test_a_32_bit_value_described_as_16_bit_is_found_out_before_anything_is_written():
    wrong = variant(
        "danfoss_fc302", items__stator_resistance__type="u16",
        worked=[{"item": "stator_resistance", "words": [37020], "value": 3.702, "per_phase": 3.702, "source": "wrong"}],
    )  # fmt: skip
    with (
        LibmodbusDrive(*DANFOSS) as drive,
        inverter(drive, wrong) as danfoss,
        pytest.raises(CheckFailed, match=r"not plausible.*read as u32, big word first it would be 3.6 ohm"),
    ):
        danfoss.write_circuit(NEW, PLATE, danfoss.snapshot())
    assert drive.truth["registers"]["1299"] == 0
    assert not [r for r in drive.truth["requests"] if r[0] in (5, 6, 16)]


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"items__stator_resistance__unit": "mohm"}, "items.stator_resistance.unit"),
        ({"items__stator_resistance__unit": "H"}, "items.stator_resistance.unit"),
        ({"items__stator_resistance__source": ""}, "items.stator_resistance.source"),
        ({"items__stator_resistance__source": "lead: a forum"}, "items.stator_resistance.source"),
        ({"items__stator_resistance__scale": 0.001}, "worked[0].value"),
        ({"items__stator_resistance__address": 1300}, "worked[0].wire"),
        ({"items__stator_resistance__convention": "line_to_line"}, "worked[0].per_phase"),
        ({"worked": []}, "worked"),
    ],
)
def test_a_profile_with_such_an_error_never_reaches_a_wire(change, key):
    with pytest.raises(ConfigurationError) as refused:
        variant("danfoss_fc302", **change)
    assert refused.value.key == key


def test_a_written_value_is_stored_by_the_coil_and_the_coil_put_back():
    with LibmodbusDrive(*DANFOSS) as drive, inverter(drive, load_profile("danfoss_fc302")) as danfoss:
        report = danfoss.write_circuit(NEW, PLATE, danfoss.snapshot())
    assert report.is_stored and report.fault == ""
    assert drive.truth["registers"]["1300"] == 37000
    assert drive.truth["coils"]["64"] == 0
    assert [r[0] for r in drive.truth["requests"] if r[1] == 64] == [1, 5, 5]


def test_another_drive_of_the_type_with_another_plate_is_not_restored():
    profile = load_profile("danfoss_fc302")
    with LibmodbusDrive(*DANFOSS) as drive, inverter(drive, profile) as danfoss:
        snapshot = danfoss.snapshot()
    with (
        LibmodbusDrive(*DANFOSS, "--set", "1239=0,810") as other,
        inverter(other, profile) as danfoss,
        pytest.raises(IdentityMismatch, match="rated_current_a in the drive is not the one of the snapshot"),
    ):
        danfoss.restore(snapshot)
    assert not [r for r in other.truth["requests"] if r[0] in (5, 6, 16)]


def test_a_watchdog_of_1_s_is_fed_through_a_settling_pause_of_2_s():
    profile = variant("danfoss_fc302", parameters__settle_s=2.0)
    options = (*DANFOSS, "--watchdog", "1000:50199:3")
    with LibmodbusDrive(*options) as drive, inverter(drive, profile) as danfoss:
        report = danfoss.write_circuit(NEW, PLATE, danfoss.snapshot())
    assert not drive.truth["tripped"] and report.written and report.fault == ""


def test_a_drive_that_trips_while_it_settles_is_restored_and_its_fault_told():
    profile = variant("danfoss_fc302", parameters__settle_s=0.3)
    with (
        LibmodbusDrive(*DANFOSS, "--trip-on", "1299:50199:3") as drive,
        inverter(drive, profile) as danfoss,
        pytest.raises(WriteBackFailed) as failed,
    ):
        danfoss.write_circuit(NEW, PLATE, danfoss.snapshot())
    assert failed.value.was_restored
    assert "tripped after the parameters were written" in failed.value.what
    assert "the drive reports" in failed.value.what
    assert drive.truth["registers"]["1300"] == 36000


def test_a_restore_says_what_a_tripped_drive_reports():
    profile = variant("danfoss_fc302", parameters__settle_s=0.0)
    with LibmodbusDrive(*DANFOSS) as drive, inverter(drive, profile) as danfoss:
        snapshot = danfoss.snapshot()
    tripped = (*DANFOSS, "--set", f"50199={READY | 1 << 3}", "--set", "1299=0,40000")
    with LibmodbusDrive(*tripped) as drive, inverter(drive, profile) as danfoss:
        report = danfoss.restore(snapshot)
    assert report.written and "fault" in report.fault


def test_under_local_control_nothing_is_written():
    with (
        LibmodbusDrive(*DANFOSS, "--set", "50199=2") as drive,
        inverter(drive, load_profile("danfoss_fc302")) as danfoss,
        pytest.raises(CheckFailed, match="local control"),
    ):
        danfoss.write_circuit(NEW, PLATE, danfoss.snapshot())
    assert drive.truth["registers"]["1300"] == 36000


def test_after_a_lost_write_answer_the_drive_is_looked_at_and_not_written_again():
    profile = variant("danfoss_fc302", parameters__settle_s=0.0)
    options = (*DANFOSS, "--lose-write", "1299")
    with LibmodbusDrive(*options) as drive, inverter(drive, profile, reply_timeout_s=0.3) as danfoss:
        report = danfoss.write_circuit(NEW, PLATE, danfoss.snapshot())
    assert [row.read_back for row in report.written] == pytest.approx([3.7])
    assert len([r for r in drive.truth["requests"] if r[0] == 16 and r[1] == 1299]) == 1


@pytest.mark.parametrize(("function", "others"), [(6, "1,3,5,6"), (16, "1,3,5,16")])
def test_a_drive_is_written_by_the_function_its_file_names(function, others):
    profile = variant("yaskawa_a1000", link__write_functions=[function], parameters__settle_s=0.0)
    with LibmodbusDrive(*YASKAWA, "--functions", others) as drive, inverter(drive, profile) as yaskawa:
        yaskawa.write_circuit(NEW, PLATE, yaskawa.snapshot())
    assert drive.truth["registers"][str(0x312)] == 7400
    assert {r[0] for r in drive.truth["requests"] if r[0] != 3} == {function}


def test_a_drive_that_takes_one_register_at_a_time_cannot_have_a_written_value_of_two():
    with pytest.raises(ConfigurationError, match="stator_resistance"):
        variant("danfoss_fc302", link__write_functions=[6])


T_CIRCUIT = {
    "stator_resistance": (1299, 0.001, "ohm", "line_to_line", 7400, 3.7),
    "rotor_resistance": (1309, 0.001, "ohm", "t_per_phase", 2333, 2.333),
    "stator_leakage_inductance": (1329, 0.001, "ohm", "t_reactance_at_rated_frequency", 3434, 3.434 / (100 * math.pi)),
    "rotor_leakage_inductance": (1339, 0.001, "ohm", "t_reactance_at_rated_frequency", 3434, 3.434 / (100 * math.pi)),
    "magnetizing_inductance": (1349, 0.001, "ohm", "t_reactance_at_rated_frequency", 99767, 99.767 / (100 * math.pi)),
}
"""L_s = 0.3285 H: L_m = sqrt(0.307 L_s) = 0.31757 H, each leakage L_s - L_m = 0.01093 H, R_r = L_s/0.307 2.18 ohm, at 100 pi."""


def test_a_drive_of_the_t_circuit_and_reactances_is_written_read_back_and_restored():
    items = {
        name: {"address": at, "type": "u32", "scale": scale, "unit": unit, "convention": convention, "access": "rw", "source": "made up"}
        for name, (at, scale, unit, convention, _, _) in T_CIRCUIT.items()
    }  # fmt: skip
    worked = [
        {"item": name, "source": "made up", "words": [*divmod(raw, 1 << 16)], "value": raw * scale, "per_phase": per_phase,
         "rated_frequency_hz": 50.0}
        for name, (_, scale, _, _, raw, per_phase) in T_CIRCUIT.items()
    ]  # fmt: skip
    changes = {f"items__{name}": table for name, table in items.items()}
    order = {"order": list(T_CIRCUIT), "settle_s": 0.0}
    profile = variant("danfoss_fc302", **changes, worked=worked, parameters=order, unknown={}, link__write_pause_s=0.0)
    held = [word for at, *_ in T_CIRCUIT.values() for word in ("--set", f"{at}=0,5000")]
    with LibmodbusDrive(*DANFOSS, *held) as drive, inverter(drive, profile) as one:
        found = one.snapshot()
        one.write_circuit(NEW, PLATE, found)
        written = one.snapshot().in_use
        ours = our_values(profile, written, PLATE)
        one.restore(found)
    assert [
        ours[name].value for name in ("rotor_resistance", "magnetizing_inductance", "stator_leakage_inductance")
    ] == (pytest.approx([2.18, 0.307, 0.0215], rel=3e-4))
    assert all(drive.truth["registers"][str(at + 1)] == 5000 for at, *_ in T_CIRCUIT.values())


def test_a_value_that_needs_an_enter_is_read_back_after_it():
    with (
        LibmodbusDrive(*YASKAWA, "--enter", "0x900,0x910") as drive,
        inverter(drive, load_profile("yaskawa_a1000")) as yaskawa,
    ):
        report = yaskawa.write_circuit(NEW, PLATE, yaskawa.snapshot())
    assert [row.read_back for row in report.written] == pytest.approx([7.4])
    assert drive.truth["registers"][str(0x312)] == 7400


def test_a_line_to_line_resistance_stands_in_the_result_per_phase():
    names, factors = names_of(load_profile("yaskawa_a1000"))
    assert names == {"stator_resistance": "stator_resistance_ohm"}
    assert factors == {"stator_resistance": 2.0}


@pytest.mark.parametrize("device", [0, 1, 255])
def test_every_unit_number_of_tcp_reaches_the_drive(device):
    with (
        LibmodbusDrive(*YASKAWA) as drive,
        inverter(drive, load_profile("yaskawa_a1000"), f"?device={device}") as yaskawa,
    ):
        assert yaskawa.read_status().state == "ready to switch on"


@pytest.mark.parametrize(
    "address", ["rtu:///dev/ttyS9?device=0", "tcp://x?device=256", "tcp://x?reply=0", "tcp://x?reply=99"]
)
def test_a_unit_number_or_reply_time_that_cannot_be_is_refused(address):
    with pytest.raises(UsageError):
        parse_url(address)


@pytest.mark.parametrize("said_by", ["address", "file"])
def test_a_slow_drive_is_waited_for_as_long_as_its_address_or_file_says(said_by):
    profile = variant("yaskawa_a1000", **({"link__reply_s": 1.5} if said_by == "file" else {}))
    query = "?reply=1.5" if said_by == "address" else ""
    with (
        LibmodbusDrive(*YASKAWA, "--delay", "400") as drive,
        inverter(drive, profile, query, reply_timeout_s=0.2) as yaskawa,
    ):
        started = time.monotonic()
        assert yaskawa.read_status().state == "ready to switch on"
    assert time.monotonic() - started > 0.4


def test_a_drive_that_answers_too_late_is_told_how_it_gets_longer():
    with (
        LibmodbusDrive(*YASKAWA, "--delay", "400") as drive,
        inverter(drive, load_profile("yaskawa_a1000"), reply_timeout_s=0.1) as yaskawa,
        pytest.raises(LinkError) as refused,
    ):
        yaskawa.read_status()
    assert "reply=SECONDS" in refused.value.remedy


def test_blocks_are_no_longer_than_the_drive_takes():
    profile = variant("danfoss_fc302", link__max_read_registers=2)
    with LibmodbusDrive(*DANFOSS, "--max-read", "2") as drive, inverter(drive, profile) as danfoss:
        assert danfoss.read_nameplate()["rated_current_a"] == pytest.approx(5.0)
    assert max(r[2] for r in drive.truth["requests"]) == 2


def ask_new(drive, out, *lines, options=()):
    """`drives new` with a person's answers."""
    from typer.testing import CliRunner

    from commissioner.cli.app import app

    return CliRunner().invoke(
        app, ["drives", "new", drive.url, "--out", str(out), *options], input="\n".join(lines) + "\n"
    )


LABELS = (
    "Drive under test", "its manual", "y", "1220", "400", "p. 1", "y", "1240", "5.0", "p. 1", "y", "1230", "50", "p. 2", "n",
    "n", "n",
)  # fmt: skip


def test_a_new_drive_file_holds_what_the_drive_proved_and_nothing_else(tmp_path):
    out = tmp_path / "new.toml"
    with LibmodbusDrive(*DANFOSS, "--max-read", "2", "--functions", "3,16") as drive:
        answer = ask_new(drive, out, *LABELS, "n", "y", options=("--probe-writes",))
    assert answer.exit_code == 0, answer.output
    profile = load_profile(str(out))
    assert {n: (i.address, i.type, i.scale) for n, i in profile.items.items()} == {
        "rated_voltage_v": (1219, "u16", 1.0),
        "rated_current_a": (1239, "u32", 0.01),
        "rated_frequency_hz": (1229, "u16", 1.0),
    }
    assert (profile.link.max_read_registers, profile.link.write_functions) == (2, (16,))
    assert profile.capabilities == frozenset() and "write_back" in profile.unknown
    assert drive.truth["registers"]["1219"] == 400


@pytest.mark.parametrize("table", [40000, 400000])
def test_registers_printed_with_their_tables_number_are_found(tmp_path, table):
    """What is typed wrong is asked again, and a decimal comma is one."""
    out = tmp_path / "new.toml"
    lines = (
        "A drive",
        "its manual",
        "y",
        "P1.01",
        str(table + 1220),
        "0",
        "400",
        "p. 1",
        "y",
        str(table + 1240),
        "5,0",
        "p. 1",
    )
    with LibmodbusDrive(*DANFOSS) as drive:
        answer = ask_new(drive, out, *lines, "n", "n", "n", "n", "n")
    assert answer.exit_code == 0, answer.output
    assert "P1.01" in answer.output and "the rest is [unknown] in it" in answer.output.replace("\n", " ")
    items = load_profile(str(out)).items
    assert (items["rated_voltage_v"].address, items["rated_current_a"].address) == (1219, 1239)


def test_labels_that_are_not_in_the_registers_named_make_no_drive_file(tmp_path):
    out = tmp_path / "new.toml"
    with LibmodbusDrive(*DANFOSS) as drive:
        answer = ask_new(drive, out, *LABELS[:6], "y", "1240", "7.3", "p. 1", "n", "n", "n", "n", "n")
    assert isinstance(answer.exception, UsageError) and not out.exists()
    assert not [r for r in drive.truth["requests"] if r[0] in (5, 6, 16)]


def test_a_drive_that_gives_one_register_at_a_time_is_read_and_written_so():
    profile = variant("yaskawa_a1000", link__max_read_registers=1, link__max_write_registers=1)
    with LibmodbusDrive(*YASKAWA, "--max-read", "1", "--max-write", "1") as drive, inverter(drive, profile) as yaskawa:
        yaskawa.write_circuit(NEW, PLATE, yaskawa.snapshot())
    assert {r[2] for r in drive.truth["requests"]} == {1}
    assert drive.truth["registers"][str(0x312)] == 7400


def test_a_block_across_a_gap_is_an_exception_and_no_zeros():
    from commissioner.errors import RequestRefused

    with (
        LibmodbusDrive(*YASKAWA) as drive,
        closing(open_port(parse_url(drive.url), load_profile("yaskawa_a1000"))) as port,
        pytest.raises(RequestRefused) as refused,
    ):
        port.read(0x311, 3)
    assert refused.value.value == 2


def test_an_ordinary_drive_is_checked_written_and_restored_over_a_serial_line():
    from tests.conformance.test_independent_peers import null_modem

    profile = load_profile("danfoss_fc302")
    with (
        null_modem() as (theirs, ours),
        LibmodbusDrive(*DANFOSS, line=("--rtu", theirs)) as drive,
        closing(open_port(parse_url(f"rtu://{ours}?parity=N&stop=1&baud=115200"), profile)) as port,
    ):
        danfoss = Inverter(port, profile, sleep=lambda _: None)
        found = danfoss.snapshot()
        assert danfoss.write_circuit(NEW, PLATE, found).written
        danfoss.restore(found)
    assert drive.truth["registers"]["1300"] == 36000


@pytest.mark.parametrize("code", [5, 6, 10, 11])
def test_a_busy_drive_is_waited_for_where_it_is_read(code):
    with (
        LibmodbusDrive(*YASKAWA, "--busy", f"{code}:3:32") as drive,
        inverter(drive, load_profile("yaskawa_a1000")) as one,
    ):
        assert one.read_status().state == "ready to switch on"
    assert len([r for r in drive.truth["requests"] if r[1] == 0x20]) == 4


def test_a_drive_that_is_busy_where_it_is_written_is_written_once_it_is_free():
    with LibmodbusDrive(*YASKAWA) as drive, inverter(drive, load_profile("yaskawa_a1000")) as yaskawa:
        snapshot = yaskawa.snapshot()
    options = (*YASKAWA, "--busy", f"6:6:{0x900}")
    with LibmodbusDrive(*options) as drive, inverter(drive, load_profile("yaskawa_a1000")) as yaskawa:
        yaskawa.write_circuit(NEW, PLATE, snapshot)
    assert drive.truth["registers"][str(0x312)] == 7400
    assert len([r for r in drive.truth["requests"] if r[1] == 0x900]) == 7


@pytest.mark.parametrize("code", [5, 11])
def test_a_write_that_may_be_under_way_is_looked_at_and_not_written_again(code):
    options = (*YASKAWA, "--later", f"{code}:150:{0x312}")
    with LibmodbusDrive(*options) as drive, inverter(drive, load_profile("yaskawa_a1000")) as yaskawa:
        report = yaskawa.write_circuit(NEW, PLATE, yaskawa.snapshot())
    assert [row.read_back for row in report.written] == pytest.approx([7.4])
    assert len([r for r in drive.truth["requests"] if r[0] == 16 and r[1] == 0x312]) == 1


def test_an_answer_from_another_unit_is_named_and_never_taken():
    with (
        LibmodbusDrive(*YASKAWA, "--unit", "7") as drive,
        inverter(drive, load_profile("yaskawa_a1000"), reply_timeout_s=0.2) as yaskawa,
        pytest.raises(LinkError) as refused,
    ):
        yaskawa.read_status()
    assert "7" in f"{refused.value} {refused.value.value}"


def test_restore_waits_as_long_as_the_address_says_and_not_a_time_of_its_own(tmp_path):
    tried = try_tune("yaskawa_a1000", tmp_path, repeat=1)
    held, before = (round(1000 * said["stator_resistance"]) for said in (tried.truth["held"], tried.before))
    with LibmodbusDrive(*YASKAWA, "--set", f"0x312={held}", "--delay", "80") as slow:
        with pytest.raises(LinkError):
            restore(find_run(tmp_path, "last"), slow.url, reply_timeout_s=0.03)
        restore(find_run(tmp_path, "last"), f"{slow.url}?reply=2", reply_timeout_s=0.03)
    assert held != before and slow.truth["registers"][str(0x312)] == before
