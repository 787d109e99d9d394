"""Stamps that wander: the voltage tells whether the samples do as well; truth is the wave in closed form at even steps."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.motor.channels.faults import put_right
from commissioner.records import RunningRecording

PERIOD = 2e-4
EVEN = PERIOD * np.arange(20_000)
TURN = 2.0 * np.pi * 49.9


def wave(time_s, noise=0.0):
    """Currents and voltages of mains that wander by 0.05 Hz, with a fifth."""
    rng = np.random.default_rng(3)
    angle = TURN * time_s + 0.3 * np.sin(2.0 * np.pi * 0.17 * time_s)
    shifts = 2.0 * np.pi / 3.0 * np.arange(3)
    volts = [325.0 * np.cos(angle - k) + 6.0 * np.cos(5.0 * (angle - k)) for k in shifts]
    amps = [10.0 * np.cos(angle - k - 0.7) + 0.1 * np.cos(5.0 * (angle - k)) for k in shifts]
    group = [
        tuple(x + noise * scale * rng.standard_normal(x.size) for x in g) for scale, g in ((10, amps), (325, volts))
    ]
    return RunningRecording(EVEN, group[0], group[1], False, None, PERIOD, source="wave")


def slow(share, by_s=4.0):
    """A logger's clock that runs fast and slow by this share."""
    return share * by_s / (2.0 * np.pi) * np.cos(2.0 * np.pi * EVEN / by_s)


def jitter(share):
    return share * PERIOD * np.random.default_rng(4).standard_normal(EVEN.size)


def stamped(one, stamps):
    return RunningRecording(stamps, one.currents_a, one.voltages_v, False, None, PERIOD, source="wave")


@pytest.mark.parametrize("off", [slow(0.01), slow(0.003), jitter(0.3), jitter(0.1)], ids=["1 %", "0.3 %", "0.3", "0.1"])
@pytest.mark.parametrize("is_true", [True, False])
def test_samples_are_brought_to_even_steps_where_the_voltage_says_that_they_wander_with_their_stamps(off, is_true):
    """Refused as `clock_jitter`, or as time that does not run forward."""
    one = stamped(wave(EVEN + off if is_true else EVEN, 1e-3), EVEN + off)
    one = replace(one, metadata={"sample_period_s": PERIOD})
    mended = put_right(one)
    (note,) = mended.notes
    assert note.code == "wandering_stamps" and ("with them" in note.what) == is_true
    np.testing.assert_allclose(np.diff(mended.time_s), mended.sample_period_s, rtol=1e-6)
    assert mended.sample_period_s == pytest.approx(PERIOD, rel=2e-3)
    true, inside = wave(mended.time_s), slice(50, -50)
    for group, of, size in ((mended.currents_a, true.currents_a, 10.0), (mended.voltages_v, true.voltages_v, 325.0)):
        error = np.array(group)[:, inside] - np.array(of)[:, inside]
        assert np.std(error) < 2.5e-3 * size


def test_how_long_a_sample_period_is_no_stamps_tell_that_wander_for_themselves():
    """1478.07 +- 0.15 rev/min were said of 1479.0."""
    for off, is_known in ((slow(0.01), False), (jitter(0.3), True)):
        mended = put_right(stamped(wave(EVEN, 1e-3), EVEN + off))
        assert bool(mended.notes) is is_known
        assert not is_known or mended.sample_period_s == pytest.approx(PERIOD, rel=2e-5)


def test_the_noise_of_channels_that_were_brought_to_even_steps_is_what_it_was():
    mended = put_right(stamped(wave(EVEN + slow(0.01), 1e-3), EVEN + slow(0.01)))
    sixth = np.diff(mended.currents_a[0], 6)
    assert np.std(sixth) / np.sqrt(924.0) == pytest.approx(1e-2, rel=0.08)


@pytest.mark.parametrize(
    "stamps",
    [EVEN, np.round(EVEN, 4), EVEN + jitter(0.02), np.where(EVEN < 2.0, EVEN, EVEN + 40 * PERIOD), np.where(EVEN < 2.0, EVEN, EVEN + 2 * PERIOD)],
    ids=["even", "rounded", "small", "gap", "two rows"],
)  # fmt: skip
def test_even_and_rounded_stamps_and_gaps_are_left_alone(stamps):
    one = stamped(wave(stamps), stamps)
    assert put_right(one).currents_a == one.currents_a and put_right(one).time_s is stamps


def test_where_the_voltage_does_not_tell_the_stamps_are_left_to_who_reads_them():
    off = slow(2e-4, 3.0)
    half = stamped(wave(EVEN + 0.5 * off), EVEN + off)
    still = RunningRecording(
        EVEN + slow(0.01), half.currents_a, tuple(0.0 * x for x in half.voltages_v), False, None, PERIOD
    )
    for one in (half, still):
        assert put_right(one).time_s is one.time_s
