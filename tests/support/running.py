"""Recordings of the simulated running motor for the tests of `monitor`, made once per scenario and seed."""

from __future__ import annotations

import copy
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from commissioner.monitor.chain import Observation, Refused, Wishes, observe
from commissioner.motor.nameplate import Nameplate
from commissioner.records import RunningRecording
from sim.recordings.running import load_scenario, record
from tests.campaigns.monitor import as_plate, as_recording

Taken = tuple[RunningRecording, Nameplate, dict[str, Any]]


@lru_cache(maxsize=8)
def taken(name: str, seed: int = 1, duration_s: float = 30.0) -> Taken:
    scenario = load_scenario(name)
    scenario["recording"]["duration_s"] = duration_s
    columns, metadata, truth = record(scenario, seed)
    return as_recording(columns, metadata), as_plate(metadata), truth


def taken_with(name: str, seed: int, duration_s: float, change: dict[str, dict[str, Any]]) -> Taken:
    """The scenario with sections updated."""
    scenario = copy.deepcopy(load_scenario(name))
    scenario["recording"]["duration_s"] = duration_s
    for section, values in change.items():
        scenario[section] = values if isinstance(values, list) else scenario[section] | values
    columns, metadata, truth = record(scenario, seed)
    return as_recording(columns, metadata), as_plate(metadata), truth


def rewired(recording: RunningRecording, order: tuple[int, ...], signs: tuple[int, ...] = (1,) * 6) -> RunningRecording:
    """The same six channels under other names: column k gets `signs[k]` times channel `order[k]`."""
    channels = [*recording.currents_a, *recording.voltages_v]
    new = [sign * channels[k] for k, sign in zip(order, signs, strict=True)]
    return replace(recording, currents_a=(new[0], new[1], new[2]), voltages_v=(new[3], new[4], new[5]))


def seen_in(recording: RunningRecording, plate: Nameplate, wishes: Wishes | None = None) -> Observation:
    seen = observe(recording, plate, wishes)
    assert isinstance(seen, Observation), seen.reason
    return seen


@lru_cache(maxsize=4)
def seen(name: str, seed: int = 1) -> Observation:
    """The chain's answer to the whole recording of `taken`."""
    return seen_in(*taken(name, seed)[:2])


def refused_in(recording: RunningRecording, plate: Nameplate) -> Refused:
    seen = observe(recording, plate)
    assert isinstance(seen, Refused)
    return seen


def without(recording: RunningRecording, keep: np.ndarray) -> RunningRecording:
    """Only the rows marked in `keep`."""
    i, v = ([signal[keep] for signal in group] for group in (recording.currents_a, recording.voltages_v))
    return replace(
        recording, time_s=recording.time_s[keep], currents_a=(i[0], i[1], i[2]), voltages_v=(v[0], v[1], v[2])
    )
