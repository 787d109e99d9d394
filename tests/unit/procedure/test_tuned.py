"""What a drive found by itself is judged: register ends, the file's limits, and a tuning that changed nothing."""

from dataclasses import replace

import pytest

from commissioner.link.files.drive_file import load_profile
from commissioner.procedure.tuned import judge_tunings
from commissioner.settings import load_motor

PLATE = load_motor("motor_2kw2")
ALTIVAR = load_profile("schneider_atv340")
"""Raw values: no plate says what they may be."""


def objections(values, before=900, profile=ALTIVAR, name="stator_resistance"):
    verdict = judge_tunings(profile, [{name: value} for value in values], {name: before}, PLATE, {})
    return [o.what for o in verdict.objections]


def typed(kind, **facts):
    item = replace(ALTIVAR.item("stator_resistance"), type=kind, **facts)
    return replace(ALTIVAR, items={**ALTIVAR.items, item.name: item})


@pytest.mark.parametrize("value", [0xFFFF, 0x8000, 0x7FFF])
def test_a_register_at_its_end_says_that_there_is_no_value(value):
    assert objections([value] * 3) == ["stator resistance stands at an end of its register"]
    assert objections([1203, value, 1201]) != []
    assert objections([1203, 1204, 1201]) == []


def test_two_registers_have_their_own_ends():
    assert objections([0xFFFF, 0xFFFE, 0xFFFF], profile=typed("u32")) == []
    assert objections([0xFFFFFFFF] * 3, profile=typed("u32")) != []
    assert objections([-32768, -32768, -32768], profile=typed("i16")) != []


def test_a_value_that_the_drive_file_does_not_allow_is_none():
    assert objections([1203, 1204, 1201], profile=typed("u16", maximum=1000.0)) == [
        "stator resistance is none that the drive file allows"
    ]


@pytest.mark.parametrize(
    ("bounds", "said"),
    [
        ({"maximum": 1000.0}, "at most 1000"),
        ({"minimum": 2.5e3}, "at least 2500"),
        ({"minimum": 1.5, "maximum": 9.0}, "1.5 ... 9"),
    ],
)
def test_a_drive_file_with_one_bound_says_that_one(bounds, said):
    verdict = judge_tunings(
        typed("u16", **bounds), [{"stator_resistance": 1203.0}] * 3, {"stator_resistance": 900}, PLATE, {}
    )
    assert [o.limit for o in verdict.objections] == [said]


def test_a_tuning_that_changed_nothing_to_the_last_digit_has_not_tuned():
    assert objections([1203] * 3, before=1203) == [
        "the drive's tuning changed nothing: every result is what stood there before"
    ]
    assert objections([1203, 1203, 1204], before=1203) == []
    assert objections([43] * 3, before=43) == []  # in steps of 2 % a second tuning may meet the same
