"""A start of a 4 kW motor with two load steps, its speed prescribed, by the fit's own kernel."""

from __future__ import annotations

import numpy as np

from commissioner.estimation.kernels.march import STATES, Load, march
from commissioner.estimation.numbers import AT, COUNT, DEFAULTS
from commissioner.estimation.record import scales_of
from commissioner.motor.nameplate import Nameplate
from commissioner.records import RunningRecording

PERIOD, COUNT_SAMPLES = 2e-4, 10_000
PLATE = Nameplate(
    rated_power_w=4000.0, rated_voltage_v=400.0, rated_frequency_hz=50.0, rated_current_a=8.3, rated_speed_rpm=1440.0, power_factor=0.8,
    pole_pairs=2, connection="star",
)  # fmt: skip
FOUR = {
    "stator_resistance": 1.32,
    "rotor_resistance": 1.02,
    "leakage_inductance": 0.0118,
    "magnetizing_inductance": 0.168,
}


def started(
    plate: Nameplate,
    *,
    voltage_noise_v: float = 0.5,
    has_shaft: bool = False,
    active: float = 0.0,
    later: float = 0.0,
    unbalance: float = 0.008,
    **added: float,
) -> RunningRecording:
    """Run-up in 0.3 s and two load steps, on mains with unbalance and a fifth; noise of 0.3 %.

    `has_shaft`: the speed is that of `inertia`, the loads in `added` and, also at rest, `active` of rated torque, with `later` more from 1.19 s on.
    """
    rng, t = np.random.default_rng(4), 0.5 * PERIOD * np.arange(2 * COUNT_SAMPLES - 1)
    turn = np.exp(1j * (100 * np.pi * t + 0.4))
    u = 326.6 * (turn + unbalance * np.conj(turn) + 0.01 * np.conj(turn) ** 5)
    slip = 0.01 + 0.99 / (1.0 + np.exp((t - 0.3) / 0.03)) + 0.02 * np.tanh((t - 0.8) / 0.01) + 0.01 * (t > 1.4)
    w = 100 * np.pi * (1.0 - np.clip(slip, 0.002, 1.0))
    p = np.zeros(COUNT)
    for name, value in {**DEFAULTS, **FOUR, **added}.items():
        p[AT[name]] = value
    out, shaft = np.empty((COUNT_SAMPLES, 3)), np.empty((COUNT_SAMPLES, 2))
    march(
        p, scales_of(plate).as_tuple(), np.zeros(STATES), np.stack([u.real, u.imag], axis=1), np.stack([w, np.gradient(w, t)], axis=1),
        Load(np.array([active, active + later]), (t > 1.19).astype(float)), PERIOD, has_shaft, out, shaft,
    )  # fmt: skip
    w = np.repeat(shaft[:, 0], 2)[:-1] if has_shaft else w
    i, axes = out[:, 0] + 1j * out[:, 1], np.exp(-2j * np.pi * np.arange(3) / 3)
    off = 100
    column = [np.concatenate([np.zeros(off), (i * a).real]) + 0.035 * rng.standard_normal(off + i.size) for a in axes]
    volts = [
        np.concatenate([np.zeros(off), (u[::2] * a).real]) + voltage_noise_v * rng.standard_normal(off + i.size)
        for a in axes
    ]
    speed = np.concatenate([np.zeros(off), w[::2] / 2.0]) + 0.05 * rng.standard_normal(off + i.size)
    time = PERIOD * np.arange(off + i.size)
    return RunningRecording(time, tuple(column), tuple(volts), False, speed, PERIOD, {}, "start.csv")
