"""The time axis: the longest stretch without a hole, the sample period, and the jitter that the stamps show or hide."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from commissioner.monitor.intake.findings import Findings, Fundamental
from commissioner.monitor.signals.supply import SupplyAngle, Vector
from commissioner.motor.computed import printed_step
from commissioner.motor.nameplate import Nameplate
from commissioner.records import RunningRecording, Signal

LEAST_SAMPLES = 64
RECORD_LONGER = "record 30-60 s at steady load without gaps"
SLOWEST_RATE = 10.0
"""Samples per rated period: the inversion needs side bands on either side of the fundamental."""
SHORTEST_S = 2.0
"""Below this the shaft line (2 Hz resolution at best) cannot be told from the mains."""
ROUNDED = 1.0 - 1e-9
LARGEST_JITTER = 0.05
"""rms deviation of the time stamps from a straight line, in sample periods."""
NOTED_JITTER = 0.01
LARGEST_HIDDEN_JITTER = 0.5
"""Of a sample period, seen in the voltage where the stamps show none: white jitter below it averages out like noise."""


def whole_stretch(recording: RunningRecording, findings: Findings) -> tuple[int, int]:
    """The longest run of samples without a hole or a number that is none."""
    time = recording.time_s
    if time.size < LEAST_SAMPLES:
        findings.add(
            "too_short",
            "refused",
            f"the recording holds {time.size} samples",
            time.size,
            LEAST_SAMPLES,
            RECORD_LONGER,
        )
        return 0, time.size
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
        findings.add(
            "time_order",
            "refused",
            "time does not run forward",
            float(np.nanmin(np.diff(time))),
            "steps above 0 s",
            "sort the rows by time; stamps that only wander leave out, and give `# sample_period_s:`",
        )
    edges = np.unique(np.concatenate([[0], holes, np.flatnonzero(broken), np.flatnonzero(broken) + 1, [time.size]]))
    lengths = np.diff(edges)
    usable = np.where(broken[np.minimum(edges[:-1], time.size - 1)], 0, lengths)
    k = int(np.argmax(usable))
    low, high = int(edges[k]), int(edges[k + 1])
    lost = _lost(steps, holes) + int(broken.sum())
    if lost or broken.any():
        kept = (high - low) / time.size
        findings.add(
            "missing_samples",
            "note",
            f"{lost} samples are missing in {max(holes.size, 1)} places; only the longest whole "
            f"stretch is used ({(high - low) * period:.2f} s, {kept:.0%} of the recording)",
            lost,
            0,
            "record without gaps",
        )
    if (high - low + 1) * period < SHORTEST_S * ROUNDED:  # to a sample, and the digits of printed times
        reason = "missing samples leave" if lost else "the recording holds"
        findings.add(
            "too_short" if not lost else "missing_samples",
            "refused",
            f"{reason} {(high - low) * period:.4g} s without a break: too short to tell a period",
            (high - low) * period,
            f"{SHORTEST_S:g} s, better 30-60 s",
            RECORD_LONGER,
        )
    return low, high


def _lost(steps: Signal, holes: NDArray[np.int64]) -> int:
    return int(np.sum(np.round(steps[holes - 1]) - 1)) if holes.size else 0


def sample_clock(recording: RunningRecording, part: slice, findings: Findings) -> float:
    """The sample period from the time stamps; jitter is what is left after a straight line and the printed digits."""
    time = recording.time_s[part]
    if time.size < 16 or any(finding.code == "time_order" for finding in findings):
        return recording.sample_period_s
    slope, deviation = _straight(time)
    rms = 0.0 if _is_printed_line(time) else float(deviation.std())
    if rms > LARGEST_JITTER:
        findings.add(
            "clock_jitter",
            "refused",
            f"the time stamps wander by {rms:.1%} of a sample period rms",
            rms,
            LARGEST_JITTER,
            "record with a hardware clock at a fixed rate",
        )
    elif rms > NOTED_JITTER:
        findings.add(
            "clock_jitter",
            "note",
            f"the time stamps wander by {rms:.1%} of a sample period rms",
            rms,
            NOTED_JITTER,
            "record with a hardware clock",
        )
    named = recording.metadata.get("sample_period_s")
    if isinstance(named, float) and abs(named / slope - 1) > 1e-3:
        findings.add(
            "clock_rate",
            "note",
            "sample_period_s and the time stamps disagree; the stamps are used",
            named,
            float(slope),
            "correct sample_period_s",
        )
    return float(slope)


def fast_enough(sample_period_s: float, plate: Nameplate, findings: Findings) -> None:
    """Refuses a rate at which the supply itself cannot be followed, which is what milliseconds read as seconds look like."""
    per_period = 1 / (plate.rated_frequency_hz * sample_period_s) if sample_period_s > 0 else 0.0
    if per_period < SLOWEST_RATE:
        findings.add(
            "sample_rate",
            "refused",
            f"{per_period:.3g} samples in a period of the rated frequency",
            per_period,
            SLOWEST_RATE,
            "record at 2 kHz or faster, and give the time in seconds",
        )


def _straight(time: Signal) -> tuple[float, Signal]:
    """(sample period, deviation of each stamp from the straight line in sample periods)."""
    index = np.arange(time.size, dtype=np.float64)
    slope, offset = np.polyfit(index, time - time[0], 1)
    return float(slope), (time - time[0] - offset - slope * index) / slope


def _is_printed_line(time: Signal) -> bool:
    """True where the stamps leave a straight line by no more than the digits in which they were printed."""
    slope, deviation = _straight(time)
    quantum = float(printed_step(time).max()) / slope
    return bool(quantum < 2.0 and np.ptp(deviation) <= 1.1 * quantum + 1e-6)


HARMONICS = 12
"""Even orders beside the fundamental in its own frame, on either side: the 25th of the supply. At 2 kHz the fifth and seventh of 5 % would
turn the vector as a jitter of 20 % does."""


def hidden_jitter(v: Vector, supply: SupplyAngle, fundamental: Fundamental, period: float, findings: Findings) -> None:
    """Jitter that the stamps do not show: it moves the voltage along the circle only, noise moves it in and out as well.

    From second differences (they drop what is slow): omega V sigma_t = sqrt((var_along - var_across) / 6).
    """
    angle = supply.angle_rad(np.arange(v.size) * period)
    turned = v * np.exp(-1j * angle) * np.exp(-1j * np.angle(fundamental.voltage_v))
    excess = _along_the_circle(turned)
    if excess > 0.0:
        excess = _along_the_circle(_without_harmonics(turned, angle))
    jitter = np.sqrt(excess) / (2 * np.pi * fundamental.frequency_hz * abs(fundamental.voltage_v)) / period
    if jitter > NOTED_JITTER * 5:
        kind = "refused" if jitter > LARGEST_HIDDEN_JITTER else "note"
        findings.add(
            "clock_jitter",
            kind,
            f"the samples were taken off their time by {jitter:.0%} of a sample period rms",
            float(jitter),
            LARGEST_HIDDEN_JITTER,
            "record with a hardware clock",
        )


def _along_the_circle(turned: Vector) -> float:
    """Variance that a vector has along the circle beyond what it has across, 0 where that is not clear."""
    rough = turned[2:] - 2 * turned[1:-1] + turned[:-2]
    along, across = float(rough.imag.var()), float(rough.real.var())
    return (along - across) / 6 if along >= 1.3 * across else 0.0


def _without_harmonics(turned: Vector, angle_rad: Signal) -> Vector:
    """Without what repeats with the supply."""
    rest: Vector = turned - turned.mean()
    step = np.exp(2j * angle_rad)
    turn = np.ones_like(step)
    for _ in range(HARMONICS):
        turn *= step
        for order in (turn, turn.conj()):
            rest -= np.vdot(order, rest) / rest.size * order
    return rest
