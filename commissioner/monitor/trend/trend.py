"""A machine against its own healthy past at the same operating point.

The threshold belongs to the machine: it is a Student quantile of its healthy recordings' scatter, pooled with the noise that
each recording claims, so that three recordings do not pretend to know what thirty would.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from scipy.special import stdtrit

FALSE_ALARM = 1e-6
"""Probability per indicator and recording at the threshold: below 1 % for 1000 recordings of six indicators."""
PRIOR_WEIGHT = 4.0
"""The noise that recordings claim counts like so many recordings."""
SAME_TORQUE = 0.25
SAME_SPEED = 0.02
LEAST_HISTORY = 3


class State(Enum):
    """What the comparison says; the value is the sentence shown."""

    STORED = "stored as a healthy recording of this machine"
    NORMAL = "no indicator has left its healthy range"
    ALARM = "an indicator has left its healthy range"
    TOO_FEW = "too few healthy recordings at this operating point for a verdict"


@dataclass(frozen=True)
class Entry:
    """One recording in the history: where the machine ran, and its indicators as (value, noise std). `utc`: when it was kept;
    empty in baselines of before."""

    source: str
    speed_rad_per_s: float
    torque_nm: float
    supply_hz: float
    indicators: Mapping[str, tuple[float, float]]
    utc: str = ""


@dataclass(frozen=True)
class History:
    """Healthy recordings (they set the range), and every recording judged against them since."""

    healthy: tuple[Entry, ...] = ()
    judged: tuple[Entry, ...] = ()


@dataclass(frozen=True)
class Watched:
    """One indicator against its range: `distance` in standard deviations of a single recording, alarm above `threshold`."""

    name: str
    value: float
    healthy_mean: float
    healthy_std: float
    distance: float
    threshold: float

    @property
    def alarms(self) -> bool:
        return abs(self.distance) > self.threshold


@dataclass(frozen=True)
class Verdict:
    """The state with the numbers that led to it. `left_out_alarms`: healthy recordings that alarm against the others."""

    state: State
    compared_with: int
    watched: tuple[Watched, ...] = ()
    left_out_alarms: int = 0
    other_operating_points: int = 0

    @property
    def sentence(self) -> str:
        """The state, of too few also how many there are and are wanted."""
        count = f": {self.compared_with}, of at least {LEAST_HISTORY}; --learn adds one"
        return self.state.value + (count if self.state is State.TOO_FEW else "")

    @property
    def names(self) -> tuple[str, ...]:
        """Of the indicators that alarm."""
        return tuple(w.name for w in self.watched if w.alarms)


def judge(entry: Entry, history: History) -> Verdict:
    """The entry against the healthy recordings at its operating point."""
    alike = [healthy for healthy in history.healthy if is_same_point(entry, healthy)]
    elsewhere = len(history.healthy) - len(alike)
    if len(alike) < LEAST_HISTORY:
        return Verdict(State.TOO_FEW, len(alike), other_operating_points=elsewhere)
    watched = tuple(compare(entry, alike))
    left_out = sum(
        any(w.alarms for w in compare(healthy, [*alike[:k], *alike[k + 1 :]])) for k, healthy in enumerate(alike)
    )
    state = State.ALARM if any(w.alarms for w in watched) else State.NORMAL
    return Verdict(state, len(alike), watched, left_out, elsewhere)


def is_same_point(one: Entry, other: Entry) -> bool:
    """Torque within a quarter (a fault changes it too), speed and supply frequency within 2 %."""
    torque = abs(one.torque_nm - other.torque_nm) <= SAME_TORQUE * max(abs(other.torque_nm), 1e-9)
    speed = abs(one.speed_rad_per_s / other.speed_rad_per_s - 1) <= SAME_SPEED
    return torque and speed and abs(one.supply_hz / other.supply_hz - 1) <= SAME_SPEED


def compare(entry: Entry, healthy: Sequence[Entry]) -> list[Watched]:
    """Every indicator that all of them have. t = (x - mean) / (s sqrt(1 + 1/n)), s^2 pooled with the claimed noise."""
    out = []
    for name, (value, noise) in entry.indicators.items():
        past = [h.indicators[name] for h in healthy if name in h.indicators]
        if len(past) != len(healthy) or len(past) < 2:
            continue
        values = np.array([v for v, _ in past])
        claimed = float(np.mean([n**2 for _, n in past] + [noise**2]))
        count = values.size
        freedom = count - 1 + PRIOR_WEIGHT
        variance = (np.sum((values - values.mean()) ** 2) + PRIOR_WEIGHT * claimed) / freedom
        std = float(np.sqrt(variance * (1 + 1 / count))) or 1e-12
        threshold = -float(stdtrit(freedom, 0.5 * FALSE_ALARM))
        out.append(Watched(name, value, float(values.mean()), std, float((value - values.mean()) / std), threshold))
    return out
