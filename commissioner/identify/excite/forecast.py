"""Compiled simulation of the near future: what a known voltage will make of a machine behind its inverter."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.identify.excite.tones import Excitation
from commissioner.identify.inverter.staircase import InverterError
from commissioner.identify.observer.kernels import Held, forecast
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.standstill import held_input
from commissioner.records import Signal

Array = NDArray[np.float64]


LOSS_ROWS = 1025


@dataclass(frozen=True)
class Forecast:
    """The excitation behind the inverter as it is known, along one axis."""

    excitation: Excitation
    lost_v: Signal
    span_a: float

    @classmethod
    def behind(cls, inverter: InverterError, excitation: Excitation, axis_deg: float) -> Forecast:
        span_a = max(inverter.current_a[-1], 1e-9)
        return cls(excitation, inverter.on_axis(np.linspace(0.0, span_a, LOSS_ROWS), axis_deg), span_a)

    def peaks(
        self,
        machine: InverseGamma,
        time_s: Signal,
        scale: float | Signal,
        start: tuple[float, float, float] = (0.0, 0.0, 0.0),
        loss: float = 1.0,
    ) -> tuple[float, float]:
        """(largest |stator flux|, largest |current|) over evenly spaced instants, from (current, rotor flux, integrated
        stator flux), this share of the inverter's loss taken off."""
        return self._ahead(machine, time_s, start, loss, (math.inf, math.inf))(scale)

    def keeps_below(
        self,
        most: tuple[float, float],
        machine: InverseGamma,
        time_s: Signal,
        start: tuple[float, float, float] = (0.0, 0.0, 0.0),
        loss: float = 1.0,
    ) -> Callable[[float | Signal], bool]:
        """Whether both `peaks` stay below the most, over the scale; what does not is simulated no further than to there."""
        peaks = self._ahead(machine, time_s, start, loss, most)

        def keeps(scale: float | Signal) -> bool:
            flux_wb, current_a = peaks(scale)
            return flux_wb < most[0] and current_a < most[1]

        return keeps

    def _ahead(
        self,
        machine: InverseGamma,
        time_s: Signal,
        start: tuple[float, float, float],
        loss: float,
        most: tuple[float, float],
    ) -> Callable[[float | Signal], tuple[float, float]]:
        """`peaks` over the scale: what is the same for all scales is computed once."""
        period_s = float(time_s[1] - time_s[0])
        of_scale, lost_v = self.excitation.over_scale(time_s), loss * self.lost_v
        matrix, gain = held_input(machine, period_s)
        r_s, leakage = machine.stator_resistance_ohm, machine.leakage_inductance_h
        held = Held(matrix, gain, r_s, leakage, lost_v, self.span_a)

        def peaks(scale: float | Signal) -> tuple[float, float]:
            flux_wb, current_a = forecast(of_scale(scale), period_s, held, start, most)
            return float(flux_wb), float(current_a)

        return peaks
