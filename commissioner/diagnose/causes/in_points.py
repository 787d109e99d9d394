"""What a cause does in a table of test points, locked rotor or no load: one factor of one of their two circuits."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from commissioner.diagnose.causes.setting import Array
from commissioner.diagnose.intake.points import Points


def always(points: Points) -> bool:
    return True


@dataclass(frozen=True)
class InPoints:
    """Its numbers' start and bounds, and the factor that they make; the first number is its size, above zero where the cause acts."""

    acts_on: Literal["resistance", "leakage", "magnetizing", "loss"]
    """Resistance (times the factor) and leakage (over it) of a locked rotor; magnetizing current and loss at no load (times it)."""
    start: tuple[float, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    factor: Callable[[Array, Array, Array], Array]
    """Of the numbers, of current (leakage) or flux (no load), and of frequency, each over the table's own reference."""
    sizes: Callable[[Array, Points, Mapping[str, float]], dict[str, float]]
    """What it does over the table's own range, which the points fix better than its numbers: numbers, points and their references."""
    is_shown: Callable[[Points], bool] = always

    @property
    def is_locked(self) -> bool:
        return self.acts_on in ("resistance", "leakage")

    @property
    def numbers(self) -> int:
        return len(self.start)
