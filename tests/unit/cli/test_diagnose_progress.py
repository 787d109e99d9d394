"""The search's own records become words."""

from commissioner.cli.screens.diagnosis_progress import Progress
from commissioner.diagnose.search.journal import Accepted, Dropped, Exchanged, Nominal, Tried


def test_the_searchs_records_become_words():
    told = Progress(is_quiet=True)
    tried = Tried("dead_time", 2.5e7, 18, 2.8e7, 100.0, "materiality")
    assert told.words_for(Nominal(20.61)) == "the plain simulation's error is 20.6 x the noise"
    assert told.words_for(tried).startswith("trying dead time")
    assert told.words_for(tried) == ""
    assert told.words_for(Accepted("dead_time", 1.145)) == "dead time helps"
    assert told.words_for(Dropped("dead_time", 1.0, 2.0, "materiality", True, is_taken=True)).endswith(
        "no longer needed"
    )
    assert told.words_for(Exchanged("instead of iron_loss sensor_lag", (), (), 3.0, 4.0, True, False)) == ""
