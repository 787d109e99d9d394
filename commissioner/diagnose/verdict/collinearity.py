"""Which causes look alike in one recording: how much of one's trace another could imitate, to first order."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.search.screening import Screening

Array = NDArray[np.float64]
ALIKE, MOST_SHOWN = 0.5, 16
"""A cause of whose trace no other could imitate this share stands alone; so many of the others are shown."""


@dataclass(frozen=True)
class Alike:
    """`share[i, k]`: part of the error power that cause `names[i]` makes which cause `names[k]` could imitate, 0 to 1,
    after the four motor parameters have taken what they can (a cosine squared). Causes that resemble each other stand
    together. `alone`: causes that no other imitates.
    """

    names: tuple[str, ...]
    share: Array
    alone: tuple[str, ...]


def look_alikes(screening: Screening, named: Collection[str] = ()) -> Alike:
    """Of the causes that were found, and of those that another one resembles."""
    names = list(screening.columns)
    share = np.array([[_imitated(screening, a, b, b in named) for b in names] for a in names]).T
    share = share.reshape(len(names), len(names))
    other = np.maximum(share, share.T) - np.eye(len(names))
    closest = other.max(axis=1) if len(names) > 1 else np.zeros(len(names))
    alone = tuple(n for n, c in zip(names, closest, strict=True) if c < ALIKE)
    wanted = sorted(range(len(names)), key=lambda k: (names[k] not in named, -closest[k]))
    shown = sorted(k for k in wanted[:MOST_SHOWN] if names[k] in named or closest[k] >= ALIKE)
    order = [shown[k] for k in _together(other[np.ix_(shown, shown)])]
    return Alike(tuple(names[k] for k in order), share[np.ix_(order, order)], alone)


def _imitated(screening: Screening, a: str, b: str, is_named: bool) -> float:
    """Share of the power of b's trace in the span of a's numbers. b's trace: as found here, else its most visible shape."""
    if a == b:
        return 1.0
    ia, ib = list(screening.columns[a]), list(screening.columns[b])
    own = screening.projected[np.ix_(ib, ib)]
    direction = screening.scores[b].step
    if not is_named or not np.any(direction):
        direction = np.linalg.eigh(own)[1][:, -1]
    power = float(direction @ own @ direction)
    cross = screening.projected[np.ix_(ia, ib)] @ direction
    inverse = np.linalg.pinv(screening.projected[np.ix_(ia, ia)], rcond=1e-9, hermitian=True)
    return float(np.clip(cross @ inverse @ cross / power, 0.0, 1.0)) if power > 0 else 0.0


def _together(likeness: Array) -> list[int]:
    """Order in which those that are alike are neighbours: leaves of an average-linkage tree."""
    if likeness.shape[0] < 3:
        return list(range(likeness.shape[0]))
    from scipy.cluster.hierarchy import leaves_list, linkage

    above = np.triu_indices(likeness.shape[0], 1)
    return [int(k) for k in leaves_list(linkage(1.0 - likeness[above], "average", optimal_ordering=True))]
