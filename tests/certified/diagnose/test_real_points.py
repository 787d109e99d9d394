"""Measured type tests of two real motors: what a constant-parameter circuit gets wrong in them is named."""

import csv
from pathlib import Path

import numpy as np
import pytest

from commissioner.diagnose.points.diagnosis import diagnose_points
from commissioner.diagnose.points.table import read_points

DATA = Path(__file__).parents[2] / "data"


STATOR_OHM = {"siemens_200kw_type_test": 0.0758, "lab_1kw1_standard_tests": 6.93}
"""Per star phase, from the locked-rotor table and the lab's DC test."""


def diagnosed(folder, test):
    with (DATA / folder / f"{test}.csv").open() as file:
        rows = list(csv.DictReader(file))
    columns = {key: np.array([float(r[key]) for r in rows]) for key in rows[0]}
    seen = diagnose_points(read_points(columns, test), STATOR_OHM[folder])
    return {c.name: c for c in seen.causes}, seen


def test_the_200_kw_motor_shows_leakage_saturation_and_rotor_skin_effect():
    causes, seen = diagnosed("siemens_200kw_type_test", "locked_rotor")
    assert set(causes) == {"leakage_saturation", "rotor_skin_effect"}
    drop, spread, _ = causes["leakage_saturation"].sizes["inductance_drop_over_range"]
    assert 0.08 < drop < 0.16 and spread < 0.02
    assert causes["rotor_skin_effect"].sizes["resistance_rise_over_range"][0] > 0.05
    assert seen.held_out_gain > 0.9
    assert seen.rmse_after_a < 0.25 * seen.rmse_before_a


@pytest.mark.parametrize("folder", ["siemens_200kw_type_test", "lab_1kw1_standard_tests"])
def test_no_load_points_show_saturation_and_a_loss_that_grows_with_flux(folder):
    causes, seen = diagnosed(folder, "no_load")
    assert set(causes) == {"magnetizing_saturation", "iron_loss"}
    assert 1.0 < causes["iron_loss"].sizes["exponent"][0] < 4.0
    assert seen.held_out_gain > 0.9


def test_the_coarse_locked_rotor_points_of_the_lab_motor_carry_nothing_significant():
    causes, seen = diagnosed("lab_1kw1_standard_tests", "locked_rotor")
    assert not causes and seen.verdict == "nothing_significant"


def test_the_kind_of_test_is_told_from_the_numbers_alone():
    for folder in ("siemens_200kw_type_test", "lab_1kw1_standard_tests"):
        for test in ("locked_rotor", "no_load"):
            with (DATA / folder / f"{test}.csv").open() as file:
                rows = list(csv.DictReader(file))
            columns = {key: np.array([float(r[key]) for r in rows]) for key in rows[0]}
            assert read_points(columns, "table").is_locked == (test == "locked_rotor")
