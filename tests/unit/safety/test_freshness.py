"""The age of the newest sample, bracketed on our own clock."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.safety.freshness import LOOSENS, Counted, DriveClock

BEGAN = DriveClock(began_after_s=100.0, sample_period_s=0.01)


def test_a_sample_is_as_old_as_it_can_be_since_the_drive_was_asked_to_begin():
    assert BEGAN.age_s(samples=20, now_s=100.5) == pytest.approx(0.3 + LOOSENS * 0.5)
    assert BEGAN.age_s(samples=0, now_s=100.5) == pytest.approx(0.5 + LOOSENS * 0.5)


def test_nothing_is_old_as_a_session_begins():
    assert BEGAN.age_s(samples=0, now_s=100.0) == 0.0


def test_no_age_is_negative():
    assert BEGAN.age_s(samples=200, now_s=100.5) == 0.0
    assert BEGAN.age_s(samples=52, now_s=100.5) == 0.0


def test_a_drive_that_had_made_no_more_began_later():
    later = BEGAN.at_most(samples=20, sent_s=100.5)
    assert later.began_after_s == pytest.approx(100.5 - 21 * 0.01)
    assert later.sample_period_s == 0.01
    assert later.age_s(samples=20, now_s=100.6) == pytest.approx(0.11 + LOOSENS * 0.1)


def test_the_latest_bound_is_kept():
    tight = BEGAN.at_most(samples=20, sent_s=100.5)
    assert tight.at_most(samples=200, sent_s=100.6) == replace(tight, made=200)
    assert BEGAN.at_most(samples=200, sent_s=100.6) == replace(BEGAN, made=200)


def test_a_sample_is_as_old_as_those_behind_it_last_by_whatever_clock():
    far = BEGAN.at_most(samples=20, sent_s=100.5).at_most(samples=200, sent_s=100.6)
    assert far.age_s(samples=150, now_s=100.6) == pytest.approx(0.5)
    assert far.at_most(samples=30, sent_s=100.6).age_s(samples=150, now_s=100.6) == pytest.approx(0.5)


@pytest.mark.parametrize("rate", [0.985, 0.9955, 1.0, 1.0045, 1.015])
def test_an_age_covers_a_drive_whose_time_runs_off_ours_however_long_the_session(rate):
    """Told by 0.5 % only, and not before seconds: after 60 s at 0.45 % a sample was said to be 270 ms younger than it was."""
    clock = DriveClock(began_after_s=0.0, sample_period_s=2e-4)
    for asked_s in np.arange(0.25, 60.0, 0.25):
        made = int(rate * asked_s / 2e-4)
        clock = clock.at_most(made, asked_s)
        true_s = (0.2 * rate) + 2e-4
        assert true_s <= clock.age_s(made, asked_s + 0.2) + 1e-3 * true_s
        assert clock.age_s(made, asked_s + 0.2) < 1.1 * true_s + 0.25 * abs(rate - 1.0)


def test_what_can_be_there_is_of_the_drives_time():
    assert QUARTER.at_most(8, sent_s=101.25).most_made(101.25) == pytest.approx(9.0)
    fast = replace(QUARTER, rate=4.0, told_s=100.0)
    assert fast.most_made(101.0) == pytest.approx((1.0 + LOOSENS) * 32.0)
    assert fast.most_made(99.0) == 0.0
    assert replace(fast, told_s=102.0).most_made(101.0) == 32.0  # an answer says no more of the time before it


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


# --- a drive whose time is meant to pass faster ----------------------------------------------------------------------

QUARTER = replace(BEGAN, sample_period_s=0.125)
"""Numbers that are exact in binary."""


def test_the_first_count_is_kept_and_pins_when_the_drive_began():
    counted = BEGAN.counted(Counted(20, sent_s=100.5, answered_s=100.51))
    assert counted == replace(BEGAN.at_most(20, 100.5), first=Counted(20, 100.5, 100.51))
    assert counted.counted(Counted(70, sent_s=101.0, answered_s=101.01)).first == Counted(20, 100.5, 100.51)
    assert counted.counted(Counted(70, sent_s=101.0, answered_s=101.01)).rate == 1.0


def test_ages_are_of_the_drives_time_where_that_passes_four_times_as_fast():
    first = QUARTER.counted(Counted(8, sent_s=101.0, answered_s=101.0))
    fast = first.counted(Counted(40, sent_s=102.0, answered_s=102.0))  # 4 s of its time in 1 s
    assert fast.rate == 4.0
    assert fast.age_s(samples=40, now_s=102.0) == pytest.approx(0.125)  # the sample that was under way
    assert fast.age_s(samples=40, now_s=102.5) == pytest.approx(2.0 + 0.125 + LOOSENS * 2.0)
    assert fast.age_s(samples=60, now_s=102.5) == 0.0
    assert fast.at_most(56, sent_s=102.5).age_s(samples=56, now_s=102.5) == pytest.approx(0.125)
    assert fast.counted(Counted(72, sent_s=103.0, answered_s=103.0)).rate == 4.0


def test_what_was_pinned_before_the_rate_was_known_does_not_count():
    first = QUARTER.counted(Counted(8, sent_s=101.0, answered_s=101.0)).at_most(0, sent_s=105.0)
    fast = first.counted(Counted(40, sent_s=102.0, answered_s=102.0))
    assert (fast.began_after_s, fast.told_s) == (102.0 - 41 * 0.125 / 4.0, 102.0)


@pytest.mark.parametrize(
    ("samples", "answered_s", "rate"),
    [(20, 102.0, 1.5), (19, 102.0, 1.0), (9, 101.0625, 1.0), (9, 101.1, 1.0), (10, 101.125, 2.0)],
)
def test_a_rate_is_told_from_half_as_fast_again_and_an_eighth_of_a_second_on(samples, answered_s, rate):
    first = QUARTER.counted(Counted(8, sent_s=101.0, answered_s=101.0))
    assert first.counted(Counted(samples, sent_s=101.0, answered_s=answered_s)).rate == pytest.approx(rate)
