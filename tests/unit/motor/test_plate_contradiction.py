"""Plate against data: a scale or a mix-up is named with both values, an honest motor is not."""

import math
from dataclasses import replace

import numpy as np
import pytest

from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import Nameplate, check
from commissioner.motor.plate_match import contradiction, doubt, plate_point, rated_point
from tests.campaigns.intake.plate import FACTORS, case, scaled
from tests.support.standstill import usable_motors

HONEST = [m for m in usable_motors() if not check(m.plate)]


@pytest.mark.parametrize("motor", HONEST, ids=lambda m: m.name)
def test_published_machines_belong_to_their_plates(motor):
    assert contradiction(rated_point(InverseGamma(*motor.truth), motor.plate), motor.plate) is None


@pytest.mark.parametrize("factor", [*FACTORS, *(1.0 / f for f in FACTORS)])
def test_a_factor_of_all_currents_is_named_with_both_values(factor):
    random = np.random.default_rng(7)
    named = []
    for _ in range(10):
        seen, plate = case(random)
        found = contradiction(scaled(seen, factor), plate)
        if found is not None:
            named.append(found)
            assert found.likely is None or abs(math.log(found.likely / factor)) < 0.35
            assert " A from the data, " in found.value and "--trust" in found.remedy
    # sqrt 3 lies nearest to what honest motors differ by
    assert len(named) >= (8 if factor < 1.8 and factor > 0.5 else 10)


def test_a_campaign_of_scale_errors_and_honest_points():
    random = np.random.default_rng(3)
    honest = [contradiction(*case(random)) for _ in range(200)]
    wrong = [contradiction(scaled(point, random.choice(FACTORS) ** random.choice([-1, 1])), plate)
             for point, plate in (case(random) for _ in range(200))]  # fmt: skip
    assert sum(c is not None for c in honest) <= 1
    assert sum(c is not None for c in wrong) >= 198


def test_a_peak_value_for_an_rms_one_is_said_and_seldom_of_honest_points():
    random = np.random.default_rng(11)
    points = [case(random) for _ in range(200)]
    told = [contradiction(*p) is not None or doubt(*p) != "" for p in points]
    assert sum(told) <= 4
    for factor in (math.sqrt(2.0), math.sqrt(0.5)):
        wrong = [(scaled(point, factor), plate) for point, plate in points]
        assert sum(contradiction(*p) is not None or "peak" in doubt(*p) for p in wrong) >= 170
    assert not any(doubt(scaled(point, 2.0), plate) for point, plate in points[:20])


def test_at_the_rated_point_the_plates_motor_draws_the_plates_values():
    plate = Nameplate(2200.0, 400.0, 50.0, 4.9, 1436.0, 0.80, 2, "star")
    rated = rated_point(InverseGamma(3.7, 2.122, 0.020934, 0.22477), plate)
    said = plate_point(plate, rated)
    assert said.current_a == pytest.approx(4.9, rel=0.02)
    assert said.power_w == pytest.approx(math.sqrt(3) * 400 * 4.9 * 0.80, rel=0.03)


def test_a_plate_read_across_two_lines_names_the_readings_that_would_fit():
    plate = Nameplate(2250.0, 400.0, 50.0, 8.42, 1436.0, 0.78, 2, "star")
    (problem,) = check(plate)
    assert "0.494" in problem.expected and "4.86 A" in problem.expected and "230.9 V" in problem.expected
    assert not check(replace(plate, rated_current_a=4.86)) and not check(replace(plate, rated_voltage_v=230.9))


@pytest.mark.parametrize("wrong", [{"rated_frequency_hz": 60.0}, {"pole_pairs": 1}, {"pole_pairs": 3}])
def test_frequency_and_poles_of_another_line_are_refused(wrong):
    plate = Nameplate(2200.0, 400.0, 50.0, 4.9, 1436.0, 0.80, 2, "star")
    assert not check(plate)
    assert any(p.key == "rated_speed_rpm" for p in check(replace(plate, **wrong)))
