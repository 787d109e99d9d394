"""A diagnosis as an operation: what it hears of the search."""

from commissioner.diagnose.search.journal import Accepted, Dropped
from commissioner.operations.recordings.diagnose import withdrawn


def test_what_was_named_and_taken_back_is_remembered():
    dropped = Dropped("remanence", 3.0, 50.0, "materiality", is_sound=True, is_taken=True)
    steps = (Accepted("dead_time", 2.0), Accepted("remanence", 1.0), dropped)
    assert withdrawn(steps, {"dead_time"}) == ["remanence"]
