"""The three tests of a textbook: closed forms of one circuit, and a published example."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from commissioner.diagnose.points.rows import are_three_tests
from commissioner.diagnose.points.three_tests import ThreeTests, solve
from commissioner.errors import DataRefused

R1, R2, L1, L2, LM = 0.9, 0.7, 4.1e-3, 4.1e-3, 0.11
FRICTION_W, IRON_W = 60.0, 140.0


def impedance(f: float, slip: float) -> complex:
    w = 2 * np.pi * f
    rotor = R2 / slip + 1j * w * L2 if slip else np.inf
    main = 1j * w * LM
    return R1 + 1j * w * L1 + (main if slip == 0 else main * rotor / (main + rotor))


def row(f: float, volts: float, slip: float) -> tuple[float, ...]:
    z = impedance(f, slip)
    current = volts / np.sqrt(3) / abs(z)
    power = 3 * current**2 * z.real
    if slip == 0.0:
        power += FRICTION_W + IRON_W * (volts / 400) ** 2
        # the active part of the current belongs to the losses: the reactive one is the circuit's
        reactive = current
        for _ in range(50):
            current = float(np.hypot(reactive, power / (np.sqrt(3) * volts)))
            power = 3 * current**2 * R1 + FRICTION_W + IRON_W * (volts / 400) ** 2
    return f, volts, current, power


def table(*rows: tuple[float, ...]) -> dict[str, np.ndarray]:
    names = ("frequency_hz", "voltage_line_v", "current_line_a", "power_w")
    return {n: np.array([r[k] for r in rows], dtype=float) for k, n in enumerate(names)}


DC = (0.0, 2 * R1 * 10.0, 10.0, np.nan)


def solved(*tables: dict[str, np.ndarray], **said: object) -> ThreeTests:
    found = solve(list(tables), [dict(said)] * len(tables))  # type: ignore[list-item]
    assert isinstance(found, ThreeTests), found
    return found


def test_direct_current_no_load_and_locked_rotor_give_the_circuit() -> None:
    found = solved(table(DC, row(50, 400, 0.0), row(12.5, 30, 1.0)))
    ratio = LM / (LM + L2)
    assert found.circuit.stator_resistance_ohm == pytest.approx(R1)
    assert found.circuit.rotor_resistance_ohm == pytest.approx(R2 * ratio**2, rel=3e-3)
    assert found.circuit.leakage_inductance_h == pytest.approx(L1 + LM - LM * ratio, rel=3e-3)
    assert found.circuit.magnetizing_inductance_h == pytest.approx(LM * ratio, rel=1e-2)
    assert found.t_circuit.stator_leakage_h == pytest.approx(L1, rel=5e-3)
    assert found.losses.together_w == pytest.approx(FRICTION_W + IRON_W, rel=1e-3)
    assert found.losses.iron_w is None
    assert "method 1" in found.method
    assert any("no uncertainty" in a for a in found.assumed) and any("equal" in a for a in found.assumed)


def test_the_order_of_the_rows_and_their_files_does_not_matter() -> None:
    one = solved(table(DC, row(50, 400, 0.0), row(12.5, 30, 1.0)))
    other = solved(table(row(12.5, 30, 1.0)), table(DC), table(row(50, 400, 0.0)))
    assert dataclasses.astuple(one.circuit) == pytest.approx(dataclasses.astuple(other.circuit))


def test_two_no_load_voltages_part_iron_and_friction() -> None:
    found = solved(table(DC, row(50, 400, 0.0), row(50, 200, 0.0), row(12.5, 30, 1.0)))
    assert found.losses.friction_w == pytest.approx(FRICTION_W, rel=0.01)
    assert found.losses.iron_w == pytest.approx(IRON_W, rel=0.01)


def test_a_design_class_splits_the_leakage_and_leaves_the_terminals_alone() -> None:
    plain = solved(table(DC, row(50, 400, 0.0), row(12.5, 30, 1.0)))
    split = solved(table(DC, row(50, 400, 0.0), row(12.5, 30, 1.0)), design_class="B")
    assert split.t_circuit.stator_leakage_h == pytest.approx(0.67 * split.t_circuit.rotor_leakage_h)
    assert split.t_circuit.as_inverse_gamma().as_tuple() == pytest.approx(plain.circuit.as_tuple())


def test_a_published_example_has_its_printed_values() -> None:
    """7.5 hp, 208 V, 60 Hz: R1 0.243, R2 0.151, X1 = X2 = 0.67, XM 14.03 ohm; 371 W of iron and friction."""
    found = solved(table((0, 13.6, 28.0, 380.8), (60, 208, 8.17, 420), (15, 25, 27.9, 920)))
    book = [found.textbook[k] for k in ("r1_ohm", "r2_ohm", "x1_ohm", "x2_ohm", "xm_ohm")]
    assert book == pytest.approx([0.243, 0.151, 0.67, 0.67, 14.03], rel=2e-3)
    assert found.losses.together_w == pytest.approx(371, abs=1)
    assert found.circuit.as_tuple() == pytest.approx((0.243, 0.151, 3.484e-3, 35.1e-3), rel=4e-3)


@pytest.mark.parametrize(
    ("tables", "word"),
    [
        ([table(DC, row(50, 400, 0.0))], "no pair"),
        ([table(row(50, 400, 0.0), row(12.5, 30, 1.0))], "stator's resistance"),
        ([table((0, 80.0, 10.0, np.nan), row(50, 400, 0.0), row(12.5, 30, 1.0))], "nothing is left for the rotor"),
        ([table(DC, row(50, 400, 0.0), (12.5, 30, 10.0, 900.0))], "power factor"),
    ],
)
def test_a_missing_or_impossible_test_is_named(tables: list[dict[str, np.ndarray]], word: str) -> None:
    found = solve(tables, [{}] * len(tables))
    assert isinstance(found, DataRefused) and word in found.what


def test_several_points_of_one_test_are_not_three_tests() -> None:
    assert not are_three_tests([table(*(row(f, v, 1.0) for f in (50, 25) for v in (40, 60, 80)))])
    assert are_three_tests([table(row(50, 400, 0.0)), table(row(12.5, 30, 1.0))])
