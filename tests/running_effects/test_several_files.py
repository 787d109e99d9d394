"""What goes with the shaft's angle, in recordings that begin at any: each file's ripple and side bands have a phase of their own."""

from __future__ import annotations

from dataclasses import replace

import pytest

from commissioner.motor.circuit import PARAMETERS
from commissioner.records import RunningRecording
from commissioner.running.diagnosis import diagnose
from commissioner.running.identification import identify
from tests.running_effects.start import FOUR, PLATE, started


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
