"""The flux guard: two independent estimates, a prediction, and what to do with the amplitude.

What saturates is the stator flux, so that is what is limited; the rotor flux is reported beside it. Estimates: (a) the
observer's; (b) model-free, the integral of u - R_s i - inverter error with drift removed by a second-order high-pass a
decade below the lowest tone. The excitation is known in advance: (c) both are carried forward over link latency plus
reaction time. From a safe scale the amplitude is raised in steps of at most `MAX_RAISE`, to what the estimated machine (its
standard errors taken threefold to the bad side) keeps within flux and current (`amplitude`), as long as (a) and (b) agree.
The current is watched beside the flux: the drive ends a test whose current passes its own limit.
"""

from __future__ import annotations

import enum
import math
from collections import deque
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from commissioner.compiled import writable
from commissioner.identify.excite.amplitude import TARGET, Amplitude
from commissioner.identify.excite.forecast import Forecast
from commissioner.identify.excite.kernels import integrated_flux
from commissioner.identify.excite.tones import Excitation
from commissioner.identify.inverter.staircase import IDEAL_INVERTER, InverterError
from commissioner.identify.observer.observer import BlockEstimate
from commissioner.motor.circuit import InverseGamma
from commissioner.records import Signal, peak

BACK_OFF_ABOVE = 0.99
ABORT_ABOVE = 1.01
MAX_RAISE, UNKNOWN_RAISE = 2.0, 1.5
UNKNOWN_SHARE = 0.75
"""Of the limit: what the guard holds a motor to that was not measured before. Resistance and loss known from DC levels can
stand for each other, and both flux estimates then read too little (up to a sixth in 1000 random cases)."""
QUIET, QUIET_CURRENT = 0.35, 0.5
"""While the estimates are unsure the amplitude climbs in small steps, as long as no more flux and current were seen."""
AGREEMENT = 0.3
HOLD_OFF, URGENT, RISING = 3.0, 1.05, 1.03
"""One step down at a time: reactions to wait for its effect, unless the flux is this far above the limit and rising."""


class FluxAdvice(enum.Enum):
    RAISE = "flux is low and both estimates agree: the amplitude may rise to the permitted scale"
    HOLD = "keep the amplitude: the estimates have not confirmed more"
    BACK_OFF = "flux or current is about to reach its limit: reduce the amplitude to the permitted scale"
    ABORT = "flux is at the limit and still rising: de-energise"


@dataclass(frozen=True)
class FluxReading:
    """Peaks of the stator flux since the last reading (observer, model-free), `fraction` of the limit reached by the largest
    of them and the predicted one, and what to do. `current_fraction`: the largest current seen or predicted, of what the
    guard acts at."""

    observer_wb: float
    model_free_wb: float
    fraction: float
    current_fraction: float
    advice: FluxAdvice
    permitted_scale: float


@dataclass(frozen=True)
class _Seen:
    """Of one block: when it ended, how far the two flux estimates were apart, the larger's peak, the current's."""

    time_s: float
    difference_wb: float
    flux_wb: float
    current_a: float


