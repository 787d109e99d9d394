"""The verdict on hand-made evidence: axes are compared where the iron was equally deep."""

import csv
import math
from dataclasses import replace
from pathlib import Path

import pytest

from commissioner.identify.estimate.held_back import HeldBack
from commissioner.identify.excite.duration import LongerTest
from commissioner.identify.intake.dc_link import LinkCourse
from commissioner.motor.circuit import PARAMETERS, SYMBOLS, InverseGamma, Quantity
from commissioner.motor.nameplate import prior
from commissioner.procedure.verdict import Decision, Evidence, decide
from commissioner.settings import load_motor, load_procedure

MOTORS = Path(__file__).parents[2] / "data" / "motors" / "motors.csv"
PLATE = load_motor("motor_2kw2")
VALUES = {
    name: Quantity(value, 0.001 * value)
    for name, value in zip(PARAMETERS, prior(PLATE).typical.as_tuple(), strict=True)
}
ACCEPTANCE = load_procedure(None, axes_deg=None).acceptance


def with_magnetizing(factor):
    l_m = VALUES["magnetizing_inductance_h"]
    return {**VALUES, "magnetizing_inductance_h": Quantity(factor * l_m.value, l_m.std)}


def test_axes_that_agree_at_one_flux_are_not_apart_because_one_went_deeper_into_the_iron():
    axes = ((0.0, VALUES), (60.0, with_magnetizing(0.9)))
    alike = ((0.0, VALUES), (60.0, with_magnetizing(1.001)))
    evidence = Evidence(VALUES, axes, at_one_flux=alike)
    assert decide(evidence, PLATE, ACCEPTANCE, write_back=True).decision is Decision.WRITE_BACK


def test_axes_that_differ_at_one_flux_are_objected_to():
    alike = ((0.0, VALUES), (60.0, with_magnetizing(0.9)))
    verdict = decide(Evidence(VALUES, alike, at_one_flux=alike), PLATE, ACCEPTANCE, write_back=True)
    assert verdict.decision is Decision.REJECT
    assert "magnetizing_inductance_h differs" in verdict.reason


def test_without_saturation_the_values_themselves_are_compared():
    axes = ((0.0, VALUES), (60.0, with_magnetizing(0.9)))
    evidence = replace(Evidence(VALUES, axes), at_one_flux=())
    assert decide(evidence, PLATE, ACCEPTANCE, write_back=True).decision is Decision.REJECT


def test_no_longer_test_is_asked_for_where_it_would_not_make_the_value_surer():
    """Twice the time leaves the first three as they are and narrows the last by the root of two."""
    longer = LongerTest(9.2, (0.1,) * 4, (0.1, 0.1, 0.099, 0.0707))
    wide = {name: Quantity(value.value, 0.1 * value.value) for name, value in VALUES.items()}
    evidence = replace(Evidence(wide, ((0.0, wide),)), beyond_time=longer.in_vain_for)
    told = {o.what.split()[0]: o.remedy for o in decide(evidence, PLATE, ACCEPTANCE, write_back=True).objections}
    assert set(told) == set(PARAMETERS)
    asks_for_time = {name for name, remedy in told.items() if remedy.startswith("lengthen")}
    assert (
        asks_for_time
        == {"magnetizing_inductance_h"}
        == {n for n, s in zip(PARAMETERS, SYMBOLS, strict=True) if f"{s} " in longer.sentence}
    )
    assert all("longer test would not" in told[name] for name in PARAMETERS if name not in asks_for_time)


def small_motor():
    """The 0.18 kW machine of the table in the place of a 1.1 kW one."""
    with MOTORS.open(encoding="utf-8") as file:
        rows = {row["id"]: row for row in csv.DictReader(file)}
    row = min((r for r in rows.values() if r["use_for_mc"] == "1"), key=lambda r: float(r["P_kW"]))
    assert float(row["P_kW"]) < 0.2
    return InverseGamma(
        float(row["Rs_ohm"]), float(row["R_R_ohm"]), 1e-3 * float(row["L_sgm_mH"]), 1e-3 * float(row["L_M_mH"])
    )


def sure_of(machine):
    return {name: Quantity(v, 1e-3 * v) for name, v in zip(PARAMETERS, machine.as_tuple(), strict=True)}


def test_a_small_motor_on_a_large_motors_plate_is_never_good_enough():
    plate = replace(PLATE, rated_power_w=1100.0, rated_current_a=2.6, rated_speed_rpm=1415.0, power_factor=0.79)
    values = sure_of(small_motor())
    verdict = decide(Evidence(values, ((0.0, values),)), plate, ACCEPTANCE, write_back=True)
    assert verdict.decision is Decision.REJECT
    assert "rated current" in verdict.reason or "copper loss" in verdict.reason


def test_copper_loss_beyond_the_plates_losses_is_an_objection_of_its_own():
    """Current and box are right, the winding's resistance alone is not."""
    values = sure_of(replace(prior(PLATE).typical, stator_resistance_ohm=8.0))
    losses_w = 3**0.5 * 400.0 * PLATE.rated_current_a * PLATE.power_factor - PLATE.rated_power_w
    assert 3 * 8.0 * PLATE.rated_current_a**2 > losses_w
    verdict = decide(Evidence(values, ((0.0, values),)), PLATE, ACCEPTANCE, write_back=True)
    assert verdict.decision is Decision.REJECT and "copper loss" in verdict.reason


