"""Current and power over the plate's: drawn in closed form, judged at the limits, each mix-up by the values that make it."""

import csv
import math
from dataclasses import FrozenInstanceError, astuple, replace

import numpy as np
import pytest

from commissioner.motor.circuit import InverseGamma
from commissioner.motor.plate_match import (
    Contradiction,
    OperatingPoint,
    _factor,
    contradiction,
    disagreement,
    doubt,
    plate_point,
    rated_point,
)
from commissioner.motor.running import from_nameplate
from tests.unit.motor.test_plate_match import KNOWN, PLATE, TABLE, scaled

RATED = OperatingPoint(400.0 / math.sqrt(3.0), 50.0, 1.0 - 1436.0 / 1500.0, 5.0, 2771.281, 2078.461)
"""Of 2.2 kW, 400 V, 50 Hz, 5 A, 1436 1/min, cos phi 0.80."""
IDS = [name for name, *_ in KNOWN]


def meshes(r_s, l_s, l_m, r_r, l_r, at):
    """Both currents of two coupled windings, by their mesh equations."""
    w = 2.0 * math.pi * at.frequency_hz
    coupled = np.array([[r_s + 1j * w * l_s, 1j * w * l_m], [1j * w * l_m, r_r / at.slip + 1j * w * l_r]])
    return np.linalg.solve(coupled, [at.voltage_v, 0.0])


def times(point, factor):
    """The same with currents that read `factor` times what they are."""
    return replace(
        point, current_a=factor * point.current_a, power_w=factor * point.power_w, reactive_var=factor * point.reactive_var,
    )  # fmt: skip


def exactly(factor):
    """A point with this factor to the last digit."""
    said = plate_point(PLATE, RATED)
    point = times(said, factor)
    near = (replace(point, reactive_var=point.reactive_var * (1.0 + k * 2.0**-52)) for k in range(-20, 21))
    return next(at for at in near if _factor(at, said) == factor)


# --- what is drawn --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("name", "machine", "plate"), KNOWN, ids=IDS)
def test_at_its_rated_point_the_plates_motor_draws_what_the_plate_says(name, machine, plate):
    at = replace(RATED, voltage_v=plate.rated_voltage_v / math.sqrt(3.0), frequency_hz=plate.rated_frequency_hz,
                 slip=plate.rated_slip)  # fmt: skip
    apparent_va = math.sqrt(3.0) * plate.rated_voltage_v * plate.rated_current_a
    said = plate_point(plate, at)
    assert astuple(said)[:3] == astuple(at)[:3]
    assert astuple(said)[3:] == pytest.approx(
        (plate.rated_current_a, apparent_va * plate.power_factor, apparent_va * math.sqrt(1.0 - plate.power_factor**2))
    )


@pytest.mark.parametrize(
    ("voltage_v", "frequency_hz", "slip"), [(115.0, 40.0, 0.1), (230.0, 60.0, 0.01), (40.0, 50.0, 1.0)]
)
def test_elsewhere_its_windings_turn_power_into_heat_and_reactive_power_into_flux(voltage_v, frequency_hz, slip):
    said = plate_point(PLATE, OperatingPoint(voltage_v, frequency_hz, slip, 0.0, 0.0, 0.0))
    it = from_nameplate(PLATE)
    stator, rotor = meshes(
        it.stator_resistance_ohm, it.stator_inductance_h, it.magnetizing_inductance_h,
        it.rotor_resistance_ohm, it.rotor_inductance_h, said,
    )  # fmt: skip
    square = [abs(i) ** 2 for i in (stator, rotor, stator + rotor)]
    heat_w = it.stator_resistance_ohm * square[0] + it.rotor_resistance_ohm / slip * square[1]
    flux_wb_a = np.dot([it.stator_leakage_h, it.rotor_leakage_h, it.magnetizing_inductance_h], square)
    assert astuple(said) == pytest.approx(
        (voltage_v, frequency_hz, slip, abs(stator), 3.0 * heat_w, 3.0 * 2.0 * math.pi * frequency_hz * flux_wb_a)
    )


