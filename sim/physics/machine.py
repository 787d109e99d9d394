"""What is simulated, as frozen facts: nameplate, Gamma-form machine, power stage, sensors, heating, named effects."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

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
    """A named departure from the four-parameter model; `size` in the unit its entry in `sim.physics.effects` states."""

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


@dataclass(frozen=True)
class Lag:
    """Low-pass of `order` equal poles in the current sensors; together `time_s` long."""

    time_s: float
    order: int