@pytest.mark.parametrize(("unusual", "word"), [
    ({"unlike": (("the current sensors' gains differ", -0.02),)}, "gains differ"), ({"lost_samples": 3}, "lost"), ({"guard_acted": True}, "flux guard"),
])  # fmt: skip
def test_what_is_only_unusual_is_rejected_where_that_was_asked_for(unusual, word):
    evidence = replace(Evidence(VALUES, ((0.0, VALUES),)), **unusual)
    assert decide(evidence, PLATE, ACCEPTANCE, write_back=True).decision is Decision.WRITE_BACK
    strict = decide(evidence, PLATE, load_procedure(strict=True).acceptance, write_back=True)
    assert strict.decision is Decision.REJECT and word in strict.reason and strict.objections[0].remedy
    assert (
        decide(
            Evidence(VALUES, ((0.0, VALUES),)), PLATE, load_procedure(strict=True).acceptance, write_back=True
        ).decision
        is Decision.WRITE_BACK
    )


def test_a_drive_that_limits_silently_is_the_first_reason():
    """However sure the values are: a current held back at 5 A made R_s 5 % too large, told to 0.9 %, and it was written."""
    held = HeldBack("current", 5.1, "A", 3.4)
    verdict = decide(Evidence(VALUES, ((0.0, VALUES),), held_back=((60.0, held),)), PLATE, ACCEPTANCE, write_back=True)
    assert verdict.decision is Decision.REJECT
    assert verdict.reason.startswith("the drive limits its current at axis 60 deg and does not say so")
    assert "5.1 A: 3.4 V are missing there" in verdict.reason


@pytest.mark.parametrize(
    ("factor", "is_written"), [(1000.0, False), (1e-5, False), (0.1, True), (10.0, True), (0.0, True)]
)
def test_a_held_value_that_no_motor_has_keeps_anything_from_being_written(factor, is_written):
    """One that some motor has may be another motor's, and is replaced."""
    name = "leakage_inductance_h"
    evidence = Evidence(VALUES, ((0.0, VALUES),), held={name: factor * VALUES[name].value})
    verdict = decide(evidence, PLATE, ACCEPTANCE, write_back=True)
    assert (verdict.decision is Decision.WRITE_BACK) is is_written
    assert is_written or f"with {1 / factor:g} times the scale" in verdict.objections[0].remedy
    assert decide(evidence, PLATE, ACCEPTANCE, write_back=False).decision is Decision.KEEP


def test_a_shaft_that_turned_is_the_reason_where_it_makes_values_too_uncertain():
    evidence = replace(Evidence(VALUES, ((0.0, VALUES),)), turned=((0.0, 0.4, 0.004), (60.0, 2.0, 0.08)))
    verdict = decide(evidence, PLATE, ACCEPTANCE, write_back=True)
    assert [o.what for o in verdict.objections] == ["the shaft turned during the test of axis 60 deg"]
    assert "2 rad/s" in str(verdict.objections[0].value)
    still = replace(evidence, turned=((0.0, 0.4, 0.004),))
    assert decide(still, PLATE, ACCEPTANCE, write_back=True).decision is Decision.WRITE_BACK


def scaled(factor):
    return {name: Quantity(factor * value.value, value.std) for name, value in VALUES.items()}


def objections(link, *tests, **more):
    axes = tuple((60.0 * number, values) for number, values in enumerate(tests))
    evidence = replace(Evidence(VALUES, axes, link=link), **more)
    return [o.what for o in decide(evidence, PLATE, ACCEPTANCE, write_back=True).objections]


def test_a_link_that_moved_before_the_tests_makes_every_value_doubtful():
    """486 V where 540 V were: an uncorrected drive applies 0.9 of what it is commanded, and all four values come out as 1/0.9."""
    moved = LinkCourse(486.0, 540.0, (486.0, 486.0))
    assert objections(moved, VALUES, VALUES) == ["the DC link moved between the tests"]
    assert moved.doubt == pytest.approx(0.05, abs=0.003)


def test_values_that_follow_the_link_are_those_of_a_drive_that_does_not_correct_for_it():
    between = LinkCourse(520.0, 545.0, (520.0, 545.0))
    assert objections(between, scaled(545.0 / 520.0), VALUES) == ["the DC link moved between the tests"]


def test_a_drive_that_corrects_for_its_link_is_not_objected_to():
    between = LinkCourse(486.0, 540.0, (486.0, 540.0))
    assert objections(between, VALUES, VALUES) == []


def test_a_test_in_which_the_link_moved_says_nothing_of_whether_the_drive_corrects():
    """Its look saw 540 V, its test 486 V, as the tests after it did: their values agree, and are all wrong."""
    within = LinkCourse(486.0, 540.0, (math.nan, 486.0))
    assert objections(within, VALUES, VALUES) == ["the DC link moved between the tests"]


@pytest.mark.parametrize("lowest_v", [531.0, 540.0])
def test_a_link_that_stood_still_or_was_not_seen_is_no_objection(lowest_v):
    """By less than R_s may be uncertain: half of 9 V in 535 V is 0.8 %."""
    assert objections(LinkCourse(lowest_v, 540.0, (540.0, lowest_v)), VALUES, VALUES) == []
    assert objections(None, VALUES, VALUES) == []


@pytest.mark.parametrize(("of_largest", "decision"), [(1.15, Decision.KEEP), (1.25, Decision.REJECT)])
def test_iron_that_a_small_test_does_not_saturate_is_the_plates_own(of_largest, decision):
    """The box holds at rated flux; an honest 18.5 kW motor tested at 0.6 of the flux limit showed 1.055 of its largest L_M and was refused."""
    most_h = prior(PLATE).upper.magnetizing_inductance_h
    values = {**VALUES, "magnetizing_inductance_h": Quantity(of_largest * most_h, 0.001 * most_h)}
    verdict = decide(Evidence(values, ((0.0, values),)), PLATE, ACCEPTANCE, write_back=False)
    assert verdict.decision is decision, verdict.reason