@pytest.mark.parametrize(("name", "machine", "plate"), KNOWN, ids=IDS)
def test_a_machine_draws_at_rated_slip_what_its_meshes_do(name, machine, plate):
    r_s, r_r, leakage_h, main_h = machine.as_tuple()
    drawn = rated_point(machine, plate)
    stator, _ = meshes(r_s, leakage_h + main_h, main_h, r_r, main_h, drawn)
    apparent = 3.0 * drawn.voltage_v * np.conj(stator)
    assert astuple(drawn) == pytest.approx(
        (plate.rated_voltage_v / math.sqrt(3.0), plate.rated_frequency_hz, plate.rated_slip, abs(stator), apparent.real,
         apparent.imag)
    )  # fmt: skip


def test_the_tables_computed_current_and_power_factor_are_drawn():
    with TABLE.open(encoding="utf-8") as file:
        rows = {row["id"]: row for row in csv.DictReader(file)}
    for name, machine, plate in KNOWN:
        row, synchronous_rpm = rows[name], 60.0 * plate.rated_frequency_hz / plate.pole_pairs
        drawn = rated_point(machine, replace(plate, rated_speed_rpm=synchronous_rpm * (1.0 - float(row["slip_calc"]))))
        power_factor = drawn.power_w / math.hypot(drawn.power_w, drawn.reactive_var)
        assert (drawn.current_a, power_factor) == pytest.approx(
            (float(row["I_calc_A"]), float(row["pf_calc"])), rel=2e-5
        )


# --- the limits -----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("edge", "outwards"), [(0.70, -1.0), (1.58, 1.0)])
def test_a_contradiction_begins_beyond_its_limits(edge, outwards):
    assert contradiction(exactly(edge), PLATE) is None
    found = contradiction(times(RATED, edge + outwards * 1e-6), PLATE)
    assert found.factor == pytest.approx(edge, abs=2e-6) and found.limit == "0.7 ... 1.58 times the plate's"


@pytest.mark.parametrize(("edge", "outwards"), [(0.80, -1.0), (1.25, 1.0)])
def test_a_doubt_begins_beyond_what_is_usual(edge, outwards):
    assert doubt(exactly(edge), PLATE) == ""
    assert f"{edge:.3g} times the current and power" in doubt(times(RATED, edge + outwards * 1e-6), PLATE)


@pytest.mark.parametrize(("edge", "outwards"), [(0.70, -1.0), (1.58, 1.0)])
def test_a_doubt_ends_where_a_contradiction_begins(edge, outwards):
    assert f"{edge:.3g} times the current and power" in doubt(exactly(edge), PLATE)
    assert doubt(times(RATED, edge + outwards * 1e-6), PLATE) == ""


@pytest.mark.parametrize("factor", [0.81, 1.0, 1.24])
def test_the_plates_own_motor_is_neither_contradicted_nor_doubted(factor):
    assert contradiction(times(RATED, factor), PLATE) is None and doubt(times(RATED, factor), PLATE) == ""


@pytest.mark.parametrize(("factor", "said"), [(math.sqrt(2.0), "1.41 times"), (math.sqrt(0.5), "0.707 times")])
def test_peak_values_of_currents_alone_are_doubted(factor, said):
    assert contradiction(times(RATED, factor), PLATE) is None
    doubted = doubt(times(RATED, factor), PLATE)
    assert said in doubted and "a peak value taken for an rms one" in doubted


@pytest.mark.parametrize(
    ("current", "power", "reactive", "mean"), [(8.0, 1.0, 1.0, 2.0), (1.0, 27.0, 1.0, 3.0), (1.0, 1.0, 64.0, 4.0)]
)
def test_the_factor_is_the_geometric_mean_of_three(current, power, reactive, mean):
    seen = replace(
        RATED, current_a=current * RATED.current_a, power_w=power * RATED.power_w, reactive_var=reactive * RATED.reactive_var,
    )  # fmt: skip
    assert contradiction(seen, PLATE).factor == pytest.approx(mean)


# --- nothing to compare ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "seen",
    [replace(times(RATED, 5.0), **{name: value})
     for name in ("current_a", "power_w", "reactive_var") for value in (0.0, -0.5, math.nan) if (name, value) != ("power_w", -0.5)]
    + [replace(RATED, voltage_v=0.0), replace(RATED, slip=-0.04, power_w=-RATED.power_w)],
)  # fmt: skip
def test_what_draws_no_power_or_gives_it_is_not_compared(seen):
    assert contradiction(seen, PLATE) is None and doubt(seen, PLATE) == ""


