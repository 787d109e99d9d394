"""A scenario played: what truly happens at terminals and shaft, on a fine grid."""

from __future__ import annotations

import math

import numpy as np

from sim.motoring import kernel as at
from sim.motoring.effects import machine_array
from sim.motoring.machine import Played, Scenario

FINE_STEP_S = 12.5e-6
SETTLE_S = 1.5
"""Before the first sample of a motor that runs already; thrown away."""


def play(scenario: Scenario) -> Played:
    """Voltage, current, speed, angle and torques, `substeps` points a sample; closing falls between two samples."""
    course, supply = scenario.course, scenario.supply
    m = machine_array(scenario)
    s = _supply_array(scenario)
    steps = [value for step in course.steps for value in step]
    load = np.array([course.constant_nm, course.fan_nm, *course.ripple, *course.swing, *steps])
    period = 1.0 / course.rate_hz
    substeps = max(4, math.ceil(period / FINE_STEP_S))
    h = period / substeps
    x = np.zeros(at.STATES)
    count = round(course.duration_s * course.rate_hz) * substeps
    closed = course.open_s
    begin = 0.0
    if course.is_running:
        x[8] = 0.97 * 2.0 * math.pi * supply.frequency_hz / scenario.machine.pole_pairs
        x[1] = x[3] = -s[at.AMPLITUDE] / s[at.OMEGA]
        settle = round(SETTLE_S / h)
        at.march(m, s, load, x, 0.0, 0.0, settle, h)
        x[10] = x[11] = 0.0
        begin, closed = settle * h, 0.0
    raw = at.march(m, s, load, x, begin, closed, count, h)
    return Played(
        np.arange(count) * h, raw[:, 0] + 1j * raw[:, 1], raw[:, 2] + 1j * raw[:, 3], raw[:, 6].copy(), raw[:, 7].copy(),
        raw[:, 4].copy(), raw[:, 5].copy(), substeps,
    )  # fmt: skip


def _supply_array(scenario: Scenario) -> np.ndarray:
    supply = scenario.supply
    s = np.zeros(at.SUPPLY_SIZE)
    s[at.AMPLITUDE] = math.sqrt(2.0 / 3.0) * supply.voltage_v
    s[at.OMEGA] = 2.0 * math.pi * supply.frequency_hz
    s[at.UNBALANCE], s[at.UNBALANCE_RAD] = supply.unbalance, supply.unbalance_rad
    s[at.FIFTH], s[at.SEVENTH] = supply.fifth, supply.seventh
    s[at.WANDER], s[at.WANDER_RATE], s[at.PHASE] = supply.wander, supply.wander_rad_per_s, supply.phase_rad
    s[at.RAMP], s[at.BOOST] = supply.ramp_s, supply.boost
    return s
