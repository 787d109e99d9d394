"""Between motor terminals and recording: cable, delay, lag, nonlinearity, gain, offset, drift and hum of the sensors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.intake.record import TO_PHASES, Record, Segment
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.kernels.kinds import CABLE, CLOCK, DELAY, DRIFT, END, EVEN, GAIN, LAG, ODD, OFFSET, TONE
from commissioner.diagnose.plant import sensor_curve
from commissioner.diagnose.plant.channel_end import COUNT, current_lost, in_all, slope_lost
from commissioner.diagnose.plant.model import Layout, Model, Term
from commissioner.diagnose.plant.ripple import Pulses
from commissioner.diagnose.plant.sampling import Terminals, conductance_per_volt, reading

Array = NDArray[np.float64]
CURVES = {EVEN: sensor_curve.even, ODD: sensor_curve.odd}


def sense(
    model: Model,
    record: Record,
    segment: Segment,
    channels: Array,
    layout: Layout,
    trajectory: tuple[Array, Array, Array],
    held_v: Array,
    jacobian: Array,
    listed: Sequence[Term],
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
    reader = reading(model, segment, listed, lambda: Pulses.of(record.facts, TO_PHASES @ held_v))
    held = to_phases @ held_v
    per_volt, grows = conductance_per_volt(model)
    there = Terminals(current, after, before, per_volt * held)
    filled = [k for k, t in enumerate(listed) if t.kind < kinds.FIRST_OF_SENSING and t.segment in (-1, segment.uid)]
    rows = [0, 1, 2, 3, *(4 + k for k in filled)] if jacobian.shape[0] else []
    current, slope = reader.of(there)
    if reader.lag or reader.late.any():
        for row in rows:
            is_conductance = row > 3 and listed[row - 4].kind == kinds.IRON_LOSS
            jacobian[row] = reader.of_row(
                jacobian[row], grows * listed[row - 4].step * held if is_conductance else None
            )
    if reader.pulses is not None:
        ripple = reader.ripple_a[:phases]
        current = current + ripple
        if rows:
            jacobian[2] -= ripple
    scale = layout.nonlinearity_scale_a
    gain = model.sum_kind(GAIN, 3)[:phases, None]
    sensed = current + model.sum_kind(OFFSET, 3)[:phases, None]
    curves = {
        kind: of(current / scale) for kind, of in CURVES.items() if any(t.kind == kind for t in (*model.terms, *listed))
    }
    shares = {kind: model.sum_kind(kind, 3 * sensor_curve.COUNT).reshape(-1, 3)[:, :phases, None] for kind in curves}
    if gain.any() or any(share.any() for share in shares.values()):
        error, slope_of_sensor = gain, 1.0 + gain
        for kind, (errors, slopes) in curves.items():
            error = error + (shares[kind] * errors).sum(axis=0)
            slope_of_sensor = slope_of_sensor + (shares[kind] * slopes).sum(axis=0)
        sensed += current * error
        for row in rows:
            jacobian[row] *= slope_of_sensor
    ages = _ages(record, segment) if DRIFT in {t.kind for t in (*model.terms, *listed)} else []
    drift = model.sum_kind(DRIFT, 3 * len(ages)).reshape(len(ages), 3)[:, :phases]
    if drift.any():
        sensed += drift.T @ np.stack(ages)
    for term, value in zip(model.terms, model.values, strict=True):
        if term.kind == TONE and value and term.segment in (-1, segment.uid):
            sensed[term.index % 3] += value * channels[:, term.index // 3]
    for k, term in enumerate(listed):
        row = jacobian[4 + k]
        if term.kind in (DELAY, LAG, CLOCK):
            row[:] = reader.by(term, there, slope)
        elif term.kind == OFFSET:
            row[term.index] = 1.0
        elif term.kind == DRIFT:
            row[term.index % 3] = ages[term.index // 3]
        elif term.kind == GAIN:
            row[term.index] = current[term.index]
        elif term.kind in CURVES:
            part, phase = divmod(term.index, 3)
            row[phase] = current[phase] * curves[term.kind][0][part, phase]
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


def _edges(voltage_per_period: Array) -> list[Array]:
    """Step of the command at, before and after each sample, over the period."""
    edge = np.diff(voltage_per_period, axis=1, prepend=0.0)
    none = np.zeros((edge.shape[0], 1))
    return [edge, np.hstack([none, edge[:, :-1]]), np.hstack([edge[:, 1:], none])]
