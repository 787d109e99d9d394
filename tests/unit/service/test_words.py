"""Sizes of causes as the page writes them."""

import re
from importlib.resources import files
from types import SimpleNamespace

import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.identify.estimate.axes import Cause
from commissioner.identify.excite.duration import LongerTest
from commissioner.identify.intake.alignment import TimeShift
from commissioner.link.files.drive_file import known_drives, load_profile
from commissioner.procedure.checks import check_name
from commissioner.procedure.states import ENDED, State
from commissioner.procedure.tuned import FEWEST
from commissioner.report.run.standing import Standing
from commissioner.report.run.summary import diagnosis_sentences
from commissioner.report.sheet.words import NBSP
from commissioner.run.archive import summary
from commissioner.run.archive.catalogue import DATED_AHEAD
from commissioner.run.archive.summary import CAN_BE_MADE, NO_RESULT
from commissioner.service.page.frame import environment, words_of
from commissioner.service.page.texts import Texts, texts_of
from commissioner.service.page.words import IN_THE_DRIVE, Words
from tests.support.service.markup import without_layout


def size(value, std, unit):
    return {"value": value, "std": std, "unit": unit}


LOSS = {"voltage_v": size(7.7558, 0.0541, "V"), "half_current_a": size(0.1052, 0.0, "A"), "tail": size(-0.93, 0.04, "")}
OFFSETS = {f"offset_{phase}_a": size(a, 4.95e-5, "A") for phase, a in zip("uvw", (0.02564, -0.01793, 0.0), strict=True)}


@pytest.mark.parametrize(
    ("sizes", "shown"),
    [
        (LOSS, "7.76 ± 0.11 V"),
        (OFFSETS, "0.025640 ± 0.000097 A; −0.017930 ± 0.000097 A; 0.000000 ± 0.000097 A"),
        ({"resistance_ohm": size(120.0, 14.0, "ohm")}, "120 ± 27 Ω"),
        ({"share": size(0.25, None, "1")}, "0.25"),
        ({}, ""),
    ],
)  # fmt: skip
def test_the_first_size_is_shown_and_what_is_measured_alike_to_the_digits_of_its_error(sizes, shown):
    assert Words(Texts("en")).size(sizes).replace(NBSP, " ") == shown


def test_every_cause_has_its_german_name():
    german, english = Words(Texts("de")), Words(Texts("en"))
    assert not [name for name in CATALOGUE if german.cause(name) == english.cause(name)]
    assert german.causes(["device_drop", "clipping"]) == f"{german.cause('device_drop')}, Übersteuerung"


def test_numbers_within_what_fills_a_sentence_are_german_and_what_only_looks_like_one_stays():
    told = Texts("de").tell("6.04 s of tones on each axis would narrow the 95 % intervals (±): L_σ 0.053 -> 0.051 %")
    assert "6,04 s" in told and "L_σ 0,053 -> 0,051 %" in told
    for name in ("tcp://127.0.0.1:502", "1.2.3", "x1.5.csv", "runs/2.5/x"):
        assert Texts("de")._value(name) == name


def test_what_the_core_remarks_of_every_run_has_its_german():
    german = Texts("de")
    remarks = (
        LongerTest(8.0, (0.002,) * 4, (0.001,) * 4).sentence, LongerTest(8.0, (0.002,) * 4, (0.002,) * 4).sentence,
        TimeShift(0, 1.2e-5, 1e-7, 2e-4).sentence, *(cause.value for cause in Cause),
        *Standing, NO_RESULT, f"{NO_RESULT}{CAN_BE_MADE}", DATED_AHEAD, "as before, read back", "no load current", "not identified",
        "Schneider Altivar ATV320, serial number not known",
        "orientations: 2; sensor gain and anisotropy need at least three: what the phases or their sensors differ by is in the values, and "
        "not all of it in the intervals",
        "the tests reached 0.685 Wb; from there to 0.731 Wb, the level that L_M is told for, their own magnetizing curve leads; a "
        "quarter of the way is in L_M's standard error",
        *diagnosis_sentences({"is_complete": False, "causes": (), "moved": ()}, {}),
        "Not finished: the time allowed was over before every cause was tried and weighed.",
        "The time allowed was over before every cause was tried: diagnose the recording again without a limit.",
    )  # fmt: skip
    assert [remark for remark in remarks if not german.knows(remark)] == []


