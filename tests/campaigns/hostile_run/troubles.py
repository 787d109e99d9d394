"""What can go wrong between host and drive, drawn at random: when, for how long, how much."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LINK = ("none", "late", "jitter", "spell", "stall", "request_stall", "drop", "duplicate", "corrupt", "busy")
HOST = ("host_stop",)
SENSORS = (
    "currents_doubled", "currents_halved", "sensor_reversed", "sensor_silent", "sensor_frozen", "all_frozen", "sensors_swapped",
    "sensor_doubled", "clipped",
)  # fmt: skip
OTHERS = ("second_master",)
KINDS = (*LINK, *HOST, *SENSORS, *OTHERS)
FOREIGN: tuple[tuple[str, float | int], ...] = (
    ("dc_bias_v", 60.0), ("amplitude_scale", 1.0), ("watchdog_ms", 2000), ("current_limit_a", 50.0), ("voltage_limit_v", 400.0),
    ("axis_deg", 90.0), ("control_word", 0), ("test_time_limit_s", 900.0), ("staged_stator_resistance", 0.1),
    ("bias_ramp_v_per_s", 5000.0), ("tone_count", 0),
)  # fmt: skip
"""What another master writes: item and value."""
LONGEST_SESSIONS_S = (1.8, 2.5, 1.3, 5.5)
"""About how long the sessions of a one-axis run last: first current, staircase, look, test with its bias."""
FOR_EVER_S = 1e6


@dataclass(frozen=True)
class Trouble:
    """`session`: the energising (from 1) it begins in, 0: from the first request on; `at_s` after it, for `length_s`.
    `amount`: seconds of delay, share of replies hit, Modbus exception, or index of FOREIGN; `phase` 0, 1, 2: which sensor."""

    kind: str
    session: int
    at_s: float
    length_s: float
    amount: float
    phase: int = 0


@dataclass(frozen=True)
class Link:
    """`wire_s` one way, `host_s` between an answer and the next request where nothing is wrong; the drive's control period, by
    which a window lasts 29 periods."""

    name: str
    wire_s: float
    host_s: float
    period_s: float


LINKS = (
    Link("loopback", 0.0003, 0.0005, 2e-4), Link("network", 0.001, 0.001, 4e-4), Link("busy host", 0.0005, 0.005, 5e-4),
    Link("gateway", 0.004, 0.001, 5e-4),
)  # fmt: skip
LINK_WEIGHTS = (0.1, 0.3, 0.3, 0.3)


def draw(rng: np.random.Generator, kind: str) -> Trouble:
    session = int(rng.integers(1, len(LONGEST_SESSIONS_S) + 1))
    at_s = float(rng.uniform(0.0, LONGEST_SESSIONS_S[session - 1]))
    phase = int(rng.integers(3))
    if kind == "none":  # the control: nothing happens
        return Trouble(kind, 0, 0.0, FOR_EVER_S, 0.0)
    if kind == "late":  # constant, from the first request on or from some moment
        from_start = rng.random() < 0.5
        return Trouble(
            kind, 0 if from_start else session, 0.0 if from_start else at_s, FOR_EVER_S, _between(rng, 0.002, 0.5)
        )
    if kind == "jitter":
        return Trouble(kind, session, at_s, FOR_EVER_S, _between(rng, 0.005, 0.24))
    if kind == "spell":
        return Trouble(kind, session, at_s, float(rng.uniform(2.0, 3.0)), float(rng.uniform(0.05, 0.2)))
    if kind in ("stall", "request_stall", "host_stop"):
        return Trouble(kind, session, at_s, 0.0, _between(rng, 0.1 if kind != "host_stop" else 0.3, 3.0))
    if kind in ("drop", "duplicate", "corrupt"):
        return Trouble(kind, session, at_s, FOR_EVER_S, _between(rng, 0.002, 0.3))
    if kind == "busy":
        return Trouble(kind, session, at_s, float(rng.uniform(0.01, 0.3)), float(rng.choice([5, 6, 10, 11])))
    if kind == "second_master":
        return Trouble(kind, session, at_s, 0.0, float(rng.integers(len(FOREIGN))))
    from_start = rng.random() < 0.5
    return Trouble(kind, 0 if from_start else session, 0.0 if from_start else at_s, FOR_EVER_S, 1.0, phase)


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
