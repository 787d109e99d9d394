"""May this recording carry an answer? Time, levels, clipping, sequence, pairing, steadiness: named findings, or a refusal.

Findings are values; `Finding.stops` marks those after which there is no torque curve.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.monitor import channels
from commissioner.monitor.supply import (
    SupplyAngle,
    Vector,
    dominant_frequency_hz,
    follow_supply,
    harmonic_phasor,
    phase_voltages,
    space_vector,
)
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import TCircuit
from commissioner.records import RunningRecording, Signal

SHORTEST_S = 2.0
"""Below this the shaft line (2 Hz resolution at best) cannot be told from the mains."""
LARGEST_JITTER = 0.05
"""rms deviation of the time stamps from a straight line, in sample periods."""
NOTED_JITTER = 0.01
LARGEST_HIDDEN_JITTER = 0.5
"""Of a sample period, seen in the voltage where the stamps show none: white jitter below it averages out like noise."""
LARGEST_CLIPPED = 0.002
"""Share of samples that sit on the same extreme value beyond what a sine would put there."""
LARGEST_FREQUENCY_WANDER = 0.004
"""Of the mean, within the stretch analysed: the grid's own drift is ten times smaller."""
LARGEST_RIPPLE = 0.35
"""Share of the voltage's rms that is not its fundamental: beyond it the voltage is a switched one, sampled without filter."""

HOPELESS = frozenset({"time_order", "dead_channel"})
"""After these not even the fundamental means anything; after other refusals it is still reported."""
LEAST_SAMPLES = 64


@dataclass(frozen=True)
class Finding:
    """What was found, its number, what was allowed, and what to do; `kind` is note, corrected or refused."""

    code: str
    kind: str
    what: str
    value: float | str | None = None
    limit: float | str | None = None
    remedy: str = ""

    @property
    def stops(self) -> bool:
        return self.kind == "refused"


@dataclass(frozen=True)
class Fundamental:
    """The mains as the terminals see it: peak phasors, positive and negative sequence, power of all three phases."""

    frequency_hz: float
    voltage_v: complex
    current_a: complex
    voltage_negative_v: complex
    current_negative_a: complex
    power_w: float
    reactive_var: float
    runs_backwards: bool

    @property
    def voltage_unbalance(self) -> float:
        return abs(self.voltage_negative_v) / abs(self.voltage_v)

    @property
    def current_unbalance(self) -> float:
        return abs(self.current_negative_a) / max(abs(self.current_a), 1e-12)

    @property
    def power_factor(self) -> float:
        return self.power_w / max(float(np.hypot(self.power_w, self.reactive_var)), 1e-12)


@dataclass(frozen=True)
class Audited:
    """The stretch that may be used, as space vectors in the right order, and everything that was found."""

    first_sample: int
    start_s: float
    sample_period_s: float
    current_a: Vector
    voltage_v: Vector
    supply: SupplyAngle | None
    fundamental: Fundamental | None
    findings: tuple[Finding, ...]
    channel_map: Mapping[str, str]

    @property
    def refusal(self) -> Finding | None:
        return next((finding for finding in self.findings if finding.stops), None)


def inspect(recording: RunningRecording, plate: Nameplate, start: TCircuit) -> Audited:
    """Everything that can be said about the recording before any verdict; never raises on bad data."""
    findings: list[Finding] = []
    low, high = _whole_stretch(recording, findings)
    period = _clock(recording, slice(low, high), findings)
    currents = [signal[low:high] for signal in recording.currents_a]
    voltages = [signal[low:high] for signal in recording.voltages_v]
    currents, voltages, exchanged = channels.sort_by_kind(currents, voltages, plate)
    findings += [Finding(*entry) for entry in exchanged]
    _levels(currents, voltages, findings)
    empty = np.zeros(0, dtype=np.complex128)
    if any(finding.code in HOPELESS and finding.stops for finding in findings) or high - low < LEAST_SAMPLES:
        return Audited(low, 0.0, period, empty, empty, None, None, tuple(findings), {})
    raw_frequency = abs(dominant_frequency_hz(_any_vector(voltages), period))
    _in_range(raw_frequency, plate, findings)
    pairing = channels.pair(
        *_phasors(currents, voltages, period, raw_frequency),
        plate,
        start,
        raw_frequency,
        recording.voltages_are_line_to_line,
    )
    findings += [Finding(*entry) for entry in pairing.findings]
    if pairing.is_refused:
        return Audited(low, 0.0, period, empty, empty, None, None, tuple(findings), pairing.channel_map)
    i, v = _vectors(currents, voltages, pairing, recording.voltages_are_line_to_line)
    supply = follow_supply(v, period, raw_frequency)
    fundamental = measure_fundamental(i, v, supply, period, pairing.runs_backwards)
    _ripple(v, fundamental, findings)
    _sampling_jitter(v, supply, fundamental, period, findings)
    _disguise(fundamental, plate, findings)
    return Audited(
        low, float(recording.time_s[low]), period, i, v, supply, fundamental, tuple(findings), pairing.channel_map
    )


