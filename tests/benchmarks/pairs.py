"""One task done by us and by a peer, by turns; the ratio of their CPU seconds."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from statistics import median

ROUNDS = 5


@dataclass(frozen=True)
class Pair:
    """`ours`, `theirs`: do the task once, CPU seconds for one `unit` of it. Both have been called once, so nothing is compiled while
    it is measured. `factor`: what of the unit is shown (1e9 for ns)."""

    task: str
    peer: str
    ours: Callable[[], float]
    theirs: Callable[[], float]
    unit: str
    factor: float = 1.0


@dataclass(frozen=True)
class Seen:
    """The best of each and the median of the rounds' ratios, which a busy host moves alike on both sides."""

    task: str
    peer: str
    unit: str
    ours: float
    theirs: float
    ratio: float
    least: float
    most: float

    def row(self) -> str:
        return (
            f"| {self.task} | {self.peer} | {self.unit} | {self.ours:.4g} | {self.theirs:.4g} | **{self.ratio:.3g}** | "
            f"{self.least:.3g} ... {self.most:.3g} |"
        )

    document = asdict


def measured(pair: Pair, rounds: int = ROUNDS) -> Seen:
    """`ratio` above one: we take less."""
    pair.ours()
    pair.theirs()
    taken = [(pair.ours(), pair.theirs()) for _ in range(rounds)]
    ratios = [theirs / ours for ours, theirs in taken]
    ours, theirs = (pair.factor * min(column) for column in zip(*taken, strict=True))
    return Seen(pair.task, pair.peer, pair.unit, ours, theirs, median(ratios), min(ratios), max(ratios))


def timed(task: Callable[[], object], units: float = 1.0) -> Callable[[], float]:
    """The task as a pair wants it: CPU seconds of this process for one of its `units`."""

    def once() -> float:
        began = time.process_time()
        task()
        return (time.process_time() - began) / units

    return once
