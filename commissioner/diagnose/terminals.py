"""Between motor terminals and recording: cable, delay, lag, nonlinearity, gain, offset, drift and hum of the sensors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose import kinds
from commissioner.diagnose.channel_end import COUNT, current_lost, in_all, slope_lost
from commissioner.diagnose.kinds import CABLE, CLOCK, DELAY, DRIFT, END, EVEN, GAIN, LAG, ODD, OFFSET, TONE
from commissioner.diagnose.lag import SHORT_LAG, behind, low_pass
from commissioner.diagnose.model import Layout, Model, Term
from commissioner.diagnose.record import TO_PHASES, Record, Segment
from commissioner.diagnose.resample import resample, resample_hermite

Array = NDArray[np.float64]


def sense(
    model: Model, record: Record, segment: Segment, channels: Array, layout: Layout,
    trajectory: tuple[Array, Array, Array], jacobian: Array, listed: Sequence[Term],
) -> Array:
    """From terminal currents to what the sensors report: cable, delay, lag, nonlinearity, gain, offset, pickup."""
    phases = record.facts.phases
    to_phases = TO_PHASES[:phases]
    current, after, before = (to_phases @ x for x in trajectory)
    period = record.facts.sample_period_s
    capacitance = model.sum_kind(CABLE, 3)
    if capacitance.any() or any(t.kind == CABLE for t in listed):
        edges = _edges(to_phases @ segment.voltage_ab_v / period)
        current = current + sum(c * e for c, e in zip(capacitance, edges, strict=True))
    at_work = {t.kind for t in (*model.terms, *listed)}
    clock = 1e-6 * _clock(segment) if CLOCK in at_work else np.zeros((0, segment.count))
    turns = _delays(segment) if DELAY in at_work else np.zeros((0, segment.count))
    late = model.sum_kind(DELAY, len(turns)) @ turns + model.sum_kind(CLOCK, len(clock)) @ clock
    lags = model.sum_kind(LAG, 2) / period
    is_short = lags < SHORT_LAG
    late = late / period + lags[is_short].sum()
    filled = [k for k, t in enumerate(listed) if t.kind < kinds.FIRST_OF_SENSING and t.segment in (-1, segment.uid)]
    rows = [0, 1, 2, 3, *(4 + k for k in filled)] if jacobian.shape[0] else []
    if is_short.all():
        current, slope = resample_hermite(current, after, before, late, period) if late.any() else (current, before)
        lag_slopes = [-slope, -slope]
    else:
        long = np.where(is_short, 0.0, lags)
        for row in rows:
            jacobian[row] = low_pass(jacobian[row], long)
        is_asked = any(t.kind == LAG for t in listed)
        lag_slopes = [_by_lag(current, long, k, late) / period for k in range(lags.size)] if is_asked else []
        current, slope = behind(current, long, late)
        slope = slope / period
    if late.any():
        for row in rows:
            jacobian[row] = resample(jacobian[row], late)
    scale = layout.nonlinearity_scale_a
    gain, even, odd = (model.sum_kind(k, 3)[:phases, None] for k in (GAIN, EVEN, ODD))
    s = current / scale
    sensed = current + model.sum_kind(OFFSET, 3)[:phases, None]
    if gain.any() or even.any() or odd.any():
        sensed += current * (gain + s * (even + s * odd))
        slope_of_sensor = 1.0 + gain + s * (2.0 * even + 3.0 * s * odd)
        for row in rows:
            jacobian[row] *= slope_of_sensor
    ages = _ages(record, segment)
    drift = model.sum_kind(DRIFT, 3 * len(ages)).reshape(len(ages), 3)[:, :phases]
    if drift.any():
        sensed += drift.T @ np.stack(ages)
    for term, value in zip(model.terms, model.values, strict=True):
        if term.kind == TONE and value and term.segment in (-1, segment.uid):
            sensed[term.index % 3] += value * channels[:, term.index // 3]
    for k, term in enumerate(listed):
        row = jacobian[4 + k]
        if term.kind == DELAY:
            row[:] = -slope * turns[term.index]
        elif term.kind == LAG:
            row[:] = lag_slopes[term.index]
        elif term.kind == CLOCK:
            row[:] = -slope * clock[term.index]
        elif term.kind == OFFSET:
            row[term.index] = 1.0
        elif term.kind == DRIFT:
            row[term.index % 3] = ages[term.index // 3]
        elif term.kind == GAIN:
            row[term.index] = current[term.index]
        elif term.kind == EVEN:
            row[term.index] = current[term.index] * s[term.index]
        elif term.kind == ODD:
            row[term.index] = current[term.index] * s[term.index] ** 2
        elif term.kind == TONE:
            row[term.index % 3] = channels[:, term.index // 3]
        elif term.kind == CABLE:
            row[:] = edges[term.index]
        if term.kind >= kinds.FIRST_OF_SENSING:
            row *= term.step
    return _at_the_end(model, sensed, layout.channel_ends_a, jacobian, listed)


def _at_the_end(model: Model, sensed: Array, ends_a: Array, jacobian: Array, listed: Sequence[Term]) -> Array:
    """The last thing a channel does: it bends before it stops. Term index: share, counted through the phases."""
    shares = model.sum_kind(END, 3 * COUNT).reshape(3, COUNT)[: sensed.shape[0]]
    asked = [(k, t) for k, t in enumerate(listed) if t.kind == END]
    if not asked and not shares.any():
        return sensed
    lost = current_lost(sensed, ends_a)
    if shares.any():
        if jacobian.shape[0]:
            jacobian *= 1.0 - in_all(shares, slope_lost(sensed, ends_a))
        sensed = sensed - in_all(shares, lost)
    for k, term in asked:
        phase, share = divmod(term.index, COUNT)
        jacobian[4 + k, phase] = -term.step * lost[share, phase]
    return sensed


def _ages(record: Record, segment: Segment) -> list[Array]:
    """Minutes since the first sample, the same settling within a quarter and a sixteenth of the recording, and swinging once to

    and fro within it (cosine and sine, zero and of slope one or zero at the start).
    """
    first, last = record.segments[0].time_s[0], record.segments[-1].time_s[-1]
    age = (segment.time_s - first) / 60.0
    whole = max(float(last - first), 1e-3) / 60.0
    settling = [tau * (1.0 - np.exp(-np.maximum(age, 0.0) / tau)) for tau in (whole / 4.0, whole / 16.0)]
    turn = 2.0 * np.pi / whole
    return [age, *settling, np.sin(turn * age) / turn, (1.0 - np.cos(turn * age)) / turn]


def _delays(segment: Segment) -> Array:
    """Delay (s) per unit at every sample: alike, and longer for every other one."""
    return np.stack([np.ones(segment.count), np.where(np.arange(segment.count) % 2, -1.0, 1.0)])


def _clock(segment: Segment) -> Array:
    """Delay (s) that each unit of a clock's rate error makes from the start of the segment: constant, and wandering once to

    and fro within it (cosine and sine).
    """
    elapsed = segment.time_s - segment.time_s[0]
    turn = 2.0 * np.pi / max(segment.count * segment.period_s, 1e-9)
    return np.stack([elapsed, np.sin(turn * elapsed) / turn, (1.0 - np.cos(turn * elapsed)) / turn])


def _edges(voltage_per_period: Array) -> list[Array]:
    """Step of the command at, before and after each sample, over the period."""
    edge = np.diff(voltage_per_period, axis=1, prepend=0.0)
    none = np.zeros((edge.shape[0], 1))
    return [edge, np.hstack([none, edge[:, :-1]]), np.hstack([edge[:, 1:], none])]


def _by_lag(current: Array, lags: Array, k: int, late: Array) -> Array:
    """Derivative of the lagged current by one lag (samples); by one that is not there as by a delay."""
    if not lags[k]:
        return -behind(current, lags, late)[1]
    h = 1e-3 * lags[k] * (np.arange(lags.size) == k)
    more, less = (behind(current, moved, late)[0] for moved in (lags + h, lags - h))
    return np.asarray((more - less) / (2e-3 * lags[k]))
