"""However the record is cut, whatever its units, whichever axis it lies on: the same machine."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from commissioner.identify.observer.observer import ParallelObserver
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import ParameterBox, prior
from commissioner.motor.space_vector import axis_current_a
from tests.support.standstill import linear_response, multitone, usable_motors

PERIOD_S = 2e-4
MOTOR = next(m for m in usable_motors() if m.name == "abb_2k2")
BOX, PEAK_A = prior(MOTOR.plate), MOTOR.plate.rated_current_peak_a
VOLTAGE_V = multitone([(14.0, 0.7, 0.0), (4.0, 2.3, 1.0), (12.0, 19.8, 2.0), (9.0, 60.1, 3.0)], 2.0, PERIOD_S)
CLEAN_A = linear_response(MOTOR.truth, VOLTAGE_V, PERIOD_S)[0]
CURRENT_A = CLEAN_A + 0.05 * np.std(CLEAN_A) * np.random.default_rng(11).standard_normal(CLEAN_A.size)
FEW = settings(max_examples=25, deadline=None)


def identified(voltage_v, current_a, box=BOX, scale_a=PEAK_A, cuts=()):
    observer = ParallelObserver(box, PERIOD_S, scale_a)
    for voltage, current in zip(np.split(voltage_v, cuts), np.split(current_a, cuts), strict=True):
        last = observer.advance(voltage, current) if voltage.size else None
    assert last is not None
    return np.array(last.parameters.as_tuple())


REFERENCE = identified(VOLTAGE_V, CURRENT_A)


@FEW
@given(st.sets(st.integers(1, VOLTAGE_V.size - 1), max_size=30))
def test_however_the_record_is_cut_into_blocks_the_parameters_are_the_same_bits(cuts):
    np.testing.assert_array_equal(identified(VOLTAGE_V, CURRENT_A, cuts=sorted(cuts)), REFERENCE)


@FEW
@given(st.floats(-3, 3).map(lambda power: 10.0**power))
def test_voltage_and_current_scaled_alike_leave_the_machine(factor):
    seen = identified(factor * VOLTAGE_V, factor * CURRENT_A, scale_a=factor * PEAK_A)
    np.testing.assert_allclose(seen, REFERENCE, rtol=1e-6)


@FEW
@given(st.floats(-3, 3).map(lambda power: 10.0**power))
def test_a_machine_of_other_impedance_comes_out_with_every_value_scaled(factor):
    box = ParameterBox(*(InverseGamma(*(factor * v for v in astuple(m))) for m in (BOX.lower, BOX.typical, BOX.upper)))
    np.testing.assert_allclose(identified(factor * VOLTAGE_V, CURRENT_A, box=box), factor * REFERENCE, rtol=1e-6)


def phases(along_a, across_a, axis_deg):
    angles = np.deg2rad(np.array([0.0, 120.0, 240.0]))
    axis = np.deg2rad(axis_deg)
    return [along_a * np.cos(axis - angle) - across_a * np.sin(axis - angle) for angle in angles]


AXES = st.floats(-720.0, 720.0)


@FEW
@given(AXES, st.floats(-5.0, 5.0), st.floats(-3.0, 3.0), st.booleans())
def test_the_current_along_an_axis_is_found_on_every_axis_whatever_runs_across_it(axis_deg, across, common, with_w):
    u, v, w = phases(CURRENT_A[:50], across, axis_deg)
    if with_w:  # three sensors: what they share is no current of the machine
        u, v, w = u + common, v + common, w + common
    seen = axis_current_a(u, v, w if with_w else None, axis_deg)
    np.testing.assert_allclose(seen, CURRENT_A[:50], atol=1e-9)


@FEW
@given(AXES)
def test_a_turn_of_a_third_with_the_phases_renamed_changes_nothing(axis_deg):
    u, v, w = phases(CURRENT_A[:50], 0.7, axis_deg)
    np.testing.assert_allclose(axis_current_a(w, u, v, axis_deg + 120.0), axis_current_a(u, v, w, axis_deg), atol=1e-9)
    assert axis_current_a(u, v, w, axis_deg + 360.0) == pytest.approx(axis_current_a(u, v, w, axis_deg), abs=1e-9)
