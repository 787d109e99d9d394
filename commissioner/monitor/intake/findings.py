"""What an audit says: findings with their number, limit and remedy, the mains as the terminals see it, the usable stretch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from commissioner.monitor.intake.sensors import Trust
from commissioner.monitor.signals.supply import SupplyAngle, Vector

WIRING = ("crossed_channels", "polarity")
LITTLE = ("too_short", "missing_samples")
"""Refusals of a stretch that is whole and too short for a shaft."""


@dataclass(frozen=True)
class Finding:
    """What was found, its number, what was allowed, and what to do; `kind` is note, corrected or refused."""

    code: str
    kind: str
    what: str
    value: float | str | None = None
    limit: float | str | None = None
    remedy: str = ""

    @property
    def stops(self) -> bool:
        return self.kind == "refused"


class Findings(list[Finding]):
    """What an audit has found so far, in order."""

    def add(
        self, code: str, kind: str, what: str, value: float | str | None, limit: float | str | None, remedy: str
    ) -> None:
        self.append(Finding(code, kind, what, value, limit, remedy))


def miswired(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """What was put right here and should be put right at the probes."""
    return tuple(f for f in findings if f.kind == "corrected" and f.code in WIRING)


@dataclass(frozen=True)
class Fundamental:
    """The mains as the terminals see it: peak phasors, positive and negative sequence, power of all three phases."""

    frequency_hz: float
    voltage_v: complex
    current_a: complex
    voltage_negative_v: complex
    current_negative_a: complex
    power_w: float
    reactive_var: float
    runs_backwards: bool

    @property
    def voltage_unbalance(self) -> float:
        return abs(self.voltage_negative_v) / abs(self.voltage_v)

    @property
    def current_unbalance(self) -> float:
        return abs(self.current_negative_a) / max(abs(self.current_a), 1e-12)

    @property
    def power_factor(self) -> float:
        return self.power_w / max(float(np.hypot(self.power_w, self.reactive_var)), 1e-12)


@dataclass(frozen=True)
class Generator:
    """The order of channels in which the plate's machine would generate: its current's lag, and whether the columns name it so."""

    lag_deg: float
    is_named: bool


@dataclass(frozen=True)
class Audited:
    """The stretch that may be used, as space vectors in the right order, and everything that was found.

    `lag_deg` is the current's behind its voltage in the order taken, `rivals_deg` in the other orders that make a motor; `others_deg`
    `generator` and `wired` as in `Pairing`.
    """

    first_sample: int
    start_s: float
    sample_period_s: float
    current_a: Vector
    voltage_v: Vector
    supply: SupplyAngle | None
    fundamental: Fundamental | None
    findings: tuple[Finding, ...]
    channel_map: Mapping[str, str]
    sensors: Trust = field(default_factory=Trust)
    lag_deg: float = 0.0
    rivals_deg: tuple[float, ...] = ()
    others_deg: tuple[float, ...] = ()
    generator: Generator | None = None
    wired: tuple[tuple[int, int], ...] = ()

    @property
    def refusal(self) -> Finding | None:
        """What stops it; that it is short, which leaves what the terminals say, where nothing else does."""
        stops = [finding for finding in self.findings if finding.stops]
        return next((finding for finding in stops if finding.code not in LITTLE), stops[0] if stops else None)
