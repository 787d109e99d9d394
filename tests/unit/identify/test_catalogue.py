"""A motor from its manufacturer's sheet: closed forms of double-cage machines, published circuits, a real plate; contradictions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.identify.catalogue import machine as per_unit
from commissioner.identify.catalogue.answer import answer
from commissioner.identify.catalogue.contradictions import settled
from commissioner.identify.catalogue.document import document
from commissioner.identify.catalogue.evidence import evidence_of
from commissioner.identify.catalogue.fit import fit
from commissioner.identify.catalogue.sheet import Sheet, Value
from tests.campaigns.intake.catalogue import PARTS, START, Machine, covered, of_published, share

NUMBERS = np.array([[0.03, 2.2, 0.022, 0.06, 0.09, 1.4, 3.1, 0.02, 0.006, 0.01, 1.0]])
ELEVEN_KW = {
    "rated_power_w": 11000, "rated_voltage_v": 400, "rated_frequency_hz": 50, "rated_speed_rpm": 1465, "rated_current_a": 21.5,
    "power_factor": 0.81, "efficiency": 0.914, "starting_current_ratio": 7.4, "starting_torque_ratio": 2.3, "breakdown_torque_ratio": 2.9,
}  # fmt: skip


def sheet(**changed: float | None) -> Sheet:
    given = {k: v for k, v in {**ELEVEN_KW, **changed}.items() if v is not None}
    return Sheet({k: Value(float(v), 0.0 if k.startswith("rated_") else 0.5e-3) for k, v in given.items()})


def test_two_parallel_cages_are_the_dispersive_branch_at_every_slip():
    r_1, x_1, r_2, x_2 = per_unit.cages(NUMBERS)[0]
    slip = np.geomspace(1e-3, 1.0, 9)
    branch = per_unit.rotor_branch(NUMBERS, slip[None])[0]
    assert branch == pytest.approx(1 / (1 / (r_1 / slip + 1j * x_1) + 1 / (r_2 / slip + 1j * x_2)), rel=1e-9)
    assert 0 < r_1 < r_2 and 0 < x_2 < x_1


def test_the_performance_is_that_of_the_closed_form():
    r_1, x_1, r_2, x_2 = per_unit.cages(NUMBERS)[0]
    base_w, _shaft = 3 * (400 / math.sqrt(3)) ** 2, 0.75
    n = NUMBERS[0]
    true = Machine(
        n[0], n[4], n[1], 1 / n[7], ((r_1, x_1), (r_2, x_2)), n[10], n[8] * base_w, n[9] * base_w, 400.0, 50.0, 2
    )
    found = {k: float(v[0]) for k, v in per_unit.performance(NUMBERS, 0.75).items()}
    slip = found["rated_slip"]
    rated = abs(true.current(slip)[0])
    assert true.shaft(slip, 400 / math.sqrt(3)) == pytest.approx(0.75 * base_w, rel=1e-6)
    assert found["rated_current"] == pytest.approx(rated / (400 / math.sqrt(3)), rel=1e-9)
    assert found["starting_current_ratio"] == pytest.approx(abs(true.current(1.0, n[10])[0]) / rated, rel=1e-9)
    torque = 0.75 * base_w / (1 - slip)
    assert found["starting_torque_ratio"] == pytest.approx(true.gap(1.0, n[10]) / torque, rel=1e-9)
    assert found["breakdown_torque_ratio"] == pytest.approx((true.pull_out() - true.friction_w) / torque, rel=1e-5)
    four = per_unit.inverse_gamma(NUMBERS, np.array([slip]))[0] * [1, 1, 1 / 314.159265, 1 / 314.159265]
    assert four == pytest.approx(true.truth(slip), rel=1e-6)


@pytest.mark.parametrize("is_another", [False, True])
@pytest.mark.parametrize("without", [(), (*PARTS, *START)])
def test_the_true_circuit_lies_within_the_stated_errors(is_another, without):
    of = covered(12, 8, without, is_another)
    inside = share(np.abs(of.sigmas) < 2, of.sigmas)
    assert inside.mean() >= 0.95 and inside.min() >= 0.85
    assert np.nanmedian(of.stated, axis=0) == pytest.approx(np.zeros(4), abs=0.45)
    assert np.nanmedian(of.stated[:, 1]) < (0.16 if is_another else 0.06)
    assert np.nanmedian(np.abs(of.off), axis=0).max() < 0.3


def test_published_single_cage_machines_lie_within_the_errors_of_their_pages():
    of = of_published(every=4)
    assert of.sigmas.shape == (9, 4)
    assert np.mean(np.abs(of.sigmas) < 2) >= 0.85 and np.abs(of.sigmas).max() < 3.5
    assert np.median(np.abs(of.off), axis=0).max() < 0.25


def test_the_plate_of_a_real_200_kw_motor_says_what_its_type_test_measured():
    plate = Sheet(
        {
            "rated_power_w": Value(200e3, 0.0), "rated_voltage_v": Value(1146, 0.0), "rated_frequency_hz": Value(60.7, 0.0),
            "rated_current_a": Value(121, 0.5), "rated_speed_rpm": Value(1800, 0.5), "rated_slip": Value(0.0122, 5e-5),
            "efficiency": Value(0.936, 5e-4), "rated_torque_nm": Value(1059, 0.5),
        }
    )  # fmt: skip
    found = answer(settled(plate, frozenset()))
    assert (
        set(found.withheld) == {"leakage_inductance_h"} and "breakdown torque" in found.withheld["leakage_inductance_h"]
    )
    rotor, main = found.parameters["rotor_resistance_ohm"], found.parameters["magnetizing_inductance_h"]
    assert abs(rotor.value - 0.0684) < 2 * rotor.std < 0.4 * rotor.value
    no_load_h = 1191 / math.sqrt(3) / 50.39 / (2 * math.pi * 60.7)
    assert abs(main.value - no_load_h) < 2 * main.std < 0.5 * main.value
    stator = found.parameters.get("stator_resistance_ohm")
    warm = 0.1517 / 2 * (234.5 + 85) / (234.5 + 45.5)
    assert stator is not None and abs(stator.value - warm) < 2 * stator.std


def test_a_winding_resistance_narrows_the_stators_and_the_parts_of_an_error_add_up():
    without = answer(sheet()).parameters["stator_resistance_ohm"]
    given = answer(sheet(winding_resistance_uv_ohm=0.46)).parameters["stator_resistance_ohm"]
    assert given.std < 0.25 * without.std
    assert given.value == pytest.approx(0.23 * (234.5 + 85) / (234.5 + 20), rel=0.05)
    assert without.std == pytest.approx(math.hypot(without.rounding, without.assumptions, without.tolerances))
    assert without.rounding < without.of_type < without.std


def test_the_fit_meets_the_values_and_is_deterministic():
    evidence = evidence_of(sheet())
    assert evidence is not None
    found, again = fit(evidence), fit(evidence)
    assert found.numbers.tolist() == again.numbers.tolist()
    assert all(abs(r.reproduced / r.given - 1.0) < 0.02 for r in answer(sheet()).rows)


@pytest.mark.parametrize(
    ("changed", "says", "trust"),
    [
        ({"efficiency": 0.80}, "contradict the efficiency", "current"),
        ({"rated_power_w": 14751.0}, r"contradict the efficiency \(horse power for kW\?\)", "efficiency"),
        ({"rated_voltage_v": 230.9}, r"contradict the efficiency \(star and delta", "efficiency"),
        ({"efficiency": 0.99}, "efficiency and speed contradict", "speed"),
        ({"rated_torque_nm": 7.31}, r"the rated torque contradicts power and speed \(kg m for N m", "power"),
        ({"rated_slip": 0.05}, "rated slip and rated speed contradict", "speed"),
        ({"rated_speed_rpm": 1765.0}, r"the rated speed does not belong .* \(it fits 60 Hz", None),
        ({"starting_current_ratio": 0.74}, "the starting current is below the rated one", "rated"),
        ({"breakdown_torque_ratio": 0.9}, "the breakdown torque is below the rated one", "rated"),
        ({"starting_torque_ratio": 3.4}, "the starting torque is above the breakdown torque", "breakdown"),
        ({"starting_current_a": 74.0}, "starting current and its ratio contradict", "ratio"),
    ],
)
def test_a_contradiction_is_refused_by_name_unless_somebody_says_what_is_right(changed, says, trust):
    with pytest.raises(DataRefused, match=says) as refusal:
        settled(sheet(**changed), frozenset())
    assert refusal.value.value and refusal.value.limit and "correct the sheet" in refusal.value.remedy
    if trust is not None:
        assert f"--trust {trust}" in refusal.value.remedy
        decided = settled(sheet(**changed), frozenset({trust, "efficiency", "current"}))
        assert "trusted, as told" in decided.remarks[0]


def test_what_a_sheet_lacks_is_withheld_with_what_would_tell_it():
    found = answer(sheet(rated_speed_rpm=None, pole_pairs=2, starting_torque_ratio=None, breakdown_torque_ratio=None, efficiency=None,
                         starting_current_ratio=None, rated_current_a=None))  # fmt: skip
    assert "rotor_time_constant_s" not in found.parameters and {"rotor_resistance_ohm", "leakage_inductance_h"} <= set(
        found.withheld
    )
    assert found.cages == {} and found.t_circuit == {} and found.plate is None
    assert any("the rated speed or slip" in r for r in document(found)["remarks"])


@pytest.mark.parametrize("missing", ["rated_voltage_v", "rated_frequency_hz"])
def test_a_sheet_that_says_nothing_is_refused_with_what_is_missing(missing):
    with pytest.raises(DataRefused, match="says too little") as refusal:
        answer(sheet(**{missing: None}))
    assert missing.split("_")[1] in str(refusal.value.limit)
