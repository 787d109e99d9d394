"""What is wrong with a recording before any model: clipping, converter steps, holes, one tone, foreign columns.

Clipped samples are masked, holes are honoured (short ones bridged by interpolating the command, longer ones start a
new stretch with a free state), nothing is filled in silently.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from commissioner.diagnose.intake.plausibility import contradiction
from commissioner.diagnose.intake.record import Facts, Record, Segment
from commissioner.diagnose.intake.refusal import refused
from commissioner.errors import DataRefused
from commissioner.records import Signal, StandstillRecording

BRIDGED_SAMPLES = 5
CLIPPED_RATIO = 3.5
PILE = 1e-6
"""How close to the end samples pile up, relative to the peak: to the last digit. Before a soft limit a channel bends, which
is a cause to be fitted."""
SHORTEST_STRETCH = 200
MOST_SAMPLES = 1_200_000
"""Of all segments together that are looked at: a million takes 2.7 GB, a hundred seconds, and shows a thousandth of the noise."""
MOST_CLIPPED = 0.3
"""Of all samples: where more sit at a limit the data are refused."""
REST_SAMPLES = 1
LEAST_AT_PEAKS = 0.5
"""Of a command's power, where it consists of tones: the rest of their lines is beside them by the window alone."""
LONGEST_REST_S = 1.0
"""Of a rest before the first command, which tells the noise and nothing else."""
MOST_LINES = 200
"""Of one segment: a random binary command has thousands of lines, and none is free of sums of others."""


@dataclass(frozen=True)
class Audit:
    """Findings as numbers; `sentences` in the order they should be read."""

    sentences: tuple[str, ...]
    clipped: dict[str, float] = field(default_factory=dict)
    step_a: tuple[float, ...] = ()
    holes: tuple[tuple[int, float, int], ...] = ()
    excited_hz: tuple[float, ...] = ()
    refusal: DataRefused | None = None


def prepare(recordings: Sequence[StandstillRecording]) -> tuple[Record, Audit]:
    """Segments without holes, masks for clipped samples, and what was found."""
    facts = _facts(recordings)
    sentences: list[str] = []
    holes: list[tuple[int, float, int]] = []
    segments: list[Segment] = []
    steps = _converter_steps(recordings, facts)
    limits = [_clip_limits(r, facts) for r in recordings]
    for file, recording in enumerate(recordings):
        currents = _currents(recording, facts.phases)
        good = ~_clipped(currents, limits[file])
        link, swing = _link_ratio(recording, facts), _link_swing(recording)
        starts = np.flatnonzero(np.r_[True, np.diff(recording.segment) != 0])
        stops = np.r_[starts[1:], recording.time_s.shape[0]]
        for start, stop in zip(starts, stops, strict=True):
            part = slice(int(start), int(stop))
            pieces, lost = _pieces(recording, currents, good, link, swing, part, file, facts)
            holes.extend(lost)
            segments.extend(pieces)
    segments = [_after_long_rest(s, round(LONGEST_REST_S / facts.sample_period_s)) for s in segments]
    kept = [s for s in segments if s.count >= SHORTEST_STRETCH]
    if len(kept) < len(segments):
        sentences.append(f"{len(segments) - len(kept)} stretches shorter than {SHORTEST_STRETCH} samples are left out.")
    kept = [replace(s, uid=k, age_s=float(s.time_s[0] - recordings[s.file].time_s[0])) for k, s in enumerate(kept)]
    record = Record(tuple(kept), facts)
    clipped = _clip_report(recordings, limits, facts)
    tones = excited_lines(record)
    refusal, more = _judge(record, tones, holes, clipped, steps)
    sentences.extend(more)
    if record.samples > MOST_SAMPLES:
        sentences.append(
            f"Of {record.samples} samples the first {record.share_of(MOST_SAMPLES) * facts.sample_period_s:.3g} s of every segment are used: "
            "more would need memory and time, and tell little."
        )
        record = record.beginning(MOST_SAMPLES)
    return record, Audit(
        tuple(sentences),
        clipped,
        steps,
        tuple(holes),
        tuple(tones),
        refusal,
    )


