"""The flux that saturates is the air gap's: neither the stator's nor the rotor's, and nothing else is named for the difference."""

import numpy as np
import pytest

from commissioner.estimation.kernels.march import STATES, march
from commissioner.estimation.numbers import AT, COUNT, DEFAULTS
from commissioner.estimation.record import scales_of
from commissioner.motor.nameplate import Nameplate
from commissioner.records import RunningRecording
from commissioner.running.diagnosis import Verdict, diagnose

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


def started(plate, **added):
    """Run-up in 0.3 s and two load steps, on mains with unbalance and a fifth; noise of 0.3 %."""
    rng, t = np.random.default_rng(4), 0.5 * PERIOD * np.arange(2 * COUNT_SAMPLES - 1)
    turn = np.exp(1j * (100 * np.pi * t + 0.4))
    u = 326.6 * (turn + 0.008 * np.conj(turn) + 0.01 * np.conj(turn) ** 5)
    slip = 0.01 + 0.99 / (1.0 + np.exp((t - 0.3) / 0.03)) + 0.02 * np.tanh((t - 0.8) / 0.01) + 0.01 * (t > 1.4)
    w = 100 * np.pi * (1.0 - np.clip(slip, 0.002, 1.0))
    p = np.zeros(COUNT)
    for name, value in {**DEFAULTS, **FOUR, **added}.items():
        p[AT[name]] = value
    out, shaft = np.empty((COUNT_SAMPLES, 3)), np.empty((COUNT_SAMPLES, 2))
    march(
        p, scales_of(plate).as_tuple(), np.zeros(STATES), np.stack([u.real, u.imag], axis=1), np.stack([w, np.gradient(w, t)], axis=1),
        np.zeros(2), np.zeros(t.size), PERIOD, False, out, shaft,
    )  # fmt: skip
    i, axes = out[:, 0] + 1j * out[:, 1], np.exp(-2j * np.pi * np.arange(3) / 3)
    off = 100
    column = [np.concatenate([np.zeros(off), (i * a).real]) + 0.035 * rng.standard_normal(off + i.size) for a in axes]
    volts = [np.concatenate([np.zeros(off), (u[::2] * a).real]) + 0.5 * rng.standard_normal(off + i.size) for a in axes]
    speed = np.concatenate([np.zeros(off), w[::2] / 2.0]) + 0.05 * rng.standard_normal(off + i.size)
    time = PERIOD * np.arange(off + i.size)
    return RunningRecording(time, tuple(column), tuple(volts), False, speed, PERIOD, {}, "start.csv")


SATURATED = {"gap_saturation_2": 0.1, "gap_saturation_3": 0.15, "leakage_split": 0.9}


def test_it_is_named_alone_with_its_size():
    """By the stator's or the rotor's flux heat of the stator, iron loss or a gain were named beside it, and the size was far off."""
    seen = diagnose([started(PLATE, **SATURATED)], PLATE)
    assert [(c.name, c.form) for c in seen.causes] == [("magnetizing_saturation", "air-gap flux")]
    size, std, _ = seen.causes[0].sizes["extra_at_rated_flux"]
    assert abs(size - 0.25) < 3.0 * std < 0.1


def test_with_a_leakage_that_saturates_both_are_named():
    """Alone the leakage makes the part that was held out worse, for want of the other."""
    seen = diagnose([started(PLATE, leakage_softness=0.25, **SATURATED)], PLATE)
    assert {c.name for c in seen.causes} == {"magnetizing_saturation", "leakage_saturation"}
    assert seen.verdict is Verdict.EXPLAINED


@pytest.mark.parametrize("winding", ["uv", "wu"])
def test_shorted_turns_of_a_delta_lie_between_two_lines(winding):
    """By a loop on one phase of the equivalent star a gain of the voltages and an iron loss were named."""
    delta = Nameplate(**{**{f: getattr(PLATE, f) for f in PLATE.__dataclass_fields__}, "connection": "delta"})
    seen = diagnose([started(delta, **{f"loop_conductance_{winding}": 0.03})], delta)
    assert [(c.name, c.form) for c in seen.causes] == [("stator_asymmetry", f"phase {winding}")]
    assert seen.causes[0].sizes[f"current_in_{winding}_of_rated"][0] == pytest.approx(0.03, rel=0.05)
