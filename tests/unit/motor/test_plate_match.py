"""Every machine of the table fits its own plate; another motor, another connection, a foreign scale do not."""

import csv
import math
from dataclasses import FrozenInstanceError, replace
from pathlib import Path

import pytest

from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import Nameplate, check, prior
from commissioner.motor.plate_match import (
    CURRENT_RATIO,
    MOST_INDUCTIVE,
    PlateMatch,
    PlateMismatch,
    current_mismatch,
    inductance_mismatch,
    mismatch,
    plate_match,
    plate_point,
    rated_point,
    sure_mismatch,
)
from commissioner.motor.running import equal_leakages, stator_impedance
from commissioner.settings import load_motor

TABLE = Path(__file__).parents[2] / "data" / "motors" / "motors.csv"
PLATE = load_motor("motor_2kw2")


def machines():
    """(name, parameters, plate) of the usable machines; what a source does not state is computed at the slip of its rated power."""
    with TABLE.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if row["use_for_mc"] != "1":
                continue
            frequency, pairs = float(row["f_Hz"]), int(float(row["poles"])) // 2
            speed = row["n_n_rpm"] or 60.0 * frequency / pairs * (1.0 - float(row["slip_calc"]))
            plate = Nameplate(
                1e3 * float(row["P_kW"]), float(row["V_LL"]), frequency, float(row["I_n_A"] or row["I_calc_A"]), float(speed),
                float(row["pf_n"] or row["pf_calc"]), pairs, "star",
            )  # fmt: skip
            parameters = InverseGamma(
                float(row["Rs_ohm"]), float(row["R_R_ohm"]), 1e-3 * float(row["L_sgm_mH"]), 1e-3 * float(row["L_M_mH"])
            )
            yield row["id"], parameters, plate


USABLE = list(machines())
KNOWN = [machine for machine in USABLE if not check(machine[2])]
"""Those whose plate can be true."""
UNLIKE = ("et_19kw", "krause_3hp", "krause_50hp", "s4a_0k25", "db_0k18")
"""Of these one factor 1.27 ... 1.7 lies between the plate's motor and them: a scale of 2 and another connection look alike."""


def scaled(machine, factor):
    return InverseGamma(*(factor * value for value in machine.as_tuple()))


def test_there_are_machines_with_plates():
    assert (len(USABLE), len(KNOWN)) == (35, 31)


def inductance(machine):
    return machine.leakage_inductance_h + machine.magnetizing_inductance_h


def drawn_over_the_plates(machine, plate):
    """Geometric mean of current, active and reactive power."""
    drawn = rated_point(machine, plate)
    said = plate_point(plate, drawn)
    pairs = zip((drawn.current_a, drawn.power_w, drawn.reactive_var), (said.current_a, said.power_w, said.reactive_var),
                strict=True)  # fmt: skip
    return math.prod(a / b for a, b in pairs) ** (1 / 3)


@pytest.mark.parametrize(
    ("ratio", "least", "most"),
    [
        (lambda machine, plate: plate_match(machine, plate).current_ratio, 0.83, 1.59),
        (lambda machine, plate: inductance(machine) / inductance(prior(plate).typical), 0.63, 1.33),
        (drawn_over_the_plates, 0.83, 1.56),
    ],
    ids=["current", "inductance", "scale"],
)
def test_the_ranges_are_those_of_the_table(ratio, least, most):
    seen = [ratio(machine, plate) for _, machine, plate in USABLE]
    assert (min(seen), max(seen)) == pytest.approx((least, most), abs=0.005)


@pytest.mark.parametrize(("name", "machine", "plate"), KNOWN, ids=[name for name, *_ in KNOWN])
def test_a_machine_fits_its_own_plate(name, machine, plate):
    match = plate_match(machine, plate)
    assert mismatch(match, plate) is None
    assert inductance_mismatch(inductance(machine), 0.0, plate) is None
    low, high = match.unseen_gain
    assert low <= 1.0 <= high