@pytest.mark.parametrize(
    ("seen", "way"), [(replace(times(RATED, 5.0), power_w=-0.5), "takes"), (replace(RATED, slip=-0.04), "gives back")]
)
def test_power_that_flows_the_other_way_by_more_than_the_rated_one_is_contradicted(seen, way):
    assert f"the plate's machine {way}" in contradiction(seen, PLATE).what


def test_less_than_an_ampere_and_a_watt_is_compared():
    """At a hundredth of the voltage 0.05 A, 0.28 W and 0.21 var are drawn."""
    small = replace(RATED, voltage_v=0.01 * RATED.voltage_v, current_a=0.05, power_w=0.277, reactive_var=0.208)
    assert contradiction(times(small, 2.0), PLATE).factor == pytest.approx(2.0, rel=2e-3)
    assert contradiction(small, PLATE) is None
    assert "1.41 times" in doubt(times(small, 1.412), PLATE)


# --- what may be behind it ------------------------------------------------------------------------------------------
def of_voltage(read):
    """The voltage reads `read` times what it is, and the powers with it."""
    return replace(
        RATED, voltage_v=read * RATED.voltage_v, power_w=read * RATED.power_w, reactive_var=read * RATED.reactive_var,
    )  # fmt: skip


def wired(impedances):
    """The plate's own motor with all its impedances so many times."""
    return rated_point(scaled(from_nameplate(PLATE).as_inverse_gamma(), impedances), PLATE)


@pytest.mark.parametrize(
    ("seen", "likely", "why"),
    [
        (wired(3.0), 1.0 / 3.0, "star and delta mixed up: impedances differ by 3"),
        (wired(1.0 / 3.0), 3.0, "star and delta mixed up: impedances differ by 3"),
        (of_voltage(math.sqrt(3.0)), math.sqrt(1.0 / 3.0), "line and phase values, mixed up"),
        (times(RATED, math.sqrt(1.0 / 3.0)), math.sqrt(1.0 / 3.0), "line and phase values, mixed up"),
        (times(RATED, math.sqrt(3.0)), math.sqrt(3.0), "line and phase values, mixed up"),
        (times(RATED, 2.0), 2.0, "a turns or a terminal factor"),
        (of_voltage(0.1), 10.0, "a probe's or a range's factor 10"),
        (times(RATED, 0.01), 0.01, "a factor 100"),
        (times(RATED, 1e3), 1e3, "milli taken for whole units"),
        (times(RATED, 1e-3), 1e-3, "milli taken for whole units"),
    ],
    ids=["star for delta", "delta for star", "line voltage for phase", "winding current for line", "line current for winding",
         "clamp with two turns", "voltage probe", "range", "milliampere", "kiloampere"],
)  # fmt: skip
def test_a_mix_up_is_named_by_the_values_that_it_makes(seen, likely, why):
    found = contradiction(seen, PLATE)
    assert (found.factor, found.likely) == pytest.approx((likely, likely), rel=1e-6)
    assert found.what.endswith(f"{why}?)") and "--trust plate or --trust data" in found.remedy


def test_both_values_and_the_point_are_said():
    found = contradiction(times(RATED, 2.0), PLATE)
    assert found.what == (
        "the data do not belong to this plate: at 400 V, 50 Hz and a slip of 0.0427 they give 2 times the plate's current "
        "and power (a probe, a turns or a terminal factor?)"
    )
    assert found.value == "10 A from the data, 5 A from the plate"


@pytest.mark.parametrize(
    ("factor", "likely"),
    [
        (1.59, math.sqrt(3.0)), (1.86, math.sqrt(3.0)), (1.87, 2.0), (2.44, 2.0), (2.46, 3.0), (3.92, 3.0), (3.94, None),
        (7.62, None), (7.65, 10.0), (13.0, 10.0), (13.2, None), (76.2, None), (76.5, 100.0), (130.0, 100.0), (132.0, None),
        (762.0, None), (765.0, 1000.0), (1300.0, 1000.0), (1320.0, None),
    ],
)  # fmt: skip
def test_the_nearest_usual_factor_is_named_within_exp_0_27(factor, likely):
    for way in (1.0, -1.0):
        found = contradiction(times(RATED, factor**way), PLATE)
        if likely is None:
            assert found.likely is None and found.what.endswith("times the plate's current and power")
        else:
            assert found.likely == likely**way and found.what.endswith("?)")