def measure_fundamental(i: Vector, v: Vector, supply: SupplyAngle, period: float, backwards: bool) -> Fundamental:
    """Sequence phasors over a Hann window, and the mean power of the whole stretch."""
    time = np.arange(v.size) * period
    angle = supply.angle_rad(time)
    window = np.hanning(v.size + 2)[1:-1]
    window /= window.sum()
    forward = np.exp(-1j * angle) * window
    positive_v, positive_i = complex(v @ forward), complex(i @ forward)
    backward = np.conj(np.exp(-1j * angle)) * window
    negative_v, negative_i = complex(v @ backward), complex(i @ backward)
    apparent = 1.5 * positive_v * np.conj(positive_i)
    frequency = float(np.average(supply.frequency_rad_per_s(time), weights=window)) / (2 * np.pi)
    return Fundamental(
        frequency,
        positive_v,
        positive_i,
        np.conj(negative_v),
        np.conj(negative_i),
        float(apparent.real),
        float(apparent.imag),
        backwards,
    )


def _whole_stretch(recording: RunningRecording, findings: list[Finding]) -> tuple[int, int]:
    """The longest run of samples without a hole or a number that is none."""
    time = recording.time_s
    signals = [time, *recording.currents_a, *recording.voltages_v]
    good = np.all([np.isfinite(signal) for signal in signals], axis=0)
    period = recording.sample_period_s
    broken = ~good
    with np.errstate(invalid="ignore"):
        steps = np.diff(time) / period
        holes = np.flatnonzero(~(steps < 1.5)) + 1 if period > 0 else np.array([], dtype=np.int64)
    if holes.size and good.all() and _is_printed_line(time):
        holes = holes[:0]
    if holes.size and good.all() and abs((time[-1] - time[0]) / period + 1 - time.size) < 0.25 * holes.size:
        holes = holes[:0]  # as many rows as the time asks for: the stamps jitter, nothing is lost
    if np.any(np.diff(time) <= 0):
        findings.append(
            Finding(
                "time_order",
                "refused",
                "time does not run forward",
                float(np.nanmin(np.diff(time))),
                "steps above 0 s",
                "sort the rows by time",
            )
        )
    edges = np.unique(np.concatenate([[0], holes, np.flatnonzero(broken), np.flatnonzero(broken) + 1, [time.size]]))
    lengths = np.diff(edges)
    usable = np.where(broken[np.minimum(edges[:-1], time.size - 1)], 0, lengths)
    k = int(np.argmax(usable))
    low, high = int(edges[k]), int(edges[k + 1])
    lost = _lost(steps, holes) + int(broken.sum())
    if lost or broken.any():
        kept = (high - low) / time.size
        findings.append(
            Finding(
                "missing_samples",
                "note",
                f"{lost} samples are missing in {max(holes.size, 1)} places; only the longest whole "
                f"stretch is used ({(high - low) * period:.2f} s, {kept:.0%} of the recording)",
                lost,
                0,
                "record without gaps",
            )
        )
    if (high - low) * period < SHORTEST_S:
        reason = "missing samples leave" if lost else "the recording holds"
        findings.append(
            Finding(
                "too_short" if not lost else "missing_samples",
                "refused",
                f"{reason} {(high - low) * period:.3g} s without a break: too few load periods",
                (high - low) * period,
                f"at least {SHORTEST_S:g} s, better 30-60 s",
                "record 30-60 s at steady load without gaps",
            )
        )
    return low, high


def _lost(steps: Signal, holes: NDArray[np.int64]) -> int:
    return int(np.sum(np.round(steps[holes - 1]) - 1)) if holes.size else 0


