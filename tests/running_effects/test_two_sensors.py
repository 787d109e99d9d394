"""Drives with two current sensors: the third current is minus their sum and carries what one of them reads wrong."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.running.diagnosis import diagnose
from tests.running_effects.cases import Case, taken

GAIN = 0.98
COMPUTED = {"w": ("u", "v"), "u": ("v", "w"), "v": ("w", "u")}


def two_sensors(recording, computed, gain, *, is_written=True, digits=3):
    """As printed by a drive without a sensor in phase `computed`; the first one that is there reads `gain` times the current."""
    currents = dict(zip("uvw", recording.currents_a, strict=True))
    first, second = COMPUTED[computed]
    currents[first] = np.round(gain * currents[first], digits)
    currents[second] = np.round(currents[second], digits)
    third = np.round(-(currents[first] + currents[second]), digits)
    currents[computed] = third if is_written else np.full_like(third, np.nan)
    return replace(recording, currents_a=(currents["u"], currents["v"], currents["w"]))


@pytest.mark.parametrize(("computed", "is_written"), [("w", True), ("u", True), ("w", False)])
def test_a_gain_error_before_the_computed_third_current_is_named_with_its_size_and_its_pair(computed, is_written):
    recording, plate, _ = taken(Case(5000, "null").scenario(), 5000)
    seen = diagnose([two_sensors(recording, computed, GAIN, is_written=is_written)], plate)
    assert seen.verdict in ("explained", "not_distinguishable"), seen.reason
    assert [c.name for c in seen.causes] == ["sensor_gain_mismatch"]
    name, (size, std, _) = next(iter(seen.causes[0].sizes.items()))
    first, second = COMPUTED[computed]
    assert name == f"{first}_against_{second}"
    assert size == pytest.approx(GAIN - 1.0, abs=max(4.0 * std, 5e-4))
    assert any(f"off by {abs(size) / 2:.2%}" in r for r in seen.remarks)


def test_what_one_of_three_sensors_does_to_all_parameters_is_said():
    """It draws all four by a third of its error, which no interval holds: a gain that all share is an impedance scale."""
    recording, plate, _ = taken(Case(5000, "null").scenario(), 5000)
    u, v, w = recording.currents_a
    seen = diagnose([replace(recording, currents_a=(1.03 * u, v, w))], plate)
    assert [c.name for c in seen.causes] == ["sensor_gain_mismatch"]
    said = next(r for r in seen.remarks if "off by" in r)
    share = next(float(word[:-1]) for word in said.split() if word.endswith("%")) / 100
    plain = diagnose([recording], plate).parameters_after
    for name, q in seen.parameters_after.items():
        if name != "rotor_time_constant_s":
            assert abs(q.value / plain[name].value - 1.0 + share) < 1e-3


def test_nothing_is_named_where_two_sensors_read_right():
    recording, plate, _ = taken(Case(5000, "null").scenario(), 5000)
    seen = diagnose([two_sensors(recording, "w", 1.0)], plate)
    assert seen.verdict == "nothing_significant"
    assert not seen.causes
    assert any("no sensor" in r or "not used as a sensor" in r for r in seen.remarks)
