"""What limits a test does not trust what was measured further than the plate and the measurement's own error allow."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from commissioner.motor.circuit import InverseGamma, Quantity
from commissioner.motor.nameplate import prior
from commissioner.procedure.course import Findings
from commissioner.procedure.energised.staircase import KNOWN_TOP, _Stair
from commissioner.procedure.steps import AT_WORST, PLATE_RESISTANCE_STD
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


def test_no_measured_resistance_moves_the_flux_limit_beyond_what_the_plate_allows():
    job = _job()
    box, at_typical_wb = prior(job.nameplate), job.flux_limit_wb(prior(job.nameplate).typical.stator_resistance_ohm)
    for absurd_ohm in (10.0, 1e3, 1e6):
        limit_wb = job.flux_limit_wb(absurd_ohm * box.typical.stator_resistance_ohm)
        assert 0.7 * at_typical_wb < limit_wb <= at_typical_wb


@pytest.mark.parametrize(("seen_ohm", "end"), [(-1.0, "lower"), (1e3, "upper")])
def test_a_staircase_of_nonsense_leaves_a_resistance_of_the_plate(seen_ohm, end):
    job = _job()
    stair = SimpleNamespace(stator_resistance=Quantity(seen_ohm, 0.01))
    assert Findings(staircases=[stair]).resistance_ohm(job) == getattr(prior(job.nameplate), end).stator_resistance_ohm


def test_a_staircase_that_tells_nothing_leaves_the_plates_resistance_and_a_sure_one_its_own():
    job = _job()
    typical_ohm = prior(job.nameplate).typical.stator_resistance_ohm
    unsure, sure = (
        SimpleNamespace(stator_resistance=Quantity(value * typical_ohm, std * typical_ohm))
        for value, std in ((0.0, 2.0), (0.6, 0.01))
    )
    assert Findings(staircases=[unsure]).resistance_ohm(job) == pytest.approx(typical_ohm, rel=0.1)
    assert Findings(staircases=[sure]).resistance_ohm(job) == pytest.approx(0.6 * typical_ohm, rel=0.01)


def test_look_staircase_and_plate_count_by_their_standard_errors():
    job = _job()
    typical_ohm = prior(job.nameplate).typical.stator_resistance_ohm
    value_ohm, std_ohm = 0.4 * typical_ohm, PLATE_RESISTANCE_STD * typical_ohm
    look = SimpleNamespace(parameters=replace(FOUND, stator_resistance_ohm=value_ohm), std=(std_ohm, 0.0, 0.0, 0.0))
    stair = SimpleNamespace(stator_resistance=Quantity(value_ohm, std_ohm))
    seen_ohm = Findings(look=look, staircases=[stair]).resistance_ohm(job)
    assert seen_ohm == pytest.approx((1.0 + 0.4 + 0.4) / 3.0 * typical_ohm)


def test_a_look_without_a_standard_error_says_nothing_of_the_resistance():
    job = _job()
    look = SimpleNamespace(parameters=FOUND, std=(float("nan"), 0.0, 0.0, 0.0))
    assert Findings(look=look).resistance_ohm(job) == pytest.approx(prior(job.nameplate).typical.stator_resistance_ohm)
