"""Which tones to drive: as informative as flux, current and voltage allow.

Minimax design: the tone frequencies and amplitudes that make the worst relative standard error of (R_s, R_R, L_sigma,
L_M) smallest (G. C. Goodwin & R. L. Payne, Dynamic System Identification, ch. 6: information adds up over tones).
Frequencies sit on a common grid where no harmonic up to the seventh and no third-order intermodulation line of the
tones falls on a tone, so that what iron and inverter add stays off the lines.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from commissioner.compiled import writable
from commissioner.identify.excite.kernels import driven_peaks, sum_of_tones
from commissioner.identify.excite.minimax import FEWEST_SHARE, minimax_cost
from commissioner.identify.inverter.staircase import IDEAL_INVERTER, InverterError
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.standstill import admittance_s, held_input, poles_per_s
from commissioner.records import Signal

TONE_COUNT = 5
DEFAULT_SECONDS = 9.0  # with the staircase about 12 s energised per axis


@dataclass(frozen=True)
class Tone:
    """amplitude x cos(2 pi frequency t + phase), t from the start of the excitation."""

    amplitude_v: float
    frequency_hz: float
    phase_rad: float


@dataclass(frozen=True)
class Excitation:
    """What the drive is told: u(t) = bias + scale x sum of tones, scale 0 ... 1 live."""

    tones: tuple[Tone, ...]
    dc_bias_v: float
    duration_s: float

    def voltage_v(self, time_s: Signal, scale: float | Signal = 1.0) -> Signal:
        """The commanded voltage at the instants, `(n,)`."""
        return self.over_scale(time_s)(scale)

    def over_scale(self, time_s: Signal) -> Callable[[float | Signal], Signal]:
        """`voltage_v` at the instants over the scale."""
        total = sum_of_tones(writable(time_s), self._table)
        return lambda scale: np.asarray(self.dc_bias_v + scale * total)

    @cached_property
    def peaks_v(self) -> float:
        """All tones at their peaks at once."""
        return sum(t.amplitude_v for t in self.tones)

    @cached_property
    def _table(self) -> Signal:
        return np.array([(t.amplitude_v, t.frequency_hz, t.phase_rad) for t in self.tones]).reshape(-1, 3)


@dataclass(frozen=True)
class ExcitationLimits:
    """Peak stator flux, peak axis current, peak axis voltage; `noise_a` is the sensor's rms noise."""

    flux_wb: float
    current_a: float
    voltage_v: float
    noise_a: float = 0.02
    rms_current_a: float = math.inf


@dataclass(frozen=True)
class DesignedExcitation:
    """The excitation, what it will drive through the machine it was designed for, and what it should yield.

    `relative_std` is (R_s, R_R, L_sigma, L_M) for a sensor noise of `noise_a`; it falls with the square root of the time.
    """

    excitation: Excitation
    peak_flux_wb: float
    peak_current_a: float
    relative_std: tuple[float, float, float, float]
    seconds: float
    noise_a: float

    def cut_to(self, seconds: float) -> DesignedExcitation:
        """What it yields where a session ended after `seconds`; itself where all was played."""
        if not 0.0 < seconds < self.seconds:
            return self
        r_s, r_r, l_s, l_m = (math.sqrt(self.seconds / seconds) * std for std in self.relative_std)
        return replace(self, relative_std=(r_s, r_r, l_s, l_m), seconds=seconds)


def design(
    estimate: InverseGamma,
    limits: ExcitationLimits,
    sample_period_s: float,
    inverter: InverterError = IDEAL_INVERTER,
    seconds: float | None = None,
) -> DesignedExcitation:
    """The minimax multitone for this machine under the limits.

    Energised time: `DEFAULT_SECONDS` up to a rotor time constant of 0.5 s, in proportion beyond. The inverter's lost
    voltage is added to the command so that the motor sees about what was designed.
    """
    time_s = seconds or DEFAULT_SECONDS * max(1.0, estimate.rotor_time_constant_s / 0.5)
    # the search has several nearly equal optima: what differs by rounding alone must end at the same tones
    about = InverseGamma(*(_rounded(value) for value in estimate.as_tuple()))
    frequencies, shares = _minimax(about, _rounded_limits(limits), _rounded(time_s), sample_period_s)
    grid_hz = 10.0 ** math.floor(math.log10(min(frequencies) / 3.0))
    frequencies = np.array(separated(frequencies.tolist(), grid_hz))
    phases = _schroeder_phases(shares)
    amplitudes = _scaled(estimate, frequencies, shares, limits)
    steady = _excitation(amplitudes, frequencies, phases, time_s)
    flux, current = predicted_peaks(estimate, steady, sample_period_s)
    # the start's transient passes what the steady peaks keep
    inside = min(1.0, limits.flux_wb / flux, limits.current_a / current)
    amplitudes = inside * amplitudes
    information = _information(estimate, frequencies, amplitudes) * time_s / (2.0 * sample_period_s * limits.noise_a**2)
    r_s, r_r, l_s, l_m = np.sqrt(np.diag(np.linalg.inv(information))).tolist()
    commanded = amplitudes * np.abs(
        1.0 + _lost_resistance(estimate, frequencies, amplitudes, inverter, limits.current_a)
    )
    top = min(1.0, (1.0 - 1e-9) * limits.voltage_v / max(float(np.sum(commanded)), 1e-12))
    excitation = _excitation(top * commanded, frequencies, phases, time_s)
    return DesignedExcitation(excitation, inside * flux, inside * current, (r_s, r_r, l_s, l_m), time_s, limits.noise_a)


