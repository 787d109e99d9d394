"""The 28 named effects, each continuous with zero = none: unit, shapes, and how it enters the machine or the sensors.

At least one shape of each is outside the usual textbook family (clamped or capacitive dead time, closed-slot leakage,
diffusion ladder, vector plays, warm-up drift, kinked sensor ...).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim.physics import layout as at
from sim.physics.laws import LEAKAGE_SHAPES, SATURATION_SHAPES, SIGN_SHAPES, leakage_excess
from sim.physics.machine import Effect, Lag, Plant

Apply = Callable[[Effect, Plant, np.ndarray, np.ndarray], Lag | None]


@dataclass(frozen=True)
class Kind:
    """One entry of the catalogue. `smallest`, `largest`: the range hidden draws use."""

    unit: str
    meaning: str
    shapes: tuple[str, ...]
    smallest: float
    largest: float
    apply: Apply


CATALOGUE: dict[str, Kind] = {}
SINCE = ("sensor_switch_on",)
"""Effects that joined the catalogue later: drawn alone only, so that a seed's mixture stays what it was."""


def _entry(name: str, unit: str, meaning: str, shapes: tuple[str, ...], smallest: float, largest: float):
    def register(apply: Apply) -> Apply:
        CATALOGUE[name] = Kind(unit, meaning, shapes, smallest, largest, apply)
        return apply

    return register


def apply(effect: Effect, plant: Plant, p: np.ndarray, s: np.ndarray) -> Lag | None:
    """Write one effect into the arrays. KeyError for an unknown name, ValueError for an unknown shape."""
    kind = CATALOGUE[effect.name]
    if effect.shape and effect.shape not in kind.shapes:
        raise ValueError(f"{effect.name}: shape {effect.shape!r} is not one of {', '.join(kind.shapes)}")
    return kind.apply(effect, plant, p, s)


def _shape(effect: Effect) -> int:
    shapes = CATALOGUE[effect.name].shapes
    return shapes.index(effect.shape) if effect.shape else 0


def _direction(effect: Effect) -> tuple[float, float]:
    angle = math.radians(effect.details.get("angle_deg", 25.0))
    return math.cos(angle), math.sin(angle)


def _per_phase(effect: Effect, default: tuple[float, float, float]) -> list[float]:
    weights = [effect.details.get(f"weight_{k}", default[j]) for j, k in enumerate("uvw")]
    return [effect.size * w for w in weights]


@_entry("dead_time", "V", "mean voltage lost per leg beyond the knee current", SIGN_SHAPES[:5], 0.05, 6.0)
def _dead_time(effect, plant, p, s):
    p[at.P_DEAD_FRACTION] = effect.size / plant.power_stage.link_v
    p[at.P_DEAD_SHAPE] = SIGN_SHAPES.index(effect.shape or "capacitive")
    p[at.P_DEAD_PER_A] = 1.0 / effect.details.get("knee_a", 0.02 * plant.nameplate.rated_peak_current_a)


@_entry(
    "device_drop", "V", "device threshold per leg; `slope_ohm` adds to R_s", ("root", "tanh", "logarithmic"), 0.05, 2.0
)
def _device_drop(effect, plant, p, s):
    p[at.P_DROP_V] = effect.size
    p[at.P_DROP_SHAPE] = SIGN_SHAPES.index(effect.shape or "root")
    p[at.P_DROP_PER_A] = 1.0 / effect.details.get("knee_a", 0.015 * plant.nameplate.rated_peak_current_a)
    p[at.P_SLOPE_OHM] = effect.details.get("slope_ohm", 0.0)


@_entry(
    "dc_link_sag",
    "fraction at rated power",
    "link voltage lost when rated power is drawn",
    ("linear", "soft"),
    0.003,
    0.06,
)
def _dc_link_sag(effect, plant, p, s):
    p[at.P_SAG_V_PER_W] = effect.size * plant.power_stage.link_v / plant.nameplate.rated_power_w
    p[at.P_SAG_TAU] = effect.details.get("time_constant_s", 0.004)
    p[at.P_SAG_SHAPE] = _shape(effect)


