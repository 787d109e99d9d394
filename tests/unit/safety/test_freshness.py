"""The age of the newest sample, bracketed on our own clock."""

import pytest

from commissioner.safety.freshness import DriveClock

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
