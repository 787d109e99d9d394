"""What the fit takes as one window: from the contactor's closing, between jumps of the voltage, in the supply's direction."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.estimation.record import prepare
from commissioner.running.diagnosis import diagnose
from tests.running_effects.cases import Case, taken


@pytest.fixture(scope="module")
def healthy():
    recording, plate, _ = taken(Case(5000, "null").scenario(), 5000)
    return recording, plate


def exchanged(recording, sign):
    """Two lines exchanged: the motor turns backwards, and a sensor with a sign says so."""
    (a, c, b), (u, w, v) = recording.currents_a, recording.voltages_v
    return replace(
        recording,
        currents_a=(a, b, c),
        voltages_v=(u, v, w),
        speed_rad_per_s=sign * recording.speed_rad_per_s,
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_motor_that_turns_backwards_is_read_with_a_signed_speed_and_with_one_that_has_no_sign(healthy, sign):
    """Signed it was refused: `no machine near the plate's values`, L_M of 3.6e-15 H."""
    recording, plate = healthy
    seen = diagnose([exchanged(recording, sign)], plate)
    assert seen.verdict == "nothing_significant", seen.reason
    assert any("backwards" in r for r in seen.remarks)


def test_a_speed_of_the_wrong_sign_is_said(healthy):
    recording, plate = healthy
    record = prepare([replace(recording, speed_rad_per_s=-recording.speed_rad_per_s)], plate)
    assert any("sign" in r for r in record.remarks)
    assert record.windows[0].speed[-1, 0] > 0.9 * record.scales.frequency_rad_per_s


def test_a_dips_edges_begin_windows_of_their_own(healthy):
    """Between two samples the instant of an edge is not known: its volt-seconds were taken for `unexplained`, 3 times the noise."""
    recording, plate = healthy
    t = recording.time_s
    low = np.where((t > 1.2) & (t < 1.5), 0.7, 1.0)
    record = prepare([replace(recording, voltages_v=tuple(low * v for v in recording.voltages_v))], plate)
    assert len(record.windows) == len(prepare([recording], plate).windows) + 2
    assert [w.is_from_rest for w in record.windows] == [True, False, False]


@pytest.mark.parametrize("has_speed", [True, False])
def test_the_field_of_a_motor_that_still_turns_is_no_supply(healthy, has_speed):
    """The window began 10 ms before the closing, with terminals that were open: `unexplained`, 8 times the noise."""
    recording, plate = healthy
    closed = int(np.argmax(np.abs(recording.currents_a[0]) > 0.1 * plate.rated_current_a))
    before = np.arange(recording.time_s.size) < closed - 2
    volts = tuple(
        np.where(before, 60.0 * np.cos(300.0 * recording.time_s - 2.0 * k * np.pi / 3.0), v)
        for k, v in enumerate(recording.voltages_v)
    )
    speed = recording.speed_rad_per_s + 100.0 * before if has_speed else None
    window = prepare([replace(recording, voltages_v=volts, speed_rad_per_s=speed)], plate).windows[0]
    plain = prepare([recording], plate).windows[0]
    assert abs(window.count - plain.count) <= 2
    assert has_speed or not window.is_from_rest
