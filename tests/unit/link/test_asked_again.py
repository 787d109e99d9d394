"""How often a read is asked again: a damaged answer is known at once, one that nobody sends costs its whole time."""

from __future__ import annotations

import pytest

from commissioner.errors import ReplyMismatch, ReplyTimeout, RequestRefused
from commissioner.link.wire.port import MOST_AGAIN, ask_again

FACTS = {"step": "", "value": "", "limit": "", "remedy": ""}


class Line:
    """Each of its first `bad` answers fails after `takes_s`."""

    def __init__(self, bad, takes_s, failure=ReplyMismatch):
        self.bad, self.takes_s, self.failure, self.asked, self.now = bad, takes_s, failure, 0, 0.0

    def ask(self):
        self.asked += 1
        if self.asked <= self.bad:
            self.now += self.takes_s
            raise self.failure("damaged", **FACTS)
        return 42

    def read(self, least, patience_s):
        return ask_again(self.ask, least, patience_s, lambda: self.now)


@pytest.mark.parametrize("bad", range(MOST_AGAIN + 1))
def test_damaged_answers_are_asked_for_again_while_there_is_patience(bad):
    assert Line(bad, 0.1).read(1, 0.75) == 42


@pytest.mark.parametrize(
    ("takes_s", "failure", "least", "patience_s", "asked"),
    [
        (0.1, ReplyMismatch, 1, 0.75, MOST_AGAIN + 1),  # that is enough, however fast
        (0.25, ReplyTimeout, 1, 0.75, 3),  # silence uses the time up
        (1.0, ReplyTimeout, 1, 0.75, 2),  # a line that cannot be brought into step: as often as ever
        (0.0, ReplyTimeout, 0, 0.0, 1),  # energised: never
        (0.0, RequestRefused, 1, 0.75, 1),  # a refusal is an answer
    ],
)
def test_no_patience_is_endless(takes_s, failure, least, patience_s, asked):
    line = Line(99, takes_s, failure)
    with pytest.raises(failure):
        line.read(least, patience_s)
    assert line.asked == asked
