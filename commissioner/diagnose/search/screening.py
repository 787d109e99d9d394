"""Score screening: what each absent effect would gain, the nominal and accepted directions projected out.

Lagrange-multiplier test in the local approach (A. Benveniste, M. Basseville, G. Moustakides, IEEE TAC 32(7), 1987)
with the nuisance directions rejected (M. Basseville, I. Nikiforov, INRIA RR-4438, 2002), bounded by physical signs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.causes import CATALOGUE, Setting
from commissioner.diagnose.fit.gauss_newton import bounded_step
from commissioner.diagnose.fit.normal_equations import Normal, NormalEquations
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.plant.model import Layout, Model, Term
from commissioner.diagnose.rules import RULES

Array = NDArray[np.float64]
SCREENED_SAMPLES = 320_000
VISIBLE = 1e-7
"""Share of a direction's power that must be left after projection for it to count as visible."""


@dataclass(frozen=True)
class Score:
    """What an effect promises to first order: gain `delta_chi2` and `step` in theta units.

    `limit` is the size of the first quantity that would just be found. `form`: all numbers to be tried, seen or not.
    """

    name: str
    delta_chi2: float
    numbers: int
    step: Array
    terms: tuple[Term, ...]
    form: tuple[Term, ...] = ()

    @property
    def threshold(self) -> float:
        return RULES.required_chi2(self.numbers)

    @property
    def net(self) -> float:
        return self.delta_chi2 - RULES.price(self.numbers)


@dataclass(frozen=True)
class Screening:
    """Scores by name, and the Gram matrix of every candidate number after projection: what could imitate what."""

    scores: Mapping[str, Score]
    projected: Array
    slope: Array
    columns: Mapping[str, tuple[int, ...]]
    normal: Normal
    times: float = 1.0
    """How much more data there are than were screened; the scores promise for all of them."""

    def ranked(self) -> list[Score]:
        return sorted(self.scores.values(), key=lambda s: -s.net)


def screen(
    model: Model, record: Record, layout: Layout, noise: Noise, setting: Setting, absent: Sequence[str]
) -> Screening:
    """Scores of the effects in `absent` at `model`, one pass over the data; of a long recording over the first part of each
    segment, and what it promises for the whole: all directions of all of it would fill the memory.
    """
    whole = record.samples
    if whole > SCREENED_SAMPLES:
        record = record.first(SCREENED_SAMPLES // len(record.segments))
    candidates = {name: CATALOGUE[name].terms(setting) for name in absent}
    candidates = {name: terms for name, terms in candidates.items() if terms}
    wanted = [*model.terms, *(t for terms in candidates.values() for t in terms)]
    normal = NormalEquations(model, record, layout, wanted, noise).normal(_block(record))
    return score(model, normal, candidates, setting, whole / record.samples)


def _block(record: Record) -> int:
    """Samples averaged in a screening: four blocks per period of the highest strong line of the command."""
    segment = max(record.segments, key=lambda s: float(np.std(s.voltage_axis_v)))
    spectrum = np.abs(np.fft.rfft(segment.voltage_axis_v - segment.voltage_axis_v.mean()))
    frequency = np.fft.rfftfreq(segment.count, record.facts.sample_period_s)
    highest = float(frequency[np.flatnonzero(spectrum > 0.01 * spectrum.max())[-1]])
    return int(np.clip(0.25 / (record.facts.sample_period_s * max(highest, 1.0)), 1, 4))


def score(
    model: Model, normal: Normal, candidates: Mapping[str, tuple[Term, ...]], setting: Setting, times: float = 1.0
) -> Screening:
    """Scores from normal equations whose columns are the model's numbers, then the candidates' in order; promised for so
    many `times` the data.
    """
    gram, slope = normal.total_gram, normal.total_slope
    active = 4 + len(model.terms)
    if not np.isfinite(gram[:active, :active]).all():
        # a fitted machine faster than the steps can follow: nothing can be said about what it lacks
        return Screening({}, np.zeros((0, 0)), np.zeros(0), {}, normal, times)
    free = np.flatnonzero(model.is_free)
    root = _inverse_root(gram[np.ix_(free, free)])
    reduced = root @ gram[free, active:]
    projected = gram[active:, active:] - reduced.T @ reduced
    left = slope[active:] - reduced.T @ (root @ slope[free])
    power = np.diag(gram)[active:]
    is_visible = np.diag(projected) > np.maximum(VISIBLE * power, 1e-6)
    columns: dict[str, tuple[int, ...]] = {}
    scores: dict[str, Score] = {}
    at = 0
    for name, terms in candidates.items():
        places = {t.symbol: at + k for k, t in enumerate(terms)}
        at += len(terms)
        for form in CATALOGUE[name].forms(terms):
            own = [t for t in form if is_visible[places[t.symbol]]]
            kept = tuple(places[t.symbol] for t in own)
            if not kept:
                continue
            one = _score(name, own, projected[np.ix_(kept, kept)], left[list(kept)], setting, times)
            if name not in scores or one.net > scores[name].net:
                scores[name], columns[name] = replace(one, form=form), kept
    return Screening(scores, projected, left, columns, normal, times)


def joint_net(screening: Screening, names: Sequence[str]) -> float:
    """What several effects together promise to first order, less their price."""
    kept = [k for n in names for k in screening.columns[n]]
    terms = [t for n in names for t in screening.scores[n].terms]
    lower, upper = (
        np.array([(x - t.start) / t.step for t, x in zip(terms, bounds, strict=True)])
        for bounds in ([t.lower for t in terms], [t.upper for t in terms])
    )
    gram, slope = screening.projected[np.ix_(kept, kept)], screening.slope[kept]
    step = bounded_step(gram, slope, lower, upper, 1e-9)
    gain = float(2.0 * step @ slope - step @ gram @ step)
    return promised(gain, len(kept), screening.times) - sum(RULES.price(screening.scores[n].numbers) for n in names)


def promised(gain: float, numbers: int, times: float) -> float:
    """What a gain in chi2 grows to with so many times the data: each number's share of the noise, which is 1, does not."""
    return max(numbers + times * (gain - numbers), 0.0) if times > 1.0 else gain


def _score(name: str, terms: Sequence[Term], gram: Array, slope: Array, setting: Setting, times: float) -> Score:
    lower = np.array([t.lower / t.step - t.start / t.step for t in terms])
    upper = np.array([t.upper / t.step - t.start / t.step for t in terms])
    step = bounded_step(gram, slope, lower, upper, 1e-9)
    entry = CATALOGUE[name]
    values = {t.symbol: float(x) * t.step for t, x in zip(terms, step, strict=True)}
    if not entry.promises_its_sign(setting, values):
        return Score(name, 0.0, len(terms), np.zeros(len(terms)), tuple(terms))
    gain = float(2.0 * step @ slope - step @ gram @ step)
    return Score(name, max(promised(gain, len(terms), times), 0.0), len(terms), step, tuple(terms))


def _inverse_root(gram: Array) -> Array:
    """W with W'W = pseudo-inverse of the Gram matrix."""
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    keep = values > 1e-11 * values[-1]
    root: Array = (vectors[:, keep] / np.sqrt(values[keep])).T / scale
    return root