def _facts(recordings: Sequence[StandstillRecording]) -> Facts:
    first = recordings[0]
    metadata = dict(first.metadata)
    phases = 3 if all(r.current_w_a is not None for r in recordings) else 2
    peak = max(float(np.abs(_currents(r, phases)).max()) for r in recordings)
    rated = _number(metadata, "rated_current_a")
    rated_peak = np.sqrt(2.0) * rated if rated else peak
    voltage, frequency = _number(metadata, "rated_voltage_v"), _number(metadata, "rated_frequency_hz")
    flux = np.sqrt(2.0 / 3.0) * voltage / (2.0 * np.pi * frequency) if voltage and frequency else 0.0
    power = _number(metadata, "rated_power_w") or 1.5 * rated_peak * max(float(np.abs(first.voltage_axis_v).max()), 1.0)
    link = None
    if first.dc_link_v is not None:
        link = float(np.median(first.dc_link_v))
    return Facts(
        first.sample_period_s,
        float(rated_peak),
        float(power),
        float(flux),
        peak,
        _number(metadata, "switching_frequency_hz"),
        link or _number(metadata, "dc_link_v"),
        phases,
        metadata,
    )


def _number(metadata: dict[str, float | str], key: str) -> float | None:
    value = metadata.get(key)
    return float(value) if isinstance(value, int | float) and np.isfinite(value) and value > 0 else None


def _currents(recording: StandstillRecording, phases: int) -> NDArray[np.float64]:
    rows = [recording.current_u_a, recording.current_v_a]
    if phases == 3 and recording.current_w_a is not None:
        rows.append(recording.current_w_a)
    return np.stack(rows)


def _link_ratio(recording: StandstillRecording, facts: Facts) -> Signal:
    """Dead-time voltage scale: link voltage times switching frequency, relative to the first file's."""
    n = recording.time_s.shape[0]
    ratio = np.ones(n)
    own = _number(dict(recording.metadata), "switching_frequency_hz")
    if own and facts.switching_frequency_hz:
        ratio = ratio * own / facts.switching_frequency_hz
    if facts.dc_link_v:
        if recording.dc_link_v is not None:
            starts = np.r_[True, np.diff(recording.segment) != 0]
            group = np.cumsum(starts) - 1
            level = np.bincount(group, recording.dc_link_v) / np.bincount(group)
            ratio = ratio * level[group] / facts.dc_link_v
        elif (value := _number(dict(recording.metadata), "dc_link_v")) is not None:
            ratio = ratio * value / facts.dc_link_v
    return ratio


def _link_swing(recording: StandstillRecording) -> Signal | None:
    """What the recorded link deviates from its median, over it; a constant column is the nominal value, not a recording."""
    link = recording.dc_link_v
    if link is None or np.ptp(link) == 0.0 or np.median(link) <= 0.0:
        return None
    return np.asarray(link / np.median(link) - 1.0)


def _converter_steps(recordings: Sequence[StandstillRecording], facts: Facts) -> tuple[float, ...]:
    """Least significant step of each current channel, 0 where the values lie on no grid."""
    return tuple(
        max(_grid(_currents(r, facts.phases)[phase], facts.current_peak_a) for r in recordings)
        for phase in range(facts.phases)
    )


def _grid(values: Signal, peak: float) -> float:
    if peak == 0.0:
        return 0.0
    unique = np.unique(np.round(values[:50000] / peak, 9))
    if unique.size < 4 or unique.size > 0.5 * min(values.size, 50000):
        return 0.0
    gaps = np.diff(unique)
    step = float(np.quantile(gaps, 0.1))
    near = gaps[np.abs(gaps - step) < 0.2 * step]
    step = float(np.mean(near)) if near.size else step
    multiples = gaps / step
    return step * peak if np.all(np.abs(multiples - np.round(multiples)) < 0.15) else 0.0


def _clip_limits(recording: StandstillRecording, facts: Facts) -> list[tuple[float, float]]:
    """Where the command stands still a current may rest at one value by right: such samples do not count as piled up.

    A channel that seldom comes to its end has it where another's, or its other one, has been seen.
    """
    moves = np.r_[True, np.diff(recording.voltage_axis_v) != 0.0]
    rows = _currents(recording, facts.phases)
    limits = [_limits_of(row[moves], facts.current_peak_a) for row in rows]
    seen = np.abs([end for pair in limits for end in pair if np.isfinite(end)])

    def is_there(end: float) -> bool:
        return bool((np.abs(np.abs(end) - seen) <= PILE * facts.current_peak_a).any())

    return [
        (float(row.min()) if is_there(row.min()) else low, float(row.max()) if is_there(row.max()) else high)
        for row, (low, high) in zip(rows, limits, strict=True)
    ]


