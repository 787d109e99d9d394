"""Leaks against healthy recordings, and false alarms over many healthy ones: see `tests.campaigns.monitor`.

One machine stays the same motor over all its recordings; mains, load level (+-2 %), phase and noise are drawn for each.
"""

from __future__ import annotations

import copy
import sys
from dataclasses import asdict
from typing import Any

import numpy as np

from commissioner.monitor.chain import Refused
from commissioner.monitor.result import entry_of
from commissioner.monitor.trend.indicators import pulses, trendable
from commissioner.monitor.trend.trend import Entry, History, State, judge
from sim.recordings.running import load_scenario, run

LEAKS_MM2 = (0.0, 0.8, 1.5, 3.1)
LEARNED = 20
HEALTHY_KINDS = ("compressor", "imbalance", "pump", "brake", "gear", "both")
LEVEL = 0.02
"""How far the load's level differs between recordings at what a person calls the same operating point."""


def compressor(leak_mm2: float, duration_s: float = 30.0) -> dict[str, Any]:
    return with_leak(load_scenario("running_leak"), leak_mm2, duration_s)


def with_leak(scenario: dict[str, Any], leak_mm2: float, duration_s: float) -> dict[str, Any]:
    made = copy.deepcopy(scenario)
    made["loads"][0]["leak_mm2"] = [leak_mm2, 0.0]
    made["recording"]["duration_s"] = duration_s
    return made


def one_machine(seed: int, kind: str) -> dict[str, Any]:
    """A scenario of `tests.campaigns.monitor.draw` whose machine is drawn once, for all its recordings."""
    from tests.campaigns.monitor import draw

    scenario = draw(seed, kind)
    short = copy.deepcopy(scenario)
    short["recording"]["duration_s"] = 0.1
    scenario["machine"] = asdict(run(short, seed)[1])
    return scenario


def at_level(scenario: dict[str, Any], seed: int) -> dict[str, Any]:
    """The same load up to `LEVEL` heavier or lighter, all of its harmonics with it."""
    level = 1 + LEVEL * float(np.random.default_rng([seed, 3]).uniform(-1, 1))
    made = copy.deepcopy(scenario)
    for load in made["loads"]:
        for key in ("mean_nm", "amplitude_nm", "once_nm"):
            if key in load:
                load[key] *= level
        if "amplitudes_nm" in load:
            load["amplitudes_nm"] = [level * a for a in load["amplitudes_nm"]]
    return made


def dissimilarity(scenario: dict[str, Any], seed: int) -> float:
    """NaN where no answer or no pulse train was given."""
    from tests.campaigns.monitor import play

    seen, _ = play(at_level(scenario, seed), seed)
    made = None if isinstance(seen, Refused) else pulses(seen)
    return float("nan") if made is None else made.dissimilarity.value


def leak_table(
    repeats: int, duration_s: float = 30.0, scenario: dict[str, Any] | None = None
) -> dict[float, np.ndarray]:
    """Dissimilarity in per cent over `repeats` recordings of each leak size."""
    base = load_scenario("running_leak") if scenario is None else scenario
    return {
        leak: np.array([dissimilarity(with_leak(base, leak, duration_s), 1000 * k + n) for n in range(repeats)])
        for k, leak in enumerate(LEAKS_MM2)
    }


def leaks(repeats: int, machines: int, first: int) -> str:
    """The shipped compressor, then `machines` others from seed `first` on."""
    lines = []
    for k in range(machines + 1):
        scenario = one_machine(first + k, "compressor") if k else load_scenario("running_leak")
        plate, load = scenario["nameplate"], scenario["loads"][0]
        lines.append(
            f"{plate['rated_power_w'] / 1e3:.3g} kW, {2 * plate['pole_pairs']} poles, {load['mean_nm']:.3g} N m, "
            f"pressure ratio {load['pressure_ratio']:.2g}"
        )
        lines.append(leak_lines(leak_table(repeats, scenario=scenario)))
        print("\n".join(lines[-2:]), file=sys.stderr, flush=True)
    return "\n".join(lines)


def leak_lines(table: dict[float, np.ndarray]) -> str:
    healthy = table[0.0]
    lines = [
        f"{'leak mm2':>9} {'mean %':>8} {'std %':>7} {'from healthy, in std of':>24} {'healthy ones':>12} {'both':>8}"
    ]
    for leak, values in table.items():
        step = values.mean() - healthy.mean()
        alone, both = healthy.std(ddof=1), np.hypot(healthy.std(ddof=1), values.std(ddof=1))
        lines.append(
            f"{leak:>9.1f} {values.mean():>8.3f} {values.std(ddof=1):>7.3f} {'':>24} {step / alone:>12.1f} {step / both:>8.1f}"
        )
    means = [values.mean() for values in table.values()]
    return "\n".join([*lines, "monotone" if means == sorted(means) else "NOT MONOTONE"])


def healthy_entry(scenario: dict[str, Any], seed: int) -> Entry | None:
    """None where the recording was refused."""
    from tests.campaigns.monitor import play

    seen, _ = play(at_level(scenario, seed), seed)
    return None if isinstance(seen, Refused) else entry_of(seen, trendable(seen, pulses(seen)), str(seed))


def false_alarms(
    count: int,
    learned: int = LEARNED,
    duration_s: float = 12.0,
    first: int = 50_000,
    scenario: dict[str, Any] | None = None,
) -> tuple[int, int, float]:
    """(healthy recordings judged against `learned` others, alarms among them, largest distance over threshold)."""
    base = with_leak(load_scenario("running_leak"), 0.0, duration_s) if scenario is None else copy.deepcopy(scenario)
    base["recording"]["duration_s"] = duration_s
    entries = [healthy_entry(base, first + k) for k in range(learned)]
    past = History(tuple(entry for entry in entries if entry is not None))
    judged, alarms, closest = 0, 0, 0.0
    for k in range(count):
        entry = healthy_entry(base, first + learned + k)
        verdict = None if entry is None else judge(entry, past)
        if verdict is None or verdict.state is State.TOO_FEW:
            continue
        judged += 1
        alarms += verdict.state is State.ALARM
        worst = max(verdict.watched, key=lambda w: abs(w.distance) / w.threshold)
        closest = max(closest, abs(worst.distance) / worst.threshold)
        if worst.alarms:
            print(f"seed {first + learned + k}: {worst}", file=sys.stderr, flush=True)
    return judged, alarms, closest


def healthy(count: int, duration_s: float, machines: int, first: int) -> str:
    """`count` recordings shared among `machines`, each with a load of the next kind."""
    lines, judged, alarms = [], 0, 0
    for k in range(machines):
        kind = HEALTHY_KINDS[k % len(HEALTHY_KINDS)]
        scenario = one_machine(first + k, kind)
        own, wrong, closest = false_alarms(
            -(-count // machines), duration_s=duration_s, first=50_000 + 10_000 * (first + k), scenario=scenario
        )
        plate = scenario["nameplate"]
        lines.append(
            f"{plate['rated_power_w'] / 1e3:.3g} kW, {2 * plate['pole_pairs']} poles, {kind}: {wrong} alarms in {own}, "
            f"the closest at {closest:.0%} of its threshold"
        )
        print(lines[-1], file=sys.stderr, flush=True)
        judged, alarms = judged + own, alarms + wrong
    return "\n".join([*lines, f"{alarms} alarms in {judged} healthy recordings of {duration_s:g} s"])
