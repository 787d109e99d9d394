"""A plant as the flat arrays the compiled kernels read (`sim.physics.layout`)."""

from __future__ import annotations

import math

import numpy as np

from sim.physics import effects
from sim.physics import layout as at
from sim.physics.laws import SATURATION_SHAPES, SIGN_SHAPES
from sim.physics.machine import Lag, Plant


def pack(plant: Plant, *, accuracy: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """(p, s): machine and sensing arrays of `layout`; `accuracy` 2 halves the integration step."""
    p, s = np.zeros(at.P_COUNT), np.zeros(at.S_COUNT)
    _pack_machine(plant, p)
    _pack_power_stage(plant, p)
    _pack_sensors(plant, s)
    lag = Lag(plant.sensors.lag_s, 1)
    for effect in plant.effects:
        lag = effects.apply(effect, plant, p, s) or lag
    p[at.P_SUBSTEPS] = _substeps(p, accuracy)
    _pack_lag(p, lag)
    return p, s


def _pack_machine(plant: Plant, p: np.ndarray) -> None:
    m, n = plant.machine, plant.nameplate
    p[at.P_PERIOD], p[at.P_ORDER] = plant.control_period_s, 4.0
    p[[at.P_RSA, at.P_RSB, at.P_RSC]] = m.stator_resistance_ohm
    p[at.P_RR], p[at.P_LEAK_H], p[at.P_LIN_H] = m.rotor_resistance_ohm, m.leakage_inductance_h, m.inductance_h
    p[at.P_FLUX_N], p[at.P_RATED_PEAK_A] = n.rated_flux_wb, n.rated_peak_current_a
    p[at.P_SAT], p[at.P_SAT_ORDER] = m.saturation_at_rated_flux, m.saturation_order
    p[at.P_SAT_SHAPE] = SATURATION_SHAPES.index(m.saturation_shape)
    dose = n.rated_current_a**2 * 60.0
    p[at.P_HEAT_S] = plant.heating.stator_per_min / dose
    p[at.P_HEAT_R] = plant.heating.rotor_per_min / (2.0 * dose)
    p[at.P_HEAT_S_TAU] = p[at.P_HEAT_R_TAU] = plant.heating.time_constant_s


def _pack_power_stage(plant: Plant, p: np.ndarray) -> None:
    stage = plant.power_stage
    p[at.P_LINK_V] = p[at.P_LINK_NOMINAL_V] = stage.link_v
    p[at.P_RIPPLE], p[at.P_RIPPLE_HZ] = stage.link_ripple, stage.link_ripple_hz
    p[at.P_DEAD_FRACTION] = stage.dead_time_s * stage.switching_frequency_hz
    p[at.P_DEAD_PER_A], p[at.P_DEAD_SHAPE] = 1.0 / stage.dead_time_knee_a, SIGN_SHAPES.index(stage.dead_time_shape)
    p[at.P_DROP_V], p[at.P_DROP_PER_A] = stage.threshold_v, 1.0 / stage.threshold_knee_a
    p[at.P_DROP_SHAPE], p[at.P_SLOPE_OHM] = SIGN_SHAPES.index(stage.threshold_shape), stage.slope_ohm
    p[at.P_SAG_TAU] = 1.0


def _pack_sensors(plant: Plant, s: np.ndarray) -> None:
    sensors = plant.sensors
    s[at.S_DELAY], s[at.S_FULL_SCALE_A], s[at.S_LSB_A] = sensors.delay_s, sensors.full_scale_a, sensors.lsb_a
    s[at.S_CLIP_A] = sensors.full_scale_a - sensors.lsb_a
    s[at.S_NOISE_A], s[at.S_TRIP_A] = sensors.noise_a, math.inf
    s[at.S_OFFSET_U : at.S_OFFSET_W + 1] = sensors.offset_a
    s[at.S_GAIN_U : at.S_GAIN_W + 1] = sensors.gain
    s[at.S_DRIFT_TAU] = 60.0
    s[at.S_LINK_NOISE_V], s[at.S_LINK_LSB_V] = sensors.link_noise_v, 0.1


def _substeps(p: np.ndarray, accuracy: float) -> float:
    """1 or an even number of Runge-Kutta steps that keeps step times fastest pole below 0.4 (error 1e-4 of the mode).

    The fastest pole is (leg slope near zero current + R_s + R_r) over the leakage inductance.
    """
    slope = p[at.P_DEAD_FRACTION] * p[at.P_LINK_V] * p[at.P_DEAD_PER_A] * _law_slope(p[at.P_DEAD_SHAPE])
    slope += p[at.P_DROP_V] * p[at.P_DROP_PER_A] * _law_slope(p[at.P_DROP_SHAPE])
    ohm = slope + p[at.P_RSA] + p[at.P_RR] + p[at.P_SLOPE_OHM] + p[at.P_SKIN1_OHM] + p[at.P_SKIN2_OHM]
    rate = ohm / p[at.P_LEAK_H]
    for r, h in ((at.P_SKIN1_OHM, at.P_SKIN1_H), (at.P_SKIN2_OHM, at.P_SKIN2_H), (at.P_EDDY_OHM, at.P_EDDY_H)):
        if p[h]:
            rate = max(rate, p[r] / p[h])
    if p[at.P_PERIOD] * rate < 0.12:
        return accuracy
    return max(2.0, 2.0 * math.ceil(p[at.P_PERIOD] * rate / 0.4 / 2.0)) * accuracy


def _law_slope(shape: float) -> float:
    """Steepest slope of each `sign_law` shape per knee current."""
    return (0.5, 1.0, 1.0, 1.0, 0.84, 1.0, 0.23)[int(shape)]


def _pack_lag(p: np.ndarray, lag: Lag) -> None:
    """Weights of the exact first-order response to a parabola through a substep's start, middle and end."""
    if lag.time_s <= 0.0:
        p[at.P_LAG_ORDER] = 0.0
        return
    p[at.P_LAG_ORDER] = lag.order
    a = p[at.P_PERIOD] / p[at.P_SUBSTEPS] * lag.order / lag.time_s
    for end, keep, first in ((1.0, at.P_LAG_KEEP, at.P_LAG_W0), (0.5, at.P_LAG_HALF, at.P_LAG_H0)):
        p[keep] = math.exp(-a * end)
        p[first : first + 3] = _parabola_weights(a, end)


def _parabola_weights(a: float, end: float) -> list[float]:
    """int_0^end a exp(-a (end - s)) q_j(s) ds for the parabolas q_j that are 1 at s = 0, 1/2, 1 (Gauss-Legendre)."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    depth = min(end, 50.0 / a)  # further back the exponential is below 2e-22
    s = end - depth * 0.5 * (1.0 - nodes)
    kernel = a * np.exp(-a * (end - s)) * weights * 0.5 * depth
    basis = (2.0 * (s - 0.5) * (s - 1.0), -4.0 * s * (s - 1.0), 2.0 * s * (s - 0.5))
    return [float(kernel @ q) for q in basis]


def fresh_state(p: np.ndarray) -> np.ndarray:
    """Cold, de-energised machine; carries the remanent flux if the parameters name one."""
    x = np.zeros(at.X_COUNT)
    x[at.X_FLUX_S : at.X_FLUX_S + 2] = p[[at.P_FLUX0_C, at.P_FLUX0_S]]
    x[at.X_FLUX_R : at.X_FLUX_R + 2] = p[[at.P_FLUX0_C, at.P_FLUX0_S]]
    x[at.X_LINK] = p[at.P_LINK_V]
    return x