def _mains_hz(plant):
    """Of the supply, whatever frequency the motor is rated for."""
    return 60.0 if plant.nameplate.rated_frequency_hz == 60.0 else 50.0


@_entry("dc_link_ripple", "fraction", "amplitude of the rectifier ripple", ("sine", "sawtooth"), 0.0005, 0.03)
def _dc_link_ripple(effect, plant, p, s):
    p[at.P_RIPPLE] = effect.size
    p[at.P_RIPPLE_HZ] = effect.details.get("frequency_hz", 6.0 * _mains_hz(plant) + 0.3)
    p[at.P_RIPPLE_RAD] = effect.details.get("phase_rad", 0.0)
    p[at.P_RIPPLE_SHAPE] = _shape(effect)


@_entry(
    "sampling_delay",
    "s",
    "samples are this old; `alternating` by +-20 % more or less",
    ("constant", "alternating"),
    2e-6,
    3e-4,
)
def _sampling_delay(effect, plant, p, s):
    s[at.S_DELAY] = effect.size


@_entry("sensor_lag", "s", "sum of time constants of the analogue filter", ("first_order", "second_order"), 5e-6, 2e-4)
def _sensor_lag(effect, plant, p, s):
    return Lag(effect.size, 1 + _shape(effect))


@_entry(
    "magnetizing_saturation",
    "fraction at rated flux",
    "extra magnetizing current at rated flux",
    SATURATION_SHAPES,
    0.01,
    0.6,
)
def _magnetizing_saturation(effect, plant, p, s):
    p[at.P_SAT] = effect.size
    p[at.P_SAT_ORDER] = effect.details.get("order", plant.machine.saturation_order)
    p[at.P_SAT_SHAPE] = SATURATION_SHAPES.index(effect.shape or plant.machine.saturation_shape)


@_entry("magnetic_hysteresis", "A", "largest memory current of the iron", ("dahl", "plays", "widening"), 0.004, 0.2)
def _magnetic_hysteresis(effect, plant, p, s):
    p[at.P_ORDER] = 12.0
    p[at.P_HYST_A] = effect.size
    p[at.P_HYST_SHAPE] = _shape(effect)
    p[at.P_HYST_WB] = effect.details.get("scale_wb", 0.12 * plant.nameplate.rated_flux_wb)


@_entry("remanence", "Wb", "flux in the machine when the first segment begins", ("once", "every_segment"), 0.004, 0.2)
def _remanence(effect, plant, p, s):
    c, q = _direction(effect)
    p[at.P_FLUX0_C], p[at.P_FLUX0_S] = effect.size * c, effect.size * q


@_entry(
    "leakage_saturation", "fraction at twice rated current", "leakage inductance lost there", LEAKAGE_SHAPES, 0.005, 0.3
)
def _leakage_saturation(effect, plant, p, s):
    m, peak = plant.machine, 2.0 * plant.nameplate.rated_peak_current_a
    knee = effect.details.get("knee", 0.5)
    p[at.P_LEAKSAT_SHAPE] = _shape(effect)
    p[at.P_LEAKSAT_WB] = knee * m.leakage_inductance_h * peak
    reach = leakage_excess((1.0 - effect.size) / knee, float(_shape(effect)))
    p[at.P_LEAKSAT] = effect.size / (1.0 - effect.size) / reach


@_entry(
    "rotor_skin_effect",
    "fraction at rated frequency",
    "R_r(f_N)/R_r(0) - 1 of the cage",
    ("one_cell", "two_cells"),
    0.01,
    0.6,
)
def _rotor_skin_effect(effect, plant, p, s):
    """Bars as R in series with (R parallel L) cells; the DC leakage stays that of the machine."""
    m, w = plant.machine, 2.0 * math.pi * plant.nameplate.rated_frequency_hz
    p[at.P_ORDER] = 12.0
    cells = [(1.0, effect.details.get("corner", 1.5))]
    if _shape(effect) == 1:
        cells = [(0.45, 0.6), (1.6, 3.5)]
    gain = sum(share / (1.0 + corner**2) for share, corner in cells)
    total = effect.size * m.rotor_resistance_ohm / gain
    for j, (share, corner) in enumerate(cells):
        p[at.P_SKIN1_OHM + 2 * j] = total * share
        p[at.P_SKIN1_H + 2 * j] = total * share / (corner * w)
        p[at.P_LEAK_H] -= p[at.P_SKIN1_H + 2 * j]
    if p[at.P_LEAK_H] < 0.3 * m.leakage_inductance_h:
        raise ValueError(f"rotor_skin_effect: {effect.size:g} needs more leakage than the machine has")


