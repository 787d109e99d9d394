"""Causes that were seen, or could hide behind a named one: their name is uncertain, and they are no absent ones."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from commissioner.diagnose.contract import UncertainName
from commissioner.diagnose.diagnosis import Diagnosis
from commissioner.diagnose.verdict.collinearity import Alike, look_alikes
from commissioner.diagnose.verdict.experiment import what_decides
from commissioner.report.diagnosis.numbers import number, percent
from commissioner.report.sheet.words import cause_name

SAME_FORM = 0.96
"""From this share on one cause makes the error of another, and only another test tells the two apart."""


def uncertain(seen: Diagnosis, withdrawn: Collection[str] = ()) -> list[UncertainName]:
    """`name`, `why` the name is uncertain, what `decides` it, and whether it `is_seen` (or could only hide); those that moved the fit first.

    `withdrawn`: accepted during the search and taken out again.
    """
    if seen.found is None:
        return []
    named = {n for c in seen.causes for n in (c.name, *c.equivalent)}
    why: dict[str, str] = {}
    for cause in sorted(seen.unsure, key=lambda c: -c.strength_sigma):
        why[cause.name] = (
            f"It helps the fit (its error: {number(cause.strength_sigma, 2)} x the noise), but is more likely another cause in disguise."
        )
    for name in seen.below_materiality:
        why.setdefault(name, "Seen, but too small to matter, or a part of the form of a named cause.")
    for name in withdrawn:
        why.setdefault(name, "Named at first, and no longer needed once the other causes were in.")
    behind = _hidden(look_alikes(seen.found.first_screening, seen.found.accepted), named)
    hidden = behind.keys() - why.keys()
    why |= {name: behind[name] for name in behind if name in hidden}
    return [
        {"name": name, "why": reason, "decides": what_decides(name, seen.found.record), "is_seen": name not in hidden}
        for name, reason in why.items()
        if name not in named
    ]


def _hidden(alike: Alike, named: Collection[str]) -> dict[str, str]:
    """Of every cause not named, the named one that makes most nearly the same error."""
    out = {}
    mine = [k for k, n in enumerate(alike.names) if n in named]
    for k, name in enumerate(alike.names):
        if name in named or not mine:
            continue
        same = np.maximum(alike.share[mine, k], alike.share[k, mine])
        if same.max() >= SAME_FORM:
            out[name] = (
                f"Not seen by itself, but it could hide behind {cause_name(alike.names[mine[int(same.argmax())]])}: "
                f"{percent(min(float(same.max()), 0.9999))} the same error in these data."
            )
    return out
