"""Blind cases of running motors: a random motor on random mains, random causes and sizes, all from one seed.

Strata: `null`; `one`, `two` causes; `absent` (a cause no catalogue names); `tie` (one steady load, or a delay: causes the
data cannot tell apart). Courses: `start` (direct on line with two load steps), `ramp` (inverter), `steady`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sim.motoring.effects import CATALOGUE, UNLISTED
from sim.motoring.machine import Course, Effect, Machine, Scenario, Sensors, Supply
from sim.scenario import MACHINE_TABLE, table_machine, table_rows

STRATA = ("null", "one", "two", "absent", "tie")
NOISES = (0.002, 0.005)
"""Of currents, of rated peak: smallest and largest."""


def draw(seed: int, stratum: str = "one", course: str = "start", only: str = "", has_speed: bool = True) -> Scenario:
    """A scenario with hidden causes; the same arguments give the same case. `only` forces the single cause."""
    if stratum not in STRATA or course not in ("start", "ramp", "steady"):
        raise ValueError(f"stratum {stratum!r} of {STRATA}, course {course!r} of start, ramp, steady")
    rng = np.random.default_rng([seed, STRATA.index(stratum), 23])
    plate, machine = motor(rng)
    torque = plate["rated_power_w"] / (2 * math.pi * plate["rated_speed_rpm"] / 60.0)
    peak_a, peak_v = math.sqrt(2) * plate["rated_current_a"], math.sqrt(2 / 3) * plate["rated_voltage_v"]
    inverter = course == "ramp"
    supply = Supply(
        voltage_v=plate["rated_voltage_v"] * rng.uniform(0.97, 1.03),
        frequency_hz=plate["rated_frequency_hz"] + rng.uniform(-0.05, 0.05),
        unbalance=0.0 if inverter else rng.uniform(0.002, 0.015),
        unbalance_rad=rng.uniform(0, 2 * math.pi),
        fifth=0.0 if inverter else rng.uniform(0.003, 0.02),
        seventh=0.0 if inverter else rng.uniform(0.002, 0.015),
        wander=0.0 if inverter else rng.uniform(0.0, 0.01),
        phase_rad=rng.uniform(0, 2 * math.pi),
        ramp_s=0.8 if inverter else 0.0,
        switching_frequency_hz=8000.0 if inverter else 0.0,
    )
    steps = ((1.0, rng.uniform(0.3, 0.5) * torque), (2.0, rng.uniform(0.3, 0.5) * torque))
    steady = course == "steady"
    plan = Course(
        duration_s=1.5 if steady else 3.0,
        open_s=0.0 if steady else 0.06 + rng.uniform(0.0, 0.02),
        is_running=steady,
        constant_nm=(rng.uniform(0.4, 0.9) if steady else 0.08) * torque,
        fan_nm=0.0 if steady else rng.uniform(0.02, 0.1) * torque,
        steps=() if steady else steps,
        ripple=(rng.uniform(0.0, 0.08), rng.uniform(0.0, 0.04)),
    )  # fmt: skip
    electrical = 0.1 / machine.pole_pairs
    sensors = Sensors(
        current_noise_a=peak_a * rng.uniform(*NOISES),
        voltage_noise_v=0.002 * peak_v,
        speed_noise_rad_per_s=electrical,
        speed_ripple_rad_per_s=rng.uniform(0.0, 1.5) * electrical,
        has_speed=has_speed,
    )
    effects = _effects(stratum, course, only, has_speed, rng)
    return Scenario(f"running-{stratum}-{course}-{seed}", plate, machine, supply, plan, sensors, effects)


def motor(rng: np.random.Generator) -> tuple[dict[str, Any], Machine]:
    """A row of the machine table between 0.5 and 45 kW, shaken by 20 %, with an inertia that runs up in 0.12 to 0.4 s."""
    rows = [
        r["id"] for r in table_rows()
        if 0.5 <= float(r["P_kW"]) <= 45.0 and 300 <= float(r["V_LL"]) <= 500 and int(float(r["poles"])) <= 6
    ]  # fmt: skip
    plate, gamma = table_machine(str(rng.choice(rows)), 0.0, str(MACHINE_TABLE))
    plate["connection"] = "star"
    shaken = {k: v * float(np.exp(rng.uniform(-0.18, 0.18))) for k, v in gamma.items()}
    pairs = int(plate["pole_pairs"])
    synchronous = 2 * math.pi * plate["rated_frequency_hz"] / pairs
    torque = plate["rated_power_w"] / (2 * math.pi * plate["rated_speed_rpm"] / 60.0)
    inertia = 2.0 * torque * float(rng.uniform(0.12, 0.4)) / synchronous
    return plate, Machine(**shaken, inertia_kg_m2=inertia, pole_pairs=pairs)


def _effects(stratum: str, course: str, only: str, has_speed: bool, rng: np.random.Generator) -> tuple[Effect, ...]:
    if only:
        return (_one(only, rng),)
    if stratum == "null":
        return ()
    if stratum == "absent":
        name = str(rng.choice(list(UNLISTED)))
        low, high = {"slot_modulation": (0.01, 0.04), "gain_drift": (0.02, 0.05), "sensor_knee": (0.01, 0.03)}[name]
        return (Effect(name, float(rng.uniform(low, high))),)
    pool = [
        name for name, kind in CATALOGUE.items()
        if (kind.needs != "inverter" or course == "ramp") and (kind.needs != "speed" or has_speed)
    ]  # fmt: skip
    if stratum == "tie":
        pool = ["sampling_delay", "sensor_lag"]
    names = rng.choice(pool, 2 if stratum == "two" else 1, replace=False)
    return tuple(_one(str(name), rng) for name in names)


def _one(name: str, rng: np.random.Generator) -> Effect:
    kind = CATALOGUE[name]
    size = math.exp(rng.uniform(math.log(kind.smallest), math.log(kind.largest)))
    sign = float(rng.choice([-1.0, 1.0])) if kind.is_signed else 1.0
    return Effect(name, sign * size, int(rng.integers(0, 3)) if kind.in_phase else 0)