@dataclass
class FluxGuard:
    """One per energised stretch, starting at rest. `latency_s` is from sample to the command that answers it taking
    effect (link both ways); `reaction_s` what the drive's amplitude ramp takes; `current_a` is the peak current that the
    amplitude aims at, `trip_a` the one at which the drive ends the test: half-way between them the guard acts; `held_v`, `least_impedance` as in `Amplitude`."""

    limit_wb: float
    latency_s: float
    excitation: Excitation
    sample_period_s: float
    stator_resistance_ohm: float
    inverter: InverterError = IDEAL_INVERTER
    axis_deg: float = 0.0
    reaction_s: float = 0.02
    current_a: float = math.inf
    trip_a: float = math.inf
    held_v: float = 0.0
    least_impedance: InverseGamma | None = None
    began_s: float = 0.0
    """Time between the excitation's start and the first sample."""
    _integral: Signal = field(default_factory=lambda: np.zeros(2), init=False)
    _samples: int = field(default=0, init=False)
    _scale_since_s: float = field(default=0.0, init=False)
    _last_scale: float = field(default=0.0, init=False)
    _granted: float = field(default=0.0, init=False)
    _ceiling: float = field(default=1.0, init=False)
    _backed_off_s: float = field(default=-math.inf, init=False)
    _backed_off_at: float = field(default=0.0, init=False)
    _share: float = field(default=UNKNOWN_SHARE, init=False)
    _recent: deque[_Seen] = field(default_factory=deque, init=False)

    def __post_init__(self) -> None:
        if self.excitation.dc_bias_v:
            raise ValueError("the guard limits the amplitude of tones; what a DC bias does is out of its reach")
        self._forecast = Forecast.behind(self.inverter, self.excitation, self.axis_deg)
        plateau_v = max(float(self.inverter.on_axis(np.array([1e9]), self.axis_deg)[0]), 0.0)
        self._amplitude = Amplitude(
            self._forecast, self.limit_wb, self.current_a, plateau_v, self.sample_period_s, self.held_v,
            self.least_impedance,
        )  # fmt: skip

    @property
    def safe_scale(self) -> float:
        """The scale at which no motor whatever can pass the flux limit."""
        return self._amplitude.safe

    @cached_property
    def first_scale(self) -> float:
        """The scale to begin with on a motor that was given a direct voltage before."""
        return self._amplitude.first_for(self.trip_a)

    def begin_known(self, machine: InverseGamma, log_std: float, ramp_per_s: float) -> float:
        """The scale to begin with on a machine measured before to `log_std`."""
        self._share = 1.0
        self._granted = self._amplitude.of_known(machine, log_std, ramp_per_s, self.began_s)
        return self._granted

    def advance(
        self,
        voltage_v: Signal,
        current_a: Signal,
        estimate: BlockEstimate,
        present_scale: float,
        lost_before: int = 0,
        age_s: float = 0.0,
    ) -> FluxReading:
        """Take in the block the observer has just taken in; `current_a` is along the axis, `(n,)`. Samples older than the
        latency say nothing of the amplitude last asked for: they permit no raise, nor do the first that follow them."""
        self._samples += lost_before + voltage_v.shape[0]
        time_s = self._samples * self.sample_period_s
        model_free = self._integrate(voltage_v, current_a)
        observer_wb, model_free_wb = peak(estimate.stator_flux_wb), peak(model_free)
        predicted_wb, predicted_a = self._predict(estimate, float(model_free[-1]), time_s, present_scale)
        fraction = max(observer_wb, model_free_wb, predicted_wb) / self.limit_wb
        largest_a = peak(current_a)
        current_fraction = max(largest_a, predicted_a) / (0.5 * (self.current_a + self.trip_a))
        difference = peak(estimate.stator_flux_wb - model_free)
        while self._recent and time_s - self._recent[0].time_s >= self._window_s:
            self._recent.popleft()
        self._recent.append(_Seen(time_s, difference, max(observer_wb, model_free_wb), largest_a))
        if abs(present_scale - self._last_scale) > 1e-4 or age_s > self.latency_s:
            self._scale_since_s = time_s
        self._last_scale = present_scale
        permitted = self._permit(estimate, present_scale, time_s, current_a)
        agreed_wb = min(observer_wb, model_free_wb)
        advice, permitted = self._advise(fraction, current_fraction, agreed_wb, present_scale, permitted, time_s)
        return FluxReading(observer_wb, model_free_wb, fraction, current_fraction, advice, permitted)

    # -- estimates ------------------------------------------------------------------------------------------------

    @cached_property
    def _lowest_hz(self) -> float:
        return min(t.frequency_hz for t in self.excitation.tones) if self.excitation.tones else 1.0

    @cached_property
    def _window_s(self) -> float:
        return max(0.25 / self._lowest_hz, 0.2)

    def _integrate(self, voltage_v: Signal, current_a: Signal) -> Signal:
        """(b): the model-free estimate at the block's samples."""
        corner = 2.0 * math.pi * 0.08 * self._lowest_hz * self.sample_period_s
        flux: Signal = integrated_flux(
            writable(voltage_v), writable(current_a), self.stator_resistance_ohm, self._forecast.lost_v,
            self._forecast.span_a, self.sample_period_s, corner, self._integral,
        )  # fmt: skip
        return flux

    def _predict(
        self, estimate: BlockEstimate, model_free_wb: float, time_s: float, scale: float
    ) -> tuple[float, float]:
        """(largest |stator flux|, largest |current|) over the horizon, from the observer's state and the model-free
        flux."""
        steps = max(2, math.ceil((self.latency_s + self.reaction_s) / self.sample_period_s))
        stride = max(1, steps // 200)
        ahead = (np.arange(steps // stride + 1, dtype=np.float64) + 0.5) * self.sample_period_s * stride
        start = (float(estimate.current_a[-1]), float(estimate.rotor_flux_wb[-1]), model_free_wb)
        return self._forecast.peaks(estimate.parameters, self.began_s + time_s + ahead, scale, start)

    # -- amplitude ------------------------------------------------------------------------------------------------

    def _permit(self, estimate: BlockEstimate, scale: float, time_s: float, current_a: Signal) -> float:
        safe = TARGET * self.first_scale
        rested_s = time_s - self._scale_since_s
        if rested_s < max(self._window_s, self.latency_s + self.reaction_s):
            return max(min(scale, self._granted), safe)
        if not self._confirms(estimate, current_a):
            is_quiet = max(r.flux_wb for r in self._recent) < QUIET * self.limit_wb
            is_quiet &= max(r.current_a for r in self._recent) < QUIET_CURRENT * self.current_a
            wanted = self._amplitude.unsure(estimate.parameters, scale) if is_quiet else scale
            if self.least_impedance is not None:
                wanted = min(wanted, max(scale, self.first_scale))
        else:
            r_s, _r_r, _l_s, l_m = estimate.parameters.as_tuple()
            s = estimate.std
            worst = replace(
                estimate.parameters,
                stator_resistance_ohm=max(r_s - 3.0 * s[0], 0.5 * r_s),
                magnetizing_inductance_h=l_m + min(3.0 * s[3], l_m),
            )
            most = (MAX_RAISE if self._share == 1.0 else UNKNOWN_RAISE) * max(scale, safe)
            wanted = min(1.0, self._ceiling, self._share * self._amplitude.by_flux(worst), most)
            seen_a = max(r.current_a for r in self._recent)
            wanted = self._amplitude.by_current(worst, estimate, self.began_s + time_s, scale, wanted, seen_a)
        self._granted = max(safe, min(1.0, wanted))
        return self._granted

    def _confirms(self, estimate: BlockEstimate, current_a: Signal) -> bool:
        """Both flux estimates have agreed over a quarter of the lowest tone, and the observer explains the current.

        The larger of the two is what is limited, so they need not agree better than one raise may be wrong by.
        """
        if len(self._recent) < 2 or self._recent[-1].time_s - self._recent[0].time_s < 0.8 * self._window_s:
            return False
        difference = max(r.difference_wb for r in self._recent)
        rms = float(np.sqrt(np.mean(current_a**2)))
        explained = estimate.residual_rms_a < max(0.2 * rms, 3.0 * estimate.noise_a)
        if not (difference < AGREEMENT * self.limit_wb and explained):
            return False
        r_s, _, _, l_m = estimate.parameters.as_tuple()
        return estimate.std[0] < 0.1 * r_s and estimate.std[3] < 0.2 * l_m

    def _advise(
        self, fraction: float, current_fraction: float, agreed_wb: float, scale: float, permitted: float, time_s: float
    ) -> tuple[FluxAdvice, float]:
        """Back off on the larger of the estimates and on the current; abort only where both flux estimates say that a
        back-off in effect did not help.

        A back-off is given time to take effect before the next one. For the flux it never asks for less than the scale
        with which no motor can pass the limit.
        """
        permitted = min(permitted, self._ceiling)
        strain = max(fraction / self._share, current_fraction)
        if strain <= BACK_OFF_ABOVE:
            return (FluxAdvice.RAISE if permitted > 1.001 * scale else FluxAdvice.HOLD), permitted
        since_s = time_s - self._backed_off_s
        if agreed_wb > ABORT_ABOVE * self.limit_wb and self.latency_s + self.reaction_s < since_s < math.inf:
            return FluxAdvice.ABORT, 0.0
        is_urgent = strain > URGENT and strain > RISING * self._backed_off_at
        if since_s < HOLD_OFF * (self.latency_s + self.reaction_s) and not is_urgent:
            return FluxAdvice.HOLD, permitted
        self._backed_off_s, self._backed_off_at = time_s, strain
        floor = min(scale, TARGET * self.safe_scale) if current_fraction <= BACK_OFF_ABOVE else 0.0
        self._granted = max(min(permitted, scale * TARGET / strain), floor)
        self._ceiling = self._granted
        return FluxAdvice.BACK_OFF, self._granted