@_entry("iron_loss", "S", "conductance parallel to the stator EMF", ("resistor", "eddy"), 2e-5, 3e-3)
def _iron_loss(effect, plant, p, s):
    if _shape(effect) == 0:
        p[at.P_IRON_S] = effect.size
        return
    p[at.P_ORDER] = 12.0
    p[at.P_EDDY_OHM] = 1.0 / effect.size
    p[at.P_EDDY_H] = p[at.P_EDDY_OHM] / (2.0 * math.pi * effect.details.get("corner_hz", 400.0))


@_entry(
    "stator_heating", "1/min at rated current", "rise of the phase resistances", ("per_phase", "shared"), 0.002, 0.12
)
def _stator_heating(effect, plant, p, s):
    p[at.P_HEAT_S] = effect.size / (60.0 * plant.nameplate.rated_current_a**2)
    p[at.P_HEAT_S_TAU] = effect.details.get("time_constant_s", 300.0)
    p[at.P_HEAT_S_SHAPE] = _shape(effect)


@_entry("rotor_heating", "1/min at rated current", "rise of the cage resistance", ("leaky", "slow"), 0.02, 2.0)
def _rotor_heating(effect, plant, p, s):
    p[at.P_HEAT_R] = effect.size / (120.0 * plant.nameplate.rated_current_a**2)
    p[at.P_HEAT_R_TAU] = effect.details.get("time_constant_s", (60.0, 1e9)[_shape(effect)])


@_entry("sensor_offset", "A", "largest offset of the three sensors", ("independent", "common"), 0.001, 0.15)
def _sensor_offset(effect, plant, p, s):
    default = ((1.0, -0.6, 0.25), (1.0, 1.0, 1.0))[_shape(effect)]
    s[at.S_OFFSET_U : at.S_OFFSET_W + 1] = _per_phase(effect, default)


@_entry("sensor_drift", "A per minute", "slow wander of the offsets", ("ramp", "warm_up", "swing"), 0.002, 0.3)
def _sensor_drift(effect, plant, p, s):
    s[at.S_DRIFT_U : at.S_DRIFT_W + 1] = _per_phase(effect, (1.0, 0.4, -0.7))
    s[at.S_DRIFT_TAU], s[at.S_DRIFT_SHAPE] = effect.details.get("time_s", 60.0), _shape(effect)


@_entry("sensor_switch_on", "A", "largest offset at the first sample, gone later", ("slow", "fast"), 0.01, 0.5)
def _sensor_switch_on(effect, plant, p, s):
    s[at.S_START_U : at.S_START_W + 1] = _per_phase(effect, (0.7, -0.4, 1.0))
    s[at.S_START_TAU] = effect.details.get("time_s", (0.06, 0.015)[_shape(effect)])


@_entry(
    "sensor_gain_mismatch",
    "fraction",
    "largest gain departure, mean of the three is 1",
    ("spread", "one_phase"),
    5e-4,
    0.03,
)
def _sensor_gain_mismatch(effect, plant, p, s):
    default = ((1.0, -0.7, -0.3), (1.0, -0.5, -0.5))[_shape(effect)]
    s[at.S_GAIN_U : at.S_GAIN_W + 1] = [1.0 + g for g in _per_phase(effect, default)]


@_entry(
    "sensor_nonlinearity",
    "fraction of full scale",
    "curvature at full scale",
    ("cubic", "soft", "kink", "even"),
    5e-4,
    0.02,
)
def _sensor_nonlinearity(effect, plant, p, s):
    if _shape(effect) == 3:
        s[at.S_QUADRATIC] = effect.size
        return
    s[at.S_CUBIC], s[at.S_NONLINEAR_SHAPE] = effect.size, _shape(effect)
    s[at.S_QUADRATIC] = effect.details.get("even", 0.0)


