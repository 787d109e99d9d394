"""A plate judged field by field: what each field must be is said once, by the loader of motor files."""

import re

import pytest
from pydantic import ValidationError

from commissioner.service.library import OF_INERTIA, judge_plate
from commissioner.service.page.texts import Texts
from commissioner.service.page.work import say_plate
from commissioner.settings import MotorFile
from commissioner.validation import wanted

PLATE = {"rated_power_w": 2200, "rated_voltage_v": 400, "rated_frequency_hz": 50, "rated_current_a": 5.0, "rated_speed_rpm": 1436,
         "power_factor": 0.8, "pole_pairs": 2, "connection": "star"}  # fmt: skip
WRONG = (
    ("pole_pairs", "2,5", "must be a whole number", "muss eine ganze Zahl sein"),
    ("rated_power_w", "much", "must be a number in W", "muss eine Zahl in W sein"),
    ("rated_voltage_v", "12", "must be 24 V or more", "muss mindestens 24 V sein"),
    ("rated_current_a", "0,01", "must be 0.05 A or more", "muss mindestens 0,05 A sein"),
    ("rated_speed_rpm", "70000", "must be at most 60000 1/min", "darf höchstens 60000 1/min sein"),
    ("power_factor", "0,1", "must be above 0.2", "muss über 0,2 liegen"),
    ("inertia_kg_m2", "-1", "must be above 0 kg m2", "muss über 0 kg m2 liegen"),
    ("connection", "both", "must be one of 'star' or 'delta'", "muss Stern oder Dreieck sein"),
    ("rated_frequency_hz", "", "is missing", "fehlt"),
)


@pytest.mark.parametrize(("key", "typed", "english", "german"), WRONG)
def test_a_field_says_what_it_must_be_in_both_languages(key, typed, english, german):
    judged = judge_plate(PLATE | {key: typed})
    assert [name for name, field in judged["fields"].items() if not field["ok"]] == [key]
    field = judged["fields"][key]
    assert (field["what"], Texts("de").tell(field["what"])) == (english, german)
    assert field["remedy"] and Texts("de").knows(field["remedy"])


@pytest.mark.parametrize(("key", "value"), [("rated_voltage_v", 12), ("pole_pairs", "x"), ("power_factor", 2)])
def test_page_and_motor_file_say_the_same(key, value):
    with pytest.raises(ValidationError) as error:
        MotorFile.model_validate(PLATE | {key: value})
    said = judge_plate(PLATE | {key: value})["fields"][key]["what"].removeprefix("must be ")
    assert f": {said}" in wanted(error.value.errors()[0], MotorFile)


@pytest.mark.parametrize(
    "changed",
    [
        {"rated_speed_rpm": 1563}, {"rated_speed_rpm": 900}, {"pole_pairs": 1, "rated_speed_rpm": 3010}, {"rated_speed_rpm": 2900},
        {"rated_current_a": 8.66}, {"rated_power_w": 4600}, {"rated_power_w": 400},
    ],
)  # fmt: skip
def test_a_plate_that_contradicts_itself_is_told_in_german(changed):
    fields = judge_plate(PLATE | changed)["fields"]
    said = [field["remedy"] for field in fields.values() if not field["ok"]]
    german = [Texts("de").tell(text) for text in said]
    assert said
    assert [text for text in german if re.search(r"\b(the|of|at|with|than|below)\b", text)] == []


@pytest.mark.parametrize(
    ("inertia", "is_asked"), [(0.015, False), (0.004, False), (2.0, False), (150.0, True), (1.5e-6, True), ("", False)]
)
def test_a_moment_of_inertia_in_another_unit_is_asked_about(inertia, is_asked):
    """0.015 kg m2 are 150 kg cm2."""
    judged = judge_plate(PLATE | {"inertia_kg_m2": inertia})
    assert judged["ok"] and (judged["questions"] == [OF_INERTIA]) is is_asked
    said = say_plate(judged, Texts("de"))
    assert ("Trägheitsmoment" in said["reason"], said["is_odd"]) == (is_asked, is_asked)
