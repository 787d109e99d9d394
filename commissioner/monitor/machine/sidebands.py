"""One speed from two side bands: what may be wrong with each, and the weights of least variance.

A true speed has upper = conj(lower). Noise and the circuit's own errors hit the two independently; an eccentric air gap, which
modulates the flux in size, hits them with opposite sign, a speed with equal sign. Generalised least squares with
these covariances takes the gap's share out as far as the noise allows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from commissioner.monitor.machine.inversion import Torus, flux_lines, moved_speed
from commissioner.monitor.signals.averaging import Lines
from commissioner.monitor.signals.supply import Vector
from commissioner.motor.running import TCircuit
from commissioner.records import Signal

AIR_GAP_FLUX = {1: 1e-3, 2: 3e-5}
"""Amplitude of the flux, as share of the main flux, that an uneven gap modulates once and twice per turn (standard
deviation); no torque makes it. Mixed eccentricity shows 50 dB below the current's fundamental; twice per turn takes an oval
stator and an oval rotor, 0.8 % of the gap each: their product's half, 75 dB below."""
LINE_MODEL_ERROR = 0.015
"""Share of a line's voltage that the constant-parameter circuit may explain wrongly (rotor skin effect, air-gap waves)."""
SATURATION = 0.2
"""Share of a line's magnetizing current likewise: iron answers a ripple of the flux's size with its incremental inductance, 0.5 to
0.8 of that of its mean flux, a ripple of its direction with the latter."""
MAINS_MODEL_ERROR = 0.03
"""The same at harmonics of the mains, where bars have more resistance and less leakage by their skin effect: the fit's robust
loss has to bear what deep bars make beyond it."""


@dataclass(frozen=True)
class BandError:
    """Speed errors in rad/s of each order: `upper`, `lower` `(m,)` independent standard deviations; `gap_*` `(modes, m)` the
    effect of one-sigma air-gap modulations, each mode's real and imaginary part in turn.
    """

    upper: Signal
    lower: Signal
    gap_upper: Vector
    gap_lower: Vector


def band_error(circuit: TCircuit, pole_pairs: int, lines: Lines, on: Torus, mean_speed_rad_per_s: float) -> BandError:
    """The errors of all orders at the given circuit, first order."""
    stator_rate = np.abs(lines.rate_rad_per_s + lines.supply_rad_per_s)
    leak = circuit.stator_leakage_h * stator_rate + circuit.rotor_leakage_h * np.abs(lines.rate_rad_per_s)
    drop = np.abs(lines.voltage_v) + leak * np.abs(lines.current_a)
    order = np.abs(lines.rate_rad_per_s / lines.supply_rad_per_s)
    of_mains = (order > 0.5) & (np.abs(order - np.round(order)) < 1e-6)
    wrong = np.where(of_mains, MAINS_MODEL_ERROR, LINE_MODEL_ERROR) * drop
    twice = np.abs(order - 2.0) < 1e-6
    wrong = np.where(twice, np.hypot(wrong, lines.asymmetry * drop[0]), wrong)
    still = np.zeros_like(lines.current_a)
    flux = flux_lines(circuit, lines.current_a, lines.voltage_v, lines.rate_rad_per_s, lines.supply_rad_per_s)
    own = flux.stator_flux_wb - circuit.stator_leakage_h * lines.current_a
    iron = SATURATION * np.abs(own) / circuit.magnetizing_inductance_h
    _, upper, lower = moved_speed(circuit, pole_pairs, lines, on, np.array([still, iron]), np.array([wrong, still]))
    gap = _gap_voltages(circuit, lines, mean_speed_rad_per_s)
    _, gap_upper, gap_lower = moved_speed(circuit, pole_pairs, lines, on, np.zeros_like(gap), gap)
    return BandError(np.hypot(*np.abs(upper)), np.hypot(*np.abs(lower)), gap_upper, gap_lower)


def _gap_voltages(circuit: TCircuit, lines: Lines, mean_speed_rad_per_s: float) -> Vector:
    """`(modes, k)`: d/dt of g(t) psi_m in the turning frame for g = 2 Re(G e^{j h angle}), G = half the amplitude."""
    stator = lines.voltage_v[0] - circuit.stator_resistance_ohm * lines.current_a[0]
    main = stator / (1j * lines.supply_rad_per_s) - circuit.stator_leakage_h * lines.current_a[0]
    turns = lines.rate_rad_per_s / mean_speed_rad_per_s
    rows = []
    for per_turn, amplitude in AIR_GAP_FLUX.items():
        for direction in (1.0, 1j):
            half = 0.5 * amplitude * direction / np.sqrt(2.0)
            row = np.where(np.abs(turns - per_turn) < 1e-3, half, 0) + np.where(
                np.abs(turns + per_turn) < 1e-3, np.conj(half), 0
            )
            rows.append(1j * (lines.rate_rad_per_s + lines.supply_rad_per_s) * main * row)
    return np.array(rows, dtype=np.complex128)


def least_variance_weight(upper: Signal, lower: Signal, moved_upper: Vector, moved_lower: Vector) -> Vector:
    """The upper band's weight w, the lower one's being 1 - w: w = (d - conj b) / (a + d - 2 Re b).

    `upper`, `lower`: independent variances `(m,)`; `moved_*` `(modes, m)`: common causes. C = [[a, b], [conj b, d]].
    """
    a = upper + np.sum(np.abs(moved_upper) ** 2, axis=0)
    d = lower + np.sum(np.abs(moved_lower) ** 2, axis=0)
    b = np.sum(moved_upper * np.conj(moved_lower), axis=0)
    return np.asarray((d - np.conj(b)) / np.maximum(a + d - 2 * b.real, 1e-300), dtype=np.complex128)
