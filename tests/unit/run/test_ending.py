"""How a run ends: what is said of a drive that may be live."""

import pytest

from commissioner.errors import DriveFault
from commissioner.link.wire.port import LinkStats
from commissioner.run.ending import still_live, taken_as_live, with_host, with_link, with_shares


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


@pytest.mark.parametrize(
    ("turns", "said"),
    [
        ([(0.03, 0.01)] * 40, "of the last 0.52 s this host took 0.39 s, and the link 0.13 s"),
        ([(0.006, 0.034)] * 40, "of the last 0.52 s this host took 0.078 s, and the link 0.44 s"),
    ],
)
def test_samples_late_by_many_small_delays_say_where_the_time_went(turns, said):
    """No gap is half the watchdog and no answer a quarter of it: two seconds of other programs left only "came too late"."""
    stats = LinkStats()
    stats.turns_s.extend([(9.0, 0.0), *turns])
    late = DriveFault("the samples came too late", step="watch", value=0.505, limit=0.5, remedy="")
    told = with_shares(with_link(with_host(late, 0.03, 0.5), 0.04, 0.5), *stats.shares_s(0.5))
    assert said in told.what
    other = DriveFault("the drive tripped", step="watch", value=1.0, limit=0.5, remedy="")
    assert with_shares(other, *stats.shares_s(0.5)).what == "the drive tripped"
    assert with_shares(DriveFault(late.what[:25], step="watch", value=1, limit=1, remedy=""), 0.0, 0.0).what.endswith(
        "late"
    )