def _clock(recording: RunningRecording, part: slice, findings: list[Finding]) -> float:
    """The sample period from the time stamps; jitter is what is left after a straight line and the printed digits."""
    time = recording.time_s[part]
    if time.size < 16:
        return recording.sample_period_s
    slope, deviation = _straight(time)
    rms = 0.0 if _is_printed_line(time) else float(deviation.std())
    if rms > LARGEST_JITTER:
        findings.append(
            Finding(
                "clock_jitter",
                "refused",
                f"the time stamps wander by {rms:.1%} of a sample period rms",
                rms,
                LARGEST_JITTER,
                "record with a hardware clock at a fixed rate",
            )
        )
    elif rms > NOTED_JITTER:
        findings.append(
            Finding(
                "clock_jitter",
                "note",
                f"the time stamps wander by {rms:.1%} of a sample period rms",
                rms,
                NOTED_JITTER,
                "record with a hardware clock",
            )
        )
    named = recording.metadata.get("sample_period_s")
    if isinstance(named, float) and abs(named / slope - 1) > 1e-3:
        findings.append(
            Finding(
                "clock_rate",
                "note",
                "sample_period_s and the time stamps disagree; the stamps are used",
                named,
                float(slope),
                "correct sample_period_s",
            )
        )
    return float(slope)


def _straight(time: Signal) -> tuple[float, Signal]:
    """(sample period, deviation of each stamp from the straight line in sample periods)."""
    index = np.arange(time.size, dtype=np.float64)
    slope, offset = np.polyfit(index, time - time[0], 1)
    return float(slope), (time - time[0] - offset - slope * index) / slope


def _is_printed_line(time: Signal) -> bool:
    """True where the stamps leave a straight line by no more than the digits in which they were printed."""
    slope, deviation = _straight(time)
    quantum = _printed_step(time) / slope
    return bool(quantum < 2.0 and np.ptp(deviation) <= 1.02 * quantum + 1e-6)


def _printed_step(time: Signal) -> float:
    """The decimal step in which the stamps were printed, 0 where there is none of 0.1 us or coarser."""
    sample = time[:500]
    for digits in range(1, 8):
        if np.all(np.abs(sample - np.round(sample, digits)) < 1e-9):
            return float(10.0**-digits)
    return 0.0


def _levels(currents: list[Signal], voltages: list[Signal], findings: list[Finding]) -> None:
    """Dead channels and clipped ones."""
    for group, kind in ((currents, "current"), (voltages, "voltage")):
        rms = np.array([signal.std() for signal in group])
        for name, value in zip("uvw", rms, strict=True):
            if value < 0.2 * rms.max() or rms.max() == 0.0:
                findings.append(
                    Finding(
                        "dead_channel",
                        "refused",
                        f"{kind} channel {name} carries {value:.3g} rms where the largest has {rms.max():.3g}",
                        float(value),
                        float(0.2 * rms.max()),
                        "check the sensor and its wiring",
                    )
                )
        for name, signal in zip("uvw", group, strict=True):
            share = clipped_share(signal)
            if share > LARGEST_CLIPPED:
                findings.append(
                    Finding(
                        "clipping",
                        "refused",
                        f"{kind} channel {name} is clipped: {share:.1%} of its samples sit on a limit",
                        share,
                        LARGEST_CLIPPED,
                        "use a larger range",
                    )
                )


def clipped_share(signal: Signal) -> float:
    """Share of samples on the extreme values beyond twice what the same signal puts one quantisation step further in."""
    if signal.size == 0 or np.ptp(signal) == 0:
        return 0.0
    share = 0.0
    for extreme, inward in ((signal.max(), -1.0), (signal.min(), 1.0)):
        on_limit = int(np.sum(signal == extreme))
        reach = np.partition(inward * (signal[signal != extreme] - extreme), 0)[0] if on_limit < signal.size else 0.0
        width = max(reach, 1e-3 * np.ptp(signal))
        near = int(np.sum((inward * (signal - extreme) > 0) & (inward * (signal - extreme) <= 3 * width)))
        if on_limit > max(near, 8):
            share += (on_limit - near / 3) / signal.size
    return share


def _any_vector(voltages: list[Signal]) -> Vector:
    return space_vector(*voltages)