def _excitation(amplitudes: Signal, frequencies: Signal, phases: Signal, seconds: float) -> Excitation:
    """Without a bias."""
    tones = zip(amplitudes.tolist(), frequencies.tolist(), phases.tolist(), strict=True)
    return Excitation(tuple(Tone(*tone) for tone in tones), 0.0, seconds)


def _rounded(value: float) -> float:
    """To three digits."""
    return float(f"{value:.3g}")


def _rounded_limits(limits: ExcitationLimits) -> ExcitationLimits:
    return ExcitationLimits(**{name: _rounded(value) for name, value in vars(limits).items()})


def predicted_peaks(machine: InverseGamma, excitation: Excitation, period_s: float) -> tuple[float, float]:
    """(stator flux, current) peaks of the linear machine under the full excitation, from rest, no inverter error."""
    time_s = np.arange(int(excitation.duration_s / period_s)) * period_s
    matrix, gain = held_input(machine, period_s)
    voltage = excitation.voltage_v(np.asarray(time_s, dtype=np.float64))
    flux, current = driven_peaks(voltage, matrix, gain, machine.leakage_inductance_h)
    return float(flux), float(current)


def separated(frequencies: Sequence[float], grid_hz: float) -> tuple[float, ...]:
    """The nearest grid frequencies whose harmonics (to the 7th) and third-order mixes miss each other's lines."""
    chosen: list[int] = []
    for frequency in sorted(frequencies):
        wanted = max(1, round(frequency / grid_hz))
        offsets = sorted(range(-wanted + 1, 4 * wanted + 40), key=abs)
        chosen.append(next(wanted + k for k in offsets if _misses(wanted + k, chosen)))
    return tuple(n * grid_hz for n in chosen)


def _misses(candidate: int, others: Sequence[int]) -> bool:
    """No line of {k n, 2 n +- m, n +- 2 m, n +- m, sums of three} lands on a tone; grid numbers."""
    tones = [*others, candidate]
    if candidate in others or (len(tones) > 1 and candidate < 3):
        return False
    lines: set[int] = set()
    for n in tones:
        lines.update(k * n for k in range(2, 8))
        for m in tones:
            if m != n:
                lines.update((abs(n - m), n + m, 2 * n + m, abs(2 * n - m)))
    return not lines.intersection(tones)


