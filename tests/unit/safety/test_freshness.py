"""The age of the newest sample, bracketed on our own clock."""

from dataclasses import replace

import pytest

from commissioner.safety.freshness import Counted, DriveClock

BEGAN = DriveClock(began_after_s=100.0, sample_period_s=0.01)


def test_a_sample_is_as_old_as_it_can_be_since_the_drive_was_asked_to_begin():
    assert BEGAN.age_s(samples=20, now_s=100.5) == pytest.approx(0.3)
    assert BEGAN.age_s(samples=0, now_s=100.5) == pytest.approx(0.5)


def test_no_age_is_negative():
    assert BEGAN.age_s(samples=200, now_s=100.5) == 0.0
    assert BEGAN.age_s(samples=50, now_s=100.5) == 0.0


def test_a_drive_that_had_made_no_more_began_later():
    later = BEGAN.at_most(samples=20, sent_s=100.5)
    assert later.began_after_s == pytest.approx(100.5 - 21 * 0.01)
    assert later.sample_period_s == 0.01
    assert later.age_s(samples=20, now_s=100.6) == pytest.approx(0.11)


def test_the_latest_bound_is_kept():
    tight = BEGAN.at_most(samples=20, sent_s=100.5)
    assert tight.at_most(samples=200, sent_s=100.6) == tight
    assert BEGAN.at_most(samples=200, sent_s=100.6) == BEGAN


def test_a_clock_does_not_change():
    with pytest.raises(AttributeError):
        BEGAN.began_after_s = 0.0
    with pytest.raises(AttributeError):
        Counted(1, 0.0, 0.1).samples = 2


# --- does its time pass as ours does? --------------------------------------------------------------------------------

COUNTED = replace(BEGAN, first=Counted(samples=20, sent_s=100.20, answered_s=100.21))


@pytest.mark.parametrize(
    ("samples", "is_told"),
    [
        (520, False),
        (517, False),
        (523, False),
        (510, True),
        (530, True),
        (355, True),
        (340, False),
        (760, True),
        (780, False),
    ],
)
def test_a_period_that_is_not_as_stated_is_told_and_another_time_left_alone(samples, is_told):
    reason = COUNTED.judge(Counted(samples, sent_s=105.20, answered_s=105.21))
    assert (reason is not None) == is_told
    if reason is not None:
        assert reason.is_fault
        assert reason.value == pytest.approx(5.0 / (samples - 20))
        assert "0.01 s within 0.5%" in str(reason.limit)


def test_what_an_answer_took_is_no_contradiction():
    assert COUNTED.judge(Counted(530, sent_s=105.20, answered_s=105.31)) is None
    assert COUNTED.judge(Counted(510, sent_s=105.09, answered_s=105.21)) is None
    assert COUNTED.judge(Counted(25, sent_s=100.20, answered_s=100.25)) is None


def test_without_a_first_count_nothing_is_judged():
    assert BEGAN.judge(Counted(10, sent_s=105.2, answered_s=105.21)) is None


def test_a_whole_sample_may_lie_between_two_counts():
    coarse = replace(COUNTED, sample_period_s=0.05)
    assert coarse.judge(Counted(121, sent_s=105.20, answered_s=105.21)) is None
    assert coarse.judge(Counted(122, sent_s=105.20, answered_s=105.21)) is not None
