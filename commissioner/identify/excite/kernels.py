"""Compiled signals of a block: the commanded tones, the flux that a current drives, the flux that a voltage integrates to."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from commissioner.compiled import njit

Array = NDArray[np.float64]
TURNS = 64
"""Of a tone, each of which adds a rounding error to it."""


@njit()
def sum_of_tones(time_s: Array, tones: Array) -> Array:
    """At evenly spaced instants `(n,)`; `tones` `(m, 3)`: amplitude, frequency in Hz, phase in rad. A tone is turned from instant to
    instant, and laid down anew after `TURNS`."""
    total = np.zeros_like(time_s)
    step_s = (time_s[-1] - time_s[0]) / (time_s.size - 1) if time_s.size > 1 else 0.0
    for m in range(tones.shape[0]):
        amplitude, omega, phase = tones[m, 0], 2.0 * math.pi * tones[m, 1], tones[m, 2]
        turn_cos, turn_sin = math.cos(omega * step_s), math.sin(omega * step_s)
        for first in range(0, time_s.size, TURNS):
            angle = omega * time_s[first] + phase
            x, y = amplitude * math.cos(angle), amplitude * math.sin(angle)
            for k in range(first, min(first + TURNS, time_s.size)):
                total[k] += x
                x, y = turn_cos * x - turn_sin * y, turn_sin * x + turn_cos * y
    return total


@njit()
def driven_flux(
    current_a: Array, lost_before: int, keeps: float, inductance_h: float, leakage_h: float, rotor_wb: float
) -> tuple[Array, float]:
    """(stator flux at the samples, the rotor's at the last): psi_R keeps its share a period and takes L_M i for the rest.

    The samples that were lost are bridged with the first current.
    """
    takes = (1.0 - keeps) * inductance_h
    for _ in range(lost_before):
        rotor_wb = keeps * rotor_wb + takes * current_a[0]
    flux = np.empty_like(current_a)
    for k in range(current_a.size):
        rotor_wb = keeps * rotor_wb + takes * current_a[k]
        flux[k] = rotor_wb + leakage_h * current_a[k]
    return flux, rotor_wb


@njit()
def integrated_flux(
    voltage_v: Array,
    current_a: Array,
    resistance_ohm: float,
    lost_v: Array,
    lost_span_a: float,
    period_s: float,
    corner: float,
    state: Array,
) -> Array:
    """psi' = u - R_s i - F(i) - 2 zeta w psi - w^2 integral(psi) at the samples; mean current over each period by trapezoid.

    A damped high-pass times an integrator as one difference equation, `corner` = w period; `state` `(2,)`, direct form II
    transposed, is carried on. F, the inverter's loss, is odd and tabulated over 0 ... `lost_span_a`.
    """
    flux = np.empty_like(voltage_v)
    a1, a2 = -2.0 + 1.4 * corner, 1.0 - 1.4 * corner + corner * corner
    z1, z2, last = state[0], state[1], current_a.size - 1
    per_a = (lost_v.size - 1) / lost_span_a
    for k in range(voltage_v.size):
        if k < last:
            following = current_a[k + 1]
        else:
            following = 2.0 * current_a[k] - current_a[k - 1] if last > 0 else current_a[k]
        mean = 0.5 * (current_a[k] + following)
        at = min(abs(mean) * per_a, lost_v.size - 1.0)
        cell = min(int(at), lost_v.size - 2)
        loss = lost_v[cell] + (at - cell) * (lost_v[cell + 1] - lost_v[cell])
        emf = voltage_v[k] - resistance_ohm * mean - (loss if mean >= 0.0 else -loss)
        flux[k] = period_s * emf + z1
        z1 = -period_s * emf - a1 * flux[k] + z2
        z2 = -a2 * flux[k]
    state[0], state[1] = z1, z2
    return flux


@njit()
def flux_behind(flux: Array, commanded: Array, admittance: NDArray[np.complex128], lost_v: float) -> float:
    """Sum of the tones' fluxes behind an inverter that acts like a resistance in series, `lost_v` over the rms current (see
    `tones.design`); `flux` per volt, all `(m,)`."""
    amplitude = commanded
    for _ in range(6):
        squares = 0.0
        for m in range(commanded.size):
            squares += abs(amplitude[m] * admittance[m]) ** 2
        amplitude = commanded / np.abs(1.0 + lost_v / max(math.sqrt(0.5 * squares), 1e-12) * admittance)
    return np.sum(flux * amplitude)


@njit()
def driven_peaks(voltage_v: Array, matrix: Array, gain: Array, leakage_h: float) -> tuple[float, float]:
    """(largest |stator flux|, largest |current|) of the linear machine under the voltages `(n,)`, from rest; `matrix`, `gain`: held-input
    model of current and rotor flux."""
    i, rotor, top_wb, top_a = 0.0, 0.0, 0.0, 0.0
    for k in range(voltage_v.size):
        i, rotor = (
            matrix[0, 0] * i + matrix[0, 1] * rotor + gain[0] * voltage_v[k],
            matrix[1, 0] * i + matrix[1, 1] * rotor + gain[1] * voltage_v[k],
        )
        top_wb, top_a = max(top_wb, abs(rotor + leakage_h * i)), max(top_a, abs(i))
    return top_wb, top_a
