"""A diagnosis as an operation: what it hears of the search."""

from commissioner.operations.diagnose import _Search
from commissioner.operations.events import SearchSaid


def test_what_was_named_and_taken_back_is_remembered():
    heard = []
    search = _Search(heard.append)
    for line in (
        "accepted dead_time: 2 times the noise",
        "accepted remanence: 1 times the noise",
        "  dropped remanence",
    ):
        search(line)
    assert search.withdrawn({"dead_time"}) == ["remanence"]
    assert heard[-1] == SearchSaid("  dropped remanence")
