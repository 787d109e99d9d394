"""How a run ends: what is said of a drive that may be live."""

from commissioner.errors import DriveFault
from commissioner.run.ending import still_live, taken_as_live, with_link


def test_a_drive_that_may_be_live_is_said_so_once():
    twice = still_live(taken_as_live("not confirmed"), taken_as_live("not confirmed"))
    assert twice.remedy.count("take the motor as live") == 1


def test_a_trip_over_a_slow_link_names_the_link_and_one_over_a_fast_link_does_not():
    def trip(answer_s):
        error = DriveFault("the drive tripped", step="watch", value=0.61, limit=0.6, remedy="reset the fault")
        return with_link(error, answer_s, 0.6)

    assert "the link was slow: an answer took 0.16 s" in trip(0.16).what
    assert trip(0.16).remedy.startswith("use a link that answers sooner") and trip(0.16).remedy.endswith(
        "reset the fault"
    )
    assert (trip(0.02).what, trip(0.02).remedy) == ("the drive tripped", "reset the fault")
