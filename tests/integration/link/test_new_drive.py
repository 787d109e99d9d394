"""`drives new`: from one page of a manual to a drive file that checks, is written, read back and taken back."""

import math
import tomllib

import pytest

from commissioner.cli.verbs.drives.asking import quantity_of
from commissioner.errors import CheckFailed, ReplyTimeout, RequestRefused
from commissioner.link.drive.ordinary.probing import Known, readings
from commissioner.link.files.drive_file import load_profile
from commissioner.registers.convention import our_values
from tests.integration.link.test_ordinary_drives import NEW, PLATE, ask_new, inverter
from tests.support.libmodbus.drive import LibmodbusDrive, needs_libmodbus

pytestmark = needs_libmodbus

MANUAL = {
    101: (400,), 102: (51,), 103: (500,), 401: (0b1001,), 901: (0,),
    201: (6400,), 203: (1800,), 205: (0x4A38, 0x0001), 207: (1300,), 209: (20000,),
}  # fmt: skip
"""An invented drive's page of registers, printed as 40101 ...: R_s between terminals and R_r in milliohm, leakages in microhenry (the
stator's of two registers, low word first: 0x14A38 = 84 536) and hundredths of a millihenry, main inductance in hundredths of one."""
DRIVE = [word for number, words in MANUAL.items() for word in ("--set", f"{number - 1}={','.join(map(str, words))}")]
LABELS = (
    "Norvik NX4", "NX4 manual", "y", "40101", "400", "12", "y", "40102", "5.1", "12", "y", "40103", "50", "12", "n", "n", "n",
)  # fmt: skip
PARAMETERS = (
    "y", "y", "40201", "6.4 ohm", "20", "y", "40203", "1.8 ohm", "20", "n", "y", "40209", "200 mH", "20",
    "y", "40205", "84,536 mH", "20", "y", "40207", "13 mH", "20", "n", "n", "t", "line_to_line",
)  # fmt: skip
STATUS = ("y", "40401", "n", "1", "0", "2", "40")
KEPT = ("y", "40901", "1")


@pytest.fixture
def asked(tmp_path):
    def ask(*lines, query="?device=1", options=()):
        out = tmp_path / "nx4.toml"
        with LibmodbusDrive(*DRIVE) as drive:
            answer = ask_new(drive, out, *lines, options=options)
        return answer, out

    return ask


def test_a_page_of_a_manual_becomes_a_file_that_writes_reads_back_and_restores(tmp_path):
    out = tmp_path / "nx4.toml"
    with LibmodbusDrive(*DRIVE) as drive:
        answer = ask_new(drive, out, *LABELS, *PARAMETERS, *STATUS, *KEPT, "30", "y", options=("--probe-writes",))
        assert answer.exit_code == 0, answer.output
        profile = load_profile(str(out))
        with inverter(drive, profile) as nx4:
            found = nx4.snapshot()
            nx4.write_circuit(NEW, PLATE, found)
            written = our_values(profile, nx4.snapshot().in_use, PLATE)
            nx4.restore(found)
    assert written["magnetizing_inductance"].value == pytest.approx(NEW.magnetizing_inductance_h, rel=1e-3)
    assert written["stator_leakage_inductance"].value == pytest.approx(NEW.leakage_inductance_h, rel=1e-3)
    assert written["stator_resistance"].value == pytest.approx(NEW.stator_resistance_ohm, rel=1e-3)
    for number, words in MANUAL.items():
        held = [drive.truth["registers"][str(number - 1 + k)] for k in range(len(words))]
        assert number == 901 or held == list(words)


def test_scale_width_and_word_order_are_the_drives_own(asked):
    answer, out = asked(*LABELS, *PARAMETERS, *STATUS, *KEPT, "30")
    assert answer.exit_code == 0, answer.output
    items = load_profile(str(out)).items
    leakage = items["stator_leakage_inductance"]
    assert (leakage.address, leakage.type, leakage.word_order, leakage.scale) == (204, "u32", "little", 1e-6)
    assert items["stator_resistance"].convention == "t_line_to_line"
    assert items["rotor_leakage_inductance"].scale == 1e-5
    assert "6.4 ohm = register 200 on the wire, u16 x 0.001" in answer.output


