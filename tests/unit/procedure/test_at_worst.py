"""A direct current reckons with the largest inductance that a look at the motor allows."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from commissioner.motor.circuit import InverseGamma
from commissioner.procedure.course import Findings
from commissioner.procedure.energised.staircase import KNOWN_TOP, _Stair
from commissioner.procedure.steps import AT_WORST
from commissioner.records import DriveIdentity
from tests.unit.procedure.test_course import _job

FOUND = InverseGamma(3.7, 2.2, 0.024, 0.3)
IDENTITY = DriveIdentity("SIM", 1, "1", 1, 20.0, 2e-4, 5000.0)


def found(std_h):
    look = SimpleNamespace(parameters=FOUND, std=(0.01, 0.01, 1e-5, std_h), inverter=None)
    return Findings(identity=IDENTITY, look=look, estimate=FOUND, is_measured=True)


@pytest.mark.parametrize("std_h", [0.0, 0.003, 0.05])
def test_the_top_level_keeps_the_flux_of_the_worst_motor(std_h):
    job, findings = _job(), found(std_h)
    top_a = _Stair(job, findings, 0.0)._top_a
    worst_wb = top_a * (FOUND.leakage_inductance_h + FOUND.magnetizing_inductance_h + AT_WORST * std_h)
    assert worst_wb == pytest.approx(KNOWN_TOP * job.flux_limit_wb(findings.resistance_ohm(job)))


def test_only_l_m_is_doubted_and_only_where_there_was_a_look():
    worst = found(0.01).at_worst(FOUND)
    assert worst.magnetizing_inductance_h == pytest.approx(0.33)
    assert replace(worst, magnetizing_inductance_h=FOUND.magnetizing_inductance_h) == FOUND
    assert Findings().at_worst(FOUND) == FOUND
