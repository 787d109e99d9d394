"""A DC bias beside small tones: how much fits under the flux limit, and the guard that holds it there.

A direct current above the tones' peak keeps the sign of every leg's current, so that what dead time and device drop take
stays constant and the tones see the linear machine (`standstill_identification` 3.4); building it up and holding it tells
the magnetizing inductance where slow tones drown in the inverter's loss. Its price is flux: L I, whatever the frequency.

A voltage integral cannot watch a constant flux. The current can: `current_flux`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from commissioner.identify.excite.current_flux import CurrentFlux
from commissioner.identify.excite.forecast import Forecast
from commissioner.identify.excite.tones import Excitation, ExcitationLimits, predicted_peaks
from commissioner.identify.inverter.staircase import DcLevel, InverterError
from commissioner.motor.circuit import InverseGamma
from commissioner.records import Signal, peak

ABOVE_TONES = 1.25
"""Bias over the tones' peak current."""
FLUX_TARGET, CUT_ABOVE = 0.85, 0.96
"""Of the flux limit: what bias and tones are to make together, and where they are taken off."""
LEAST = 0.1
"""Of the flux limit: a bias that makes less would not be worth its time."""
DOUBT = 0.05
"""How far L_M may be off."""
AHEAD_POINTS = 200


@dataclass(frozen=True)
class BiasPlan:
    """`scale` of the tones; the bias in volts along the axis, the current it drives, the peak flux of both together."""

    scale: float
    voltage_v: float
    current_a: float
    peak_flux_wb: float


def plan_bias(
    machine: InverseGamma,
    excitation: Excitation,
    limits: ExcitationLimits,
    levels: Sequence[DcLevel],
    sample_period_s: float,
) -> BiasPlan | None:
    """The largest bias with tones below it; None where none worth its time fits. `levels` say which voltage holds which
    current on this axis: no model of the inverter is needed."""
    flux_wb, current_a = predicted_peaks(machine, excitation, sample_period_s)
    inductance_h = machine.leakage_inductance_h + machine.magnetizing_inductance_h
    ratio = ABOVE_TONES * current_a
    scale = min(
        FLUX_TARGET * limits.flux_wb / (inductance_h * ratio + flux_wb),
        limits.current_a / (ratio + current_a),
        max(abs(level.current_a) for level in levels) / ratio,
        1.0,
    )
    bias_a = ratio * scale
    if inductance_h * bias_a < LEAST * limits.flux_wb:
        return None
    voltage_v = _holding(levels, bias_a)
    tones_v = scale * sum(t.amplitude_v for t in excitation.tones)
    if voltage_v + tones_v > limits.voltage_v:
        return None
    return BiasPlan(scale, voltage_v, bias_a, inductance_h * bias_a + scale * flux_wb)


def _holding(levels: Sequence[DcLevel], current_a: float) -> float:
    """The voltage that holds this current: straight lines between the levels, both signs taken together."""
    size = sorted((abs(level.current_a), abs(level.voltage_v)) for level in levels)
    currents, volts = zip(*size, strict=True)
    return float(np.interp(current_a, currents, volts))


@dataclass
class BiasGuard:
    """One per biased stretch. `rotor_flux_wb` is what the rotor holds when it begins; times as in `FluxGuard`."""

    machine: InverseGamma
    limit_wb: float
    latency_s: float
    excitation: Excitation
    scale: float
    bias_v: float
    sample_period_s: float
    inverter: InverterError
    axis_deg: float
    rotor_flux_wb: float
    reaction_s: float = 0.02
    _forecast: Forecast = field(init=False)
    _flux: CurrentFlux = field(init=False)

    def __post_init__(self) -> None:
        worst_h = (1.0 + DOUBT) * self.machine.magnetizing_inductance_h
        self.machine = replace(self.machine, magnetizing_inductance_h=worst_h)
        whole = replace(self.excitation, dc_bias_v=self.bias_v)
        self._forecast = Forecast.behind(self.inverter, whole, self.axis_deg)
        self._flux = CurrentFlux(self.machine, self.sample_period_s, self.rotor_flux_wb)

    def advance(self, current_a: Signal, ends_s: float, lost_before: int = 0) -> tuple[float, float]:
        """(largest |stator flux| of the block, the same over latency and reaction as well), in Wb; `ends_s` is the end of
        the block from the excitation's start."""
        seen = self._flux.advance(current_a, lost_before)
        peak_wb = peak(seen)
        steps = max(2, math.ceil((self.latency_s + self.reaction_s) / self.sample_period_s))
        stride = max(1, steps // AHEAD_POINTS)
        ahead = ends_s + (np.arange(steps // stride + 1, dtype=np.float64) + 0.5) * self.sample_period_s * stride
        start = (float(current_a[-1]), self._flux.rotor_flux_wb, float(seen[-1]))
        predicted_wb, _ = self._forecast.peaks(self.machine, ahead, self.scale, start)
        return peak_wb, max(peak_wb, predicted_wb)
