"""What a drive may apply of what it was asked for, at its edge."""

import math

import numpy as np
import pytest

from commissioner.safety.applied import judge_applied

ASKED = np.array([-8.0, 3.0, 5.0])
"""Tones about the block: 8 V at most, of 20 V where all peaks meet; so 10 V and 2 V of room."""
PEAKS_V = 20.0


def test_what_was_asked_for_is_applied():
    assert judge_applied(ASKED, ASKED, PEAKS_V, 0.0) is None
    assert judge_applied(np.zeros(3), np.zeros(3), 0.0, 0.0) is None


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("bias_v", "most_v"), [(0.0, 12.0), (6.0, 18.0), (-6.0, 18.0)])
def test_a_quarter_more_than_the_largest_tone_and_a_tenth_of_all_peaks_beside_the_bias(sign, bias_v, most_v):
    inside, beyond = (np.array([0.1, sign * most_v * (1.0 + step), -0.1]) for step in (0.0, 1e-9))
    assert judge_applied(inside, ASKED, PEAKS_V, bias_v) is None
    reason = judge_applied(beyond, ASKED, PEAKS_V, bias_v)
    assert reason is not None
    assert (reason.value, reason.limit) == (pytest.approx(most_v), pytest.approx(most_v))
    assert reason.value > reason.limit
    assert not reason.is_fault
    assert "a second master" in reason.remedy


def test_a_voltage_that_is_no_number_is_more_than_was_asked_for():
    assert judge_applied(np.array([0.0, math.nan]), ASKED, PEAKS_V, 0.0) is not None
