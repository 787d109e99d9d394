"""What is recorded: machine, supply, course of a test, sensors and hidden effects of a motor that is started and loaded."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Machine:
    """Gamma circuit (leakage on the rotor's side), per phase of the star equivalent, and the shaft. SI."""

    stator_resistance_ohm: float
    rotor_resistance_ohm: float
    leakage_inductance_h: float
    inductance_h: float
    inertia_kg_m2: float
    pole_pairs: int
    rotor_slots: int = 28


@dataclass(frozen=True)
class Supply:
    """Mains with what is wrong with them, or an inverter (`ramp_s` above 0) with a sine filter."""

    voltage_v: float
    frequency_hz: float
    unbalance: float = 0.0
    unbalance_rad: float = 0.0
    fifth: float = 0.0
    seventh: float = 0.0
    wander: float = 0.0
    wander_rad_per_s: float = 2.0
    phase_rad: float = 0.0
    ramp_s: float = 0.0
    boost: float = 0.06
    switching_frequency_hz: float = 0.0


@dataclass(frozen=True)
class Course:
    """`open_s`: contactor open before; `is_running`: turning in steady state from the first sample.

    `load`: constant torque, per speed squared (both N m at synchronous speed); `steps`: (time after closing, torque added).
    `ripple`: share of the load at once and twice the shaft's frequency; `swing`: share of the load that pulsates so many times a turn
    of the shaft, as one behind a belt or a gear does.
    """

    duration_s: float = 3.0
    open_s: float = 0.08
    is_running: bool = False
    rate_hz: float = 5000.0
    constant_nm: float = 0.0
    fan_nm: float = 0.0
    steps: tuple[tuple[float, float], ...] = ()
    ripple: tuple[float, float] = (0.0, 0.0)
    swing: tuple[float, float] = (0.0, 1.0)


@dataclass(frozen=True)
class Sensors:
    """Noise of currents (A), voltages (V), and of the speed (rad/s, mechanical), an encoder's ripple at shaft frequency.

    `speed_lines`: 0 = no speed column quantisation, else pulses a turn counted over a sample.
    """

    current_noise_a: float = 0.0
    voltage_noise_v: float = 0.0
    speed_noise_rad_per_s: float = 0.0
    speed_ripple_rad_per_s: float = 0.0
    has_speed: bool = True
    has_w: bool = True
    line_to_line: bool = False


@dataclass(frozen=True)
class Effect:
    """`size` in the catalogue's unit; `phase` 0, 1, 2 = u, v, w where the effect sits in one; -0.25, 0.75, 1.75 = a delta's
    windings uv, vw, wu."""

    name: str
    size: float
    phase: float = 0
    details: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Scenario:
    name: str
    nameplate: dict[str, float]
    machine: Machine
    supply: Supply
    course: Course
    sensors: Sensors
    effects: tuple[Effect, ...] = ()


@dataclass(frozen=True)
class Played:
    """Truth on a fine grid, `substeps` points a sample: vectors in stator coordinates, amplitude-invariant."""

    time_s: NDArray[np.float64]
    voltage: NDArray[np.complex128]
    current: NDArray[np.complex128]
    speed_rad_per_s: NDArray[np.float64]
    angle_rad: NDArray[np.float64]
    torque_nm: NDArray[np.float64]
    load_nm: NDArray[np.float64]
    substeps: int
