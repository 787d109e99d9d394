"""The smallest sizes that a recording would have shown, of causes that were named and of those that were not."""

from __future__ import annotations

import numpy as np

from commissioner.diagnose import contract
from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.rules import RULES
from commissioner.diagnose.search.screening import Screening
from commissioner.diagnose.search.search import Found
from commissioner.diagnose.verdict.evidence import sizes_with_spread

Limit = tuple[str, tuple[float, str]]


def detection_limits(found: Found) -> dict[str, contract.Limit | dict[str, contract.Limit]]:
    """Smallest size of each effect that these data would have shown beside the named causes: the first of its sizes."""
    screened = {name: one for one in (found.first_screening, found.screening) for name in one.scores}
    limits = {
        name: _limit_of_absent(found, name, screening)
        for name, screening in screened.items()
        if name not in found.accepted
    }
    limits |= {name: _limit_of_named(found, name) for name in found.accepted}
    return {
        name: {key: {"value": abs(value), "unit": unit}}
        for name, (key, (value, unit)) in sorted((n, x) for n, x in limits.items() if x is not None)
        if np.isfinite(value) and value != 0.0
    }


def _limit_of_named(found: Found, name: str) -> Limit | None:
    """What was found, made as small as a gain that just counts."""
    count = sum(t.effect == name for t in found.fit.model.terms)
    share = float(np.sqrt(max(RULES.required_chi2(count), found.material_chi2) / max(found.gains[name], 1e-300)))
    sizes = {key: (value, unit) for key, (value, _, unit) in sizes_with_spread(found.fit, name, found.setting).items()}
    if not sizes:
        return None
    key, (value, unit) = max(CATALOGUE[name].measures(sizes), key=lambda item: abs(item[1][0]))
    return key, (share * value, unit)


def _limit_of_absent(found: Found, name: str, screening: Screening) -> Limit | None:
    """At the most visible shape, and steady where the size is that of a steady course."""
    score, sizes = screening.scores[name], CATALOGUE[name].sizes
    measures = CATALOGUE[name].measures
    scale = max(found.record.samples * found.record.facts.phases / max(float(screening.normal.count.sum()), 1.0), 1.0)
    none = dict.fromkeys((t.symbol for t in score.terms), 0.0)
    alone = [measures(sizes(found.setting, {**none, t.symbol: t.step})) for t in score.terms]
    counts = [k for k, items in enumerate(alone) if any(value for _, (value, _) in items)]
    if not counts:
        return None
    columns, terms = np.array(screening.columns[name])[counts], [score.terms[k] for k in counts]
    told = screening.projected[np.ix_(columns, columns)]
    shape = np.array([1.0 / t.step for t in terms]) if CATALOGUE[name].course else np.linalg.eigh(told)[1][:, -1]
    power = float(shape @ told @ shape)
    if power <= 0.0:
        return None
    theta = shape * np.sqrt(max(score.threshold, found.material_chi2) / (scale * power))
    theta = theta if theta.sum() >= 0.0 else -theta
    found_sizes = sizes(found.setting, {t.symbol: float(x) * t.step for t, x in zip(terms, theta, strict=True)})
    return max(measures(found_sizes), key=lambda item: abs(item[1][0]))
