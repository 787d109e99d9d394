"""What the saturable machine shows at a flux: secant, incremental and sine inductance; its inverse-Gamma form."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sim.physics.laws import SATURATION_SHAPES, saturation_excess
from sim.physics.machine import Machine, Plant

QUARTER = 125
"""Points in a quarter of a period, the others say the same: 3e-16 from sixteen times as many, 2e-8 for the kink of `knee`."""


def stator_inductance_h(plant: Plant, flux_wb: float, kind: str = "secant") -> float:
    """L_s of the Gamma form at a stator flux amplitude.

    `secant` psi/i, `incremental` d psi/d i, `sine` = what a sinusoidal flux of this amplitude shows at its own
    frequency (first harmonic of the magnetizing current).
    """
    current_a = _magnetizing(plant)
    if kind == "secant":
        return flux_wb / current_a(flux_wb) if flux_wb > 0 else _small_signal(plant)
    if kind == "incremental":
        d = 1e-6
        return 2 * d / (current_a(flux_wb + d) - current_a(flux_wb - d))
    if kind != "sine":
        raise ValueError(f"kind is secant, incremental or sine, not {kind!r}")
    turn = (np.arange(QUARTER) + 0.5) * (math.pi / 2) / QUARTER
    current = np.array([current_a(flux_wb * math.cos(a)) for a in turn])
    return flux_wb / (2.0 * float(np.mean(current * np.cos(turn)))) if flux_wb > 0 else _small_signal(plant)


def _small_signal(plant: Plant) -> float:
    return stator_inductance_h(plant, 1e-6)


def _magnetizing(plant: Plant) -> Callable[[float], float]:
    """The current over the flux."""
    m, rated_wb = saturated(plant), plant.nameplate.rated_flux_wb
    strength, order, shape = m.saturation_at_rated_flux, m.saturation_order, SATURATION_SHAPES.index(m.saturation_shape)

    def current_a(flux_wb: float) -> float:
        excess = saturation_excess((flux_wb / rated_wb) ** 2, strength, order, float(shape))
        return flux_wb / m.inductance_h * (1.0 + excess)

    return current_a


def saturated(plant: Plant) -> Machine:
    """The machine with a `magnetizing_saturation` effect, if any, written into its saturation fields."""
    m = plant.machine
    for effect in plant.effects:
        if effect.name == "magnetizing_saturation":
            order = effect.details.get("order", m.saturation_order)
            shape = effect.shape or m.saturation_shape
            m = replace(m, saturation_at_rated_flux=effect.size, saturation_order=order, saturation_shape=shape)
    return m


def inverse_gamma(plant: Plant, stator_flux_wb: float, kind: str = "secant") -> dict[str, float]:
    """R_s, R_R, L_sigma, L_M of the inverse-Gamma form at a stator flux, and the rotor flux that goes with it.

    With k = L_s / (L_s + L_leak): R_R = k^2 R_r, L_sigma = k L_leak, L_M = k L_s; rotor flux k psi_s when the rotor
    carries no current.
    """
    m = plant.machine
    ls = stator_inductance_h(plant, stator_flux_wb, kind)
    k = ls / (ls + m.leakage_inductance_h)
    return {
        "stator_resistance_ohm": m.stator_resistance_ohm,
        "rotor_resistance_ohm": k * k * m.rotor_resistance_ohm,
        "leakage_inductance_h": k * m.leakage_inductance_h,
        "magnetizing_inductance_h": k * ls,
        "stator_flux_wb": stator_flux_wb,
        "rotor_flux_wb": k * stator_flux_wb,
    }
