"""Leaks against healthy recordings, and false alarms over many healthy ones: see `tests.campaigns.monitor`."""

from __future__ import annotations

import copy
import sys
from typing import Any

import numpy as np

from commissioner.monitor.chain import Observation
from commissioner.monitor.indicators import pulses, trendable
from commissioner.monitor.result import entry_of
from commissioner.monitor.trend import Entry, History, State, judge
from sim.running_recording import load_scenario

LEAKS_MM2 = (0.0, 0.8, 1.5, 3.1)
LEARNED = 20


def compressor(leak_mm2: float, duration_s: float = 30.0) -> dict[str, Any]:
    scenario = copy.deepcopy(load_scenario("running_leak"))
    scenario["loads"][0]["leak_mm2"] = [leak_mm2, 0.0]
    scenario["recording"]["duration_s"] = duration_s
    return scenario


def dissimilarity(leak_mm2: float, seed: int, duration_s: float = 30.0) -> float:
    from tests.campaigns.monitor import play

    seen, _ = play(compressor(leak_mm2, duration_s), seed)
    assert isinstance(seen, Observation)
    made = pulses(seen)
    assert made is not None
    return made.dissimilarity.value


def leak_table(repeats: int, duration_s: float = 30.0) -> dict[float, np.ndarray]:
    """Dissimilarity in per cent over `repeats` recordings of each leak size."""
    return {
        leak: np.array([dissimilarity(leak, 1000 * k + n, duration_s) for n in range(repeats)])
        for k, leak in enumerate(LEAKS_MM2)
    }


def leaks(repeats: int) -> str:
    table = leak_table(repeats)
    healthy = table[0.0]
    lines = [f"{'leak mm2':>9} {'mean %':>8} {'std %':>7} {'from healthy, in std':>21}"]
    for leak, values in table.items():
        spread = np.hypot(healthy.std(ddof=1), values.std(ddof=1))
        lines.append(
            f"{leak:>9.1f} {values.mean():>8.2f} {values.std(ddof=1):>7.2f} {(values.mean() - healthy.mean()) / spread:>21.1f}"
        )
    return "\n".join(lines)


def healthy_entry(seed: int, duration_s: float) -> Entry:
    from tests.campaigns.monitor import play

    seen, _ = play(compressor(0.0, duration_s), seed)
    assert isinstance(seen, Observation)
    return entry_of(seen, trendable(seen, pulses(seen)), str(seed))


def false_alarms(
    count: int, learned: int = LEARNED, duration_s: float = 12.0, first: int = 50_000
) -> tuple[int, float]:
    """(alarms among `count` healthy recordings judged against `learned` others, largest distance over threshold)."""
    past = History(tuple(healthy_entry(first + k, duration_s) for k in range(learned)))
    alarms, closest = 0, 0.0
    for k in range(count):
        if k and k % 50 == 0:
            print(f"{k} judged, {alarms} alarms, closest {closest:.0%} of its threshold", file=sys.stderr, flush=True)
        verdict = judge(healthy_entry(first + learned + k, duration_s), past)
        assert verdict.state is not State.TOO_FEW
        alarms += verdict.state is State.ALARM
        closest = max(closest, *(abs(w.distance) / w.threshold for w in verdict.watched))
    return alarms, closest


def healthy(count: int, duration_s: float) -> str:
    alarms, closest = false_alarms(count, duration_s=duration_s)
    return f"{alarms} alarms in {count} healthy recordings of {duration_s:g} s; the closest came to {closest:.0%} of its threshold"
