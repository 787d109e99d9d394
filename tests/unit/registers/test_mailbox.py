"""Parameter requests and answers as the cited manual prints them; what is no answer is refused by name."""

from dataclasses import replace
from pathlib import Path

import pytest

from commissioner.errors import ConfigurationError, ReplyMismatch, RequestRefused
from commissioner.link.files.drive_file import build, load_profile
from commissioner.registers.mailbox import BEYOND, answered, request
from commissioner.registers.profile import plan_spans
from commissioner.settings import read_toml
from tests.support.vendor_process import MADE_UP

G120 = load_profile("siemens_g120")
BOX, RAMP = G120.mailbox, G120.items["ramp_down"]


def test_the_printed_request_to_write_p1121_goes_out_word_by_word():
    words = request(BOX, RAMP, 0x80, (0x4142, 0x6666))
    assert words == (0x0001, 0x2F10, 0x8002, 0x0101, 0x1001, 0x0461, 0x0000, 0x0801, 0x4142, 0x6666)
    assert request(BOX, RAMP, 0x80) == (0x0001, 0x2F0A, 0x8001, 0x0101, 0x1001, 0x0461, 0x0000)


def test_a_complete_answer_gives_the_values_words():
    assert answered(BOX, RAMP, 0x80, (2, 0x2F0A, 0x8001, 0x0101, 0x0801, 0x4142, 0x6666), writes=False) == (
        0x4142,
        0x6666,
    )
    assert answered(BOX, RAMP, 0x80, (2, 0x2F04, 0x8002, 0x0101, 0, 0, 0), writes=True) == ()


@pytest.mark.parametrize(
    ("seen", "said"),
    [
        ((2, 0x2F00, 2, 0, 0, 0, 0), "not in the drive's present state"),
        ((2, 0x2F08, 0x8081, 0x0101, 0x4401, 0, 0), "there is no such parameter"),
        ((2, 0x2F08, 0x8001, 0x0101, 0x4401, 3, 0), "there is no such index"),
        ((2, 0x2F08, 0x8081, 0x0101, 0x4401, 0x6F, 0), "its meaning is not in the drive file"),
    ],
)
def test_a_drive_that_says_no_is_told_with_its_reason(seen, said):
    with pytest.raises(RequestRefused, match=said):
        answered(BOX, RAMP, 0x80, seen, writes=False)


@pytest.mark.parametrize(
    "seen",
    [
        (0, 0x2F0A, 0x8001, 0x0101, 0x0801, 0, 0),
        (2, 0x300A, 0x8001, 0x0101, 0x0801, 0, 0),
        (2, 0x2F0A, 0x7F01, 0x0101, 0x0801, 0, 0),
        (2, 0x2F04, 0x8002, 0x0101, 0x0801, 0, 0),
        (2, 0x2F08, 0x8001, 0x0101, 0x0601, 0, 0),
        (2, 0x2F0E, 0x8001, 0x0101, 0x0802, 0, 0),
    ],
    ids=["idle", "another data set", "an older question", "a write's", "16 bits wide", "two values"],
)
def test_another_answer_than_the_one_asked_for_is_never_a_value(seen):
    with pytest.raises(ReplyMismatch):
        answered(BOX, RAMP, 0x80, seen, writes=False)


def test_neighbours_behind_a_mailbox_are_asked_for_one_by_one_and_lie_beyond_every_register():
    first, second = RAMP, replace(RAMP, name="next", index=1, address=RAMP.address + 8)
    assert len(plan_spans([first, second], 125)) == 2
    assert RAMP.address >= BEYOND and RAMP.place == 1121


def changed(*path, to):
    document = read_toml(Path(MADE_UP[0]))
    table = document
    for step in path[:-1]:
        table = table[step]
    if to is None:
        del table[path[-1]]
    else:
        table[path[-1]] = to
    return document


@pytest.mark.parametrize(
    ("path", "to", "key"),
    [
        (("mailbox",), None, "items.rated_voltage_v.parameter"),
        (("mailbox", "source"), "lead: a forum", "mailbox.source"),
        (("mailbox", "address"), 50, "items.status_word.address"),
        (("items", "stator_resistance", "address"), 77, "items.stator_resistance.address"),
        (("items", "stator_resistance", "parameter"), None, "items.stator_resistance.address"),
        (("items", "stator_resistance", "parameter"), 1351, "worked[0].request"),
        (("items", "stator_resistance", "word_order"), "little", "items.stator_resistance.word_order"),
        (("items", "rated_voltage_v", "type"), "ascii", "items.rated_voltage_v.length"),
        (("link", "write_functions"), [6], "link.write_functions"),
        (("mailbox", "data_set"), 48, "worked[0].request"),
    ],
)
def test_a_mailbox_that_is_not_described_whole_never_reaches_a_wire(path, to, key):
    with pytest.raises(ConfigurationError) as refused:
        build(changed(*path, to=to), "made_up.toml")
    assert refused.value.key == key


def test_an_unlock_without_a_source_is_refused():
    document = read_toml(Path(MADE_UP[1]))
    document["unlock"]["source"] = "lead: general knowledge"
    with pytest.raises(ConfigurationError) as refused:
        build(document, "made_up.toml")
    assert refused.value.key == "unlock.source"