@pytest.mark.parametrize("record", [RATED, Contradiction("x", 2.0, 1.0, "A", 2.0, None, "1", "y")])
def test_what_was_found_stays(record):
    with pytest.raises(FrozenInstanceError):
        record.factor = 1.0


def test_a_published_machine_wired_otherwise_is_contradicted_in_its_class():
    """All impedances three times: at the same slip a third of the current and of both powers, whatever the machine."""
    for name, machine, plate in KNOWN:
        right, wrong = (rated_point(scaled(machine, k), plate) for k in (1.0, 3.0))
        assert astuple(wrong)[3:] == pytest.approx([x / 3.0 for x in astuple(right)[3:]]), name
        assert contradiction(wrong, plate).factor < 0.7, name


def test_a_circuit_by_hand():
    """R_s 1 ohm, leakage 4 ohm, R_R / s of 25 ohm beside 25 ohm of main reactance: 1 + 4j + 12.5 (1 + j) = 13.5 + 16.5j ohm."""
    w = PLATE.rated_frequency_rad_per_s
    drawn = rated_point(InverseGamma(1.0, 25.0 * PLATE.rated_slip, 4.0 / w, 25.0 / w), PLATE)
    current_a = 400.0 / math.sqrt(3.0) / math.hypot(13.5, 16.5)
    assert astuple(drawn)[3:] == pytest.approx((current_a, 3 * 13.5 * current_a**2, 3 * 16.5 * current_a**2))


@pytest.mark.parametrize(
    ("off", "is_one"), [(1.0, True), (1.04, True), (1.05, False), (1 / 1.04, True), (1 / 1.05, False)]
)
def test_one_number_is_said_where_current_and_powers_have_it_in_common(off, is_one):
    """A current that is `off` beside both powers is off by two thirds of it beside the mean: 3 % at exp(0.045)."""
    point = times(RATED, 2.5)
    what = contradiction(replace(point, current_a=off * point.current_a), PLATE).what
    if is_one:
        assert (
            f"they give {2.5 * off ** (1 / 3):.3g} times" in what
            and "times the plate's current and power" in what
            and "mean" not in what
        )
    else:
        mean = 2.5 * off ** (1 / 3)
        assert (
            f"{2.5 * off:.3g} times the plate's current, 2.5 times its active and 2.5 times its reactive power, {mean:.3g} times in"
            in what
        )


def test_three_ratios_disagree_by_the_largest_over_the_smallest():
    assert disagreement(times(RATED, 2.5), PLATE) == pytest.approx(0.0, abs=1e-6)
    one = replace(RATED, current_a=2.0 * RATED.current_a, power_w=0.25 * RATED.power_w)
    assert disagreement(one, PLATE) == pytest.approx(math.log(8.0), abs=1e-6)
    assert disagreement(replace(RATED, power_w=-RATED.power_w), PLATE) == math.inf


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_power_that_flows_the_other_way_than_the_slip_lets_it_is_said(way):
    """Of a motor and of a generator, from the rated power on between the two; below, losses may make up for it."""
    at = replace(RATED, slip=way * RATED.slip)
    said = plate_point(PLATE, at)
    assert math.copysign(1.0, said.power_w) == way
    seen = replace(said, current_a=3.0 * said.current_a, power_w=-said.power_w)
    found = contradiction(seen, PLATE)
    assert found.likely is None and found.factor == pytest.approx(3.0)
    does = "takes" if way > 0.0 else "gives back"
    assert f"show {seen.power_w:.4g} W, where the plate's machine {does} {abs(said.power_w):.4g} W" in found.what
    assert contradiction(replace(said, power_w=-way * 1e-4), PLATE) is not None
    idling = plate_point(PLATE, replace(RATED, slip=way * 0.01))
    for share in (0.999, 1.001):
        other = replace(idling, power_w=idling.power_w - way * share * PLATE.rated_power_w)
        assert other.power_w * idling.power_w < 0.0
        assert (contradiction(other, PLATE) is not None) is (share > 1.0)


def test_a_power_of_none_contradicts_nothing():
    assert contradiction(replace(RATED, power_w=0.0), PLATE) is None
    assert contradiction(replace(RATED, reactive_var=-RATED.reactive_var), PLATE) is None
