"""A two-pole motor's shaft turns some tenths of a hertz below the mains: beside the line that an offset of the sensors has, which
is taken out and may hold some of it."""

from typing import Any

import pytest

from tests.support.running import seen_in, taken_with

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
