"""The leg's loss as a smooth curve: shapes of real inverters pass it, a resistance does not hide in it."""

from __future__ import annotations

import numpy as np
import pytest

from commissioner.identify.inverter.leg_law import LegLaw

LARGEST_A = 6.0
PLATEAU_V = 10.0
SHAPES = {
    "tanh": np.tanh,
    "arc tangent": lambda z: 2.0 / np.pi * np.arctan(0.5 * np.pi * z),
    "root": lambda z: z / np.sqrt(1.0 + z * z),
    "capacitive": lambda z: np.where(z < 1.0, 0.5 * z, 1.0 - 0.5 / np.maximum(z, 1.0)),
}


def knots_a(law: LegLaw) -> np.ndarray:
    return law.corner_a * law.knots / (1.0 - law.knots)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("knee_a", [0.05, 0.15])
def test_a_known_shape_is_followed_between_the_knots(name, knee_a):
    law = LegLaw(LARGEST_A)
    values = PLATEAU_V * SHAPES[name](knots_a(law) / knee_a)
    current = np.linspace(0.3, LARGEST_A, 200)
    curve = law.basis(current) @ values
    assert np.max(np.abs(curve - PLATEAU_V * SHAPES[name](current / knee_a))) < 0.01 * PLATEAU_V


def test_the_curve_is_odd_and_a_test_axis_adds_its_legs():
    law = LegLaw(LARGEST_A)
    values = PLATEAU_V * np.tanh(knots_a(law) / 0.1)
    current = np.array([-3.0, -0.05, 0.05, 3.0])
    curve = law.basis(current) @ values
    assert curve == pytest.approx(-curve[::-1])
    legs = law.basis(np.array([3.0])) @ values + law.basis(np.array([1.5])) @ values
    assert law.on_axis(np.array([3.0]), 0.0) @ values == pytest.approx(2.0 / 3.0 * legs)


def test_what_is_expected_of_a_loss_forbids_a_resistance():
    """In standard deviations: shapes of inverters are likely, a loss in proportion to the current is not."""
    law = LegLaw(LARGEST_A)
    current = knots_a(law)
    likely = [np.linalg.norm(law.expectations @ shape(current / 0.1)) for shape in SHAPES.values()]
    a_tenth_of_the_plateau_as_resistance = 0.1 * current / LARGEST_A
    assert max(likely) < 0.1 * np.linalg.norm(law.expectations @ a_tenth_of_the_plateau_as_resistance)
