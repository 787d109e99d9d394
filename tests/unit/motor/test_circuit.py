"""Conversions between circuits, against the published table and closed forms."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from commissioner.motor.circuit import (
    EQUAL_LEAKAGE,
    STATOR_SHARE_OF_LEAKAGE,
    Gamma,
    InverseGamma,
    from_t_model,
    to_t_model,
)
from tests.support.standstill import MOTORS


def test_all_39_published_t_circuits_have_their_published_inverse_gamma_values():
    with MOTORS.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 39
    for row in rows:
        found = from_t_model(
            float(row["Rs_ohm"]),
            float(row["Rr_ohm"]),
            1e-3 * float(row["Lls_mH"]),
            1e-3 * float(row["Llr_mH"]),
            1e-3 * float(row["Lm_mH"]),
        )
        assert found.rotor_resistance_ohm == pytest.approx(float(row["R_R_ohm"]), rel=2e-5)
        assert found.leakage_inductance_h == pytest.approx(1e-3 * float(row["L_sgm_mH"]), rel=2e-4), row["id"]
        assert found.magnetizing_inductance_h == pytest.approx(1e-3 * float(row["L_M_mH"]), rel=2e-5)


def test_published_gamma_machine_is_the_published_inverse_gamma_machine():
    found = Gamma(3.7, 2.5, 0.023, 0.245).as_inverse_gamma()
    assert found.as_tuple() == pytest.approx((3.7, 2.09, 0.021, 0.224), rel=3e-3)


@pytest.mark.parametrize("assumption", list(STATOR_SHARE_OF_LEAKAGE))
def test_t_model_under_an_assumption_has_the_same_terminals_and_keeps_the_assumption(assumption):
    machine = InverseGamma(3.7, 2.09, 0.021, 0.224)
    t = to_t_model(machine, assumption=assumption)
    back = from_t_model(
        *(
            getattr(t, name).value
            for name in (
                "stator_resistance_ohm",
                "rotor_resistance_ohm",
                "stator_leakage_h",
                "rotor_leakage_h",
                "magnetizing_inductance_h",
            )
        )
    )
    assert back.as_tuple() == pytest.approx(machine.as_tuple(), rel=1e-12)
    share = STATOR_SHARE_OF_LEAKAGE[assumption]
    assert t.stator_leakage_h.value / (t.stator_leakage_h.value + t.rotor_leakage_h.value) == pytest.approx(share)
    assert t.assumption == assumption


def test_equal_leakage_is_equal_self_inductance():
    t = to_t_model(InverseGamma(3.7, 2.09975, 0.0209325, 0.223967), assumption=EQUAL_LEAKAGE)
    assert t.stator_leakage_h.value == pytest.approx(10.7e-3, rel=1e-4)
    assert t.rotor_resistance_ohm.value == pytest.approx(2.296, rel=1e-4)


def test_standard_errors_of_the_t_model_agree_with_scattered_machines():
    machine = InverseGamma(3.7, 2.09, 0.021, 0.224)
    std = np.array(machine.as_tuple()) * np.array([0.002, 0.005, 0.004, 0.006])
    rng = np.random.default_rng(5)
    scattered = [
        to_t_model(InverseGamma(*(machine.as_tuple() + std * rng.standard_normal(4)))).rotor_resistance_ohm.value
        for _ in range(2000)
    ]
    stated = to_t_model(machine, np.diag(std**2)).rotor_resistance_ohm.std
    assert stated == pytest.approx(np.std(scattered), rel=4 / np.sqrt(4000))


@pytest.mark.parametrize("slip_hz", [0.3, 3.0, 50.0])
def test_a_leakage_in_the_rotor_branch_is_the_same_circuit_without_it(slip_hz):
    """At the terminals, supply of 50 Hz."""
    w, slip, plain, leakage = 100.0 * np.pi, slip_hz / 50.0, InverseGamma(1.3, 1.0, 0.012, 0.17), 0.009

    def seen(four, in_rotor):
        rotor, main = four.rotor_resistance_ohm / slip + 1j * w * in_rotor, 1j * w * four.magnetizing_inductance_h
        return four.stator_resistance_ohm + 1j * w * four.leakage_inductance_h + rotor * main / (rotor + main)

    assert seen(plain.with_rotor_leakage(leakage), 0.0) == pytest.approx(seen(plain, leakage), rel=1e-12)
