"""How much of the designed amplitude a motor may be given: by what is known of it, and while nothing is.

A tone of amplitude A cannot make more flux than A / omega (1 - R_s Y is at most 1 for a passive machine), and no command makes more
than a direct voltage as large as its peaks: so a first scale is safe for any motor. What is known of the motor, taken to the bad side, permits more. Behind an inverter that loses
several times R_s I the current follows the amplitude like a corner, and no describing function tells it: it is simulated.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from commissioner.identify.excite.forecast import Forecast
from commissioner.identify.excite.kernels import flux_behind
from commissioner.identify.observer.observer import BlockEstimate
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.standstill import admittance_s

TARGET = 0.93
KNOWN_TARGET = 0.85
"""Flux that the first amplitude may make of a motor already measured, of the limit."""
SURE_LOSS, KNOWN_LOSS = 0.8, 0.97
"""Share of the inverter's loss that is sure to be taken: from before, and once current has flowed."""
SMALL_RAISE, CURRENT_STEP = 1.25, 0.15
"""While the estimates are unsure: largest ratio of two amplitudes, and what a raise may add of the permitted current."""
GROWTH = 3.0
STRIDE, HALVINGS = 4, 7
"""Periods per step of a simulated test; halvings in the search for a scale."""


@dataclass(frozen=True)
class Amplitude:
    """`limit_wb`: stator flux never to be passed; `current_a`: peak current aimed at; `plateau_v`: what the inverter takes
    of the axis voltage at large currents; `held_v`: a direct voltage that the motor was given, its flux staying below the limit;
    `least_impedance`: the machine of least impedance that the motor may be, where it may be another than the plate's."""

    forecast: Forecast
    limit_wb: float
    current_a: float
    plateau_v: float
    sample_period_s: float
    held_v: float = 0.0
    least_impedance: InverseGamma | None = None

    @property
    def safe(self) -> float:
        """The scale at which no motor whatever can pass the flux limit.

        Either flux stays below it even without resistance and inverter, or the whole command stays inside the measured
        dead band (`SURE_LOSS` of it), where no current flows. The two do not add up: fast tones carry slow ones across.
        """
        return min(1.0, max(self.limit_wb / max(self._bound_wb(), 1e-12), self._below(SURE_LOSS * self.plateau_v)))

    @property
    def first(self) -> float:
        """The scale to begin with on a motor of which the direct voltage alone is known: at which it cannot pass the limit either.

        With I the current that V drives in the end, a stator current of I lets the flux rise no more (u - R_s I - F(I) <= 0 for every
        u <= V), and the rotor's flux follows the current: neither ever passes what V makes.
        """
        return max(self.safe, self._below(self.held_v))

    def first_for(self, trip_a: float) -> float:
        """`first`, at which the machine of least impedance draws no more than half-way from the current aimed at to `trip_a` either."""
        if self.least_impedance is None or math.isinf(trip_a):
            return self.first
        step_s = STRIDE * self.sample_period_s
        is_permitted = self.forecast.keeps_below(
            (math.inf, 0.5 * (self.current_a + trip_a)), self.least_impedance,
            np.arange(step_s, self.forecast.excitation.duration_s, step_s), loss=SURE_LOSS,
        )  # fmt: skip
        return _largest(0.0, self.first, is_permitted)

    def _below(self, voltage_v: float) -> float:
        """The scale at which no peak of the command passes this voltage; 1 at the most."""
        return min(1.0, voltage_v / max(self.forecast.excitation.peaks_v, 1e-12))

    def _bound_wb(self) -> float:
        """Sum of A / omega (1 + |sin phase|): flux of a machine without resistance, started from rest at full scale."""
        return sum(
            t.amplitude_v / (2.0 * math.pi * t.frequency_hz) * (1.0 + abs(math.sin(t.phase_rad)))
            for t in self.forecast.excitation.tones
        )

    def of_known(self, machine: InverseGamma, log_std: float, ramp_per_s: float, began_s: float) -> float:
        """The scale to begin with on a machine measured before to `log_std`: simulated from rest, its flux stays below
        `KNOWN_TARGET` and its current below what is aimed at. Never below `safe`."""
        worst = replace(
            machine,
            stator_resistance_ohm=machine.stator_resistance_ohm * math.exp(-log_std),
            magnetizing_inductance_h=machine.magnetizing_inductance_h * math.exp(log_std),
        )
        step_s = STRIDE * self.sample_period_s
        time_s = np.arange(step_s, self.forecast.excitation.duration_s, step_s)
        ramp = np.minimum(time_s * ramp_per_s, 1.0)
        most = KNOWN_TARGET * self.limit_wb, self.current_a
        is_permitted = self.forecast.keeps_below(most, worst, began_s + time_s, loss=SURE_LOSS)
        return _largest(self.safe, 1.0, lambda scale: is_permitted(np.minimum(ramp, scale)))

    def by_flux(self, worst: InverseGamma) -> float:
        """What keeps the machine's flux within `TARGET` of the limit whatever the phases: sum over tones of its flux
        amplitudes behind the inverter. Below full scale the inverter takes a larger share."""
        tones = self.forecast.excitation.tones
        f, commanded = np.array([t.frequency_hz for t in tones]), np.array([t.amplitude_v for t in tones])
        admittance = admittance_s(worst, f)
        flux = np.abs((1.0 - worst.stator_resistance_ohm * admittance) / (2j * np.pi * f))
        lost = SURE_LOSS * math.sqrt(2.0 / math.pi) * self.plateau_v
        return TARGET * self.limit_wb / max(float(flux_behind(flux, commanded, admittance, lost)), 1e-12)

    def by_current(
        self, worst: InverseGamma, estimate: BlockEstimate, time_s: float, scale: float, wanted: float, seen_a: float
    ) -> float:
        """The largest scale up to the wanted one, at least the present, that keeps the simulated current of what is left
        of the test below what is aimed at and below `GROWTH` times the largest one seen: a machine fitted to a small
        current is no promise of a large one. `time_s` is from the excitation's start."""
        if wanted <= scale or math.isinf(self.current_a):
            return wanted
        step_s = STRIDE * self.sample_period_s
        ahead_s = max(self.forecast.excitation.duration_s - time_s, 2.0 * step_s)
        ahead = time_s + np.arange(0.0, ahead_s, step_s)
        start = (float(estimate.current_a[-1]), float(estimate.rotor_flux_wb[-1]), 0.0)
        most_a = min(self.current_a, max(GROWTH * seen_a, CURRENT_STEP * self.current_a))
        return _largest(scale, wanted, self.forecast.keeps_below((math.inf, most_a), worst, ahead, start, KNOWN_LOSS))

    def unsure(self, machine: InverseGamma, scale: float) -> float:
        """A small raise: it adds at most `CURRENT_STEP` of the permitted current, all tones at their peaks at once."""
        ohms = machine.stator_resistance_ohm + machine.rotor_resistance_ohm
        return min(
            SMALL_RAISE * scale,
            scale + CURRENT_STEP * self.current_a * ohms / max(self.forecast.excitation.peaks_v, 1e-12),
        )


def _largest(low: float, high: float, is_permitted: Callable[[float], bool]) -> float:
    """The largest permitted scale between `low`, which is taken to be, and `high`, to 1 % of the way."""
    if low >= high or is_permitted(high):
        return max(low, high)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_permitted(middle) else (low, middle)
    return low
