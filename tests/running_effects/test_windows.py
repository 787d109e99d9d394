"""What the fit takes as one window: from the contactor's closing, between jumps of the voltage, in the supply's direction; and what each has of
its own, as the shaft's angle at its beginning is any."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.estimation.record import prepare
from commissioner.motor.circuit import PARAMETERS
from commissioner.records import RunningRecording
from commissioner.running.diagnosis import diagnose
from commissioner.running.identification import identify
from tests.running_effects.cases import Case, taken
from tests.running_effects.start import FOUR, PLATE, started


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


def _loads(*, has_speed: bool, **added: float) -> list[RunningRecording]:
    """Two steady loads, the second begun 0.06 s later."""
    out = []
    for first, load in ((5000, 0.2), (5301, 0.8)):
        whole, part = (
            started(PLATE, has_shaft=True, inertia=0.03, unbalance=0.02, load_constant=load, **added),
            slice(first, None),
        )
        seen = replace(
            whole, time_s=whole.time_s[part], currents_a=tuple(x[part] for x in whole.currents_a), voltages_v=tuple(x[part] for x in whole.voltages_v),
            speed_rad_per_s=whole.speed_rad_per_s[part] if has_speed else None, source=f"load_{load}.csv",
        )  # fmt: skip
        out.append(seen)
    return out


def test_a_load_that_ripples_has_another_phase_in_each_file() -> None:
    """One ripple for all files put the slip elsewhere: R_R of three motors 9 to 41 % off, three to twelve stated errors."""
    found = identify(_loads(has_speed=False, load_ripple_cos=0.06), PLATE)
    for key, true in zip(PARAMETERS, FOUR.values(), strict=True):
        assert abs(found.parameters[key].value - true) < 3.0 * found.parameters[key].std, key
    r_r = found.parameters["rotor_resistance_ohm"]
    assert r_r.value == pytest.approx(FOUR["rotor_resistance"], rel=0.05)
    assert r_r.std < 0.1 * r_r.value


def test_a_broken_bar_is_named_from_two_loads() -> None:
    """Where the bar lies at a file's first sample is any: at one angle for both nothing was named."""
    size = 0.06
    found = diagnose(_loads(has_speed=True, cage_asymmetry_re=size), PLATE)
    assert [c.name for c in found.causes] == ["rotor_asymmetry"]
    assert found.causes[0].sizes["relative_asymmetry"][0] == pytest.approx(size, rel=0.1)


def test_a_healthy_motors_two_loads_have_no_name() -> None:
    found = diagnose(_loads(has_speed=True, load_ripple_cos=0.06), PLATE)
    assert (found.causes, found.verdict) == ((), "nothing_significant")