def _limits_of(values: Signal, peak: float) -> tuple[float, float]:
    """Lower and upper bound of the samples to trust, infinite where none pile up at an end."""
    bounds = []
    for sign in (1.0, -1.0):
        signed = sign * values
        top = float(signed.max())
        bounds.append(sign * top if top > 0.3 * peak and _piles_up(signed, top, PILE * peak) else sign * np.inf)
    return float(bounds[1]), float(bounds[0])


def _piles_up(signed: Signal, top: float, width: float) -> bool:
    """Many samples in a row within `width` of the top, and far fewer just below: a crest has 2.4 times at most."""
    at_top = signed >= top - width
    runs = np.diff(np.flatnonzero(np.diff(np.r_[0, at_top.astype(int), 0])))[::2]
    below = signed[~at_top]
    next_width = max(2e-3 * top, 1.05 * (top - float(below.max()) if below.size else 0.0), width)
    beside = int((~at_top & (signed >= top - width - next_width)).sum())
    return bool(at_top.sum() >= 10 and runs.max() >= 3 and at_top.sum() > CLIPPED_RATIO * max(beside, 1))


def _clipped(currents: NDArray[np.float64], limits: Sequence[tuple[float, float]]) -> NDArray[np.bool_]:
    out = np.zeros(currents.shape[1], dtype=bool)
    for row, (low, high) in zip(currents, limits, strict=True):
        margin = 1e-6 * max(abs(low) if np.isfinite(low) else 0.0, abs(high) if np.isfinite(high) else 0.0, 1e-9)
        out |= (row >= high - margin) | (row <= low + margin)
    return out


def _clip_report(
    recordings: Sequence[StandstillRecording], limits: Sequence[Sequence[tuple[float, float]]], facts: Facts
) -> dict[str, float]:
    tops = [
        float(np.abs(row).max())
        for recording, rows in zip(recordings, limits, strict=True)
        for row, pair in zip(_currents(recording, facts.phases), rows, strict=True)
        if np.isfinite(pair).any()
    ]
    if not tops:
        return {}
    count = sum(
        int(_clipped(_currents(r, facts.phases), rows).sum()) for r, rows in zip(recordings, limits, strict=True)
    )
    return {"limit_a": float(np.median(tops)), "samples": float(count)}


def _pieces(
    recording: StandstillRecording,
    currents: NDArray[np.float64],
    good: NDArray[np.bool_],
    link: Signal,
    swing: Signal | None,
    part: slice,
    file: int,
    facts: Facts,
) -> tuple[list[Segment], list[tuple[int, float, int]]]:
    time, period = recording.time_s[part], recording.sample_period_s
    number = int(recording.segment[part][0])
    # step by step: a clock that is not quite the period's is no loss
    steps = np.maximum(np.round(np.diff(time) / period).astype(int), 1)
    holes = [(number, float(time[k + 1]), int(steps[k]) - 1) for k in np.flatnonzero(steps > 1)]
    cuts = np.flatnonzero(steps > 1 + BRIDGED_SAMPLES) + 1
    axis = recording.axis_deg[part]
    turns = np.flatnonzero(np.diff(axis) != 0) + 1
    bounds = np.unique(np.r_[0, cuts, turns, time.shape[0]])
    out = []
    for begin, end in itertools.pairwise(bounds):
        inner = slice(part.start + int(begin), part.start + int(end))
        out.append(
            _on_grid(
                Segment(
                    number,
                    file,
                    float(axis[begin]),
                    recording.time_s[inner],
                    recording.voltage_axis_v[inner],
                    currents[:, inner],
                    good[inner],
                    link[inner],
                    bool(begin == 0) and _is_at_rest(currents[:, inner], facts),
                    link_swing=None if swing is None else swing[inner],
                ),
                np.r_[0, np.cumsum(steps[begin : end - 1])],
                period,
            )
        )
    return out, holes


def _after_long_rest(segment: Segment, most: int) -> Segment:
    return segment.between(segment.idle - most, segment.count) if segment.idle > most else segment


def _is_at_rest(currents: NDArray[np.float64], facts: Facts) -> bool:
    return float(np.abs(currents[:, :REST_SAMPLES]).max()) < 0.05 * facts.current_peak_a


