"""A running motor's four parameters beside its plate: silent where they are its, a sentence where a factor is between them."""

import math

import pytest

from commissioner.motor.circuit import InverseGamma, Quantity
from commissioner.motor.nameplate import Nameplate, prior
from commissioner.operations.recordings.trust import unlike_plate

PLATE = Nameplate(7500.0, 400.0, 50.0, 15.1, 1455.0, 0.84, 2, "star")


def said(factor, share=0.01):
    """With all impedances `factor` times the plate's typical ones, each told to `share`."""
    typical = prior(PLATE).typical.as_tuple()
    names = InverseGamma.__dataclass_fields__
    return unlike_plate(
        {n: Quantity(factor * v, share * factor * v) for n, v in zip(names, typical, strict=True)}, PLATE
    )


def test_the_plates_motor_is_not_doubted():
    assert said(1.0) == []


@pytest.mark.parametrize("factor", [math.sqrt(3.0), 0.5])
def test_voltages_between_lines_and_doubled_currents_are_told_with_both_currents(factor):
    (sentence,) = said(factor)
    assert "do not belong to this plate" in sentence and "A from the data" in sentence and "between lines" in sentence


def test_a_peak_taken_for_an_rms_value_is_doubted():
    (sentence,) = said(math.sqrt(2.0))
    assert "a peak value taken for an rms one" in sentence


def test_what_a_recording_does_not_tell_contradicts_no_plate():
    assert said(math.sqrt(3.0), share=0.2) == []
