"""How a run ends: what is said of a drive that may be live."""

from commissioner.run.ending import still_live, taken_as_live


def test_a_drive_that_may_be_live_is_said_so_once():
    twice = still_live(taken_as_live("not confirmed"), taken_as_live("not confirmed"))
    assert twice.remedy.count("take the motor as live") == 1
