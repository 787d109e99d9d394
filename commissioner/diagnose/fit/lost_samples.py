"""Samples lost without a gap in the time stamps: found by their jump in delay, then put right in the data.

Three ways to lose one: the current channel skips (all later currents come early), whole rows vanish (command and current
both skip), or a value is held. Each is tried where a scan points; the one that mends the segment's error is kept. A sample
that stands out and holds no other's value is a spike, as noise with heavy tails has them: left out, and no loss.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from commissioner.compiled import njit
from commissioner.diagnose.fit.normal_equations import whiten
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import TO_PHASES, Record, Segment, each_segment
from commissioner.diagnose.plant.model import Layout, Model
from commissioner.diagnose.plant.prediction import exact_step, predict

Array = NDArray[np.float64]
MOST_EVENTS = 16
"""In one segment and round: a logger that loses more has no clock."""
LEAST_GAIN = 80.0
"""Delta chi2 of one event: 40 for the look over all instants (2 ln N is below 30), 40 for the rule."""
LEAST_SHARE = 0.03
WORST_CONDITION = 1e12
LEAST_JUMP = 0.7
"""Samples by which the delay must seem to jump: several jumps in a segment do not add up to a whole number anywhere."""
STANDS_OUT = 9.0
"""Times the usual jump of the residual from one sample to the next: worth a trial."""
MOST_IN_A_ROW = 3
MOST_SKIPPED = 24
SPIKE = "spike"
"""The way of an event in which no sample was lost."""
MOST_BETWEEN_ALIKE = 16.0
"""Chi2 of two or three phases that hold one current twice: from noise alone, one of a thousand has more."""
START = 50
"""Samples in which a pulse is flux left from before, not a loss."""


@dataclass(frozen=True)
class Loss:
    """One event: segment number, time (s) in the recording, samples, and which way."""

    segment: int
    time_s: float
    samples: int
    way: str

    @property
    def is_spike(self) -> bool:
        """One sample stands out, and none is lost."""
        return self.way == SPIKE


def mend(
    record: Record, model: Model, layout: Layout, noise: Noise, *, is_first: bool
) -> tuple[Record, tuple[Loss, ...]]:
    """The record with unmarked losses masked and re-aligned, spikes masked, and the list of them. `is_first`: the model was
    fitted to data with all their losses, and is right in their middle rather than at the start.
    """

    def of_segment(k: int) -> tuple[Segment, list[Loss]]:
        one = _Mending(record, k, model, layout, noise)
        losses = one.put_skips_right(begins_anywhere=is_first)
        for _ in range(MOST_EVENTS):
            loss = one.put_one_right()
            if loss is None:
                break
            losses.append(loss)
        return one.segment, losses

    done = each_segment(of_segment, record)
    return replace(record, segments=tuple(s for s, _ in done)), tuple(x for _, losses in done for x in losses)


class _Mending:
    """One segment as mended so far, what the model predicts for it, and its chi2."""

    def __init__(self, record: Record, k: int, model: Model, layout: Layout, noise: Noise) -> None:
        self.record, self.k, self.model, self.layout, self.noise = record, k, model, layout, noise
        self.segment = record.segments[k]
        self.predicted_a = self._predict(self.segment)
        self.chi2 = self._chi2(self.segment, self.predicted_a)

    def _predict(self, segment: Segment) -> Array:
        segments = list(self.record.segments)
        segments[self.k] = segment
        return predict(self.model, replace(self.record, segments=tuple(segments)), self.k, self.layout).currents_a

    def _chi2(self, segment: Segment, predicted_a: Array) -> float:
        white = whiten(segment.currents_a - predicted_a, segment.is_good, self.noise, self.record.facts.sample_period_s)
        return float(white @ white)

    def _judge(self, repaired: Segment) -> tuple[Array, float]:
        """Currents that the model predicts after the repair, and their chi2: rows put back change the command, too."""
        is_same = repaired.voltage_axis_v is self.segment.voltage_axis_v
        predicted = self.predicted_a if is_same else self._predict(repaired)
        return predicted, self._chi2(repaired, predicted)

    @property
    def excess(self) -> float:
        return self.chi2 - float(self.segment.good_count) * self.record.facts.phases

    def _gain(self, repaired: Segment, chi2: float) -> float:
        """What the repair gains beyond the samples that no longer count."""
        masked = max(self.segment.good_count - repaired.good_count, 0)
        return self.chi2 - chi2 - 3.0 * masked * self.record.facts.phases

    def put_skips_right(self, *, begins_anywhere: bool) -> list[Loss]:
        """Skips of the current channel alone move no state of the machine: the whole staircase of them is found at once.

        Where it `begins_anywhere`, none from the start as well: then the segment's whole current may be early beside the others'.
        """
        found = [x for x in map(self._skips_right, {begins_anywhere, False}) if x is not None]
        if not found:
            return []
        _, self.segment, losses, self.predicted_a, self.chi2 = max(found, key=lambda x: x[0])
        return losses

    def _skips_right(self, begins_anywhere: bool) -> tuple[float, Segment, list[Loss], Array, float] | None:
        """Gain and repair of the staircase; none where a delay that drifts evenly explains as much."""
        segment, sigma = self.segment, self.noise.sigma_a[:, None]
        predicted = np.ascontiguousarray(self.predicted_a / sigma)
        seen = np.ascontiguousarray(np.where(segment.is_good, segment.currents_a / sigma, np.nan))
        shifts = _staircase(seen, predicted, LEAST_GAIN, begins_anywhere)
        before = np.r_[shifts[0] if begins_anywhere else 0, shifts[:-1]]
        repaired, losses = segment, []
        for at in np.flatnonzero(shifts - before):
            n, where = int(shifts[at] - before[at]), int(at + before[at] - before[0])
            if where + n >= segment.count - 2:
                break
            losses.append(Loss(segment.number, float(segment.time_s[at]), n, "current samples"))
            repaired = _shifted(repaired, where, n)
        if not losses or _drifts_evenly(seen, predicted, shifts):
            return None
        there, chi2 = self._judge(repaired)
        gain = self._gain(repaired, chi2)
        is_enough = gain >= max(LEAST_GAIN * len(losses), LEAST_SHARE * self.excess)
        return (gain, repaired, losses, there, chi2) if is_enough else None

    def put_one_right(self) -> Loss | None:
        """The one event whose repair gains most, if it gains enough."""
        segment = self.segment
        residual = np.where(segment.is_good, segment.currents_a - self.predicted_a, 0.0)
        slope = np.gradient(self.predicted_a, axis=1)
        best: tuple[float, Segment, Loss, Array, float] | None = None
        for at in _suspects(residual, slope, segment, self.model, self.noise):
            for repaired, loss in self._repairs(at):
                there, chi2 = self._judge(repaired)
                gain = self._gain(repaired, chi2)
                if gain > max(LEAST_GAIN, LEAST_SHARE * self.excess) and (best is None or gain > best[0]):
                    best = (gain, repaired, loss, there, chi2)
        if best is None:
            return None
        _, self.segment, loss, self.predicted_a, self.chi2 = best
        return loss

    def _repairs(self, at: int) -> Iterator[tuple[Segment, Loss]]:
        segment = self.segment
        for near in (at, at - 1, at + 1):
            if not 2 <= near < segment.count - MOST_IN_A_ROW - 2:
                continue
            time = float(segment.time_s[near])
            without = segment.is_good.copy()
            without[near] = False
            way = "held value" if self._is_held(near) else SPIKE
            yield replace(segment, is_good=without), Loss(segment.number, time, 1, way)
            for n in range(1, MOST_IN_A_ROW + 1):
                yield _shifted(segment, near, n), Loss(segment.number, time, n, "current samples")
                yield _inserted(segment, near, n), Loss(segment.number, time, n, "whole rows")

    def _is_held(self, at: int) -> bool:
        """Whether all phases repeat an earlier current that is no spike itself, or are zero: what stands in a lost one's place."""
        seen = self.segment.currents_a
        error = seen - self.predicted_a
        first = at
        while first > max(at - MOST_EVENTS, 1) and self._is_alike(seen[:, first], seen[:, first - 1]):
            first -= 1
        repeats = first < at and self._is_alike(error[:, first], error[:, first - 1])
        return repeats or self._is_alike(seen[:, at], np.zeros(seen.shape[0]))

    def _is_alike(self, a: Array, b: Array) -> bool:
        """Whether the noise of two samples makes what lies between them."""
        return float((((a - b) / self.noise.sigma_a) ** 2).sum()) < 2.0 * MOST_BETWEEN_ALIKE


