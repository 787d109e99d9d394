"""Kills while the index is written: the short version of `python -m tests.campaigns.archive.index_kills`."""

from tests.campaigns.archive.index_kills import campaign


def test_eight_kills_lose_no_run_and_leave_a_true_list():
    done = campaign(8, seed=4)
    assert done.kills == 8 and done.runs > 30
    assert done.broken == []
