"""Scalar laws of iron, semiconductor and leakage path, compiled; every shape has a number used in scenarios.

All laws are odd (or even) in their argument, continuous, and zero-strength means the linear machine.
"""

from __future__ import annotations

import math

from sim.physics.compiled import kernel, piece

SIGN_SHAPES = ("capacitive", "tanh", "clipped", "arctan", "clamped", "root", "logarithmic")
SATURATION_SHAPES = ("power", "exponential", "knee", "steel")
LEAKAGE_SHAPES = ("rational", "root", "closed_slot")


@piece
def sign_law(z: float, shape: float) -> float:
    """Smooth sign of `z` = current over knee current, -1..1 (only `logarithmic` passes 1, slowly).

    `capacitive` is the mean voltage lost in a dead time during which the load current alone charges the output
    capacitance of the leg: a ramp that does not finish below the knee (z/2), one that does above it (1 - 1/(2z)).
    """
    if shape == 0.0:
        reach = 1.0 / max(abs(z), 1.0)  # no branch: the sign of a current is hard to predict
        return z * reach * (1.0 - 0.5 * reach)
    if shape == 5.0:
        return z / math.sqrt(1.0 + z * z)
    return _rarer_sign_law(z, shape)


@kernel
def _rarer_sign_law(z: float, shape: float) -> float:
    if shape == 1.0:
        return math.tanh(z)
    if shape == 2.0:
        return min(1.0, max(-1.0, z))
    if shape == 3.0:
        return 2.0 / math.pi * math.atan(0.5 * math.pi * z)
    if shape == 4.0:  # zero-current clamping: nothing is lost until the current holds the diode open
        cube = z * z * z
        return cube / (1.0 + abs(cube))
    return math.asinh(z) / math.asinh(40.0)  # a diode's logarithm, 1 at 40 knee currents


@piece
def saturation_excess(y: float, strength: float, order: float, shape: float) -> float:
    """Extra magnetizing current as a fraction of the linear one; `y` = (flux / rated flux)^2, `strength` at y = 1.

    `power` is strength * y^(order/2) (Qu, Ranta, Hinkkanen, Luomi 2012, DOI 10.1109/TIA.2012.2190818);
    `exponential` and `knee` (nothing below 0.6 rated flux, quadratic above) are other irons; `steel` adds the
    low-flux permeability dip that annealed sheet shows.
    """
    if shape == 0.0 and order == 7.0:
        return strength * y * y * y * math.sqrt(y)
    if strength == 0.0:
        return 0.0
    return _rarer_saturation(y, strength, order, shape)


@kernel
def _rarer_saturation(y: float, strength: float, order: float, shape: float) -> float:
    if shape == 0.0:
        return strength * y ** (0.5 * order)
    if shape == 1.0:
        return strength * (math.exp(0.5 * order * y) - 1.0) / (math.exp(0.5 * order) - 1.0)
    if shape == 2.0:
        over = math.sqrt(y) - 0.6
        return 1.4 * strength * over * over / 0.16 / (1.0 + over) if over > 0.0 else 0.0
    dip = 0.35 * strength * math.exp(-y / 0.04)
    return dip + strength * y * y * y


@kernel
def leakage_excess(x: float, shape: float) -> float:
    """How far the leakage path has given way at `x` = leakage flux over its knee: 0 at 0, growing like x^2 first."""
    if shape == 0.0:
        return x * x / (1.0 + x * x)
    if shape == 1.0:
        return math.sqrt(1.0 + x * x) - 1.0
    return (math.log1p(math.exp(6.0 * (x - 1.0))) - math.log1p(math.exp(-6.0))) / 6.0