@njit(nogil=True)
def _staircase(seen, predicted, price, begins_anywhere):  # type: ignore[no-untyped-def]
    """(n,) samples by which each one seen is early: the least sum of squares plus `price` per step up (Viterbi).

    It counts from none, and may step up before the first sample, or, where it `begins_anywhere`, from where it begins.
    """
    phases, count = seen.shape
    cost = np.zeros(2 * MOST_SKIPPED + 1)
    if not begins_anywhere:
        cost[:] = np.inf
        cost[MOST_SKIPPED] = 0.0
    came_from = np.zeros((count, 2 * MOST_SKIPPED + 1), dtype=np.int8)
    for t in range(count):
        for n in range(2 * MOST_SKIPPED, -1, -1):
            best, origin = cost[n], n
            for step in range(1, min(n, MOST_IN_A_ROW) + 1):
                if cost[n - step] + price < best:
                    best, origin = cost[n - step] + price, n - step
            at = min(max(t + n - MOST_SKIPPED, 0), count - 1)
            for p in range(phases):
                if not np.isnan(seen[p, t]):
                    best += (seen[p, t] - predicted[p, at]) ** 2
            cost[n], came_from[t, n] = best, origin
    shifts = np.zeros(count, dtype=np.int64)
    n = int(np.argmin(cost))
    for t in range(count - 1, -1, -1):
        shifts[t] = n
        n = came_from[t, n]
    return shifts - MOST_SKIPPED


