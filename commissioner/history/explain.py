"""What would explain that two results differ: each cause as the direction in which it moves the four parameters.

A cause explains a difference where nothing significant is left once its size is fitted. Causes of the same direction (a warmer
stator winding, a longer cable) cannot be told apart by four numbers; both are named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from commissioner.identify.estimate.axes import Identity
from commissioner.identify.estimate.common_ground import CommonGround, Result

Array = NDArray[np.float64]
REST = 0.01
"""What is left after a cause has to be so probable by chance."""
WARMTH = (-0.35, 0.60)
"""Relative change of a resistance by temperature alone: copper between -20 and 130 degC."""


@dataclass(frozen=True)
class Explanation:
    """`size`: relative, of what the cause moves; `rest_probability`: of what it leaves, by chance."""

    cause: str
    size: float
    std: float
    rest_probability: float
    sentence: str


@dataclass(frozen=True)
class _Direction:
    cause: str
    along: tuple[float, float, float, float]
    within: tuple[float, float]
    sentence: str


def explain(
    old: Result, new: Result, moved: tuple[Array, Array], common: CommonGround, verdict: Identity
) -> tuple[Explanation, ...]:
    """The simplest causes that suffice, the most probable first; empty where nothing has moved or nothing suffices. `moved`:
    differences of the parameters' logarithms on common ground `(4,)`, and their standard errors at one temperature."""
    difference, std = moved
    weight = std**-2
    if verdict is Identity.SAME:
        return ()
    found = [made for one in _directions(old, new, common) if (made := _fit(one, difference, weight)) is not None]
    if verdict is Identity.OTHER:
        found.append(
            Explanation("another motor", 0.0, 0.0, 1.0, "no change of one motor moves so much of it: another motor")
        )
    return tuple(sorted(found, key=lambda one: -one.rest_probability))


def _fit(direction: _Direction, difference: Array, weight: Array) -> Explanation | None:
    along = np.array(direction.along)
    bound = float(np.sum(weight * along**2))
    size = float(np.sum(weight * along * difference)) / bound
    rest = difference - size * along
    probability = float(chdtrc(3, np.sum(weight * rest**2)))
    relative = float(np.expm1(size))
    if probability < REST or not direction.within[0] <= relative <= direction.within[1]:
        return None
    return Explanation(
        direction.cause,
        relative,
        (1.0 + relative) * bound**-0.5,
        probability,
        f"{direction.sentence}: {100 * relative:+.2g} %",
    )


def _directions(old: Result, new: Result, common: CommonGround) -> Sequence[_Direction]:
    warmth = [] if common.temperature_degc is not None else [
        _Direction("temperature", (1.0, 1.0, 0.0, 0.0), WARMTH, "winding and rotor warmer or colder, both resistances"),
    ]  # fmt: skip
    flux = [] if common.stator_flux_wb is not None and new.curve and old.curve else [
        _Direction("flux", (0.0, 0.0, 0.0, 1.0), (-0.3, 0.3), "another flux, or iron of another saturation, L_M"),
    ]  # fmt: skip
    return [
        *warmth,
        _Direction("winding temperature", (1.0, 0.0, 0.0, 0.0), WARMTH, "the stator winding warmer or colder, R_s alone"),
        _Direction("cable", (1.0, 0.0, 0.0, 0.0), (-0.5, 5.0), "cable, terminals or devices of the inverter, R_s alone"),
        _Direction("rotor", (0.0, 1.0, 0.0, 0.0), (-0.5, 1.0), "the rotor: its temperature, its bars or rings, R_R alone"),
        _Direction("sensor scale", (1.0, 1.0, 1.0, 1.0), (-0.3, 0.3), "the scale of the current sensors, or another axis of unlike ones, all alike"),
        *flux,
        _Direction("leakage", (0.0, 0.0, 1.0, 0.0), (-0.3, 0.3), "leakage alone: slots, a filter or choke at the output, L_sigma"),
    ]  # fmt: skip
