"""A load that pulsates at a frequency of its own, behind a belt or a gear: recordings by the simulator, whose key tells share and ratio."""

from __future__ import annotations

from dataclasses import replace

import pytest

from commissioner.estimation.fit import problem_of
from commissioner.estimation.record import prepare
from commissioner.running.diagnosis import Diagnosis, diagnose
from commissioner.running.export import model_document
from commissioner.running.nominal import nominal
from commissioner.running.residual.swing_lines import swing_of
from sim.motoring.machine import Scenario
from sim.motoring.recording import build
from tests.running_effects.cases import Case, taken

SHARE, TURNS = 0.15, 1.618


def _case(seed: int, course: str, swing: tuple[float, float], *, has_speed: bool) -> Scenario:
    scenario = Case(seed, "null", course, has_speed).scenario()
    return replace(scenario, course=replace(scenario.course, swing=swing))


@pytest.fixture(scope="module")
def steady() -> tuple[Scenario, Diagnosis]:
    """A steady motor without a speed column: `unexplained`, 0.44 of the noise left, before the cause had a name."""
    scenario = _case(2, "steady", (SHARE, TURNS), has_speed=False)
    recording, plate, _ = taken(scenario, 2)
    return scenario, diagnose([recording], plate)


def test_it_is_named_with_its_size_and_how_often_it_comes(steady: tuple[Scenario, Diagnosis]) -> None:
    scenario, seen = steady
    assert seen.verdict == "explained"
    (cause,) = seen.causes
    assert (cause.name, cause.equivalent) == ("load_ripple", ())
    torque, times = cause.sizes["torque_nm"], cause.sizes["times_a_turn"]
    assert abs(torque[0] - SHARE * scenario.course.constant_nm) < 2.0 * torque[1]
    assert abs(times[0] - TURNS) < 3.0 * times[1] < 0.01
    assert times[2] == "a turn"
    assert any(remark.startswith("The load pulsates at 39.") and "1.61" in remark for remark in seen.remarks)


def test_the_simulator_plays_it_from_the_extended_model(steady: tuple[Scenario, Diagnosis]) -> None:
    """Its speed pulsates as much: of torque and inertia a steady motor tells little more than their ratio."""
    scenario, seen = steady
    assert seen.found is not None
    assert seen.record is not None
    drawn = build(dict(model_document(seen.found, seen.record)["scenario"]))
    load_nm = drawn.course.constant_nm + sum(added for _, added in drawn.course.steps)
    share, times = drawn.course.swing
    assert share * load_nm / drawn.machine.inertia_kg_m2 == pytest.approx(
        SHARE * scenario.course.constant_nm / scenario.machine.inertia_kg_m2, rel=0.05
    )
    assert times == pytest.approx(TURNS, abs=0.01)


@pytest.mark.parametrize(("seed", "turns"), [(3, 0.37), (12, 2.37)])
def test_a_measured_speed_tells_it(seed: int, turns: float) -> None:
    """Nothing is missing in the simulation then: its input swings."""
    scenario = _case(seed, "start", (SHARE, turns), has_speed=True)
    recording, plate, _ = taken(scenario, seed)
    problem, fit = nominal(problem_of(prepare([recording], plate)))
    swing = swing_of(problem, fit.machine)
    assert swing is not None
    assert swing.times_a_turn == pytest.approx(turns, rel=0.006)
    assert swing.hz == pytest.approx(
        swing.times_a_turn * 0.98 * scenario.supply.frequency_hz / plate.pole_pairs, rel=0.03
    )


@pytest.mark.parametrize("flicker", [0.0, 0.008])
def test_mains_that_flicker_are_no_load(flicker: float) -> None:
    """At 17.5 Hz, near which rotor and field swing against each other; the load itself pulsates once and twice a turn."""
    scenario = _case(514, "start", (0.0, 1.0), has_speed=True)
    scenario = replace(scenario, supply=replace(scenario.supply, wander=flicker, wander_rad_per_s=110.0))
    recording, plate, _ = taken(scenario, 514)
    problem, fit = nominal(problem_of(prepare([recording], plate)))
    assert scenario.course.ripple[0] > 0.0
    assert swing_of(problem, fit.machine) is None
