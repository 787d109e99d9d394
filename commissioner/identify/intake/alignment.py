"""Currents that lie early or late against the voltage: whole sample periods are taken off by shifting rows, the rest of a
period is a parameter of the fit, which is exact between none and one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from commissioner.identify.intake.stretches import Stretch, refused
from commissioner.motor.circuit import QUANTILE, Quantity

MOST_PERIODS = 3.0
"""By which the currents may lie off the voltage, either way; what is beyond is another fault than a late channel."""
OWN = 0.25
"""Of a period: what a sampling chain may be late by itself, beside rows that are."""
FARTHEST = 6
"""Whole periods that are tried, so that a refusal can name the value."""
COARSE = 0.6
"""Of a period, by which a coarse look may be wrong."""
SLACK = 0.01
"""Of a period, beyond none and one, that is still the fit's own: 0.05 moved L_sigma of a drive's recording by nine standard errors."""

LOWEST, HIGHEST = -0.999, 1.999
"""Periods: a fitted delay beyond lies at its bound, one period early or two late."""


@dataclass(frozen=True)
class TimeShift:
    """How far the currents lie behind the voltages: `periods` taken off as rows, `value_s` in all, and its standard error."""

    periods: int
    value_s: float
    std_s: float
    sample_period_s: float

    @property
    def is_significant(self) -> bool:
        return abs(self.value_s) > 3.0 * self.std_s and abs(self.value_s) > 0.01 * self.sample_period_s

    @property
    def sentence(self) -> str:
        return (
            f"the currents lie {self.value_s * 1e6:+.4g} +- {QUANTILE * self.std_s * 1e6:.2g} us "
            f"({self.value_s / self.sample_period_s:+.3g} sample periods) behind the voltage: taken into account"
        )


def more_periods(delay: Quantity, period_s: float) -> int:
    """Whole periods that a fitted delay asks to be taken off beside those already off; 0 where the fit may keep it."""
    late, std = delay.value / period_s, delay.std / period_s
    if late < -SLACK and late < -3.0 * std:
        return math.floor(late)
    return math.floor(late) if late > 1.0 + SLACK and late > 1.0 + 3.0 * std else 0


def beyond_bound(delay: Quantity, period_s: float) -> int:
    """-1 or 1 where a fitted delay lies at its bound, towards which it wants more; else 0. Where its standard error is as large as the
    way to there, nothing says where it belongs."""
    return int(delay.value >= HIGHEST * period_s) - int(delay.value <= LOWEST * period_s)


def rows_off(coarse_periods: float) -> int:
    """Whole periods that a coarse look would take off; none where a fit finds the way by itself."""
    return math.floor(coarse_periods) if not -COARSE < coarse_periods < 1.0 + COARSE else 0


def shifted(stretches: Sequence[Stretch], periods: int) -> list[Stretch]:
    """Every stretch with its currents taken `periods` rows earlier; what has no partner at the ends is left out."""
    return [_shifted(s, periods) for s in stretches] if periods else list(stretches)


def _shifted(stretch: Stretch, n: int) -> Stretch:
    count = stretch.voltage_v.size - abs(n)
    v, i = max(-n, 0), max(n, 0)
    if count < 2:
        return stretch
    return replace(
        stretch,
        voltage_v=stretch.voltage_v[v : v + count],
        current_a=stretch.current_a[i : i + count],
        cross_a=stretch.cross_a[i : i + count],
        is_measured=None if stretch.is_measured is None else stretch.is_measured[i : i + count],
        link_ratio=None if stretch.link_ratio is None else stretch.link_ratio[v : v + count],
        starts_at_rest=stretch.starts_at_rest and n >= 0,
    )


def require_near(shift: TimeShift) -> None:
    """DataRefused where the currents lie further off than a sampling chain makes them."""
    periods = shift.value_s / shift.sample_period_s
    if abs(periods) <= MOST_PERIODS + OWN:
        return
    raise refused(
        "the current answers before the voltage" if periods < 0 else "the current answers too late",
        f"the current lies {periods:+.2f} sample periods ({shift.value_s * 1e6:+.0f} us) behind the voltage",
        f"within {MOST_PERIODS:g} sample periods of {shift.sample_period_s * 1e6:.0f} us",
        "voltage_axis_v holds from its own row's time to the next, currents are read at the row's time: shift the "
        "voltage column by the missing rows; where the rows are right, the motor or the link does what these models lack "
        "(a skin effect, a rippling link): `commissioner diagnose` names it",
    )