@pytest.mark.parametrize(("name", "machine", "plate"), USABLE, ids=[name for name, *_ in USABLE])
def test_star_for_delta_and_the_reverse_are_named(name, machine, plate):
    delta = replace(plate, connection="delta")
    star_for_delta = mismatch(plate_match(scaled(machine, 3.0), delta), delta).what
    delta_for_star = mismatch(plate_match(scaled(machine, 1 / 3), plate), plate).what
    says = "may be" if name in UNLIKE else "is"
    assert star_for_delta.startswith("the motor") and "wired in star where the plate says delta" in star_for_delta
    assert delta_for_star.startswith("the motor") and "wired in delta where the plate says star" in delta_for_star
    assert f"{says} wired" in star_for_delta + delta_for_star


@pytest.mark.parametrize(("name", "machine", "plate"), KNOWN, ids=[name for name, *_ in KNOWN])
@pytest.mark.parametrize("factor", [math.sqrt(3.0), 2.0])
def test_a_current_scale_is_not_called_a_connection(name, machine, plate, factor):
    if name in UNLIKE:
        return
    for off, of in ((factor, replace(plate, connection="delta")), (1.0 / factor, plate)):
        found = mismatch(plate_match(scaled(machine, off), of), of)
        assert found is None or "is wired" not in found.what


@pytest.mark.parametrize(("name", "machine", "plate"), KNOWN, ids=[name for name, *_ in KNOWN])
@pytest.mark.parametrize("factor", [1 / 3, 1.0, 10.0, 0.1])
def test_what_another_connection_does_not_explain_is_not_called_one(name, machine, plate, factor):
    """A delta plate's motor cannot have a third of its impedances by its wiring, nor ten times them."""
    delta = replace(plate, connection="delta")
    found = mismatch(plate_match(scaled(machine, factor), delta), delta)
    assert (found is None) if factor == 1.0 else ("wired" not in found.what and "factor 3" in found.remedy)


def test_the_ratios_are_those_of_the_circuit():
    machine = prior(PLATE).typical
    omega = 2 * math.pi * PLATE.rated_frequency_hz
    slip = 1 - PLATE.rated_speed_rpm * PLATE.pole_pairs / (60 * PLATE.rated_frequency_hz)
    impedance = stator_impedance(equal_leakages(machine), omega, slip)
    current_a = PLATE.rated_voltage_v / math.sqrt(3) / abs(impedance)
    losses_w = math.sqrt(3) * PLATE.rated_voltage_v * PLATE.rated_current_a * PLATE.power_factor - PLATE.rated_power_w
    match = plate_match(machine, PLATE)
    assert match.current_ratio == pytest.approx(current_a / PLATE.rated_current_a)
    assert match.copper_loss_ratio == pytest.approx(
        3 * machine.stator_resistance_ohm * PLATE.rated_current_a**2 / losses_w
    )
    assert match.impedance_ratio == pytest.approx(1.0)
    assert plate_match(scaled(machine, 2.0), PLATE).impedance_ratio == pytest.approx(2.0)


def test_a_plate_without_losses_leaves_nothing_for_the_copper():
    lossless = replace(PLATE, rated_power_w=math.sqrt(3) * 400.0 * PLATE.rated_current_a * PLATE.power_factor)
    assert plate_match(prior(PLATE).typical, lossless).copper_loss_ratio > 1e9


@pytest.mark.parametrize(
    ("current", "copper", "what"),
    [
        (CURRENT_RATIO[0], 0.5, None),
        (CURRENT_RATIO[1], 0.5, None),
        (1.0, 1.0, None),
        (CURRENT_RATIO[0] - 1e-9, 0.5, "another rated current"),
        (CURRENT_RATIO[1] + 1e-9, 0.5, "another rated current"),
        (1.0, 1.0 + 1e-9, "copper loss"),
        (0.1, 9.0, "another rated current"),
    ],
)
def test_the_bounds_are_where_they_are_said_to_be(current, copper, what):
    found = mismatch(PlateMatch(current, copper, 1.0), PLATE)
    assert (found is None) if what is None else (what in found.what and found.limit and found.remedy)
    if what == "copper loss":
        assert (found.value, found.limit) == (copper, "1")
    elif what:
        assert found.value == current and "0.66 ... 1.66" in found.limit