def test_the_live_line_speaks_the_language_of_its_page():
    script = files("commissioner.service.page").joinpath("static", "js", "page.js").read_text("utf-8")
    assert "?lang=${root.lang}" in script
    line = SimpleNamespace(cookies={}, query_params={"lang": "de"}, headers={"accept-language": "en-US"})
    assert texts_of(line).language == "de"


@pytest.mark.parametrize(
    ("plate_low", "repeats", "title"),
    [
        (None, 3, "own tunings agree with each other<"), (0.5, 3, "own tunings agree with the plate and with each other<"),
        (None, 1, "has tuned itself<"), (0.5, 2, "own tuning agrees with the plate<"),
    ],
)  # fmt: skip
def test_tunings_agree_only_with_what_they_were_compared_with(plate_low, repeats, title):
    """With the plate where it judges; with each other from three on."""
    row = {
        "name": "stator_resistance", "unit": "raw", "before": 1.0, "median": 2.0, "spread_percent": 0.1, "change_percent": None,
        "ours": plate_low, "plate_low": plate_low, "plate_high": plate_low,
    }  # fmt: skip
    words = {**words_of("en"), "losses": ()}
    template = environment().get_template("work/tuned.html")
    result = {"outcome": "commissioned", "tune": {"rows": [row], "repeats": [{}] * repeats}, "reason": "x"}
    parts = environment().get_template("frame/parts.html").make_module(words)
    context = template.new_context(
        {
            **words,
            "p": parts,
            "result": result,
            "tune": result["tune"],
            "good": True,
            "is_unjudged": plate_low is None,
            "fewest": FEWEST,
        }
    )
    said = without_layout("".join(template.blocks["main"](context)))
    assert title in said
    assert "raw" not in said
    assert ("0.10\N{NO-BREAK SPACE}%" in said) is (repeats > 1)


def test_a_value_in_words_has_the_readers_decimal_mark_and_a_key_keeps_its_letters():
    german = Words(Texts("de"))
    assert words_of("de")["short"]("6.3 ... 80 mH") == "6,3 ... 80 mH"
    assert words_of("de")["short"]("not confirmed by the drive") == "vom Umrichter nicht bestätigt"
    said = german.sentence("lengthen excitation.seconds, or look for noise on the current sensors")
    assert str(said).startswith("excitation.seconds verlängern")
    assert (
        german.sentence("x.csv: a standstill recording needs the column segment")
        == "x.csv: einer Aufzeichnung im Stillstand fehlt die Spalte segment"
    )


def test_a_value_of_the_circuit_is_told_in_the_unit_that_people_read():
    german = Words(Texts("de"))
    assert german.circuit("leakage_inductance_h", 0.0215) == "21,5\u00a0mH"
    assert german.circuit("stator_resistance_ohm", 0.2956, 9.853) == "0,2956 … 9,853\u00a0Ω"


def test_what_an_ordinary_drive_holds_is_named_and_measured_in_german():
    """A register's name without its unit, the limit with the value's one."""
    german = Words(Texts("de"))
    for name, shown in (
        ("stator_resistance in the drive", "Ständerwiderstand im Umrichter"),
        ("communication_timeout_s in the drive", "Zeitüberwachung der Verbindung im Umrichter"),
        ("rated_power_w in the drive", "Bemessungsleistung im Umrichter"),
        ("my_register in the drive", "My register in the drive"),
    ):
        assert german.check_name(name) == shown
    assert (
        german.check_limit({"name": "", "limit": "near 0.3 ... 9.853 ohm"}) == "nahe 0,3 ... 9,853\N{NO-BREAK SPACE}Ω"
    )


def test_every_register_that_a_shipped_file_describes_has_a_german_name():
    german, maps = Texts("de"), (load_profile(name) for name in known_drives())
    items = {name for profile in maps if profile.kind != "commissioning_map" for name in profile.items}
    assert len(items) > 30
    assert (
        sorted(
            name for name in items if not german.knows(check_name(f"{name} in the drive").removesuffix(IN_THE_DRIVE))
        )
        == []
    )


