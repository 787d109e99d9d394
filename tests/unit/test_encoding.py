"""JSON from outside: what is read is what ours can hold."""

import pytest

from commissioner.encoding import read_json


@pytest.mark.parametrize("text", ["[" * 100_000, "1" * 400, '{"n": -9223372036854775809}', "9" * 5000, "{"])
def test_json_that_is_none_of_ours_is_a_value_error(text):
    with pytest.raises(ValueError, match=r"."):
        read_json(text)


def test_the_largest_counter_is_read():
    assert read_json(b'{"n": [9223372036854775807, -9223372036854775808]}') == {"n": [2**63 - 1, -(2**63)]}


def test_half_a_character_is_a_question_mark():
    assert read_json('{"a": ["\\ud800", "\\ud83d\\ude00"]}') == {"a": ["?", "\N{GRINNING FACE}"]}
