"""The answer key of a scenario: what is really in the motor, the inverter and the sensors."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from sim.physics import effects
from sim.physics import layout as at
from sim.physics.inductance import inverse_gamma, saturated
from sim.physics.kernel import link_voltage, load
from sim.physics.laws import sign_law
from sim.physics.machine import Plant
from sim.physics.packing import pack
from sim.scenario import Scenario

KINDS = ("secant", "incremental", "sine")


def answer_key(scenario: Scenario, seed: int = 0) -> dict[str, Any]:
    """Everything a judge needs, JSON-ready. Parameters in SI, per-phase star, referred to the stator."""
    plant = scenario.plant
    rated = plant.nameplate.rated_flux_wb
    return {
        "scenario": scenario.name,
        "seed": seed,
        "nameplate": dataclasses.asdict(plant.nameplate),
        "rated_flux_wb": rated,
        "stator_resistance_ohm": plant.machine.stator_resistance_ohm,
        "apparent_stator_resistance_ohm": apparent_resistance_ohm(plant),
        "gamma": dataclasses.asdict(saturated(plant)),
        "inverse_gamma": {
            "unsaturated": inverse_gamma(plant, 1e-3 * rated),
            "at_rated_flux": inverse_gamma(plant, rated),
            "over_flux": [_row(plant, f * rated) for f in np.linspace(0.05, 1.3, 26)],
        },
        "inverter": inverter_truth(plant),
        "sensors": dataclasses.asdict(plant.sensors),
        "heating": dataclasses.asdict(plant.heating),
        "effects": effect_list(plant),
        "drive_parameters": dict(
            zip(
                ("stator_resistance_ohm", "rotor_resistance_ohm", "leakage_inductance_h", "magnetizing_inductance_h"),
                scenario.setup.parameters,
                strict=True,
            )
        ),
    }


def link_gain(plant: Plant) -> float:
    """What comes out of what is commanded, in the mean over the rectifier's ripple: a sawtooth's mean is not the nominal link."""
    p, _ = pack(plant)
    times = np.arange(1000) / 1000.0 / p[at.P_RIPPLE_HZ]
    return float(np.mean([link_voltage(t, 0.0, p) for t in times]) / p[at.P_LINK_NOMINAL_V])


def apparent_resistance_ohm(plant: Plant) -> float:
    """Of the stator with that of the devices, which no measurement at the terminals tells apart."""
    p, _ = pack(plant)
    return plant.machine.stator_resistance_ohm + float(p[at.P_SLOPE_OHM])


def sensor_gain(plant: Plant, axes_deg: Sequence[float]) -> float:
    """By which the three current sensors, what was hidden in them included, scale a current along these axes in the mean: a
    current along one axis is read by each sensor times the square of its phase's cosine. Of axes all round it is the sensors' mean."""
    _, s = pack(plant)
    seen = np.cos(np.radians(np.subtract.outer(np.asarray(axes_deg, dtype=float), [0.0, 120.0, 240.0]))) ** 2
    return float(np.mean(2.0 / 3.0 * seen @ s[at.S_GAIN_U : at.S_GAIN_W + 1]))


def _row(plant: Plant, flux_wb: float) -> dict[str, Any]:
    return {"stator_flux_wb": flux_wb, **{kind: inverse_gamma(plant, flux_wb, kind) for kind in KINDS}}


def inverter_truth(plant: Plant) -> dict[str, Any]:
    """Leg error law of the inverter as it stands (effects included): plateau volts and a table over leg current."""
    p, _ = pack(plant)
    lost = _leg_law(plant)
    dead_v = float(p[at.P_DEAD_FRACTION] * p[at.P_LINK_V])
    currents = np.concatenate([np.linspace(0.0, 0.5, 26), np.linspace(0.6, 2.0, 15), np.linspace(2.5, 10.0, 16)])
    return {
        "dead_time_v": dead_v,
        "threshold_v": float(p[at.P_DROP_V]),
        "slope_ohm": float(p[at.P_SLOPE_OHM]),
        "link_v": float(p[at.P_LINK_V]),
        "switching_frequency_hz": plant.power_stage.switching_frequency_hz,
        "leg_error": [[float(i), lost(float(i))] for i in currents],
    }


def leg_error_v(plant: Plant, current_a: float) -> float:
    """Mean voltage (V) a leg loses while it carries this current."""
    return _leg_law(plant)(current_a)


def _leg_law(plant: Plant) -> Callable[[float], float]:
    p, _ = pack(plant)
    m = load(p)

    def lost_v(current_a: float) -> float:
        dead = m.dead_fraction * p[at.P_LINK_V] * sign_law(current_a * m.dead_per_a, m.dead_shape)
        drop = m.drop_v * sign_law(current_a * m.drop_per_a, m.drop_shape)
        return float(dead + drop + p[at.P_SLOPE_OHM] * current_a)

    return lost_v


def axis_error_v(plant: Plant, axis_deg: float, current_a: float) -> float:
    """Voltage error (V) along a test axis that carries this DC current.

    Off the multiples of 30 degrees the legs also push across the axis; the cross current that answers is found first.
    """
    from scipy.optimize import brentq  # a third of the time that a simulated drive needs to begin

    resistance, lost = plant.machine.stator_resistance_ohm, _leg_law(plant)
    cross = brentq(lambda c: resistance * c + _leg_errors(lost, axis_deg, current_a, c)[1], -20.0, 20.0)
    return _leg_errors(lost, axis_deg, current_a, float(cross))[0]


def _leg_errors(
    lost: Callable[[float], float], axis_deg: float, along_a: float, across_a: float
) -> tuple[float, float]:
    """Leg errors (V) projected along and across the axis, for a current with both components."""
    angles = np.radians(axis_deg) - np.array([0.0, 2.0, -2.0]) * np.pi / 3.0
    errors = [lost(float(along_a * np.cos(a) - across_a * np.sin(a))) for a in angles]
    return float(2.0 / 3.0 * np.dot(errors, np.cos(angles))), float(-2.0 / 3.0 * np.dot(errors, np.sin(angles)))


def effect_list(plant: Plant) -> list[dict[str, Any]]:
    """Names, sizes in engineering units and shapes of the named effects that were put in."""
    return [
        {
            "name": e.name,
            "size": e.size,
            "unit": effects.CATALOGUE[e.name].unit,
            "shape": e.shape or effects.CATALOGUE[e.name].shapes[0],
            **e.details,
        }
        for e in plant.effects
    ]
