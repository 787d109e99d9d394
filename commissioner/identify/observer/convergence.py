"""Has the online estimate settled? A verdict with its numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from commissioner.identify.observer.observer import BlockEstimate
from commissioner.motor.quantities import FOUR


@dataclass(frozen=True)
class Settling:
    """`drift` is each parameter's relative change over the window, `relative_std` its standard error, both `(4,)`."""

    has_settled: bool
    drift: tuple[float, float, float, float]
    relative_std: tuple[float, float, float, float]
    reason: str


def settled(
    history: Sequence[tuple[float, BlockEstimate]], window_s: float, allowed_std: tuple[float, float, float, float]
) -> Settling:
    """Judge (time, estimate) pairs: every relative standard error within `allowed_std`, and no parameter has moved in
    the last `window_s` by more than three of its standard errors or a third of what is allowed."""
    nothing = (float("inf"),) * 4
    if not history:
        return Settling(False, nothing, nothing, "no estimate yet")
    now, last = history[-1]
    since = next((e for t, e in reversed(history) if now - t >= window_s), None)
    values = last.parameters.as_tuple()
    std = tuple(s / v for s, v in zip(last.std, values, strict=True))
    if since is None:
        return Settling(False, nothing, _four(std), f"less than {window_s:g} s of estimates")
    drift = tuple(abs(a / b - 1.0) for a, b in zip(since.parameters.as_tuple(), values, strict=True))
    for name, moved, s, allowed in zip((q.words for q in FOUR), drift, std, allowed_std, strict=True):
        if s > allowed:
            return Settling(
                False, _four(drift), _four(std), f"{name}: standard error {percent(s)}, allowed {percent(allowed)}"
            )
        if moved > max(3.0 * s, allowed / 3.0):
            return Settling(
                False,
                _four(drift),
                _four(std),
                f"{name}: moved {percent(moved)} in {window_s:g} s, error {percent(s)}",
            )
    return Settling(
        True, _four(drift), _four(std), "all four parameters within their allowed standard errors and at rest"
    )


def _four(values: tuple[float, ...]) -> tuple[float, float, float, float]:
    a, b, c, d = values
    return a, b, c, d


def percent(share: float) -> str:
    """`12.95%`; a share below that with its first digit that is not zero."""
    first = math.floor(math.log10(share)) if 0.0 < share < math.inf else 0
    return f"{share:.{max(2, -first - 2)}%}"