# no finer than 12 bits over three times the rated peak: such steps count as noise (`hidden.draw` gives them to recordings without a cause)
@_entry("quantization", "A", "step of the converter", ("mid_tread", "floor"), 0.013, 0.15)
def _quantization(effect, plant, p, s):
    s[at.S_LSB_A] = effect.size
    if _shape(effect) == 1:
        s[at.S_OFFSET_U : at.S_OFFSET_W + 1] -= 0.5 * effect.size


@_entry(
    "clipping", "fraction of the peak cut off", "sensor's end below the current's peak", ("hard", "soft"), 0.02, 0.4
)
def _clipping(effect, plant, p, s):
    s[at.S_CLIP_A] = effect.details.get("limit_a", (1.0 - effect.size) * plant.nameplate.rated_peak_current_a)
    s[at.S_CLIP_SHAPE] = _shape(effect)


@_entry("mains_pickup", "A", "largest mains line in the sensors", ("sine", "distorted"), 0.0005, 0.05)
def _mains_pickup(effect, plant, p, s):
    s[at.S_PICKUP_U : at.S_PICKUP_W + 1] = _per_phase(effect, (1.0, 0.6, 0.8))
    s[at.S_PICKUP_HZ] = effect.details.get("frequency_hz", 50.02)
    s[at.S_PICKUP_RAD], s[at.S_PICKUP_SHAPE] = effect.details.get("phase_rad", 0.3), _shape(effect)


@_entry("clock_drift", "ppm", "sampling clock slow against the drive's", ("constant", "wandering"), 0.05, 100.0)
def _clock_drift(effect, plant, p, s):
    """Acts where the recording is sampled."""


@_entry(
    "lost_samples", "samples", "current samples missing, unmarked", ("current_only", "whole_rows", "held"), 1.0, 12.0
)
def _lost_samples(effect, plant, p, s):
    """Acts where the recording is sampled."""


@_entry("shaft_motion", "rad/s electrical", "the rotor turns", ("creep", "decaying", "pendulum"), 0.01, 3.0)
def _shaft_motion(effect, plant, p, s):
    p[at.P_SPEED], p[at.P_SPEED_SHAPE] = effect.size, _shape(effect)
    p[at.P_SPEED_RATE] = effect.details.get("rate_per_s", (0.0, 0.2, 3.7)[_shape(effect)])


@_entry(
    "inductance_anisotropy",
    "fraction",
    "half the spread of inductance over directions",
    ("leakage", "main"),
    5e-4,
    0.06,
)
def _inductance_anisotropy(effect, plant, p, s):
    c, q = _direction(effect)
    c2, s2 = c * c - q * q, 2.0 * c * q
    first = (at.P_ANISO_C, at.P_SALIENT_C)[_shape(effect)]
    p[first], p[first + 1] = effect.size * c2, effect.size * s2


@_entry(
    "resistance_anisotropy", "fraction", "half the spread of resistance over directions", ("phases", "cage"), 5e-4, 0.06
)
def _resistance_anisotropy(effect, plant, p, s):
    c, q = _direction(effect)
    c2, s2 = c * c - q * q, 2.0 * c * q
    if _shape(effect) == 1:
        p[at.P_RR_C], p[at.P_RR_S] = effect.size * c2, effect.size * s2
        return
    for j, slot in enumerate((at.P_RSA, at.P_RSB, at.P_RSC)):  # R_x = R (1 + 2 e cos(2 theta_x - 2 theta_0))
        turn = 2.0 * j * 2.0 * math.pi / 3.0
        p[slot] *= 1.0 + 2.0 * effect.size * (math.cos(turn) * c2 + math.sin(turn) * s2)


@_entry("cable_capacitance", "F", "capacitance behind the sensors, star", ("step", "damped"), 5e-10, 2e-7)
def _cable_capacitance(effect, plant, p, s):
    s[at.S_CABLE_F], s[at.S_CABLE_SHAPE] = effect.size, _shape(effect)
