"""A segment whose current is noise alone, beside one that carries a current, is told as what it is: the motor was taken off between tests."""

import dataclasses

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.identify.intake.audit import audit
from commissioner.motor.space_vector import phase_cosines
from commissioner.records import StandstillRecording
from tests.support.standstill import linear_current, multitone

PERIOD_S = 2e-4
TRUTH = (18.5, 8.6, 0.074, 0.371)
TONES = [(9.0, 0.8, 0.0), (7.0, 4.3, 1.1), (11.0, 9.0, 2.3), (12.0, 20.5, 0.4)]


def recorded(carried=1.0, seed=1, noise_a=0.02, step_a=0.0, offset_a=0.0):
    """Two segments of four tones; the second carries this share of its current, in each phase's own noise."""
    rng = np.random.default_rng(seed)
    voltage = multitone(TONES, 3.0, PERIOD_S)
    whole = linear_current(TRUTH, voltage, PERIOD_S)
    axis = np.concatenate([whole, carried * whole])
    cosines = np.array(phase_cosines(0.0))[:, None]
    phases = (
        cosines * axis + noise_a * rng.standard_normal((3, axis.size)) + offset_a * np.array([[1.0], [-0.7], [0.4]])
    )
    if step_a:
        phases = step_a * np.round(phases / step_a)
    time_s = np.concatenate([np.arange(whole.size), 60_000 + np.arange(whole.size)]) * PERIOD_S
    segment = np.repeat([0, 1], whole.size)
    return StandstillRecording(
        time_s, segment, np.zeros(axis.size), np.concatenate([voltage, voltage]), *phases, None, PERIOD_S
    )  # fmt: skip


@pytest.mark.parametrize(("step_a", "offset_a"), [(0.0, 0.0), (0.01, 0.0), (0.0, 0.05)])
@pytest.mark.parametrize("seed", range(1, 9))
def test_noise_alone_is_no_current(seed, step_a, offset_a):
    """Eight seeds of it were said to answer before the voltage, to flow against it, or beside the axis."""
    with pytest.raises(DataRefused) as refusal:
        audit(recorded(0.0, seed, step_a=step_a, offset_a=offset_a))
    assert refusal.value.what == "segment 1 carries no current"
    assert "noise" in str(refusal.value.value) and "contactor" in refusal.value.remedy


@pytest.mark.parametrize("carried", [1.0, 0.1, 0.03])
def test_a_current_that_is_lost_in_noise_but_driven_is_one(carried):
    """Down to a third of the noise."""
    audit(recorded(carried))


def test_a_current_that_is_nothing_at_all_is_none():
    rec = recorded()
    still = np.where(rec.segment == 1, 0.0, 1.0)
    with pytest.raises(DataRefused, match="segment 1 carries no current"):
        audit(dataclasses.replace(
            rec, current_u_a=still * rec.current_u_a, current_v_a=still * rec.current_v_a, current_w_a=still * rec.current_w_a
        ))  # fmt: skip