def _in_range(frequency_hz: float, plate: Nameplate, findings: list[Finding]) -> None:
    if not 0.1 * plate.rated_frequency_hz < frequency_hz < 2.0 * plate.rated_frequency_hz:
        findings.append(
            Finding(
                "supply_frequency",
                "refused",
                f"the strongest voltage line is at {frequency_hz:.4g} Hz",
                frequency_hz,
                f"{0.1 * plate.rated_frequency_hz:.3g} ... {2 * plate.rated_frequency_hz:.3g} Hz",
                "check the voltage channels",
            )
        )


def _phasors(
    currents: list[Signal], voltages: list[Signal], period: float, frequency_hz: float
) -> tuple[list[complex], list[complex]]:
    """Peak phasors of six channels over the first seconds: long enough to average, short enough for one frequency."""
    count = min(currents[0].size, max(int(2.0 / period), int(5 / (frequency_hz * period))))
    angle = 2 * np.pi * frequency_hz * np.arange(count) * period
    return (
        [harmonic_phasor(signal[:count] - signal[:count].mean(), angle) for signal in currents],
        [harmonic_phasor(signal[:count] - signal[:count].mean(), angle) for signal in voltages],
    )


def _vectors(
    currents: list[Signal], voltages: list[Signal], pairing: channels.Pairing, line_to_line: bool
) -> tuple[Vector, Vector]:
    ordered_i = [sign * currents[k] for k, sign in zip(pairing.current_order, pairing.current_sign, strict=True)]
    ordered_v = [sign * voltages[k] for k, sign in zip(pairing.voltage_order, pairing.voltage_sign, strict=True)]
    star = phase_voltages(*ordered_v) if line_to_line else (ordered_v[0], ordered_v[1], ordered_v[2])
    i, v = space_vector(*ordered_i), space_vector(*star)
    return i - i.mean(), v - v.mean()


def _ripple(v: Vector, fundamental: Fundamental, findings: list[Finding]) -> None:
    known = abs(fundamental.voltage_v) ** 2 + abs(fundamental.voltage_negative_v) ** 2
    share = float(np.sqrt(max(np.mean(np.abs(v) ** 2) - known, 0.0) / known))
    if share > LARGEST_RIPPLE:
        findings.append(
            Finding(
                "switched_voltage",
                "refused",
                f"{share:.0%} of the voltage is not its fundamental",
                share,
                LARGEST_RIPPLE,
                "filter the voltage before sampling, or give the mean over each switching period",
            )
        )


def _sampling_jitter(
    v: Vector, supply: SupplyAngle, fundamental: Fundamental, period: float, findings: list[Finding]
) -> None:
    """Jitter that the stamps do not show: it moves the voltage along the circle only, noise moves it in and out as well.

    From second differences (they drop harmonics): omega V sigma_t = sqrt((var_along - var_across) / 6).
    """
    turned = (
        v * np.exp(-1j * supply.angle_rad(np.arange(v.size) * period)) * np.exp(-1j * np.angle(fundamental.voltage_v))
    )
    rough = turned[2:] - 2 * turned[1:-1] + turned[:-2]
    excess = max(float(rough.imag.var() - rough.real.var()), 0.0) / 6
    if rough.imag.var() < 1.3 * rough.real.var():
        return
    jitter = np.sqrt(excess) / (2 * np.pi * fundamental.frequency_hz * abs(fundamental.voltage_v)) / period
    if jitter > NOTED_JITTER * 5:
        kind = "refused" if jitter > LARGEST_HIDDEN_JITTER else "note"
        findings.append(
            Finding(
                "clock_jitter",
                kind,
                f"the samples were taken off their time by {jitter:.0%} of a sample period rms",
                float(jitter),
                LARGEST_HIDDEN_JITTER,
                "record with a hardware clock",
            )
        )


def _disguise(fundamental: Fundamental, plate: Nameplate, findings: list[Finding]) -> None:
    """Line-to-line voltages under the names of phase voltages are root three too large, and 30 degrees off."""
    per_hertz = abs(fundamental.voltage_v) / fundamental.frequency_hz
    rated = plate.rated_voltage_v * np.sqrt(2 / 3) / plate.rated_frequency_hz
    if per_hertz > 1.45 * rated:
        findings.append(
            Finding(
                "voltage_level",
                "refused",
                "the voltages are too large for this motor: line-to-line under the names of phase voltages?",
                float(per_hertz / rated),
                1.45,
                "name the columns voltage_uv_v, voltage_vw_v, voltage_wu_v, or correct the plate",
            )
        )
