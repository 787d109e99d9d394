"""The drive's conventions against closed forms: any two circuits must show the terminals the same impedance."""

import dataclasses
import math

import pytest

from commissioner.errors import CheckFailed, UsageError
from commissioner.link.files.drive_file import load_profile
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import Nameplate
from commissioner.registers.convention import CONVENTIONS, as_in_drive, drive_value, drive_values, our_values
from commissioner.registers.profile import Item

CIRCUIT = InverseGamma(3.2, 1.8, 0.026, 0.21)
PLATE = Nameplate(2200.0, 400.0, 50.0, 5.0, 1436.0, 0.8, 2, "star")


def value(name, convention, quantity="", plate=PLATE):
    return drive_value(Item(name, 0, "f32", convention=convention, quantity=quantity), CIRCUIT, plate)


def impedance_of_t(omega, leak_s, leak_r, main, rotor):
    branch = 1 / (1 / (1j * omega * main) + 1 / (1j * omega * leak_r + rotor))
    return 1j * omega * leak_s + branch


@pytest.mark.parametrize("omega", [0.7, 12.0, 314.0, 5000.0])
def test_each_circuit_shows_the_terminals_the_same_impedance(omega):
    _, r_r, l_sigma, l_m = CIRCUIT.as_tuple()
    inverse_gamma = impedance_of_t(omega, l_sigma, 0.0, l_m, r_r)
    t = impedance_of_t(
        omega,
        value("stator_leakage_inductance", "t_per_phase"),
        value("rotor_leakage_inductance", "t_per_phase"),
        value("magnetizing_inductance", "t_per_phase"),
        value("rotor_resistance", "t_per_phase"),
    )
    gamma = impedance_of_t(
        omega,
        0.0,
        value("leakage_inductance", "gamma_per_phase"),
        value("magnetizing_inductance", "gamma_per_phase"),
        value("rotor_resistance", "gamma_per_phase"),
    )
    assert t == pytest.approx(inverse_gamma, rel=1e-12)
    assert gamma == pytest.approx(inverse_gamma, rel=1e-12)


def test_line_to_line_is_twice_the_phase():
    assert value("stator_resistance", "line_to_line") == pytest.approx(6.4)


def test_a_reactance_is_taken_at_rated_frequency():
    assert value("leakage_inductance", "reactance_at_rated_frequency") == pytest.approx(2 * math.pi * 50 * 0.026)


def test_per_cent_is_of_rated_phase_impedance():
    base_ohm = 400 / math.sqrt(3) / 5
    assert value("stator_resistance", "percent_of_base_impedance") == pytest.approx(100 * 3.2 / base_ohm)
    assert value("leakage_inductance", "percent_of_base_impedance") == pytest.approx(
        100 * 2 * math.pi * 50 * 0.026 / base_ohm
    )


def test_the_time_constant_does_not_depend_on_the_circuit():
    assert value("rotor_time_constant", "time_constant") == pytest.approx(0.21 / 1.8)
    l_r = value("rotor_leakage_inductance", "t_per_phase") + value("magnetizing_inductance", "t_per_phase")
    assert l_r / value("rotor_resistance", "t_per_phase") == pytest.approx(0.21 / 1.8)


def test_stator_inductance_is_leakage_plus_main():
    assert value("stator_inductance", "per_phase") == pytest.approx(0.236)


def test_without_a_nameplate_a_reactance_is_refused():
    with pytest.raises(UsageError, match="reactance at rated frequency"):
        value("leakage_inductance", "t_reactance_at_rated_frequency", "stator_leakage_inductance", plate=None)


def test_a_quantity_that_the_circuit_does_not_have_is_refused():
    with pytest.raises(UsageError, match="says nothing about leakage_inductance"):
        value("leakage_inductance", "t_per_phase")
    with pytest.raises(UsageError):
        value("no_load_current", "per_phase")
    with pytest.raises(UsageError):
        value("stator_resistance", "")


def test_every_convention_can_say_the_stator_resistance():
    for convention in CONVENTIONS:
        assert value("stator_resistance", convention) > 0


@pytest.mark.parametrize("main", ["stator_inductance", "magnetizing_inductance"])
@pytest.mark.parametrize("stator", ["line_to_line", "t_line_to_line"])
def test_a_whole_circuit_is_read_back_whatever_its_stator_resistance_is_said_in(main, stator):
    circuits = {
        "gamma": {"rotor_resistance": "", "leakage_inductance": "", main: ""},
        "t": {"rotor_resistance": "", "stator_leakage_inductance": "", "rotor_leakage_inductance": "", "magnetizing_inductance": ""},
    }  # fmt: skip
    for circuit, quantities in circuits.items():
        items = {q: Item(q, 0, "f32", convention=f"{circuit}_per_phase") for q in quantities}
        items["stator_resistance"] = Item("stator_resistance", 0, "f32", convention=stator)
        profile = dataclasses.replace(load_profile("danfoss_fc302"), items=items)
        held = {q: drive_value(item, CIRCUIT, PLATE) for q, item in items.items()}
        ours = {one.field: one.value for one in our_values(profile, held, PLATE).values()}
        assert ours == pytest.approx(
            {
                "stator_resistance_ohm": CIRCUIT.stator_resistance_ohm,
                "rotor_resistance_ohm": CIRCUIT.rotor_resistance_ohm,
                "leakage_inductance_h": CIRCUIT.leakage_inductance_h,
                "magnetizing_inductance_h": CIRCUIT.magnetizing_inductance_h,
            },
            rel=1e-12,
        )


def test_per_cent_and_reactances_are_of_the_plate_in_the_drive():
    held = {"rated_voltage_v": 415.0, "rated_current_a": 4.8, "rated_frequency_hz": math.nan, "pole_pairs": 2.0}
    base = as_in_drive(PLATE, held)
    assert (base.rated_voltage_v, base.rated_current_a, base.rated_frequency_hz) == (415.0, 4.8, 50.0)
    percent = value("stator_resistance", "percent_of_base_impedance", plate=base)
    assert percent == pytest.approx(100 * 3.2 / (415.0 / (math.sqrt(3) * 4.8)))


@pytest.mark.parametrize(("scale", "fits"), [(0.001, True), (0.5, True), (10.0, False), (1.3, False)])
def test_a_value_that_its_registers_steps_would_change_is_not_written(scale, fits):
    item = Item("stator_resistance", 0, "u16", scale=scale, unit="ohm", convention="per_phase")
    yaskawa = load_profile("yaskawa_a1000")
    profile = dataclasses.replace(yaskawa, items={**yaskawa.items, item.name: item})
    if fits:
        assert drive_values(profile, CIRCUIT).values == {"stator_resistance": 3.2}
        return
    with pytest.raises(CheckFailed, match="counts in steps of"):
        drive_values(profile, CIRCUIT)
