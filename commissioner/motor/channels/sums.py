"""Three channels that should be the lines of one motor: without a neutral they add up to zero, and what is left names the odd one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.records import Signal

Array = NDArray[np.float64]
OPEN_SUM, OPEN_SUM_OF_PHASES = 0.12, 0.3
"""Share of three channels that their sum holds, from which one is no line of this motor (a gain of 1.3); voltages to a star point may hold that of the
mains' own zero sequence."""
LARGEST_SUM_AT_REST = 0.06
"""Of a current at standstill, what the three may leave in step with one of them: sensors differ by a few per cent."""
FED = 0.3
"""Of the rated peak, in all three together: with less the motor is not fed, and noise has no sum."""
MOSTLY = 0.75
"""Quantile of what is compared: neither spikes nor a pause before the start count."""
SAME, ALIKE = 0.9999, 0.98
"""Correlation of two channels that are one, and of one with what the others leave for it, from which a gain says all."""
TURNED = 0.1
"""Of minus one, the gain of a channel whose sensor was clamped the other way round."""


@dataclass(frozen=True)
class OpenSum:
    """Three channels of a `kind` that do not add up to zero: `share` of them is left, more than `limit`. `gain` of channel `odd` (its place),
    over what the other two leave for it; None where no gain of one explains it."""

    kind: str
    share: float
    limit: float
    which: str
    odd: int | None = None
    gain: float | None = None

    @property
    def what(self) -> str:
        return f"the three {self.kind}s do not add up to zero: {self.which}"

    @property
    def remedy(self) -> str:
        return (
            f"check the export, and range, ratio, turns and direction of each sensor, and that the three {self.kind}s are the three lines of "
            "one motor"
        )

    @property
    def is_turned(self) -> bool:
        """Whether the odd one has the wrong sign and nothing else."""
        return self.gain is not None and abs(self.gain + 1.0) < TURNED


def open_sum(
    group: Sequence[Signal], kind: str, names: Sequence[str], rated_peak: float, *, may_move: bool = False
) -> OpenSum | None:
    """None where the three add up to zero, or the motor is not fed. `may_move`: voltages to a star point that may."""
    there = np.all(np.isfinite(group), axis=0)
    if there.sum() < 2:
        return None
    x = np.array(group)[:, there]
    x -= np.median(x, axis=1, keepdims=True)
    size = float(np.quantile(np.abs(x).sum(axis=0), MOSTLY))
    if size < FED * rated_peak:
        return None
    share = float(np.quantile(np.abs(x.sum(axis=0)), MOSTLY)) / max(size, 1e-12)
    limit = OPEN_SUM_OF_PHASES if may_move else OPEN_SUM
    return _named(x, share, limit, kind, names) if share > limit else None


def left_in_step(currents: Sequence[Signal]) -> tuple[float, int]:
    """(share of three currents that their sum holds in step with one of them, beyond what noise makes; that one): noise and offsets are in step with none."""
    phases = [i - np.mean(i) for i in currents]
    total = np.sum(phases, axis=0)
    largest = max(float(np.mean(i * i)) for i in phases)
    noise = [float(np.var(np.diff(i, 2))) / 6.0 for i in phases]
    shares = [
        max(abs(float(np.mean(total * i))) - n, 0.0) / max(largest, 1e-300) for i, n in zip(phases, noise, strict=True)
    ]
    return max(shares), int(np.argmax(shares))


def _named(x: Array, share: float, limit: float, kind: str, names: Sequence[str]) -> OpenSum:
    for j, k in ((0, 1), (1, 2), (0, 2)):
        if _correlation(x[j], x[k]) > SAME:
            return OpenSum(kind, share, limit, f"{kind}s {names[j]} and {names[k]} are one and the same")
    left = x - x.sum(axis=0)  # minus the two others
    with_left = np.array([_correlation(own, other) for own, other in zip(x, left, strict=True)])
    k = int(np.argmax(np.abs(with_left)))
    if abs(with_left[k]) < ALIKE:
        return OpenSum(kind, share, limit, "one of them at least is something else")
    gain = float(x[k] @ left[k] / (left[k] @ left[k]))
    is_turned = " (its sign is turned)" if gain < 0.0 else ""
    which = f"{kind} {names[k]} is {gain:.3g} times what the other two leave for it{is_turned}"
    return OpenSum(kind, share, limit, which, k, gain)


def _correlation(a: Array, b: Array) -> float:
    """Of two signals; 0 where one stands still."""
    a, b = a - a.mean(), b - b.mean()
    return float(a @ b) / max(float(np.sqrt((a @ a) * (b @ b))), 1e-300)
