"""Causes as they are named: size, strength, confidence, what else would do as well, and those kept back."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from commissioner.diagnose.causes import CATALOGUE, between
from commissioner.diagnose.fit.gauss_newton import on_part
from commissioner.diagnose.fit.lost_samples import Loss
from commissioner.diagnose.intake.audit import Audit
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.rules import RULES
from commissioner.diagnose.search.acceptance import shows
from commissioner.diagnose.search.search import EXPLORED, Found
from commissioner.diagnose.verdict import calibration
from commissioner.diagnose.verdict.evidence import (
    Dropped,
    alternatives,
    claim_features,
    confidence,
    setting_for,
    sizes_with_spread,
)
from commissioner.diagnose.verdict.lack_of_fit import LackOfFit


@dataclass(frozen=True)
class Cause:
    """One named cause. `sizes`: name -> (value, std, unit); `strength_sigma` rms contribution over the noise rms."""

    name: str
    title: str
    sizes: Mapping[str, tuple[float, float, str]]
    gain_share: float
    strength_sigma: float
    delta_chi2: float
    confidence: float
    equivalent: tuple[str, ...] = ()
    rivals: Mapping[str, float] = field(default_factory=dict)
    features: tuple[float, ...] = ()
    from_audit: bool = False


def causes_of(
    found: Found, lack: LackOfFit, trust: float, audit: Audit, noise: Noise, excluded: Sequence[str]
) -> tuple[list[Cause], tuple[Cause, ...]]:
    """Causes that are named, and those that were fitted but are more likely wrong than right as names.

    `trust`: factor on every confidence (see `confidence_factor`).
    """
    refitted = _refitted_without(
        found, noise, excluded, [n for n in found.accepted if _may_be_named(found, n, lack, trust)]
    )
    without = {name: refitted.get(name, Dropped(found.gains[name], {})) for name in found.accepted}
    causes = [_cause(found, name, lack, without[name], noise, excluded, trust) for name in found.accepted]
    causes = _in_truth(_with_open_ties(causes, without), audit)
    losses = () if lack.from_bursts_sigma > 0.0 and not found.accepted else found.losses
    causes += _audit_causes(audit, found, noise, {c.name for c in causes}, losses)
    unsure = tuple(
        c
        for c in causes
        if c.confidence < RULES.least_confidence or (not c.from_audit and _is_less_than_left(c.strength_sigma, lack))
    )
    return [c for c in causes if c not in unsure], unsure


def explained_share(found: Found, lack: LackOfFit, left_sigma: float) -> float:
    """Share of the structured error power that is not among what is left (`left_sigma`, causes not named included)."""
    count = float(found.fit.normal.count.sum())
    structured = max(found.nominal.chi2 - found.fit.chi2, 0.0) + lack.sigma**2 * count
    return 1.0 - min(left_sigma**2 * count / max(structured, left_sigma**2 * count, 1.0), 1.0)


def _is_less_than_left(strength_sigma: float, lack: LackOfFit) -> bool:
    """A cause that makes less of the error than what no cause makes may be a part of that unknown."""
    return lack.sigma > max(strength_sigma, RULES.mostly_explained_sigma)


def _may_be_named(found: Found, name: str, lack: LackOfFit, trust: float) -> bool:
    """Whether the name is likely enough: else its alternatives need not be sought."""
    count = float(found.fit.normal.count.sum())
    total = max(found.nominal.chi2 - found.fit.chi2, 1.0)
    sure = trust * confidence(claim_features(found.fit, found.accepted, name, lack, total), calibration.WEIGHTS)
    is_likely = sure >= RULES.least_confidence or _is_dominant(found.gains[name], lack, count)
    return is_likely and not _is_less_than_left(float(np.sqrt(found.gains[name] / count)), lack)


def _is_dominant(gain: float, lack: LackOfFit, count: float) -> bool:
    """Whether so much is left that nothing like it was among what the confidence learned from, and yet one cause alone takes nearly all of
    the error that is not another's: then it is there, whatever else is.
    """
    return RULES.much_left_sigma**2 * count < lack.sigma**2 * count < (1.0 - RULES.dominant_share) * gain


def _refitted_without(found: Found, noise: Noise, excluded: Sequence[str], asked: Sequence[str]) -> dict[str, Dropped]:
    """Fits without each of the causes `asked` about, on the first part of every segment where that shows them as well."""
    if not asked:
        return {}
    record, layout = found.record, found.layout
    out: dict[str, Dropped] = {}
    for samples in (*EXPLORED, record.samples):
        if len(out) == len(asked):
            break
        fitted, part = on_part(found.fit, record, layout, noise, samples)
        share = part.samples / record.samples
        shown = [n for n in asked if n not in out and (part is record or shows(fitted, share, n, found.gains[n]))]
        if shown:
            setting = setting_for(found.setting, part)
            out |= alternatives(fitted, found.accepted, part, layout, setting, noise, record.samples, excluded, shown)
    return out


def _cause(
    found: Found,
    name: str,
    lack: LackOfFit,
    without: Dropped,
    noise: Noise,
    excluded: Sequence[str],
    trust: float,
) -> Cause:
    count = float(found.fit.normal.count.sum())
    total = max(found.nominal.chi2 - found.fit.chi2, 1.0)
    # where the way to a cause bends, the loss foretold at its end falls short of a fit's
    gain = total if found.accepted == (name,) else max(found.gains[name], min(without.loss, total))
    fixed = () if found.setting.link_varies else tuple(n for n in CATALOGUE if between(name, n).is_always_tied)
    unsettled = min(RULES.nearly_all_share * gain, RULES.left_tie_share * lack.sigma**2 * count)
    close = tuple(
        n
        for n, r in without.rivals.items()
        if r.loss + _more_numbers(found, name, n) < max(RULES.tie_chi2, between(name, n).tied_share * gain, unsettled)
    )
    features = claim_features(found.fit, found.accepted, name, lack, total)
    sure = confidence(features, calibration.WEIGHTS) * trust
    if _is_dominant(gain, lack, count) and all(r.loss > RULES.rival_loss_share * gain for r in without.rivals.values()):
        sure = max(sure, RULES.dominant_confidence * trust)
    if not noise.is_known:
        sure *= calibration.UNKNOWN_NOISE_FACTOR
    strength = float(np.sqrt(gain / count))
    if strength < calibration.TRACE_SIGMA:
        sure *= calibration.TRACE_FACTOR
    return Cause(
        name,
        CATALOGUE[name].title,
        sizes_with_spread(found.fit, name, found.setting),
        min(gain / total, 1.0),
        strength,
        gain,
        sure,
        tuple(c for c in dict.fromkeys((*fixed, *close)) if c not in excluded),
        {n: r.loss for n, r in without.rivals.items()},
        tuple(features),
    )


def _with_open_ties(causes: Sequence[Cause], without: Mapping[str, Dropped]) -> list[Cause]:
    """Sizes whose spread holds half of what they move by if a tied cause beside them is the other one, or if they have another form: either
    may be true.
    """
    out = []
    for cause in causes:
        tied = [
            without[c.name].rivals[n]
            for c in causes
            if c is not cause
            for n in c.equivalent
            if n in without[c.name].rivals
        ]
        tied += without[cause.name].forms
        sizes = {}
        for key, (value, spread, unit) in cause.sizes.items():
            moved = [0.5 * r.moved.get(cause.name, {}).get(key, 0.0) for r in tied]
            sizes[key] = (value, float(np.linalg.norm([spread, max(np.abs(moved), default=0.0)])), unit)
        out.append(replace(cause, sizes=sizes))
    return out


def _more_numbers(found: Found, name: str, rival: str) -> float:
    """What the numbers are worth (G. Schwarz, Ann. Statist. 6(2), 1978) that a rival has more, or fewer, where one of the two can only imitate the
    other: a drift that has settled at once, a sensor's bend that has.
    """
    if name not in CATALOGUE[rival].imitates and rival not in CATALOGUE[name].imitates:
        return 0.0
    mine = sum(t.effect == name for t in found.fit.model.terms)
    return float(np.log(found.fit.normal.count.sum())) * (len(CATALOGUE[rival].terms(found.setting)) - mine)


def _in_truth(causes: Sequence[Cause], audit: Audit) -> list[Cause]:
    """Causes under the name that their sizes give them."""
    out = []
    for cause in causes:
        truth = CATALOGUE[cause.name].in_truth([value for value, _, _ in cause.sizes.values()], audit)
        if truth is None:
            out.append(cause)
            continue
        name, sizes = truth
        exact = {key: (value, 0.0, unit) for key, (value, unit) in sizes.items()}
        out.append(replace(cause, name=name, title=CATALOGUE[name].title, sizes=exact, equivalent=()))
    return out


def _audit_causes(
    audit: Audit, found: Found, noise: Noise, named: Collection[str], losses: Sequence[Loss]
) -> list[Cause]:
    """Causes that leave no waveform: coarse converter steps, clipped and missing samples. `losses` without a gap in time: none where
    errors come and go that samples put right do not take away.
    """
    unmarked = float(sum(x.samples for x in losses))
    seen = {n: c.seen_in(audit, found.record, noise, unmarked) for n, c in CATALOGUE.items() if n not in named}
    return [
        Cause(
            name, CATALOGUE[name].title, {k: (v, 0.0, unit) for k, (v, unit) in sizes.items()}, 0.0, 0.0, 0.0, 0.99,
            from_audit=True,
        )
        for name, sizes in seen.items() if sizes
    ]  # fmt: skip


def confidence_factor(lack: LackOfFit, share: float) -> float:
    """Factor on every confidence where what is left is small, yet more than noise makes around the tones or in a state, and a
    larger part of all there was to explain than a right name leaves: 1 at the most that one may leave.
    """
    is_trace = (
        max(lack.from_tones_sigma, lack.from_states_sigma, lack.from_ruled_out_sigma) > 0.0
        and lack.sigma <= RULES.mostly_explained_sigma
    )
    return min((1.0 - RULES.explained_share) / (1.0 - share), 1.0) if is_trace and share < 1.0 else 1.0