def test_the_drives_own_tuning_is_assisted_and_what_was_not_asked_is_a_comment(asked):
    _, out = asked(*LABELS, *PARAMETERS, *STATUS, *KEPT, "30")
    profile = load_profile(str(out))
    assert profile.tuning.form == "assisted" and profile.tuning.results == profile.parameter_names
    assert "# [watchdog]" in out.read_text("utf-8")


def test_nothing_can_be_written_where_no_status_says_that_the_drive_is_at_rest(asked):
    answer, out = asked(*LABELS, *PARAMETERS, "n", *KEPT, "30")
    assert answer.exit_code == 0, answer.output
    profile = load_profile(str(out))
    assert profile.capabilities == frozenset() and profile.tuning is None and "status_word" in profile.unknown


def test_bits_that_do_not_say_at_rest_make_no_drive_file(asked):
    answer, out = asked(*LABELS, *PARAMETERS, "y", "40401", "n", "0", "1", "2", "40", *KEPT, "30")
    assert not out.exists()
    assert isinstance(answer.exception, CheckFailed | SystemExit)


def test_a_word_order_that_nothing_proved_is_said_so_and_the_device_is_the_addresss(tmp_path):
    out = tmp_path / "nx4.toml"
    with LibmodbusDrive(*DRIVE) as drive:
        drive.url += "?device=17" if "?" not in drive.url else "&device=17"
        answer = ask_new(drive, out, *LABELS, "n")
    assert answer.exit_code == 0, answer.output
    assert load_profile(str(out)).link.device_id == 17
    assert "# not proved" in next(line for line in out.read_text("utf-8").splitlines() if line.startswith("word_order"))


def test_a_reactance_is_of_the_motor_on_the_label(tmp_path):
    out = tmp_path / "nx4.toml"
    with LibmodbusDrive(*DRIVE) as drive:
        lines = (
            "y",
            "n",
            "n",
            "n",
            "y",
            "40209",
            "20 ohm",
            "20",
            "n",
            "n",
            "n",
            "n",
            "inverse_gamma",
            *STATUS,
            *KEPT,
            "",
        )
        answer = ask_new(drive, out, *LABELS, *lines)
    assert answer.exit_code == 0, answer.output
    (worked,) = tomllib.loads(out.read_text("utf-8"))["worked"]
    assert worked["per_phase"] == pytest.approx(20 / (100 * math.pi)) and worked["rated_frequency_hz"] == 50.0


class Silent:
    """A line on which nobody answers, but for one refusal where `refuses`."""

    def __init__(self, refuses):
        self.refuses = refuses

    def read(self, address, count):
        kind = RequestRefused if self.refuses and count == 1 else ReplyTimeout
        raise kind("no answer to it", step="read", value=2, limit="an answer", remedy="check the cable")


def test_a_drive_that_says_nothing_at_all_is_told_from_one_without_the_value():
    known = Known("rated_voltage_v", 40101, 400.0, "V", "p. 12")
    assert readings(Silent(refuses=True), known) == []
    with pytest.raises(ReplyTimeout):
        readings(Silent(refuses=False), known)


@pytest.mark.parametrize(
    ("text", "value"), [("3.2 ohm", (3.2, "ohm")), ("13mH", (13.0, "mH")), ("3,2 Ω", (3.2, "ohm")), ("2 %", (2.0, "%"))]
)
def test_a_value_is_read_with_its_unit(text, value):
    assert quantity_of("rotor_resistance" if value[1] == "ohm" else "magnetizing_inductance")(text) == value


def test_what_the_drive_does_not_show_is_asked_again_and_no_answer_is_lost(asked):
    wrong = (
        "y",
        "y",
        "40202",
        "6.4 ohm",
        "20",
        "y",
        "40201",
        "6.4 mH",
        "6.4 ohm",
        "20",
        "n",
        "n",
        "n",
        "n",
        "n",
        "n",
        "n",
        "per_phase",
    )
    answer, out = asked(*LABELS, *wrong, *STATUS, *KEPT, "")
    assert answer.exit_code == 0, answer.output
    assert (
        "no reading of register 40202 gives 6.4 ohm" in answer.output
        and "is no stator resistance with its unit" in answer.output
    )
    assert load_profile(str(out)).items["stator_resistance"].address == 200