def _drifts_evenly(seen: Array, predicted: Array, shifts: NDArray[np.int64]) -> bool:
    """Whether a smooth delay (growing evenly, wandering once to and fro) lies nearer to the data than its staircase does."""
    count = shifts.size
    t = np.linspace(0.0, 1.0, count)
    forms = np.stack([np.ones_like(t), t, np.sin(2.0 * np.pi * t), np.cos(2.0 * np.pi * t)], axis=1)
    apart = forms @ np.linalg.lstsq(forms, shifts.astype(float), rcond=None)[0] - shifts
    at = np.clip(np.arange(count) + shifts, 0, count - 1)
    slope = np.gradient(predicted, axis=1)[:, at] * apart
    is_seen = ~np.isnan(seen)
    power = float((slope[is_seen] ** 2).sum())
    met = float((slope * (seen - predicted[:, at]))[is_seen].sum())
    return power > LEAST_GAIN and met > 0.5 * power


def _suspects(residual: Array, slope: Array, segment: Segment, model: Model, noise: Noise) -> Iterator[int]:
    """Instants worth trying: the strongest jump of the residual, the best step in delay beside a drifting one, and the best
    pulse of voltage, for that is what rows that vanished look like to the machine.
    """
    jump = np.abs(np.diff(residual, axis=1))
    good = segment.is_good[1:] & segment.is_good[:-1]
    scale = np.maximum(1.4826 * np.median(jump[:, good], axis=1, keepdims=True) / 0.9, 1.2 * noise.sigma_a[:, None])
    score = np.where(good, (jump / scale).max(axis=0), 0.0)
    at = int(np.argmax(score))
    if score[at] > STANDS_OUT:
        yield at + 1
    step = _delay_step(residual / noise.sigma_a[:, None], slope / noise.sigma_a[:, None])
    if step is not None:
        yield step
    pulse = _pulse(residual, segment, model, noise)
    if pulse is not None:
        yield pulse


