"""The flux guard: two independent estimates, a prediction, and how much amplitude they permit.

What saturates is the stator flux, so that is what is limited; the rotor flux is reported beside it. Estimates: (a) the
observer's; (b) model-free, the integral of u - R_s i - inverter error with drift removed by a second-order high-pass a
decade below the lowest tone. The excitation is known in advance: (c) both are carried forward over link latency plus
reaction time. Amplitude: a tone of amplitude A cannot make more flux than A / omega (1 - R_s Y is at most 1 for a
passive machine), so a first scale is safe for any motor; from there it is raised in steps of at most `MAX_RAISE`, to
what the estimated machine (its standard errors taken threefold to the bad side) keeps within `TARGET` of the limit, as
long as (a) and (b) agree.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field, replace

import numpy as np

from commissioner.identify.excitation import Excitation
from commissioner.identify.forecast import forecast
from commissioner.identify.observer import BlockEstimate
from commissioner.identify.resistance import IDEAL_INVERTER, InverterError
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.standstill import admittance_s, held_input
from commissioner.records import Signal

TARGET = 0.93
BACK_OFF_ABOVE = 0.99
ABORT_ABOVE = 1.01
MAX_RAISE = 2.0
QUIET, SMALL_RAISE = 0.35, 1.25
"""While the estimates are unsure the amplitude climbs in small steps, as long as neither has seen this much flux."""
AGREEMENT = 0.3
LOSS_ROWS = 1025
SURE_LOSS = 0.8
HOLD_OFF, URGENT, RISING = 3.0, 1.05, 1.03
"""One step down at a time: reactions to wait for its effect, unless the flux is this far above the limit and rising."""
KNOWN_TARGET = 0.85
"""Flux that the first amplitude may make of a motor already measured, of the limit."""


class FluxAdvice(enum.Enum):
    RAISE = "flux is low and both estimates agree: the amplitude may rise to the permitted scale"
    HOLD = "keep the amplitude: the estimates have not confirmed more"
    BACK_OFF = "flux is about to reach the limit: reduce the amplitude to the permitted scale"
    ABORT = "flux is at the limit and still rising: de-energise"


@dataclass(frozen=True)
class FluxReading:
    """Peaks of the stator flux since the last reading (observer, model-free), its predicted peak, `fraction` of the
    limit reached by the largest, and what to do."""

    observer_wb: float
    model_free_wb: float
    predicted_wb: float
    rotor_wb: float
    fraction: float
    advice: FluxAdvice
    permitted_scale: float


@dataclass
class FluxGuard:
    """One per energised stretch, starting at rest. `latency_s` is from sample to the command that answers it taking
    effect (link both ways); `reaction_s` what the drive's amplitude ramp takes."""

    limit_wb: float
    latency_s: float
    excitation: Excitation
    sample_period_s: float
    stator_resistance_ohm: float
    inverter: InverterError = IDEAL_INVERTER
    axis_deg: float = 0.0
    reaction_s: float = 0.02
    began_s: float = 0.0
    """Time between the excitation's start and the first sample."""
    _integral: tuple[float, float] = field(default=(0.0, 0.0), init=False)
    _samples: int = field(default=0, init=False)
    _scale_since_s: float = field(default=0.0, init=False)
    _last_scale: float = field(default=0.0, init=False)
    _granted: float = field(default=0.0, init=False)
    _ceiling: float = field(default=1.0, init=False)
    _backed_off_s: float = field(default=-math.inf, init=False)
    _backed_off_at: float = field(default=0.0, init=False)
    _recent: list[tuple[float, float, float, float]] = field(default_factory=list, init=False)

    def __post_init__(self) -> None:
        if self.excitation.dc_bias_v:
            raise ValueError("the guard limits the amplitude of tones; what a DC bias does is out of its reach")
        self._span_a = max(self.inverter.current_a[-1], 1e-9)
        self._lost_v = self.inverter.on_axis(np.linspace(0.0, self._span_a, LOSS_ROWS), self.axis_deg)

    @property
    def safe_scale(self) -> float:
        """The scale at which no motor whatever can pass the limit.

        Either flux stays below it even without resistance and inverter, or the whole command stays inside the measured
        dead band (`SURE_LOSS` of it), where no current flows. The two do not add up: fast tones carry slow ones across.
        """
        command_v = sum(t.amplitude_v for t in self.excitation.tones)
        in_dead_band = SURE_LOSS * self._plateau_v / max(command_v, 1e-12)
        return min(1.0, max(self.limit_wb / max(self._bound_wb(), 1e-12), in_dead_band))

    @property
    def _plateau_v(self) -> float:
        return max(float(self.inverter.on_axis(np.array([1e9]), self.axis_deg)[0]), 0.0)

    def advance(
        self, voltage_v: Signal, current_a: Signal, estimate: BlockEstimate, present_scale: float, lost_before: int = 0
    ) -> FluxReading:
        """Take in the block the observer has just taken in; `current_a` is along the axis, `(n,)`."""
        self._samples += lost_before + voltage_v.shape[0]
        time_s = self._samples * self.sample_period_s
        model_free = self._integrate(voltage_v, current_a)
        observer = np.abs(estimate.stator_flux_wb)
        observer_wb, model_free_wb = float(np.max(observer)), float(np.max(np.abs(model_free)))
        predicted_wb = self._predict(estimate, float(model_free[-1]), time_s, present_scale)
        fraction = max(observer_wb, model_free_wb, predicted_wb) / self.limit_wb
        difference = float(np.max(np.abs(estimate.stator_flux_wb - model_free)))
        self._recent = [r for r in self._recent if time_s - r[0] < self._window_s]
        self._recent.append((time_s, difference, max(observer_wb, model_free_wb), estimate.residual_rms_a))
        if abs(present_scale - self._last_scale) > 1e-4:
            self._scale_since_s = time_s
        self._last_scale = present_scale
        permitted = self._permit(estimate, present_scale, time_s, current_a)
        advice, permitted = self._advise(fraction, min(observer_wb, model_free_wb), present_scale, permitted, time_s)
        rotor_wb = float(np.max(np.abs(estimate.rotor_flux_wb)))
        return FluxReading(observer_wb, model_free_wb, predicted_wb, rotor_wb, fraction, advice, permitted)

    # -- estimates ------------------------------------------------------------------------------------------------

    @property
    def _lowest_hz(self) -> float:
        return min(t.frequency_hz for t in self.excitation.tones) if self.excitation.tones else 1.0

    @property
    def _window_s(self) -> float:
        return max(0.25 / self._lowest_hz, 0.2)

    def _integrate(self, voltage_v: Signal, current_a: Signal) -> Signal:
        """psi' = u - R_s i - F(i) - 2 zeta w psi - w^2 integral(psi); mean current over the period by trapezoid."""
        from scipy.signal import lfilter

        following = np.append(
            current_a[1:], 2.0 * current_a[-1] - current_a[-2] if current_a.size > 1 else current_a[-1]
        )
        mean = 0.5 * (current_a + following)
        emf = voltage_v - self.stator_resistance_ohm * mean - self.inverter.on_axis(mean, self.axis_deg)
        corner = 2.0 * math.pi * 0.08 * self._lowest_hz * self.sample_period_s
        # Damped high-pass times integrator, as one difference equation; two states in direct form II transposed.
        a = [1.0, -2.0 + 1.4 * corner, 1.0 - 1.4 * corner + corner * corner]
        b = [self.sample_period_s, -self.sample_period_s]
        flux, final = lfilter(b, a, emf, zi=np.array(self._integral))
        self._integral = (float(final[0]), float(final[1]))
        return np.asarray(flux)

    def _predict(self, estimate: BlockEstimate, model_free_wb: float, time_s: float, scale: float) -> float:
        """Largest |stator flux| over the horizon, from the observer's state and from the model-free flux."""
        steps = max(2, math.ceil((self.latency_s + self.reaction_s) / self.sample_period_s))
        stride = max(1, steps // 200)
        period = self.sample_period_s * stride
        ahead = (np.arange(steps // stride + 1) + 0.5) * period
        future = np.asarray(self.began_s + time_s + ahead, dtype=np.float64)
        start = (float(estimate.current_a[-1]), float(estimate.rotor_flux_wb[-1]), model_free_wb)
        return self._forecast(estimate.parameters, future, scale, period, start, self._lost_v)

    def _forecast(
        self, machine: InverseGamma, time_s: Signal, scale: float | Signal, period_s: float,
        start: tuple[float, float, float], lost_v: Signal,
    ) -> float:  # fmt: skip
        voltage = self.excitation.voltage_v(time_s, scale)
        matrix, gain = held_input(machine, period_s)
        r_s, leakage = machine.stator_resistance_ohm, machine.leakage_inductance_h
        return float(forecast(voltage, period_s, matrix, gain, r_s, leakage, lost_v, self._span_a, *start))

    # -- amplitude ------------------------------------------------------------------------------------------------

    def _bound_wb(self) -> float:
        """Sum of A / omega (1 + |sin phase|): flux of a machine without resistance, started from rest at full scale."""
        return sum(
            t.amplitude_v / (2.0 * math.pi * t.frequency_hz) * (1.0 + abs(math.sin(t.phase_rad)))
            for t in self.excitation.tones
        )

    def _peak_at_full_scale(self, machine: InverseGamma) -> float:
        """Sum over tones of the machine's flux amplitudes behind the inverter: no phase relation can exceed it.

        Below full scale the inverter takes a larger share, so that flux falls faster than the scale.
        """
        f = np.array([t.frequency_hz for t in self.excitation.tones])
        commanded = np.array([t.amplitude_v for t in self.excitation.tones])
        admittance = admittance_s(machine, f)
        flux = np.abs((1.0 - machine.stator_resistance_ohm * admittance) / (2j * np.pi * f))
        lost = SURE_LOSS * math.sqrt(2.0 / math.pi) * self._plateau_v
        amplitude = commanded
        for _ in range(6):  # the inverter's equivalent resistance, see excitation.design
            sigma = math.sqrt(0.5 * float(np.sum(np.abs(amplitude * admittance) ** 2)))
            amplitude = commanded / np.abs(1.0 + lost / max(sigma, 1e-12) * admittance)
        return float(np.sum(flux * amplitude))

    def begin_known(self, machine: InverseGamma, log_std: float, ramp_per_s: float) -> float:
        """The scale to begin with on a machine measured before to `log_std`: simulated from rest, its flux stays below
        `KNOWN_TARGET`. Never below `safe_scale`."""
        worst = replace(
            machine,
            stator_resistance_ohm=machine.stator_resistance_ohm * math.exp(-log_std),
            magnetizing_inductance_h=machine.magnetizing_inductance_h * math.exp(log_std),
        )
        period = 4.0 * self.sample_period_s
        time_s = np.arange(period, self.excitation.duration_s, period)
        ramp = np.minimum(time_s * ramp_per_s, 1.0)

        def peak_wb(scale: float) -> float:
            amplitude = np.minimum(ramp, scale)
            return self._forecast(
                worst, self.began_s + time_s, amplitude, period, (0.0, 0.0, 0.0), SURE_LOSS * self._lost_v
            )

        low, high = self.safe_scale, 1.0
        if peak_wb(high) < KNOWN_TARGET * self.limit_wb:
            low = high
        while high - low > 0.01:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if peak_wb(middle) < KNOWN_TARGET * self.limit_wb else (low, middle)
        self._granted = low
        return low

    def _permit(self, estimate: BlockEstimate, scale: float, time_s: float, current_a: Signal) -> float:
        safe = TARGET * self.safe_scale
        rested_s = time_s - self._scale_since_s
        if rested_s < max(self._window_s, self.latency_s + self.reaction_s):
            return max(min(scale, self._granted), safe)
        if not self._confirms(estimate, current_a):
            is_quiet = max(r[2] for r in self._recent) < QUIET * self.limit_wb
            self._granted = max(safe, min(1.0, (SMALL_RAISE if is_quiet else 1.0) * scale))
            return self._granted
        r_s, _r_r, _l_s, l_m = estimate.parameters.as_tuple()
        s = estimate.std
        worst = replace(
            estimate.parameters,
            stator_resistance_ohm=max(r_s - 3.0 * s[0], 0.5 * r_s),
            magnetizing_inductance_h=l_m + min(3.0 * s[3], l_m),
        )
        by_model = TARGET * self.limit_wb / max(self._peak_at_full_scale(worst), 1e-12)
        self._granted = max(safe, min(1.0, by_model, MAX_RAISE * max(scale, safe)))
        return self._granted

    def _confirms(self, estimate: BlockEstimate, current_a: Signal) -> bool:
        """Both flux estimates have agreed over a quarter of the lowest tone, and the observer explains the current.

        The larger of the two is what is limited, so they need not agree better than one raise may be wrong by.
        """
        if len(self._recent) < 2 or self._recent[-1][0] - self._recent[0][0] < 0.8 * self._window_s:
            return False
        difference = max(r[1] for r in self._recent)
        rms = float(np.sqrt(np.mean(current_a**2)))
        explained = estimate.residual_rms_a < max(0.2 * rms, 3.0 * estimate.noise_a)
        certain = estimate.std[0] < 0.1 * estimate.parameters.stator_resistance_ohm
        certain &= estimate.std[3] < 0.2 * estimate.parameters.magnetizing_inductance_h
        return bool(difference < AGREEMENT * self.limit_wb and explained and certain)

    def _advise(
        self, fraction: float, agreed_wb: float, scale: float, permitted: float, time_s: float
    ) -> tuple[FluxAdvice, float]:
        """Back off on the larger of the estimates; abort only where both say that a back-off in effect did not help.

        A back-off is given time to reach the flux before the next one, and never asks for less than the scale with
        which no motor can pass the limit.
        """
        permitted = min(permitted, self._ceiling)
        if fraction <= BACK_OFF_ABOVE:
            return (FluxAdvice.RAISE if permitted > 1.001 * scale else FluxAdvice.HOLD), permitted
        since_s = time_s - self._backed_off_s
        if agreed_wb > ABORT_ABOVE * self.limit_wb and self.latency_s + self.reaction_s < since_s < math.inf:
            return FluxAdvice.ABORT, 0.0
        is_urgent = fraction > URGENT and fraction > RISING * self._backed_off_at
        if since_s < HOLD_OFF * (self.latency_s + self.reaction_s) and not is_urgent:
            return FluxAdvice.HOLD, permitted
        self._backed_off_s, self._backed_off_at = time_s, fraction
        self._granted = max(min(permitted, scale * TARGET / fraction), min(scale, TARGET * self.safe_scale))
        self._ceiling = self._granted
        return FluxAdvice.BACK_OFF, self._granted