def _on_grid(segment: Segment, index: NDArray[np.int64], period: float) -> Segment:
    """Rows at `index` of the period's grid, whatever the time stamps were rounded to. Missing ones are put back as masked samples; the
    command there is the smooth curve through its neighbours.
    """
    every = np.arange(index[-1] + 1)
    time_s = segment.time_s[0] + every * period
    if every.size == index.size:
        return replace(segment, time_s=time_s)
    good = np.zeros(every.size, dtype=bool)
    good[index] = segment.is_good
    currents = np.zeros((segment.currents_a.shape[0], every.size))
    currents[:, index] = segment.currents_a
    command = CubicSpline(index, segment.voltage_axis_v)(every)
    command[index] = segment.voltage_axis_v
    return replace(
        segment,
        time_s=time_s,
        voltage_axis_v=command,
        currents_a=currents,
        is_good=good,
        link_ratio=np.interp(every, index, segment.link_ratio),
        link_swing=None if segment.link_swing is None else np.interp(every, index, segment.link_swing),
    )


def excited_lines(record: Record) -> list[float]:
    """Frequencies the command excites, Hz: spectral peaks within 40 dB of the largest, merged over segments; none where most of its
    power lies between them, as a sweep's does; a segment with more than tones are, as a random binary command has, adds none.
    """
    found: list[float] = []
    at_peaks = power = 0.0
    for segment in record.segments:
        v = segment.voltage_axis_v - segment.voltage_axis_v.mean()
        n = v.shape[0]
        if np.std(v) == 0:
            continue
        window = np.hanning(n)
        spectrum = np.abs(np.fft.rfft(v * window))
        frequency = np.fft.rfftfreq(n, record.facts.sample_period_s)
        peaks = np.flatnonzero((spectrum[1:-1] > spectrum[:-2]) & (spectrum[1:-1] >= spectrum[2:])) + 1
        strong = peaks[spectrum[peaks] > 1e-2 * spectrum.max()]
        power += float((spectrum**2).sum())
        if strong.size > MOST_LINES:
            continue
        is_near = np.zeros(spectrum.size, dtype=np.bool_)
        is_near[np.clip(strong[:, None] + np.arange(-2, 3), 0, spectrum.size - 1)] = True
        at_peaks += float((spectrum[is_near] ** 2).sum())
        for f in frequency[strong]:
            if all(abs(f - g) > 2.5 / (n * record.facts.sample_period_s) for g in found):
                found.append(float(f))
    return sorted(found) if at_peaks > LEAST_AT_PEAKS * power else []


def _judge(
    record: Record,
    tones: Sequence[float],
    holes: Sequence[tuple[int, float, int]],
    clipped: dict[str, float],
    steps: Sequence[float],
) -> tuple[DataRefused | None, list[str]]:
    out: list[str] = []
    if not record.segments:
        return refused(
            "no stretch of the recording is long enough to fit anything",
            0,
            f"{SHORTEST_STRETCH} samples without a hole",
            "record again without losses, for longer",
        ), out
    if float(max(np.std(s.voltage_axis_v) for s in record.segments)) == 0.0:
        return refused(
            "the command is constant: nothing is excited",
            0.0,
            "a command that moves",
            "record a test with tones (`commissioner run`)",
        ), out
    if record.facts.current_peak_a == 0.0:
        return refused(
            "every current sample is zero: no sensor or no motor is connected",
            0.0,
            "a current that flows",
            "check sensors and leads",
        ), out
    lost = sum(h[2] for h in holes)
    if lost:
        out.append(f"{lost} samples are missing in {len(holes)} holes; they were left out, not filled.")
    if clipped:
        out.append(f"{clipped['samples']:.0f} samples sit at a limit of {clipped['limit_a']:.4g} A; they are masked.")
        share = clipped["samples"] / record.samples
        if share > MOST_CLIPPED:
            return refused(
                f"{share:.0%} of the samples are clipped",
                share,
                f"at most {MOST_CLIPPED:.0%}",
                "record again at a lower level",
            ), out
    if (refusal := contradiction(record)) is not None:
        return refusal, out
    if max(steps, default=0.0) > 0:
        out.append(f"currents come in steps of {max(steps) * 1e3:.3g} mA.")
    if len(tones) == 1:
        out.append(
            "a single tone is excited: it carries two numbers per axis, so linear causes cannot be told from the "
            "machine's own parameters; only distortion can be named."
        )
    if any(not s.starts_at_rest for s in record.segments):
        out.append("some stretches do not start at rest; their initial state is fitted.")
    return None, out