@pytest.mark.parametrize(
    ("current", "impedances", "connection", "says"),
    [
        (1 / 3, 3.0, "delta", "is wired in star where the plate says delta: all its impedances are three times"),
        (0.2201, 3.0, "delta", "is wired in star"), (0.2199, 3.0, "delta", "all impedances are 3 times"),
        (0.5, 3.002, "delta", "is wired in star"), (0.5, 3.001, "delta", "may be wired in star"),
        (0.5533, 2.0, "delta", "may be wired in star"), (0.5534, 2.0, "delta", "all impedances are 2 times"),
        (0.25, 9.0, "delta", "is wired in star"),
        (3.0, 1 / 3, "star", "is wired in delta where the plate says star: all its impedances are a third of"),
        (1.981, 0.33, "star", "is wired in delta"), (1.979, 0.33, "star", "all impedances are 0.33 times"),
        (4.979, 1.0, "star", "may be wired in delta"), (4.981, 1.0, "star", "all impedances are 1 times"),
        (1 / 3, 3.0, "star", "all impedances are 3 times"), (3.0, 1 / 3, "delta", "all impedances are 0.33 times"),
    ],
)  # fmt: skip
def test_the_connection_is_named_where_the_other_one_would_make_the_plates_motor(current, impedances, connection, says):
    plate = replace(PLATE, connection=connection)
    found = mismatch(PlateMatch(current, 0.1, impedances), plate)
    assert says in f"{found.what}; {found.remedy}"
    assert ("wire the motor in" in found.remedy) is ("wired" in says)


def test_the_first_inductance_is_bounded_upwards_alone():
    typical_h = inductance(prior(PLATE).typical)
    assert inductance_mismatch(0.01 * typical_h, 0.0, PLATE) is None
    found = inductance_mismatch(MOST_INDUCTIVE * typical_h * 1.001, 0.0, PLATE)
    assert "inductance" in found.what and found.value == pytest.approx(MOST_INDUCTIVE * 1.001)
    assert "at most 1.95" in found.limit
    delta = replace(PLATE, connection="delta")
    for factor in (MOST_INDUCTIVE * 1.001, 3.0, 2.999 * MOST_INDUCTIVE):
        says = "is" if factor > 2.45 else "may be"  # iron that is not saturated shows more than three times as much
        assert f"{says} wired in star" in inductance_mismatch(factor * typical_h, 0.0, delta).what
        assert "wired" not in inductance_mismatch(factor * typical_h, 0.0, PLATE).what
    unsure = inductance_mismatch(3.0 * typical_h, 0.5 * typical_h, delta)
    assert "is wired in star" in unsure.what and unsure.value == pytest.approx(3.0)
    assert inductance_mismatch(3.0 * typical_h, 0.53 * typical_h, delta) is None
    assert "wired" not in inductance_mismatch(3.001 * MOST_INDUCTIVE * typical_h, 0.0, delta).what


def test_a_first_inductance_whose_range_reaches_a_star_for_delta_names_it():
    """A 22 kW motor's first current told 6.3 +- 1.6 times the plate's typical inductance, of 4.4 that it had: the wiring was not named."""
    typical_h = inductance(prior(PLATE).typical)
    delta = replace(PLATE, connection="delta")
    assert "is wired in star" in inductance_mismatch(6.3 * typical_h, 1.6 * typical_h, delta).what
    assert "wired" not in inductance_mismatch(6.3 * typical_h, 0.1 * typical_h, delta).what
    assert "wired" not in inductance_mismatch(6.3 * typical_h, 1.6 * typical_h, PLATE).what


@pytest.mark.parametrize(
    ("over", "connection", "says"),
    [
        (1.45, "star", None), (0.3, "star", None), (1.46, "star", "may be wired in delta"), (2.44, "star", "may be wired in delta"),
        (2.45, "star", "is wired in delta"), (3.2, "star", "is wired in delta"), (1.45, "delta", None),
        (2.0, "delta", "draws more than the plate's motor would; all impedances are 0.5 times what"),
        (4.0, "delta", "draws more than the plate's motor would; all impedances are 0.25 times what"),
    ],
)  # fmt: skip
def test_what_a_test_draws_names_a_delta_for_a_star_alone(over, connection, says):
    found = current_mismatch(over, replace(PLATE, connection=connection))
    if says is None:
        assert found is None
    else:
        assert says in f"{found.what}; {found.remedy}"
        assert (found.value, found.limit) == (over, "at most 1.45 times the plate's typical")


