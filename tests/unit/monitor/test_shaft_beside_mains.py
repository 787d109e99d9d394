"""A two-pole motor's shaft turns some tenths of a hertz below the mains: beside the line that an offset of the sensors has, which
is taken out and may hold some of it."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from commissioner.monitor.chain import Wishes
from commissioner.monitor.periods.combs import _is_drift, find
from commissioner.monitor.periods.periods import Periodicity, ShaftSearch
from commissioner.monitor.signals.supply import TurningFrame
from commissioner.operations.recordings.stretches import in_its_states
from tests.support.running import refused_in, seen_in, taken_with

TWO_POLES: dict[str, dict[str, Any]] = {
    "nameplate": {"pole_pairs": 1, "rated_frequency_hz": 50.0, "rated_speed_rpm": 2870.0},
    "machine": {"pole_pairs": 1},
    "supply": {"frequency_hz": 50.0},
    "steady_load": {"constant_nm": 1.2, "per_speed_squared_nms2": 0.0},
}


@pytest.mark.parametrize("seed", [1, 2])
def test_the_mean_speed_is_right_within_two_turns_of_the_slip(seed: int) -> None:
    """Seven to eight standard errors off while the mains were taken out alone."""
    recording, plate, truth = taken_with("running_fan", seed, 4.5, TWO_POLES)
    seen = seen_in(recording, plate)
    assert seen.mean_speed_std < 1e-4 * seen.mean_speed_rad_per_s
    assert abs(seen.mean_speed_rad_per_s - truth["mean_speed_rad_per_s"]) < 3.0 * seen.mean_speed_std


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_shaft_that_is_one_with_the_mains_is_not_said_to_be_seen(seed: int) -> None:
    """At a quarter of that load the two are half a period of the recording's length apart: 2.9 to 3.4 stated errors off, with a slip twice too large."""
    light = TWO_POLES | {"steady_load": {"constant_nm": 0.3, "per_speed_squared_nms2": 0.0}}
    recording, plate, truth = taken_with("running_fan", seed, 4.5, light)
    seen = refused_in(recording, plate)
    assert seen.reason.code == "no_shaft_line" and "is not told from it" in seen.reason.what
    assert seen.shaft_hz is not None
    assert abs(2 * np.pi * seen.shaft_hz.value - truth["mean_speed_rad_per_s"]) < 3.0 * 2 * np.pi * seen.shaft_hz.std
    (state,) = in_its_states(recording, plate, Wishes())[2]
    speed = state["mean_speed_rad_per_s"]
    assert abs(speed["value"] - truth["mean_speed_rad_per_s"]) < 2.0 * speed["std"]


@pytest.mark.parametrize("second", [0.05, 0.5])
def test_a_line_that_is_one_with_the_mains_tells_no_frequency(second: float) -> None:
    """The second line of a four-pole shaft at 24.98 Hz, a quarter of a period beside 50 Hz: what was left of it drew the first aside by 4.5 stated errors."""
    period, shaft_hz, rng = 1e-3, 24.98, np.random.default_rng(3)
    t = np.arange(6000) * period
    turn, noise = 2 * np.pi * shaft_hz * t, rng.standard_normal((2, t.size))
    current = 10.0 - 5.0j + 0.1 * np.cos(turn) + second * np.sin(2 * turn + 0.4) + 0.01 * (noise[0] + 1j * noise[1])
    supply = np.full(t.size, 100 * np.pi)
    volts, still = np.full(t.size, 326.0 + 0j), np.zeros(t.size)
    frame = TurningFrame(t, current, volts, supply * t, supply, period, 400.0, 0.0, still)
    found = find(frame, slice(0, t.size), ShaftSearch(2, 50.0, 0.001, 0.003))
    assert found.shaft is not None and found.shaft.is_told_from_mains and set(found.shaft.harmonics_seen) >= {1, 2}
    assert abs(found.shaft.frequency_hz - shaft_hz) < min(3.0 * found.shaft.frequency_std_hz, 1e-3)


def test_what_drifts_is_no_load() -> None:
    """ "1.6e-09 Hz, the slowest line of the currents, fits 0.0 times" had been the reason of a refusal."""
    frame = SimpleNamespace(time_s=np.arange(3000) * 1e-3)
    for hertz, drifts in ((0.2, True), (1.0, False)):
        load = Periodicity("load", hertz, 1e-3, "clock", 100.0, (1,))
        assert _is_drift(load, cast("TurningFrame", frame), slice(0, 3000)) is drifts
