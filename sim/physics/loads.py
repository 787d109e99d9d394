"""What hangs on the shaft: torque tables over one turn of the load, and what turns them.

Every periodic load is a table over its own phase (one turn = 1). The phase advances with the shaft angle (a crank, a
gear wheel) or with time (a brake switched by a clock). Torque is positive against rotation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

TABLE_SIZE = 2048
POLYTROPIC = 1.25
"""Between isothermal (1.0) and adiabatic air (1.4)."""
LEAK_PER_MM2 = 0.13
"""sqrt(2 R T) A / (V omega): 1 mm2 on 20 cm3 at 150 rad/s and 290 K, per radian and mm2."""


@dataclass(frozen=True)
class PeriodicLoad:
    """`torque_nm` over one turn; the phase is `turns_per_shaft_turn * angle / 2 pi + turns_per_s * time + start`."""

    name: str
    torque_nm: NDArray[np.float64]
    turns_per_shaft_turn: float
    turns_per_s: float
    start: float


def build(entry: dict, rng: np.random.Generator) -> PeriodicLoad:
    """One `[[loads]]` entry of a scenario as a table. KeyError names an unknown kind."""
    kind = entry["kind"]
    table = _TABLES[kind](entry)
    independent = "frequency_hz" in entry
    return PeriodicLoad(
        name=str(entry.get("name", kind)),
        torque_nm=table,
        turns_per_shaft_turn=0.0 if independent else 1.0 / float(entry.get("ratio", 1.0)),
        turns_per_s=float(entry["frequency_hz"]) if independent else 0.0,
        start=float(entry.get("start", rng.uniform())),
    )


def compressor(entry: dict) -> NDArray[np.float64]:
    """Two (or more) cylinders on one crank; `leak_mm2` is the hole in each suction valve.

    The table is scaled so that the tight machine takes `mean_nm`; a leak then lowers its own cylinder's work.
    """
    leaks = list(entry.get("leak_mm2", [0.0, 0.0]))
    tight = _cylinder(0.0, entry)
    scale = float(entry["mean_nm"]) / (len(leaks) * tight.mean())
    shift = TABLE_SIZE // len(leaks)
    spread = list(entry.get("cylinder_gain", [1.0] * len(leaks)))
    return scale * sum(
        gain * np.roll(_cylinder(float(leak), entry), k * shift)
        for k, (leak, gain) in enumerate(zip(leaks, spread, strict=True))
    )


def _cylinder(leak_mm2: float, entry: dict) -> NDArray[np.float64]:
    """Crank torque of one cylinder over a turn, pressures in units of suction, volume in units of the swept one."""
    ratio = float(entry.get("pressure_ratio", 4.0))
    dead = float(entry.get("dead_volume", 0.06))
    rod = float(entry.get("crank_to_rod", 0.25))
    angle = 2 * np.pi * np.arange(TABLE_SIZE) / TABLE_SIZE
    sine, cosine = np.sin(angle), np.cos(angle)
    root = np.sqrt(1 - (rod * sine) ** 2)
    volume = dead + 0.5 * (1 - cosine + (1 - root) / rod)
    slope = 0.5 * (sine + rod * sine * cosine / root)
    step = LEAK_PER_MM2 * leak_mm2 * 2 * np.pi / TABLE_SIZE
    pressure = np.ones(TABLE_SIZE)
    mass = volume[0] * ratio ** (1 / POLYTROPIC)
    for _turn in range(3):
        for k in range(TABLE_SIZE):
            density = mass / volume[k]
            p = density**POLYTROPIC
            if p > 1.0:
                mass -= step * np.sqrt(density * (p - 1.0))
            p = min(max((mass / volume[k]) ** POLYTROPIC, 1.0), ratio)
            mass = volume[k] * p ** (1 / POLYTROPIC)
            pressure[k] = p
    return -(pressure - 1.0) * slope


def brake(entry: dict) -> NDArray[np.float64]:
    """A brake switched on for `duty` of its period, with first-order rise and fall over `edge` of the period."""
    phase = np.arange(TABLE_SIZE) / TABLE_SIZE
    edge, duty = float(entry.get("edge", 0.06)), float(entry.get("duty", 0.5))
    on = 1 / (1 + np.exp(-(phase - 0.25) / (edge / 4))) - 1 / (1 + np.exp(-(phase - 0.25 - duty) / (edge / 4)))
    return float(entry["amplitude_nm"]) * (on - on.mean()) / (on.max() - on.min()) * 2 + float(entry.get("mean_nm", 0))


def pump(entry: dict) -> NDArray[np.float64]:
    """Vanes passing the outlet: `vanes` pulses a turn of the form |sin|, and a once-per-turn part."""
    phase = 2 * np.pi * np.arange(TABLE_SIZE) / TABLE_SIZE
    pulse = np.abs(np.sin(0.5 * float(entry.get("vanes", 5)) * phase))
    pulse -= pulse.mean()
    once = float(entry.get("once_nm", 0.0)) * np.sin(phase + 0.7)
    return float(entry.get("mean_nm", 0.0)) + float(entry["amplitude_nm"]) * pulse / np.ptp(pulse) * 2 + once


def harmonics(entry: dict) -> NDArray[np.float64]:
    """`amplitudes_nm[h-1]` and `phases_rad[h-1]` of the harmonics 1, 2, ... over one turn, on top of `mean_nm`."""
    phase = 2 * np.pi * np.arange(TABLE_SIZE) / TABLE_SIZE
    amplitudes = entry["amplitudes_nm"]
    phases = entry.get("phases_rad", [0.0] * len(amplitudes))
    table = np.full(TABLE_SIZE, float(entry.get("mean_nm", 0.0)))
    for h, (amplitude, start) in enumerate(zip(amplitudes, phases, strict=True), start=1):
        table += amplitude * np.cos(h * phase + start)
    return table


_TABLES = {"compressor": compressor, "brake": brake, "pump": pump, "gear": harmonics, "harmonics": harmonics}
