"""What the page and the terminal say for every kind of result: explained, tied, unexplained, unfinished, nothing, refused."""

from types import SimpleNamespace

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.diagnosis import Diagnosis
from commissioner.diagnose.document import as_document, refused_document
from commissioner.diagnose.intake.audit import Audit
from commissioner.diagnose.intake.record import Facts
from commissioner.diagnose.intake.refusal import refused
from commissioner.diagnose.verdict.experiment import next_experiment, procedure, what_decides
from commissioner.report.diagnosis import sections
from commissioner.report.diagnosis.names import (
    class_name,
    main_name,
    main_quantity,
    main_size,
    plain_of,
    sentence,
    size_words,
    sure_words,
)
from commissioner.report.diagnosis.page import page_of
from commissioner.report.diagnosis.words import actions, headline, meaning, remarks, tone
from commissioner.report.page import Page, Table, render
from commissioner.report.sheet.words import cause_name

FACTS = Facts(2e-4, 5.0, 1500.0, 0.8, 5.0, 5000.0, 540.0, 3)
LOST = {"voltage_v": (7.9, 0.07, "V"), "half_current_a": (0.1, 0.005, "A"), "time_us": (2.9, 0.03, "us")}
OVER = "The time allowed was over before every cause was tried: diagnose the recording again without a limit."


def cause(name, sizes=None, equivalent=(), share=0.8, strength=19.0, confidence=0.98):
    """One entry of the document's `causes`."""
    parameters = {k: {"value": v, "std": s, "unit": u} for k, (v, s, u) in (sizes or {}).items()}
    return {
        "name": name,
        "title": "",
        "parameters": parameters,
        "gain_share": share,
        "confidence": confidence,
        "equivalent": list(equivalent),
        "strength_over_noise": strength,
        "delta_chi2": 1e6,
        "alternatives": {},
        "found_by": "fit",
    }


def document(verdict, causes=(), **more):
    """What `diagnose` writes, as far as the words need it."""
    gain = {
        "held_out": 0.9999,
        "rmse_before_a": 0.33,
        "rmse_after_a": 0.0104,
        "noise_floor_a": 0.0103,
        "explained_share": 0.9999,
        "structured_error_over_noise": 11.3,
    }
    limits = {name: {} for name in ("sensor_offset", "sensor_lag", "leakage_saturation")}
    return {
        "verdict": verdict,
        "reason": "a reason with sensor_offset",
        "kind": "recording",
        "causes": list(causes),
        "gain": gain,
        "remarks": [],
        "audit": [],
        "next_experiment": None,
        "parameters_before": {},
        "parameters_after": {},
        "uncertain": [],
        "detection_limits": limits,
        "cannot_tell": [],
        "line_levels_db": {},
        "dc_link_v": 540.0,
        **more,
    }


LEGS = cause("dead_time", LOST, ["device_drop"])
LATE = cause("sampling_delay", {"delay_us": (120.0, 1.0, "us")}, ["sensor_lag"])


def test_a_leg_voltage_is_named_as_what_it_is_and_as_normal():
    words = headline(document("not_distinguishable", [LEGS]))
    assert words.startswith("The inverter loses 7.9 V per leg (dead time and device drop together). That is normal.")
    assert "over 99.9 %" in words and tone(document("not_distinguishable", [LEGS])) == "good"


@pytest.mark.parametrize(("v", "w", "said"), [(-0.6, 0.0, "60.0 % off"), (-0.2, -0.2, "40.0 % off"), (0.1, -0.1, "")])
def test_legs_that_lose_unlike_voltages_are_not_called_normal(v, w, said):
    legs = cause("dead_time", LOST | {"unequal_v": (v, 0.01, "1"), "unequal_w": (w, 0.01, "1")}, ["device_drop"])
    words = headline(document("not_distinguishable", [legs]))
    assert (
        ("normal" not in words and f"one is {said} their mean: check its gate driver" in words)
        if said
        else "That is normal" in words
    )


def test_much_leg_voltage_is_not_called_normal():
    words = headline(document("not_distinguishable", [LEGS], dc_link_v=48.0))
    assert "normal" not in words and "16.5 % of its DC link is much" in words