def test_two_measurements_of_one_day_are_told_apart_by_their_time():
    instants = ["2026-11-29T04:46:37+00:00", "2026-11-29T04:54:32+00:00", "2027-01-02T10:00:00+00:00"]
    assert Words(Texts("en")).days(instants) == ["2026-11-29 04:46:37", "2026-11-29 04:54:32", "2027-01-02"]


def test_who_sits_here_without_an_account_is_no_english_word_on_the_german_page():
    assert (Texts("de").person("operator"), Texts("de").person("otto"), Texts("en").person("operator")) == (
        "Bediener",
        "otto",
        "operator",
    )


def test_what_somebody_called_a_thing_is_no_word_to_translate():
    german = Texts("de")
    assert german.tell("there is no motor 'drive'") == "Motor 'drive' gibt es nicht"
    assert (
        german.tell("there is no motor 'driv'; did you mean 'drive'?") == "Motor 'driv' gibt es nicht; gemeint 'drive'?"
    )
    assert german.seen("there is no motor 'drive'", "drive") == "drive"
    assert german.seen("the drive does not do this", "fault") == german.tell("fault") != "fault"
    assert german.short("one of: motor, drive, 2.5") == "eines von: motor, drive, 2.5"
    assert german.tell("operator operates this drive").startswith("operator ")


def test_a_write_that_failed_is_told_whole_in_german():
    german, back = Texts("de"), "the values held before this write are in the drive again, verified"
    said = german.tell(f"writing back failed: the drive did not store: the memory failed; {back}")
    assert "der Speicher hat versagt" in said and "geprüft" in said
    said = german.tell(f"writing back failed: the drive holds rotor_resistance = 3.2 instead of 3.7; {back}")
    assert "im Umrichter steht rotor_resistance = 3,2 statt 3,7" in said
    assert german.short("the memory failed (3)") == "der Speicher hat versagt (3)"
    assert german.short("at least 3.5") == "mindestens 3,5"


@pytest.mark.parametrize("state", [state for state in State if state is not State.IDLE and state not in ENDED])
def test_how_far_a_cut_off_run_came_is_told_in_german(state):
    said = Texts("de").tell(f"the process ended while {state.value}")
    assert said.startswith("der Prozess endete beim ") and state.value not in said


@pytest.mark.parametrize(
    "reason", ["the service that started this run is gone", "nothing heard from the service for 2 s",
               "the operator's page was lost for 6 s", "the service is being shut down"],
)  # fmt: skip
def test_why_the_service_stopped_a_run_is_told_in_german_and_a_persons_words_stay(reason):
    german = Texts("de")
    assert german.why("service", reason) not in ("", reason)
    assert german.why("anna", reason) == reason
    assert german.person("service") == "Dienst"


@pytest.mark.parametrize("kind", ["parameters_written", "snapshot_restored", "about_to"])
@pytest.mark.parametrize("facts", [{}, {"is_stored": False}, {"store_count_after": 3, "endurance_writes": 100000}, {"is_stored": False, "store_count_after": 3, "endurance_writes": 9}, {"values": {"stator_resistance": 3.2}}])  # fmt: skip
def test_what_a_drive_holds_after_a_run_is_told_in_german(kind, facts):
    """Above all of a run that was cut off while it wrote."""
    _held, said = summary._word(kind, facts | {"action": "commit"})
    german = Texts("de").tell(said)
    assert not set(re.findall(r"[a-z]{3,}", german)) & {
        "new",
        "old",
        "read",
        "stored",
        "before",
        "drive",
        "used",
        "writes",
    }


@pytest.mark.parametrize("name", ["leer.csv", "my-file.csv", "20261129-082711-x", "hall3"])
def test_a_file_or_an_id_that_begins_a_sentence_keeps_its_letters(name):
    said = Words(Texts("de")).sentence(f"{name}: the file is empty")
    assert said == f"{name}: Die Datei ist leer"