def _pulse(residual: Array, segment: Segment, model: Model, noise: Noise) -> int | None:
    """Where one pulse of voltage explains most of the residual along the axis: filter matched to the linear machine."""
    angle = np.deg2rad(segment.axis_deg)
    weights = TO_PHASES[: residual.shape[0]] @ np.array([np.cos(angle), np.sin(angle)])
    along = weights @ residual / float(weights @ weights)
    variance = float((weights * noise.sigma_a) @ (weights * noise.sigma_a)) / float(weights @ weights) ** 2
    transition, _, output, _ = exact_step(model.nominal, segment.period_s)
    first, trace = float(output[0]), float(np.trace(transition))
    poles = [1.0, -trace, float(np.linalg.det(transition))]
    zeros = [first, float(output @ transition[:, 0]) - trace * first]
    impulse = np.zeros(along.shape[0])
    impulse[0] = 1.0
    power = np.cumsum(lfilter(zeros, poles, impulse) ** 2)[::-1]
    gain = lfilter(zeros, poles, along[::-1])[::-1] ** 2 / power / variance
    at = START + int(np.argmax(gain[START:-20]))
    return at if gain[at] > LEAST_GAIN else None


def _delay_step(residual: Array, slope: Array) -> int | None:
    """Where a jump of the delay by whole samples explains most, constant delay and drift projected out."""
    y, w = (residual * slope).sum(axis=0), (slope**2).sum(axis=0)
    t = np.linspace(-1.0, 1.0, y.shape[0])
    basis = np.stack([np.ones_like(t), t])
    gram = (basis * w) @ basis.T
    if not w.any() or np.linalg.cond(gram) > WORST_CONDITION:
        return None  # nothing moves here
    left = y - w * (np.linalg.solve(gram, basis @ y) @ basis)
    after = np.cumsum(left[::-1])[::-1]
    moments = np.cumsum((basis * w)[:, ::-1], axis=1)[:, ::-1]
    power = moments[0] - np.einsum("it,ij,jt->t", moments, np.linalg.inv(gram), moments)
    inside = slice(20, -20)
    gain = after[inside] ** 2 / np.maximum(power[inside], 1e-6 * float(w.sum()))
    at = int(np.argmax(gain))
    samples = after[inside][at] / max(float(power[inside][at]), 1e-12)
    is_jump = abs(samples) >= LEAST_JUMP
    return at + 20 if gain[at] > LEAST_GAIN and is_jump else None


def _shifted(segment: Segment, at: int, n: int) -> Segment:
    """Currents from `at` on belong n samples later."""
    currents, good = segment.currents_a.copy(), segment.is_good.copy()
    currents[:, at + n :] = segment.currents_a[:, at:-n]
    good[at + n :] = segment.is_good[at:-n]
    good[at : at + n] = False
    return replace(segment, currents_a=currents, is_good=good)


def _inserted(segment: Segment, at: int, n: int) -> Segment:
    """n rows put back before `at`: command interpolated, currents masked; the end is cut to keep the length."""
    v = segment.voltage_axis_v
    gap = np.interp(np.arange(1, n + 1) / (n + 1), [0.0, 1.0], [v[at - 1], v[at]])
    voltage = np.concatenate([v[:at], gap, v[at:-n]])
    blank = np.zeros((segment.currents_a.shape[0], n))
    currents = np.hstack([segment.currents_a[:, :at], blank, segment.currents_a[:, at:-n]])
    good = np.concatenate([segment.is_good[:at], np.zeros(n, dtype=bool), segment.is_good[at:-n]])
    return replace(segment, voltage_axis_v=voltage, currents_a=currents, is_good=good)
