"""A word of another language is understood however it is written."""

import pytest

from commissioner.recordings.words import TRANSLATED, folded, translated


@pytest.mark.parametrize("name", ["akım", "Akım", "AKIM", "akim", "Akim"])
def test_a_dotless_i_is_an_i(name):
    assert translated(name) == "current"


@pytest.mark.parametrize("written", [str.upper, str.title, folded], ids=["upper", "title", "without marks"])
def test_every_word_means_the_same_in_every_case(written):
    words = list(TRANSLATED)
    assert [translated(written(word)).lower() for word in words] == [translated(word).lower() for word in words]


@pytest.mark.parametrize("name", ["\u017fpannung", "\u1e9e", "\u212a", "te\u017fti"])
def test_a_letter_that_only_looks_alike_breaks_nothing(name):
    assert isinstance(translated(name), str)
