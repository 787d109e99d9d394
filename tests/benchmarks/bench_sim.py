"""How fast the simulated drive is: `python -m tests.benchmarks.bench_sim` prints figures.

The peer is motulator 0.5.0 on the same standstill case with its averaged converter; its solver is SciPy's, interpreted, as it ships.
The difference of the currents is printed too.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sim.drive.drive_map import load_map
from sim.drive.firmware import Firmware
from sim.drive.memory import Memory
from sim.drive.states import Setup
from sim.physics import layout as at
from sim.physics.kernel import play_voltages
from sim.physics.machine import Heating, Machine, Plant, PowerStage, Sensors
from sim.physics.packing import fresh_state, pack
from sim.scenario import load
from sim.wire.server import run_in_thread
from sim.wire.station import Options
from tests.benchmarks.pairs import Pair, timed
from tests.sim.client import TcpClient

PEER_PERIOD_S = 3e-4
MACHINE = Machine()
PLAIN = Plant(
    machine=MACHINE,
    power_stage=PowerStage(dead_time_s=0.0, threshold_v=0.0, slope_ohm=0.0, link_ripple=0.0),
    sensors=Sensors(lag_s=0.0),
    heating=Heating(0.0, 0.0),
    control_period_s=PEER_PERIOD_S,
)


def tones(seconds: float, period_s: float) -> np.ndarray:
    """Axis voltage (V) of the case: three tones."""
    t = np.arange(round(seconds / period_s)) * period_s
    return 14.0 * np.cos(math.pi * t) + 10.0 * np.cos(2 * math.pi * 4.3 * t) + 9.0 * np.cos(2 * math.pi * 41.9 * t)


def play(plant: Plant, voltage: np.ndarray) -> tuple[float, np.ndarray]:
    """(CPU seconds, axis current at the end of each period), best of five."""
    best = math.inf
    p, _ = pack(plant)
    points, link = np.zeros((voltage.size, at.POINTS, 2)), np.zeros(voltage.size)
    for _ in range(6):
        x = fresh_state(p)
        start = time.process_time()
        play_voltages(x, p, voltage, 0.0, points, link)
        best = min(best, time.process_time() - start)
    return best, points[:, -1, 0]


def interrupts(seconds: float) -> float:
    """CPU seconds for the default drive's whole control interrupt: machine, inverter, sensors, sample ring."""
    firmware = Firmware(load("default").plant, load_map(), Setup(), Memory(None, [3.0, 2.0, 20.0, 200.0]), 1)
    v = firmware.values
    v.update(
        mode=1, watchdog_ms=2000, current_limit_a=13.0, test_time_limit_s=1e4, voltage_limit_v=100.0, duration_s=1e4
    )
    v.update(
        amplitude_scale=1.0,
        scale_ramp_per_s=9.0,
        tone_count=3,
        tones=[14.0, 0.5, 0.0, 10.0, 4.3, 0.0, 9.0, 41.9, 0.0, *[0.0] * 15],
    )
    for word in (6, 7, 15):
        firmware.control(word)
    firmware.run_until_sample(100)
    start = time.process_time()
    for index in range(100, 100 + round(seconds * 5000), 1000):
        firmware.run_until_sample(index + 1000)
    return time.process_time() - start


def peer(voltage: np.ndarray) -> tuple[float, np.ndarray]:
    """motulator's CPU seconds and its sampled axis current."""
    from motulator.common.model._simulation import Delay
    from motulator.drive import model
    from motulator.drive.utils import InductionMachinePars

    parameters = InductionMachinePars(
        n_p=2,
        R_s=MACHINE.stator_resistance_ohm,
        R_r=MACHINE.rotor_resistance_ohm,
        L_ell=MACHINE.leakage_inductance_h,
        L_s=lambda flux: 0.34 / (1.0 + (0.84 * flux) ** 7),
    )
    drive = model.Drive(
        model.VoltageSourceConverter(u_dc=540.0), model.InductionMachine(parameters), model.ExternalRotorSpeed()
    )
    drive.delay = Delay(0)
    control = _Replay(voltage)
    start = time.process_time()
    model.Simulation(drive, control).simulate(t_stop=(voltage.size - 1.5) * PEER_PERIOD_S)
    return time.process_time() - start, np.array(control.current)


class _Replay:
    """A motulator control system that plays a row of axis voltages and notes the current it samples."""

    def __init__(self, voltage: np.ndarray) -> None:
        self.voltage, self.k, self.current = voltage, 0, []

    def __call__(self, drive: Any) -> tuple[float, list[float]]:
        self.current.append(drive.machine.i_ss.real)
        u = self.voltage[min(self.k, self.voltage.size - 1)] / 540.0
        self.k += 1
        return PEER_PERIOD_S, [0.5 + u, 0.5 - 0.5 * u, 0.5 - 0.5 * u]

    def post_process(self) -> SimpleNamespace:
        return SimpleNamespace()


def stream(seconds: float) -> tuple[float, int, int]:
    """(wall seconds, samples, windows) of one session read over loopback TCP by a blocking client in this process."""
    clock = time.perf_counter
    with run_in_thread(load("default"), Options(tcp_port=0)) as running, TcpClient(running.addresses["tcp"]) as client:
        client.prepare(duration_s=seconds, time_limit_s=1e4, watchdog_ms=2000)
        client.enable()
        start = clock()
        windows = client.stream()
        return clock() - start, sum(w[3] for w in windows), len(windows)


def pairs(seconds: float = 1.0) -> list[Pair]:
    """The same voltages through the same machine: ours compiled, theirs interpreted."""
    voltage, plays = tones(seconds, PEER_PERIOD_S), 200
    p, _ = pack(PLAIN)
    points, link = np.zeros((voltage.size, at.POINTS, 2)), np.zeros(voltage.size)

    def ours() -> None:
        for _ in range(plays):
            play_voltages(fresh_state(p), p, voltage, 0.0, points, link)

    return [
        Pair(
            "simulated machine and inverter",
            "motulator 0.5.0",
            timed(ours, plays * seconds),
            lambda: peer(voltage)[0] / seconds,
            "ms a simulated second",
            1e3,
        )
    ]


def figures(seconds: float) -> dict[str, float]:
    """All figures by name; the peer's only where it is there."""
    out: dict[str, float] = {}
    play(PLAIN, tones(0.1, PEER_PERIOD_S))
    ours, current = play(PLAIN, tones(4.0, PEER_PERIOD_S))
    out["ideal inverter, 300 us: ms per simulated s"] = 1e3 * ours / 4.0
    full = replace(PLAIN, power_stage=PowerStage(), sensors=Sensors(), heating=Heating(), control_period_s=2e-4)
    out["real inverter, 200 us: ms per simulated s"] = 1e3 * play(full, tones(4.0, 2e-4))[0] / 4.0
    out["whole control interrupt, 200 us: ms per simulated s"] = 1e3 * interrupts(4.0) / 4.0
    _, sampled = peer(tones(seconds, PEER_PERIOD_S))
    n = min(sampled.size, current.size)
    out["largest difference of the currents to motulator's, mA"] = 1e3 * float(
        np.abs(sampled[1:n] - current[: n - 1]).max()
    )
    wall, samples, windows = stream(5.0 * seconds)
    out["loopback TCP, four channels: windows per s"] = windows / wall
    out["loopback TCP, four channels: samples per s"] = samples / wall
    return out


@pytest.mark.benchmark
def test_print_simulator_figures():
    for name, value in figures(0.5).items():
        print(f"{name}: {value:,.2f}")


if __name__ == "__main__":
    for name, value in figures(2.0).items():
        print(f"{name}: {value:,.2f}")
