"""Real motors: what the model says at standstill against locked-rotor readings, and plates against type tests."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from commissioner.motor.circuit import InverseGamma, from_t_model
from commissioner.motor.nameplate import Nameplate, check, prior, rated_flux
from commissioner.motor.standstill import admittance_s
from tests.support.standstill import usable_motors

DATA = Path(__file__).parent.parent / "data"
MOTORS = {m.name: m for m in usable_motors()}


def rows(*path: str) -> list[dict[str, str]]:
    with DATA.joinpath(*path).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def impedance(machine: InverseGamma, frequency_hz: float) -> complex:
    return complex(1.0 / admittance_s(machine, np.array([frequency_hz]))[0])


def measured(row: dict[str, str]) -> complex:
    """R + jX per star phase from line voltage, line current and three-phase power."""
    voltage, current, power = (float(row[k]) for k in ("voltage_line_v", "current_line_a", "power_w"))
    resistance = power / (3.0 * current**2)
    return complex(resistance, math.sqrt((voltage / math.sqrt(3.0) / current) ** 2 - resistance**2))


def test_lab_motor_at_standstill_has_its_measured_impedance():
    machine = InverseGamma(*MOTORS["lab_1k1"].truth)
    for row in rows("lab_1kw1_standard_tests", "locked_rotor.csv"):
        if 2.0 <= float(row["current_line_a"]) <= 3.2:
            seen, model = measured(row), impedance(machine, float(row["frequency_hz"]))
            assert model.real == pytest.approx(seen.real, rel=0.07)
            assert model.imag == pytest.approx(seen.imag, rel=0.07)


def test_traction_motor_reactance_is_measured_near_150_a_and_its_resistance_shows_the_deep_bars():
    machine = InverseGamma(*MOTORS["siemens_1tb1817"].truth)
    near = [r for r in rows("siemens_200kw_type_test", "locked_rotor.csv") if float(r["current_line_a"]) == 149]
    assert len(near) == 2
    for row in near:
        seen, model = measured(row), impedance(machine, float(row["frequency_hz"]))
        assert model.imag == pytest.approx(
            seen.imag, rel=0.06
        )  # the leakage itself falls 11 % over the test's currents
        hot = 0.5 * float(row["winding_resistance_uv_ohm"])
        bars = (seen.real - hot) / (model.real - machine.stator_resistance_ohm)
        assert 1.3 < bars < 1.8  # 0.102 ohm at 50 Hz, 0.115 ohm at 60.7 Hz against 0.072 ohm at rated slip


def test_two_small_lab_motors_at_standstill_have_their_measured_impedance():
    for row in rows("db_small_motors", "tests.csv"):
        if row["test"] != "locked_rotor":
            continue
        voltage = np.mean([float(row[k]) for k in ("V_ab_V", "V_bc_V", "V_ca_V")]) / math.sqrt(3.0)
        current = np.mean([float(row[k]) for k in ("I_a_A", "I_b_A", "I_c_A")])
        seen = voltage / current * np.exp(1j * math.acos(float(row["power_factor"])))
        model = impedance(InverseGamma(*MOTORS[{"1": "db_0k37", "2": "db_0k18"}[row["motor"]]].truth), 60.0)
        assert abs(model - seen) < 0.05 * abs(seen)  # resistance given at 20 C, the winding's temperature not recorded


def test_traction_motor_plate_bounds_what_its_type_test_found():
    plate = MOTORS["siemens_1tb1817"].plate
    box = prior(plate)
    locked = measured(rows("siemens_200kw_type_test", "locked_rotor.csv")[2])
    assert box.lower.leakage_inductance_h < locked.imag / (2 * math.pi * 50) < box.upper.leakage_inductance_h
    no_load = rows("siemens_200kw_type_test", "no_load.csv")
    stator_h = [
        float(r["voltage_line_v"]) / math.sqrt(3) / float(r["current_line_a"]) / (2 * math.pi * 60.7) for r in no_load
    ]
    assert all(box.lower.magnetizing_inductance_h < h < box.upper.magnetizing_inductance_h for h in stator_h)


def test_rated_flux_of_the_traction_motor_lies_between_the_no_load_points_that_enclose_it():
    plate = MOTORS["siemens_1tb1817"].plate
    flux = rated_flux(plate, 0.069).stator_rms_wb
    no_load = [
        float(r["voltage_line_v"]) / math.sqrt(3) / (2 * math.pi * 60.7)
        for r in rows("siemens_200kw_type_test", "no_load.csv")
    ]
    assert no_load[4] < flux < no_load[2]  # between 1075 and 1272 V, the plate says 1146 V


def test_delta_motor_as_star_equivalent_draws_its_measured_current_at_its_measured_speed():
    """Published per delta phase at 20 C: R_s 0.56, X_1 1.52, X_m 66.4, X_2 2.31, R_2 0.42 ohm; operation at 90 C."""
    warm = (234.5 + 90.0) / (234.5 + 20.0)
    omega = 2 * math.pi * 50
    machine = from_t_model(*(v / 3 for v in (0.56 * warm, 0.42 * warm, 1.52 / omega, 2.31 / omega, 66.4 / omega)))
    row = next(r for r in rows("msl_18kw5_load_curve", "load_curve.csv") if r["P_mech_W"] == "18500")
    slip = 1 - float(row["n_rpm"]) / 1500
    rotor = machine.rotor_resistance_ohm / slip
    x_m = 1j * omega * machine.magnetizing_inductance_h
    z = machine.stator_resistance_ohm + 1j * omega * machine.leakage_inductance_h + rotor * x_m / (rotor + x_m)
    current = 400 / math.sqrt(3) / z
    assert abs(current) == pytest.approx(float(row["I_line_A"]), rel=0.02)
    assert math.cos(np.angle(z)) == pytest.approx(float(row["power_factor"]), rel=0.01)
    plate = Nameplate(18500, 400, 50, 32.85, 1462.5, 0.898, 2, "delta")
    assert check(plate) == ()
    assert prior(plate).contains(machine)
