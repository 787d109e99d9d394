"""Blind cases by name: what is drawn for each, the recording alone, and the key that is opened afterwards."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from commissioner.records import StandstillRecording
from sim.physics.effects import CATALOGUE
from sim.recordings.hidden import STRATA, UNUSUAL, draw
from sim.recordings.standstill import record
from sim.scenario import Scenario

WEIGHTS = {
    "null": 600, "one": 270, "two": 150, "three": 100, "four": 50, "wrong_form": 150, "absent": 100, "tie": 60,
}  # fmt: skip
NULL_NOISES = ("white", "red", "flicker", "quantised")
CLASSES = (
    frozenset({"dead_time", "device_drop"}), frozenset({"sampling_delay", "sensor_lag"}),
    frozenset({"rotor_skin_effect", "iron_loss"}),
)  # fmt: skip
"""Causes that terminals cannot always tell apart: one switching frequency; second order only; same-order networks."""


@dataclass(frozen=True)
class Case:
    """One blind case. `excluded`: names the diagnosis is forbidden to use, so that the true cause is absent."""

    stratum: str
    seed: int
    only: str = ""
    excitation: str = "rich"
    noise: str = ""
    excluded: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return "-".join(x for x in (self.stratum, self.only, self.excitation, self.noise, str(self.seed)) if x)

    def scenario(self, seconds: float) -> Scenario:
        """The hidden machine and its excitation. `absent` with a name: an ordinary single cause, forbidden."""
        stratum = "one" if self.excluded else self.stratum
        return draw(self.seed, stratum, self.excitation, self.only, self.noise, seconds)


def class_of(name: str) -> frozenset[str]:
    """The names no terminal measurement surely separates from this one, itself included."""
    return next((c for c in CLASSES if name in c), frozenset({name}))


def plan(cases: int, strata: Sequence[str] = STRATA, release: int = 1) -> list[Case]:
    """`cases` in the proportions of the full protocol, seeds of their own for every release."""
    total = sum(WEIGHTS[s] for s in strata)
    out = []
    for stratum in strata:
        count = max(round(cases * WEIGHTS[stratum] / total), 1)
        out += [_case(stratum, k, 100_000 * release + k) for k in range(count)]
    return out


def _case(stratum: str, k: int, seed: int) -> Case:
    if stratum == "null":
        return Case(stratum, seed, "", "poor" if k % 10 == 9 else "rich", NULL_NOISES[k % 4])
    if stratum == "one":
        return Case(stratum, seed, sorted(CATALOGUE)[k % len(CATALOGUE)])
    if stratum == "absent" and k % 2:
        only = sorted(set(UNUSUAL) - {"mains_pickup"})[k // 2 % (len(UNUSUAL) - 1)]
        return Case(stratum, seed, only, excluded=tuple(sorted(class_of(only))))
    return Case(stratum, seed)


def recording_of(scenario: Scenario, seed: int) -> StandstillRecording:
    """What the diagnosis may see, and nothing else."""
    columns, metadata, _ = record(scenario, seed)
    del metadata["scenario"]
    return StandstillRecording(
        columns["time_s"], columns["segment"], columns["axis_deg"], columns["voltage_axis_v"], columns["current_u_a"],
        columns["current_v_a"], columns.get("current_w_a"), columns.get("dc_link_v"), metadata["sample_period_s"], metadata,
    )  # fmt: skip


def without_noise(scenario: Scenario, keep: Sequence[str] | None = None) -> Scenario:
    """The same machine recorded without noise; `keep` names the only effects left in it."""
    plant = scenario.plant
    effects = tuple(e for e in plant.effects if keep is None or e.name in keep)
    silent = dataclasses.replace(
        plant, effects=effects, sensors=dataclasses.replace(plant.sensors, noise_a=0.0, bits=0)
    )
    return dataclasses.replace(scenario, plant=silent)


def other_excitation(scenario: Scenario, seed: int, level: float = 0.8) -> Scenario:
    """The same machine under new phases and another level, for the gain on data nobody fitted."""
    random = np.random.default_rng([seed, 99])
    segments = []
    for segment in scenario.segments:
        tones = tuple((v, f, float(random.uniform(-np.pi, np.pi))) for v, f, _ in segment.tones)
        segments.append(dataclasses.replace(segment, tones=tones, scale=level * segment.scale))
    return dataclasses.replace(scenario, segments=tuple(segments))


def sealed(cases: Sequence[Case], seconds: float) -> str:
    """SHA-256 of all drawn machines and causes: whoever has it can check that no answer was changed later."""
    documents = [case.scenario(seconds).document for case in cases]
    return hashlib.sha256(json.dumps(documents, sort_keys=True, default=str).encode()).hexdigest()


def key_of(scenario: Scenario) -> list[dict[str, Any]]:
    """The hidden causes: name, size in the simulator's unit, shape."""
    return [{"name": e.name, "size": e.size, "shape": e.shape} for e in scenario.plant.effects]
