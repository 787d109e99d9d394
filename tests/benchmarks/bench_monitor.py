"""How fast the self-sensing chain is: `python -m tests.benchmarks.bench_monitor` prints figures.

Target: a 60-s, 8-kHz, six-channel recording in at most 1.5 s after warm-up on 2 cores.
"""

from __future__ import annotations

import time

import pytest

from commissioner.monitor.chain import Observation, observe
from commissioner.monitor.trend.indicators import pulses, trendable
from sim.recordings.running import load_scenario, record
from tests.campaigns.monitor import as_plate, as_recording


def figures(name: str, repeats: int = 5) -> tuple[float, float]:
    """(best wall seconds, best CPU seconds) of the chain and its indicators on a 60-s recording."""
    scenario = load_scenario(name)
    scenario["recording"]["duration_s"] = 60.0
    columns, metadata, _ = record(scenario, 1)
    recording, plate = as_recording(columns, metadata), as_plate(metadata)
    wall, cpu = [], []
    for _ in range(repeats + 1):
        started, worked = time.perf_counter(), time.process_time()
        seen = observe(recording, plate)
        assert isinstance(seen, Observation)
        trendable(seen, pulses(seen))
        wall.append(time.perf_counter() - started)
        cpu.append(time.process_time() - worked)
    return min(wall[1:]), min(cpu[1:])


@pytest.mark.benchmark
def test_chain_on_a_minute_of_recording() -> None:
    wall, cpu = figures("running_compressor", 2)
    print(f"monitor, 60 s x 8 kHz x 6 channels: {wall:.2f} s wall, {cpu:.2f} s CPU")


if __name__ == "__main__":
    for name in ("running_compressor", "running_gear", "running_brake_1hz9"):
        wall, cpu = figures(name)
        print(f"{name:<22} {wall:6.2f} s wall {cpu:6.2f} s CPU")