@pytest.mark.parametrize(
    ("one", "name", "certain", "shown", "hidden"),
    [
        (LEGS, "dead time + device drop, together", "one of the two", "lost per leg 7.90", "2.9"),
        (LATE, "sampling delay or sensor lag", "98 % that it is one of the two", "delay in all 120.0", "time"),
        (cause("iron_loss", {"conductance_ms": (1.5, 0.1, "mS")}, ["rotor_skin_effect"]), "iron loss or rotor skin effect",
         "one of the two", "depends on which", "1.5"),
    ],
)  # fmt: skip
def test_a_tie_has_the_name_certainty_and_size_of_the_class(one, name, certain, shown, hidden):
    assert class_name(one) == name and certain in sure_words(one)
    assert shown in size_words(one) and hidden not in size_words(one)


def test_of_several_directions_the_largest_size_leads_under_its_own_name():
    broken_bar = cause(
        "resistance_anisotropy", {"stator_anisotropy": (1e-5, 3e-5, "1"), "rotor_anisotropy": (0.0096, 1e-4, "1")}
    )
    assert (main_name(broken_bar), main_size(broken_bar), main_quantity(broken_bar)) == (
        "rotor anisotropy",
        "0.96 %",
        "0.960 ± 0.020 %",
    )
    assert (main_name(LEGS), main_size(LEGS)) == ("lost per leg", "7.9 V")
    unlike = cause("iron_loss", {"conductance_ms": (0.3, 0.01, "mS")}, ["rotor_skin_effect"])
    assert (main_name(unlike), main_size(unlike), main_quantity(unlike)) == ("", "", "-")


def test_a_tie_of_unlike_causes_is_said_without_a_size():
    one = cause("sensor_nonlinearity", {"even_at_full_scale": (0.01, 1e-4, "1")}, ["leakage_saturation"])
    seen = document("not_distinguishable", [one])
    assert "sensor nonlinearity or leakage saturation; this recording cannot say which" in headline(seen)
    assert tone(seen) == "warn" and "1.0 %" not in headline(seen)


@pytest.mark.parametrize("verdict", ["unexplained", "nothing_significant", "explained"])
def test_an_unfinished_search_says_so_and_never_that_no_cause_does_it(verdict):
    seen = document(verdict, [LEGS] if verdict == "explained" else [], remarks=[OVER], is_complete=False)
    words = headline(seen) + " ".join(meaning(seen))
    assert words.startswith("Not finished") and "commissioner diagnose" in words
    assert "no cause in the catalogue" not in words and tone(seen) == "warn" and remarks(seen) == []
    assert "no cause can be named" not in str([s.parts for s in sections.causes(seen)]).lower()


def test_an_unexplained_error_keeps_what_is_known_beside_it():
    words = headline(document("unexplained", [LEGS]))
    assert "no cause in the catalogue makes" in words and "dead time + device drop" in words


def test_what_is_uncertain_or_behind_a_class_does_not_stand_among_the_absent():
    seen = document(
        "not_distinguishable",
        [LATE],
        uncertain=[
            {"name": "sensor_offset", "why": "w", "decides": CATALOGUE["sensor_offset"].decides, "is_seen": True}
        ],
    )
    absent = [row[0] for row in sections.not_found(seen).parts[0].rows]
    assert absent == ["leakage saturation"]
    assert "inverter off" in sections.uncertain_names(seen)[0].parts[0].rows[0][2]


def test_parameters_are_given_without_interval_and_not_for_the_drive():
    value = {"value": 0.32, "std": 0.001}
    saturated = cause("magnetizing_saturation", {"extra_current_a": (0.6, 0.01, "A")})
    seen = document(
        "explained",
        [saturated],
        parameters_before={"magnetizing_inductance_h": {"value": 0.16, "std": 0.01}},
        parameters_after={"magnetizing_inductance_h": value},
    )
    words, table = sections.parameters(seen).parts
    assert "do not enter these in a drive" in words and "unsaturated" in words
    assert isinstance(table, Table) and table.rows[0][1:] == ("160.0 mH", "320.0 mH", "-50.0 %")


def test_causes_below_the_noise_ask_for_no_action():
    small = cause("sensor_gain_mismatch", {"gain_v_over_u": (-0.005, 1e-4, "1")}, share=1e-5, strength=0.1)
    assert [who for who, _ in actions(document("explained", [LEGS, small]))] == ["for the drive"]


@pytest.mark.parametrize("name", list(CATALOGUE))
def test_every_cause_has_a_sentence_with_and_without_a_size_and_what_decides_it(name):
    bare, sized = cause(name), cause(name, {"size": (2.0, 0.1, "V")})
    for one in (bare, sized, cause(name, equivalent=["clock_drift"])):
        words = sentence(one)
        assert "{" not in words and "_" not in words and "()" not in words and not words.endswith((" ", ":", ","))
    assert CATALOGUE[name].decides.endswith(".") and (CATALOGUE[name].words.motor or plain_of(bare).motor)
    assert "_" not in cause_name(name)


