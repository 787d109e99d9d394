"""What a plate says: rated flux, prior box, contradictions."""

from __future__ import annotations

import dataclasses

import pytest

from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import Nameplate, check, prior, rated_flux
from tests.support.standstill import usable_motors

PLATE = Nameplate(2200.0, 400.0, 50.0, 5.0, 1436.0, 0.8, 2, "star")


def test_rated_flux_of_the_published_example_is_0_689_wb_rms_and_0_974_wb_peak():
    flux = rated_flux(PLATE, 3.7)
    assert flux.stator_rms_wb == pytest.approx(0.689, abs=5e-4)
    assert flux.stator_peak_wb == pytest.approx(0.974, abs=5e-4)


def test_without_resistance_the_peak_is_line_voltage_over_omega_times_sqrt_two_thirds():
    assert rated_flux(PLATE, 0.0).stator_peak_wb == pytest.approx(1.0396, abs=1e-4)


def test_connection_does_not_change_the_star_equivalent():
    delta = dataclasses.replace(PLATE, connection="delta")
    assert rated_flux(delta, 3.7) == rated_flux(PLATE, 3.7)


def test_prior_box_contains_all_35_published_machines():
    outside = [m.name for m in usable_motors() if not prior(m.plate).contains(InverseGamma(*m.truth))]
    assert outside == []


def test_only_the_textbook_plates_whose_current_cannot_carry_their_power_are_refused():
    refused = {m.name for m in usable_motors() if check(m.plate)}
    assert refused == {"krause_3hp", "krause_50hp", "krause_500hp", "krause_2250hp"}


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"rated_speed_rpm": 1500.0}, "rated_speed_rpm"),
        ({"rated_speed_rpm": 2900.0}, "rated_speed_rpm"),
        ({"rated_power_w": 22000.0}, "rated_power_w"),
        ({"power_factor": 1.2}, "power_factor"),
        ({"connection": "triangle"}, "connection"),
        ({"rated_current_a": float("nan")}, "rated_current_a"),
        ({"pole_pairs": 0}, "pole_pairs"),
    ],
)
def test_an_impossible_plate_names_the_key(change, key):
    problems = check(dataclasses.replace(PLATE, **change))
    assert problems[0].key == key
    assert problems[0].expected