def test_the_largest_first_inductance_is_still_the_plates():
    """Of plates whose typical inductance times the limit is no rounded number."""
    plates = [plate for _, _, plate in KNOWN]
    pairs = [(plate, inductance(prior(plate).typical)) for plate in plates]
    even = [
        (plate, typical_h) for plate, typical_h in pairs if MOST_INDUCTIVE * typical_h / typical_h == MOST_INDUCTIVE
    ]
    assert even
    for plate, typical_h in even:
        assert inductance_mismatch(MOST_INDUCTIVE * typical_h, 0.0, plate) is None
        assert inductance_mismatch(MOST_INDUCTIVE * typical_h * (1.0 + 1e-9), 0.0, plate) is not None


def test_an_unseen_gain_is_the_ratio_over_the_bounds():
    assert PlateMatch(1.2, 0.5, 1.0).unseen_gain == pytest.approx((1.2 / 1.66, 1.2 / 0.66))


@pytest.mark.parametrize("record", [PlateMatch(1.2, 0.5, 1.0), PlateMismatch("x", 1.0, "y", "z")])
def test_what_was_found_stays(record):
    with pytest.raises(FrozenInstanceError):
        record.value = 2.0


@pytest.mark.parametrize(("std_share", "is_sure"), [(0.0, True), (0.2, True), (0.4, False)])
def test_a_copper_loss_contradicts_the_plate_where_it_is_sure(std_share, is_sure):
    """R_s at twice what all the plate's losses allow: 0.2 of it as a standard error leaves 1.2 times, 0.4 leaves 0.4 times."""
    plate = load_motor("motor_2kw2")
    machine = prior(plate).typical
    loss = plate_match(machine, plate).copper_loss_ratio
    hot = replace(machine, stator_resistance_ohm=2.0 / loss * machine.stator_resistance_ohm)
    assert mismatch(plate_match(hot, plate), plate) is not None
    assert (sure_mismatch(hot, std_share * hot.stator_resistance_ohm, plate) is not None) is is_sure
    assert sure_mismatch(machine, 0.0, plate) is None


def test_a_resistance_that_is_not_known_at_all_hides_no_other_contradiction():
    """Twice its standard error is more than R_s itself: the rated current of three times the impedances contradicts all the same."""
    plate = load_motor("motor_2kw2")
    threefold = InverseGamma(*(3.0 * value for value in prior(plate).typical.as_tuple()))
    assert sure_mismatch(threefold, threefold.stator_resistance_ohm, plate) is not None


def test_a_copper_loss_that_is_not_known_at_all_contradicts_no_plate():
    """Of a large motor, where a hundredth of the resistance is not a hundredth of an ohm."""
    small = load_motor("motor_2kw2")
    plate = replace(small, rated_power_w=500.0 * small.rated_power_w, rated_current_a=500.0 * small.rated_current_a)
    machine = prior(plate).typical
    loss = plate_match(machine, plate).copper_loss_ratio
    hot = replace(machine, stator_resistance_ohm=2.0 / loss * machine.stator_resistance_ohm)
    assert sure_mismatch(hot, 0.0, plate) is not None
    assert sure_mismatch(hot, hot.stator_resistance_ohm, plate) is None


def test_a_resistance_is_taken_for_no_less_than_a_part_of_itself():
    """Below nothing it would draw 1.69 times the rated current, and contradict this plate for certain."""
    machine, plate = next((machine, plate) for name, machine, plate in KNOWN if name == "et_19kw")
    loss = plate_match(machine, plate).copper_loss_ratio
    hot = replace(machine, stator_resistance_ohm=1.5 / loss * machine.stator_resistance_ohm)
    assert sure_mismatch(hot, 0.0, plate) is not None
    assert sure_mismatch(hot, hot.stator_resistance_ohm, plate) is None