def test_a_delay_below_zero_is_a_current_that_is_read_late():
    words = sentence(cause("sampling_delay", {"delay_us": (-13.7, 0.1, "us")}))
    assert "read" in words and "14" in words.replace("13.7", "14") and "-" not in words


@pytest.mark.parametrize("names", [
    ("dead_time", "device_drop"), ("sampling_delay", "sensor_lag"), ("iron_loss", "rotor_skin_effect"), ("sensor_offset", "sensor_drift"),
    ("inductance_anisotropy", "sensor_gain_mismatch"), ("remanence", "shaft_motion"),
])  # fmt: skip
def test_every_tie_has_a_procedure_with_a_command_and_what_it_changes(names):
    how = procedure(names, FACTS)
    assert len(how.steps) >= 2 and how.command.startswith("commissioner diagnose ") and how.changes_values
    assert not any(n in step for n in names if "_" in n for step in how.steps)


def test_the_procedure_for_the_legs_has_the_drives_own_numbers():
    class Tied:
        name, equivalent, strength_sigma, delta_chi2 = "dead_time", ("device_drop",), 19.0, 3e8

    class Seen:
        facts, segments = FACTS, ()

    plan = next_experiment("not_distinguishable", [Tied], Seen)
    assert "from 5000 to 2500 Hz" in plan["steps"][0] and plan["repeats"] == 1
    assert "switching frequency" in plan["do"] and plan["predicted_sigma"] > 100.0


def test_what_was_seen_stands_apart_from_what_could_only_hide():
    both = [
        {"name": n, "why": "w", "decides": "d", "is_seen": is_seen}
        for n, is_seen in (("iron_loss", False), ("sensor_lag", True))
    ]
    titles = {
        s.title: s.parts[0].rows[0][0] for s in sections.uncertain_names(document("explained", [LEGS], uncertain=both))
    }
    assert titles == {
        "Seen, but the name is uncertain": "sensor lag",
        "Not seen, but could hide behind a named cause": "iron loss",
    }


def test_nobody_is_asked_to_record_the_link_that_is_recorded():
    segment = SimpleNamespace(link_swing=None)
    record = SimpleNamespace(segments=(segment,))
    assert "column dc_link_v" in what_decides("dc_link_sag", record)
    segment.link_swing = np.zeros(3)
    assert "half the level" in what_decides("dc_link_sag", record) and "column" not in what_decides(
        "dc_link_ripple", record
    )


def test_a_refusal_and_a_null_are_said_plainly():
    data = refused_document(refused("sensor_offset too large", 3.0, "at most 2", "turn it off"), "recording")
    assert "cannot carry" in headline(data) and meaning(data) == [
        "sensor offset too large; turn it off",
        "Seen: 3.00; expected: at most 2; step: diagnose.",
    ]
    assert data["error"] == {
        "kind": "DataRefused",
        "what": "sensor_offset too large",
        "step": "diagnose",
        "value": 3.0,
        "limit": "at most 2",
        "remedy": "turn it off",
    }
    null = document("nothing_significant")
    assert headline(null).startswith("Nothing significant") and tone(null) == "good" and actions(null) == []


def test_a_class_in_a_list_reads_as_one_name():
    words = headline(document("explained", [LEGS, cause("sensor_offset")], remarks=[OVER], is_complete=False))
    assert "dead time + device drop and sensor offset." in words


def test_the_page_of_a_refusal_has_the_reason_and_the_data():
    seen = Diagnosis("refused", "too short for sensor_offset", (), (), Audit(()))
    page = page_of(seen, as_document(seen), "file.csv")
    assert page.tone == "bad" and [s.title for s in page.sections] == ["What it means", "The data"]
    assert "too short for sensor offset" in page.sections[0].parts


def test_underscore_names_never_reach_the_page():
    seen = document("unexplained", [LEGS, LATE], remarks=["Something about sensor_offset and dc_link_sag."])
    seen["next_experiment"] = next_experiment("unexplained", [], None)
    parts = [*sections.what_it_means(seen), *sections.causes(seen), *sections.next_test(seen), sections.not_found(seen)]
    html = render(Page("t", headline(seen), tone(seen), [], parts)).partition("<main>")[2]
    assert not [name for name in CATALOGUE if "_" in name and name in html]
    assert "<code>commissioner diagnose" in html
