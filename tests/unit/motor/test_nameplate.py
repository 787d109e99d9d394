"""What a plate says: rated flux, prior box, contradictions."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import (
    LEAST_SLIP_OF_LOSSES,
    Nameplate,
    check,
    plate_doubt,
    prior,
    rated_flux,
    typical_efficiency,
)
from commissioner.motor.quantities import plate_words
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


@pytest.mark.parametrize(
    ("pole_pairs", "rpm", "pairs"),
    [(2, 960.0, 3), (2, 2890.0, 1), (2, 720.0, 4), (1, 1436.0, 2), (4, 1436.0, 2), (1, 1000.0, 0), (1, 3600.0, 0)],
)
def test_a_speed_of_other_pole_pairs_says_of_which(pole_pairs, rpm, pairs):
    """3000, 1500, 1000, 750 1/min at 50 Hz; 1000 itself and 3600 are of none."""
    (problem,) = check(dataclasses.replace(PLATE, pole_pairs=pole_pairs, rated_speed_rpm=rpm))
    assert (f"is of {pairs} pole pair{'s' * (pairs > 1)})" if pairs else "pole pairs of one line") in problem.expected
    assert ("1/min at 50 Hz is of" in problem.expected) == bool(pairs)


IE5_4_POLES = {120: 0.743, 370: 0.843, 1100: 0.895, 4000: 0.928, 15000: 0.954, 75000: 0.970, 200000: 0.974}
"""IEC TS 60034-30-2 at 1500 1/min."""


@pytest.mark.parametrize(("power_w", "efficiency"), IE5_4_POLES.items())
def test_the_best_motors_pass_with_a_plate_rounded_by_a_per_cent(power_w, efficiency):
    current = power_w / (np.sqrt(3) * 400 * 0.8 * efficiency * 1.01)
    assert (
        check(dataclasses.replace(PLATE, rated_power_w=float(power_w), rated_current_a=current, power_factor=0.8)) == ()
    )


IE1_SLOW = {
    (120, 3): 0.383,
    (120, 4): 0.31,
    (180, 3): 0.455,
    (180, 4): 0.38,
    (250, 4): 0.434,
    (370, 4): 0.497,
    (550, 4): 0.561,
}
"""IEC 60034-30-1 at 1000 and 750 1/min."""


@pytest.mark.parametrize(("motor", "efficiency"), IE1_SLOW.items())
def test_small_motors_of_many_poles_pass_with_the_little_efficiency_that_they_have(motor, efficiency):
    power_w, pairs = motor
    current = power_w / (np.sqrt(3) * 400 * 0.6 * efficiency)
    slow = dataclasses.replace(
        PLATE, rated_power_w=float(power_w), rated_current_a=current, power_factor=0.6, pole_pairs=pairs,
        rated_speed_rpm=2700.0 / pairs,
    )  # fmt: skip
    assert check(slow) == ()


@pytest.mark.parametrize("power_w", [550.0, 2200.0, 75000.0])
def test_the_delta_current_beside_the_star_voltage_of_eight_poles_is_refused_all_the_same(power_w):
    efficiency = {550.0: 0.73, 2200.0: 0.819, 75000.0: 0.931}[power_w]  # IE3
    current = np.sqrt(3) * power_w / (np.sqrt(3) * 400 * 0.7 * efficiency)
    slow = dataclasses.replace(
        PLATE, rated_power_w=power_w, rated_current_a=current, power_factor=0.7, pole_pairs=4, rated_speed_rpm=710.0
    )
    (problem,) = check(slow)
    assert f"400 V with {current / np.sqrt(3):.3g} A would fit" in problem.expected


def test_a_small_motors_delta_voltage_beside_its_star_current_is_refused_with_the_sqrt_3():
    small = dataclasses.replace(
        PLATE, rated_power_w=120.0, rated_voltage_v=230.0, rated_current_a=0.42, power_factor=0.72
    )
    (problem,) = check(small)
    assert "0.43 ... 0.901 times" in problem.expected
    assert "(it is 0.996): 230 V with 0.727 A would fit, or 398.4 V with 0.42 A" in problem.expected


@pytest.mark.parametrize(
    ("volts", "amperes", "readings"),
    [
        (460.0, 38.0, "460 V with 19 A would fit, or 230 V with 38 A"),
        (230.0, 19.0, "230 V with 38 A would fit, or 460 V with 19 A"),
    ],
)
def test_the_low_voltages_current_beside_the_high_voltage_of_a_230_460_v_plate_is_refused_with_the_two(
    volts, amperes, readings
):
    """NEMA MG 1, 15 hp, 4 poles: 230/460 V, 38/19 A, 1765 1/min, efficiency 0.91."""
    plate = Nameplate(11190.0, volts, 60.0, amperes, 1765.0, 0.81, 2, "star")
    (problem,) = check(plate)
    assert readings in problem.expected


def test_the_electrical_input_given_as_the_power_is_refused():
    (problem,) = check(dataclasses.replace(PLATE, rated_power_w=2626.0, rated_current_a=4.86, power_factor=0.78))
    assert "the one at the shaft" in problem.expected


@pytest.mark.parametrize(
    ("plate", "said"),
    [
        ((3730.0, 400.0, 7.39629, 1480.4), "3.73 kW, 400 V star, 7.396 A, 1480 1/min"),
        ((20e6, 11000.0, 1250.5, 1493.0), "20000 kW, 11000 V star, 1250 A, 1493 1/min"),  # no 1.1e+04 V
    ],
)
def test_a_plate_is_told_to_four_digits_and_without_an_exponent(plate, said):
    names = ("rated_power_w", "rated_voltage_v", "rated_current_a", "rated_speed_rpm")
    assert plate_words(dict(zip(names, plate, strict=True)), "star") == said
    assert plate_words({"rated_power_w": 2200.0}) == ""


IE1 = {
    1: {120: 0.45, 180: 0.528, 370: 0.639, 750: 0.721, 2200: 0.797, 11000: 0.876, 90000: 0.93, 200000: 0.94},
    2: {120: 0.50, 180: 0.57, 370: 0.66, 750: 0.721, 2200: 0.797, 11000: 0.876, 90000: 0.93, 200000: 0.94},
    3: {120: 0.383, 180: 0.455, 370: 0.597, 750: 0.70, 2200: 0.777, 7500: 0.847, 90000: 0.93, 200000: 0.94},
    4: {120: 0.31, 180: 0.38, 370: 0.497, 750: 0.612, 2200: 0.719, 7500: 0.81, 30000: 0.885, 90000: 0.914},
}
"""IEC 60034-30-1 at 50 Hz: the least efficient motors on the market, by pole pairs and watts."""


def ie1_plates(share_of_losses=1.0):
    """Plates of motors with this share of the losses of IE1."""
    for pairs, motors in IE1.items():
        for power_w, efficiency in motors.items():
            better = 1.0 - share_of_losses * (1.0 - efficiency)
            yield dataclasses.replace(
                PLATE, rated_power_w=float(power_w), rated_current_a=power_w / (np.sqrt(3) * 400 * 0.75 * better),
                power_factor=0.75, pole_pairs=pairs, rated_speed_rpm=2850.0 / pairs,
            )  # fmt: skip


def test_no_plate_of_the_table_and_none_of_the_least_efficient_class_is_doubted():
    honest = [*(m.plate for m in usable_motors() if not check(m.plate)), *ie1_plates()]
    assert [plate for plate in honest if check(plate) or plate_doubt(plate)] == []


@pytest.mark.parametrize("share_of_losses", [1.0, 0.6])
def test_a_power_in_kw_taken_for_one_in_hp_is_doubted_from_2_kw_on_or_30_kw_of_slow_ones(share_of_losses):
    """IE1, and IE3 with 0.6 of its losses. Of smaller ones efficiency does not tell: an IE3 motor so read is an IE1 motor."""
    for plate in ie1_plates(share_of_losses):
        if plate.rated_power_w >= (2200.0 if plate.pole_pairs <= 2 else 30e3):
            misread = dataclasses.replace(plate, rated_power_w=0.7457 * plate.rated_power_w)
            said = plate_doubt(misread) or check(misread)[0].expected
            assert check(misread) or f"{plate.rated_power_w:.4g} W would fit, a number of kW taken for hp" in said


@pytest.mark.parametrize("power_w", [750.0, 2200.0, 90000.0])
def test_a_number_of_hp_taken_for_kw_is_refused_with_the_power_that_fits(power_w):
    (plate,) = (p for p in ie1_plates(0.6) if p.rated_power_w == power_w and p.pole_pairs == 2)
    (problem,) = check(dataclasses.replace(plate, rated_power_w=power_w / 0.7457))
    assert f"{power_w:.4g} W would fit, a number of hp taken for kW" in problem.expected


def test_a_small_motors_60_hz_beside_its_speed_at_50_hz_is_doubted():
    small = dataclasses.replace(
        PLATE, rated_power_w=180.0, rated_current_a=0.6, power_factor=0.7, rated_speed_rpm=1370.0
    )
    assert plate_doubt(small) == "" and check(small) == ()
    of_60 = dataclasses.replace(small, rated_frequency_hz=60.0)
    assert check(of_60) == () and "a slip of 0.24" in plate_doubt(of_60)


@pytest.mark.parametrize("motor", [m for m in usable_motors() if not check(m.plate)][::4], ids=lambda m: m.name)
def test_a_speed_next_to_the_synchronous_one_is_doubted(motor):
    synchronous_rpm = 60.0 * motor.plate.rated_frequency_hz / motor.plate.pole_pairs
    said = plate_doubt(dataclasses.replace(motor.plate, rated_speed_rpm=0.9993 * synchronous_rpm))
    assert "not the synchronous one" in said and "a slip of 0.0007" in said
    doubted_from = 1.0 - LEAST_SLIP_OF_LOSSES * (
        1.0 - typical_efficiency(motor.plate.rated_power_w, motor.plate.pole_pairs)
    )
    assert plate_doubt(dataclasses.replace(motor.plate, rated_speed_rpm=(doubted_from - 1e-6) * synchronous_rpm)) == ""


def test_no_plate_of_the_table_says_half_as_much_slip_as_is_doubted():
    """Measured: 0.121 of the typical losses at the least."""
    honest = [m.plate for m in usable_motors() if not check(m.plate)]
    least = min(p.rated_slip / (1.0 - typical_efficiency(p.rated_power_w, p.pole_pairs)) for p in honest)
    assert least == pytest.approx(0.121, abs=0.001)
