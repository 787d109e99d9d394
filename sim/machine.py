"""What is simulated, as frozen facts: nameplate, Gamma-form machine, power stage, sensors, heating, named effects."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from sim import layout as at
from sim.laws import SATURATION_SHAPES, SIGN_SHAPES, saturation_excess

COPPER_PER_K = 0.00393


@dataclass(frozen=True)
class Nameplate:
    rated_power_w: float = 2200.0
    rated_voltage_v: float = 400.0
    rated_frequency_hz: float = 50.0
    rated_current_a: float = 5.0
    rated_speed_rpm: float = 1436.0
    power_factor: float = 0.80
    pole_pairs: int = 2

    @property
    def rated_flux_wb(self) -> float:
        """Stator flux amplitude at rated voltage and frequency, no resistive drop: V sqrt(2/3) / (2 pi f)."""
        return self.rated_voltage_v * math.sqrt(2.0 / 3.0) / (2.0 * math.pi * self.rated_frequency_hz)

    @property
    def rated_peak_current_a(self) -> float:
        return math.sqrt(2.0) * self.rated_current_a


@dataclass(frozen=True)
class Machine:
    """Gamma form, per phase. Saturation: i_M = psi/inductance_h * (1 + excess), excess given at rated flux.

    Defaults: the measured 2.2 kW machine of Qu, Ranta, Hinkkanen, Luomi (DOI 10.1109/TIA.2012.2190818).
    """

    stator_resistance_ohm: float = 3.7
    rotor_resistance_ohm: float = 2.5
    leakage_inductance_h: float = 0.023
    inductance_h: float = 0.34
    saturation_at_rated_flux: float = (0.84 * 400.0 * math.sqrt(2.0 / 3.0) / (100.0 * math.pi)) ** 7
    saturation_order: float = 7.0
    saturation_shape: str = "power"


@dataclass(frozen=True)
class PowerStage:
    switching_frequency_hz: float = 5000.0
    dead_time_s: float = 2.5e-6
    dead_time_knee_a: float = 0.12
    dead_time_shape: str = "capacitive"
    threshold_v: float = 1.2
    threshold_knee_a: float = 0.08
    threshold_shape: str = "root"
    slope_ohm: float = 0.02
    link_v: float = 540.0
    link_ripple: float = 0.006
    link_ripple_hz: float = 300.0

    @property
    def dead_time_v(self) -> float:
        return self.dead_time_s * self.switching_frequency_hz * self.link_v


@dataclass(frozen=True)
class Sensors:
    noise_a: float = 0.010
    offset_a: tuple[float, float, float] = (0.025, -0.018, 0.012)
    gain: tuple[float, float, float] = (1.003, 0.998, 1.001)
    bits: int = 12
    full_scale_a: float = 15.0
    delay_s: float = 4e-6
    lag_s: float = 8e-6
    link_noise_v: float = 0.5

    @property
    def lsb_a(self) -> float:
        return 2.0 * self.full_scale_a / 2**self.bits if self.bits else 0.0


@dataclass(frozen=True)
class Heating:
    """Resistance rise per minute at rated current, adiabatic, and the time constant towards the iron."""

    stator_per_min: float = 0.035
    rotor_per_min: float = 0.03
    time_constant_s: float = 500.0


@dataclass(frozen=True)
class Effect:
    """A named departure from the four-parameter model; `size` in the unit its entry in `sim.effects` states."""

    name: str
    size: float
    shape: str = ""
    details: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Plant:
    nameplate: Nameplate = field(default_factory=Nameplate)
    machine: Machine = field(default_factory=Machine)
    power_stage: PowerStage = field(default_factory=PowerStage)
    sensors: Sensors = field(default_factory=Sensors)
    heating: Heating = field(default_factory=Heating)
    effects: tuple[Effect, ...] = ()
    control_period_s: float = 2e-4


def pack(plant: Plant, *, accuracy: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """(p, s): machine and sensing arrays of `layout`; `accuracy` 2 halves the integration step."""
    from sim import effects

    p, s = np.zeros(at.P_COUNT), np.zeros(at.S_COUNT)
    _pack_machine(plant, p)
    _pack_power_stage(plant, p)
    _pack_sensors(plant, s)
    lag = _Lag(plant.sensors.lag_s, 1)
    for effect in plant.effects:
        lag = effects.apply(effect, plant, p, s) or lag
    p[at.P_SUBSTEPS] = _substeps(p, accuracy)
    _pack_lag(p, lag)
    return p, s


@dataclass(frozen=True)
class _Lag:
    time_s: float
    order: int


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


def _pack_lag(p: np.ndarray, lag: _Lag) -> None:
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


def stator_inductance_h(plant: Plant, flux_wb: float, kind: str = "secant") -> float:
    """L_s of the Gamma form at a stator flux amplitude.

    `secant` psi/i, `incremental` d psi/d i, `sine` = what a sinusoidal flux of this amplitude shows at its own
    frequency (first harmonic of the magnetizing current).
    """
    if kind == "secant":
        return flux_wb / _magnetizing_current(plant, flux_wb) if flux_wb > 0 else _small_signal(plant)
    if kind == "incremental":
        d = 1e-6
        return 2 * d / (_magnetizing_current(plant, flux_wb + d) - _magnetizing_current(plant, flux_wb - d))
    if kind != "sine":
        raise ValueError(f"kind is secant, incremental or sine, not {kind!r}")
    turn = (np.arange(2000) + 0.5) * math.pi / 2000
    current = np.array([_magnetizing_current(plant, flux_wb * math.cos(a)) for a in turn])
    return flux_wb / (2.0 * float(np.mean(current * np.cos(turn)))) if flux_wb > 0 else _small_signal(plant)


def _small_signal(plant: Plant) -> float:
    return stator_inductance_h(plant, 1e-6)


def _magnetizing_current(plant: Plant, flux_wb: float) -> float:
    m = saturated(plant)
    y = (flux_wb / plant.nameplate.rated_flux_wb) ** 2
    excess = saturation_excess(
        y, m.saturation_at_rated_flux, m.saturation_order, float(SATURATION_SHAPES.index(m.saturation_shape))
    )
    return flux_wb / m.inductance_h * (1.0 + excess)


def saturated(plant: Plant) -> Machine:
    """The machine with a `magnetizing_saturation` effect, if any, written into its saturation fields."""
    from dataclasses import replace

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