@lru_cache(maxsize=8)
def _minimax(
    machine: InverseGamma, limits: ExcitationLimits, seconds: float, period_s: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(frequencies, amplitude shares) that minimise the worst relative standard error, by simplex search in logarithms.

    Kept, for the tests of one motor ask for the same. It starts near what all such optima look like (most of the flux on a tone below the rotor's corner, one above it, little
    on the others) and is begun anew where it ended, as a simplex may have collapsed (W. H. Press et al., Numerical
    Recipes, 3rd ed., 10.5).
    """
    from scipy.optimize import minimize

    slow, fast = (-p / (2.0 * math.pi) for p in poles_per_s(machine))
    lowest = max(3.0 / seconds, 0.15 * slow)
    highest = min(0.05 / period_s, 3.0 * fast)  # above, skin effect and timing say more than the machine
    start_f = np.clip(np.array([0.5 * slow, fast / 6.0, fast / 3.0, fast, 3.0 * fast]), lowest, highest)
    start = np.concatenate([np.log(start_f), np.log([0.6, 0.2, 0.06, 0.06, 0.06])])

    bounds = np.array([lowest, highest])
    of_machine = np.array(machine.as_tuple())
    of_limits = np.array([limits.current_a, limits.flux_wb, limits.voltage_v, limits.rms_current_a])
    cost = partial(minimax_cost, bounds=bounds, machine=of_machine, limits=of_limits)
    found, options = start, {"maxiter": 1200, "xatol": 0.01, "fatol": 1e-3}
    for _ in range(2):
        found = minimize(cost, found, method="Nelder-Mead", options=options).x
    f = np.exp(np.clip(found[:TONE_COUNT], math.log(lowest), math.log(highest)))
    order = np.argsort(f)
    return f[order], _shares(found[TONE_COUNT:])[order]


def _shares(logarithms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares of the limits, summing to one, each at least 6 % so that every tone can be measured."""
    raw = np.exp(logarithms - np.max(logarithms))
    raw = raw / raw.sum()
    floored = np.maximum(raw, FEWEST_SHARE)
    return np.asarray(floored / floored.sum())


def _gains(machine: InverseGamma, f: Sequence[float] | NDArray[np.float64]) -> tuple[Signal, Signal]:
    """Amplitudes of current (A/V) and stator flux (Wb/V) per volt at each frequency."""
    frequencies = np.asarray(f, dtype=np.float64)
    admittance = admittance_s(machine, frequencies)
    flux = (1.0 - machine.stator_resistance_ohm * admittance) / (2j * np.pi * frequencies)
    return np.abs(admittance), np.abs(flux)


def _scaled(
    machine: InverseGamma,
    f: Sequence[float] | NDArray[np.float64],
    shares: NDArray[np.float64],
    limits: ExcitationLimits,
) -> NDArray[np.float64]:
    """Voltages that use each tone's share of whichever limit it presses most, scaled so that no sum of peaks passes."""
    current, flux = _gains(machine, f)
    amplitudes = shares / np.maximum(current / limits.current_a, flux / limits.flux_wb)
    use = max(
        float(np.sum(amplitudes * current)) / limits.current_a,
        float(np.sum(amplitudes * flux)) / limits.flux_wb,
        float(np.sum(amplitudes)) / limits.voltage_v,
        math.sqrt(0.5 * float(np.sum((amplitudes * current) ** 2))) / limits.rms_current_a,
    )
    return np.asarray(amplitudes / use)


def _information(
    machine: InverseGamma, f: Sequence[float] | NDArray[np.float64], amplitudes: Signal
) -> NDArray[np.float64]:
    """Fisher information of the logarithms of the parameters per unit of 2 sigma^2 / N, (4, 4).

    An unknown delay between voltage and current is carried along and eliminated (Schur complement): two tones could fix
    four parameters, but not tell them from a delay.
    """
    r_s, r_r, l_s, l_m = machine.as_tuple()
    omega = 2j * np.pi * np.asarray(f)
    branch = 1.0 / (1.0 / r_r + 1.0 / (omega * l_m))
    admittance = 1.0 / (r_s + omega * l_s + branch)
    # d ln Y = -Y dZ, dZ per relative change of each parameter
    impedance = np.column_stack([np.full(omega.size, r_s), branch**2 / r_r, omega * l_s, branch**2 / (omega * l_m)])
    nominal = admittance * amplitudes
    sensitivity = -(nominal * admittance)[:, None] * impedance
    delay = -omega * nominal
    shared = (sensitivity.conj().T @ delay).real
    alone = (sensitivity.conj().T @ sensitivity).real
    return np.asarray(alone - np.outer(shared, shared) / float(np.vdot(delay, delay).real))


def _schroeder_phases(shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Phases that spread the peaks (M. R. Schroeder, IEEE Trans. Inf. Theory 16, 1970), all starting the flux near
    zero."""
    power = shares**2 / np.sum(shares**2)
    n = power.size
    return np.array([-2.0 * math.pi * float(np.sum((k - np.arange(k)) * power[:k])) for k in range(n)]) % (
        2.0 * math.pi
    )


def _lost_resistance(
    machine: InverseGamma, frequencies: Signal, amplitudes: Signal, inverter: InverterError, current_a: float
) -> NDArray[np.complex128]:
    """R_eq Y per tone: what the inverter takes, seen as a resistance in series.

    A constant voltage that follows the sign of a many-toned current acts on each tone like sqrt(2/pi) V / sigma_i
    (random-input describing function; A. Gelb & W. E. Vander Velde, Multiple-Input Describing Functions, ch. 2).
    """
    admittance = admittance_s(machine, np.asarray(frequencies))
    sigma_a = math.sqrt(0.5 * float(np.sum((amplitudes * np.abs(admittance)) ** 2)))
    plateau_v = max(float(inverter.on_axis(np.array([current_a]), 0.0)[0]), 0.0)
    return np.asarray(math.sqrt(2.0 / math.pi) * plateau_v / max(sigma_a, 1e-12) * admittance)
