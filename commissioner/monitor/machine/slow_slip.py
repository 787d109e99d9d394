"""How the slip wanders over seconds: from the impedance that the motor shows, period by period of the supply.

A mains voltage that moves by 0.2 % moves the slip by 0.4 % of itself; at 0.1 Hz that turns the shaft 0.02 rad away from a fixed
ratio to the mains, and smears the tenth harmonic by a fifth of a radian. The mean line of (14) has a signal-to-noise ratio
that no side band has, so the slow part of the phase is computed, and only the rest is looked for in the combs.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import make_lsq_spline

from commissioner.monitor.machine.inversion import flux_lines
from commissioner.monitor.signals.supply import KNOT_SPACING_S, TurningFrame, Vector
from commissioner.motor.running import TCircuit
from commissioner.records import Signal


def slip_phase(frame: TurningFrame, circuit: TCircuit) -> Signal:
    """`(n,)` rad of the supply's angle that turn a shaft at mean slip as far: the integral of the slow slip frequency's deviation
    from its mean over (1 - slip), negative where the shaft lags.

    Slip frequency = Re{(d lambda_r/dt + R_r i_r) / (j lambda_r)} of the means over whole supply periods, quasi-steady
    (rate 0), through a cubic spline with knots `KNOT_SPACING_S` apart. Wrong parameters scale it, by about their error in R_r.
    """
    supply = float(frame.supply_rad_per_s.mean())
    step = max(1, round(2 * np.pi / supply / frame.sample_period_s))
    blocks = frame.time_s.size // step
    pieces = int(np.ptp(frame.time_s) / KNOT_SPACING_S)
    if pieces < 3:
        return np.zeros(frame.time_s.size)
    current, voltage, time, pace = (
        signal[: blocks * step].reshape(blocks, step).mean(axis=1)
        for signal in (frame.current_a, frame.voltage_v, frame.time_s, frame.supply_rad_per_s)
    )
    flux = flux_lines(circuit, current, voltage, pace - supply, supply)
    slip = np.real(
        (circuit.rotor_resistance_ohm / 1j) * _rotor_current(circuit, current, flux.rotor_flux_wb) / flux.rotor_flux_wb
    )
    inner = np.linspace(frame.time_s[0], frame.time_s[-1], pieces + 1)[1:-1]
    knots = np.concatenate([[frame.time_s[0]] * 4, inner, [frame.time_s[-1]] * 4])
    slow = make_lsq_spline(time, slip - slip.mean(), knots, k=3).antiderivative()
    phase = np.asarray(slow(frame.time_s), dtype=np.float64)
    return np.asarray((phase - phase.mean()) / (1 + slip.mean() / supply), dtype=np.float64)


def _rotor_current(circuit: TCircuit, current: Vector, rotor_flux: Vector) -> Vector:
    return np.asarray((rotor_flux - circuit.magnetizing_inductance_h * current) / circuit.rotor_inductance_h)
