"""What a direct current leaves in the rotor is gone before the tones begin: the guard starts from no flux."""

import math
from dataclasses import replace

import numpy as np
import pytest

from commissioner.motor.circuit import InverseGamma
from commissioner.procedure.course import Findings
from commissioner.procedure.energised.session import BIAS_RAMP_PER_S, LEFT, OFFSET_S, REST_STEP_S, rest
from commissioner.records import SampleBlock
from commissioner.safety.commands import Wait
from commissioner.study.commissioning import commissioned
from commissioner.study.specification import Case
from tests.unit.procedure.test_course import _job

SLOW = InverseGamma(0.2, 0.16, 0.004, 0.09)
ENERGISED = (0, SampleBlock(0, 0, 1e-4, 0.0, np.ones(1), np.ones(1), np.ones(1), None, 540.0))


@pytest.mark.parametrize("machine", [SLOW, replace(SLOW, rotor_resistance_ohm=0.05)])
def test_the_rest_lasts_until_a_tenth_of_the_flux_is_left(machine):
    job, findings = _job(), Findings(estimate=machine, blocks=[ENERGISED])
    waits = list(rest(job, findings))
    rested_s = sum(wait.seconds for wait in waits) + 1.0 / BIAS_RAMP_PER_S + OFFSET_S
    assert math.exp(-rested_s / machine.rotor_time_constant_s) == pytest.approx(LEFT)
    assert all(isinstance(wait, Wait) and 0.0 < wait.seconds <= REST_STEP_S for wait in waits)


def test_a_fast_motor_is_not_waited_for():
    fast = replace(SLOW, rotor_resistance_ohm=100.0 * SLOW.rotor_resistance_ohm)
    assert list(rest(_job(), Findings(estimate=fast, blocks=[ENERGISED]))) == []


def test_a_motor_that_was_not_energised_before_is_not_waited_for():
    assert list(rest(_job(), Findings(estimate=SLOW))) == []


def test_true_flux_stays_below_the_limit_where_a_staircase_leaves_much_of_it():
    """18.5 kW, rotor time constant 0.45 s: 1.05 of the limit was reached half a second after the second axis' staircase."""
    row = commissioned(Case(0, 1402414796, "commission", "msl_18kw5", 0.2, ("any",), None, "memory", (), (0.0, 60.0)))
    assert row["outcome"] == "commissioned" and row["effects"] == "dead_time"
    assert row["peak_flux_fraction"] < 1.0


def test_a_slow_motor_is_measured_along_its_second_axis_without_what_the_first_left():
    """19 kW, T_R 0.6 s: the flux left along the first axis drove 1.3 A beside the second, which was taken for a sensor's fault; before that
    points of a climb that was still building up flux made R_s zero, and the first look ran into the drive's own current limit."""
    row = commissioned(Case(0, 1275242802, "commission", "et_19kw", 0.2, ("any",), None, "memory", (), (0.0, 60.0)))
    assert (row["outcome"], row["effects"]) == ("commissioned", "dead_time sensor_gain_mismatch")
    assert row["peak_flux_fraction"] < 1.0
