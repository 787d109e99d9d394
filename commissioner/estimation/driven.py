"""The bare machine, its voltage and its speed given: what current it draws."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from commissioner.estimation.kernels.march import STATES, Load, march
from commissioner.estimation.numbers import AT, COUNT, DEFAULTS, FOUR
from commissioner.estimation.record import between
from commissioner.motor.circuit import InverseGamma

Array = NDArray[np.float64]
Vector = NDArray[np.complex128]


def driven(
    circuit: InverseGamma,
    voltage_v: Vector,
    electrical_speed_rad_per_s: Array,
    period_s: float,
    current_a: complex,
    rotor_flux_wb: complex,
) -> Vector:
    """Stator current (n,), from voltage (n,) and speed (n,) at the sample times, and current and rotor flux at the first of them.

    All complex numbers are amplitude-invariant space vectors in stator coordinates; the rotor flux is that of the inverse-Gamma circuit.
    """
    count = voltage_v.size
    p, first = np.zeros(COUNT), np.zeros(STATES)
    for name, value in (DEFAULTS | dict(zip(FOUR, circuit.as_tuple(), strict=True))).items():
        p[AT[name]] = value
    stator_flux_wb = circuit.leakage_inductance_h * current_a + rotor_flux_wb
    first[:4] = stator_flux_wb.real, stator_flux_wb.imag, rotor_flux_wb.real, rotor_flux_wb.imag
    voltage = np.stack([between(voltage_v.real), between(voltage_v.imag)], axis=1)
    speed = np.stack([between(electrical_speed_rad_per_s), np.zeros(2 * count - 1)], axis=1)
    out, shaft, no_scales = np.zeros((count, 3)), np.zeros((count, 2)), (*(1.0,) * 5, 0.0)
    no_load = Load(np.zeros(2), np.zeros(2 * count - 1))
    march(p, no_scales, first, voltage, speed, no_load, period_s, False, out, shaft)
    return np.asarray(out[:, 0] + 1j * out[:, 1])
