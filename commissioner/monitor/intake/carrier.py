"""Voltages of a switching inverter sampled without a filter: the carrier, and means over whole periods of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from commissioner.monitor.intake.findings import Finding
from commissioner.monitor.signals.supply import dominant_frequency_hz, space_vector
from commissioner.records import RunningRecording, Signal

LEAST_RATE = 10.0
"""Samples per carrier period from which a mean over whole periods is the mean of the pulses: edges fall between samples."""
LEAST_LOCKED, LOCKED = 16.0, 0.03
"""Samples per carrier period where they fall on the same places of it in each (their number whole, to so much): no mean helps."""
KNOWN_TO = 0.98
"""Of the rate: a carrier is found to a fraction of the supply's frequency."""
LEAST_SAMPLES = 24
"""In a mean, where the fundamental allows: an edge between two samples is a part of the mean that small."""
SWITCHED = 0.35
"""Share of the voltage's rms beside its fundamental and slower parts that makes it a switched one."""
SLOW = 12.0
"""Times the fundamental: harmonics of a motor's supply lie below, a carrier above."""
PARTS_OF_STRONGEST = 0.05
LONGEST_WINDOW = 0.05
"""Of the fundamental's period: a longer mean would take off some of the fundamental."""
MOST_PERIODS = 8


@dataclass(frozen=True)
class Carrier:
    """Mean frequency, how far it is spread beyond its side bands, and the samples in a window of whole periods."""

    frequency_hz: float
    spread_hz: float
    window: int


def means_over_carrier(recording: RunningRecording) -> tuple[RunningRecording, Finding | None]:
    """The recording as means over whole carrier periods where its voltages are switched ones; as it is where they are not.

    The finding says what was done, or, as a refusal, the rate that would do.
    """
    v = space_vector(*(np.nan_to_num(x) for x in recording.voltages_v))
    steps = np.diff(recording.time_s)
    if v.size < 2000 or not np.all(np.isfinite(steps)) or np.ptp(steps) > 0.5 * np.median(steps):
        return recording, None
    period = recording.sample_period_s
    fundamental = abs(dominant_frequency_hz(v, period))
    found = find(v, period, fundamental)
    if found is None:
        return recording, None
    rate = 1.0 / (period * found.frequency_hz)
    if rate < KNOWN_TO * LEAST_RATE:
        return recording, Finding(
            "switched_voltage", "refused",
            f"the voltages are those of a switching inverter (carrier {found.frequency_hz / 1e3:.3g} kHz) at {rate:.3g} samples a "
            "carrier period",
            f"{1e-3 / period:.4g} kHz", f"{LEAST_RATE * found.frequency_hz / 1e3:.3g} kHz",
            f"sample at {LEAST_RATE * found.frequency_hz / 1e3:.3g} kHz or faster, or filter the voltage before sampling",
        )  # fmt: skip
    if (
        found.spread_hz <= 0.02 * found.frequency_hz
        and abs(rate - round(rate)) < LOCKED
        and rate < LEAST_LOCKED - LOCKED
    ):
        good = 1e-3 * found.frequency_hz
        return recording, Finding(
            "switched_voltage", "refused",
            f"the samples are locked to the carrier of {good:.3g} kHz, {rate:.3g} a period at the same places: an edge between two of them "
            "shifts every mean alike",
            f"{1e-3 / period:.4g} kHz", f"{LEAST_LOCKED * good:.3g} kHz, or a rate that is no multiple of the carrier",
            f"sample at {LEAST_LOCKED * good:.3g} kHz or faster, at {(round(rate) + 0.5) * good:.4g} kHz, or filter the voltage before sampling",
        )  # fmt: skip
    kind = "spread" if found.spread_hz > 0.02 * found.frequency_hz else "fixed"
    return _averaged(recording, found.window), Finding(
        "carrier_means", "note",
        f"the voltages are switched by a {kind} carrier of {found.frequency_hz / 1e3:.4g} kHz: means over {found.window} samples "
        f"({1e3 * found.window * period:.3g} ms, {found.window * period * found.frequency_hz:.2f} carrier periods) were taken of "
        "voltages and currents",
        found.frequency_hz,
    )  # fmt: skip


def find(v: np.ndarray, period_s: float, fundamental_hz: float) -> Carrier | None:
    """The carrier of a voltage space vector `(n,)`, None where its power is slow."""
    n = min(v.size, 1 << 17)
    x = (v[:n] - v[:n].mean()) * np.hanning(n)
    power = np.abs(np.fft.fft(x)) ** 2
    frequency = np.abs(np.fft.fftfreq(n, period_s))
    fast = frequency > SLOW * fundamental_hz
    if np.sum(power[fast]) < SWITCHED**2 * np.sum(power[~fast]):
        return None
    width = max(6.0 * fundamental_hz, 3.0 / (n * period_s))
    edges = np.arange(SLOW * fundamental_hz, 0.5 / period_s + width, width)
    cluster = np.histogram(frequency[fast], edges, weights=power[fast])[0]
    strong = np.flatnonzero(cluster > PARTS_OF_STRONGEST * cluster.max())
    first = float(edges[strong[0]] + 0.5 * width)
    near = fast & (np.abs(frequency - first) < 1.5 * width)
    centre = float(np.average(frequency[near], weights=power[near]))
    near = fast & (np.abs(frequency - centre) < 1.5 * width)
    centre = float(np.average(frequency[near], weights=power[near]))
    spread = float(np.sqrt(np.average((frequency[near] - centre) ** 2, weights=power[near])))
    spread = max(spread - 3.0 * fundamental_hz, 0.0)
    return Carrier(centre, spread, _window(centre, period_s, fundamental_hz))


def _window(carrier_hz: float, period_s: float, fundamental_hz: float) -> int:
    """Samples that hold a whole number of carrier periods best, within a twentieth of the fundamental's period."""
    one = 1.0 / (carrier_hz * period_s)
    most = max(1, min(MOST_PERIODS, int(LONGEST_WINDOW / fundamental_hz * carrier_hz)))
    enough = [m for m in range(1, most + 1) if m * one >= LEAST_SAMPLES] or [most]
    choices = [(abs(round(m * one) / one - m) + 0.01 * m, round(m * one)) for m in enough]
    return max(min(choices)[1], 1)


def _averaged(recording: RunningRecording, window: int) -> RunningRecording:
    count = recording.time_s.size // window

    def mean(x: Signal) -> Signal:
        return np.asarray(x[: count * window].reshape(count, window).mean(axis=1))

    speed = recording.speed_rad_per_s
    i, v = ([mean(x) for x in group] for group in (recording.currents_a, recording.voltages_v))
    return replace(
        recording,
        time_s=mean(recording.time_s),
        currents_a=(i[0], i[1], i[2]),
        voltages_v=(v[0], v[1], v[2]),
        speed_rad_per_s=None if speed is None else mean(speed),
        sample_period_s=recording.sample_period_s * window,
        metadata={k: value for k, value in recording.metadata.items() if k != "sample_period_s"},
    )
