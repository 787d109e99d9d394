"""The DC staircase: resistance and inverter error apart, climbing from below, refusing what cannot tell."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from commissioner.errors import DataRefused
from commissioner.identify.inverter.staircase import DcLevel, InverterError, StaircaseLimits, fit_staircase, staircase
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import prior, rated_flux
from commissioner.motor.space_vector import phase_cosines
from tests.support.standstill import usable_motors

SHAPES = {
    "tanh": lambda x: np.tanh(x / 0.15),
    "long tail": lambda x: 2 / np.pi * np.arctan(x / 0.1),
    "corner": lambda x: np.clip(x / 0.12, -1.0, 1.0),
}


def lost_v(current: float, axis_deg: float, plateau: float, shape) -> float:
    return 2 / 3 * sum(c * plateau * shape(c * current) for c in phase_cosines(axis_deg))


def measured(axis_deg: float, shape, offset: float = 0.02, resistance: float = 3.7) -> list[DcLevel]:
    """Levels as a motor of 3.7 ohm behind legs that lose 8 V would settle."""
    levels = []
    for volts in (3.0, 6.0, 9.0, 10.5, 11.5, 12.5, 14.0, 17.0, 21.0, 26.0):
        for u in (volts, -volts):
            i = brentq(lambda x, u=u: resistance * x + lost_v(x, axis_deg, 8.0, shape) - u, -20, 20)
            levels.append(DcLevel(u, i + offset, 1e-4))
    return levels


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("axis_deg", [0.0, 30.0, 60.0])
def test_resistance_is_found_behind_legs_that_lose_eight_volts(axis_deg, shape):
    fitted = fit_staircase(measured(axis_deg, SHAPES[shape]), axis_deg)
    error = abs(fitted.stator_resistance.value - 3.7)
    assert error < 0.03 * 3.7
    assert error < 4.0 * fitted.stator_resistance.std + 0.004 * 3.7
    assert fitted.error_voltage.value == pytest.approx(8.0, rel=0.06)
    assert fitted.offset_a == pytest.approx(0.02, abs=0.004)


def test_an_ideal_inverter_is_seen_as_one():
    levels = [DcLevel(3.7 * i, i, 1e-4) for i in (0.5, 1.0, 1.5, 2.0, -0.5, -1.0, -1.5, -2.0)]
    fitted = fit_staircase(levels, 0.0)
    assert fitted.stator_resistance.value == pytest.approx(3.7, rel=0.005)
    assert abs(fitted.error_voltage.value) < 0.03 * 3.7 * 2.0


@pytest.mark.parametrize("levels", [[], [DcLevel(5.0, 1.0, 0.0)], [DcLevel(5.0, 1.0, 0.0), DcLevel(-5.0, -1.0, 0.0)]])
def test_too_few_levels_are_refused_with_a_remedy(levels):
    with pytest.raises(DataRefused) as refused:
        fit_staircase(levels, 0.0)
    assert refused.value.remedy


def test_lost_voltage_on_a_phase_axis_is_four_thirds_and_between_phases_two_over_root_three_of_a_leg():
    leg = InverterError((0.0, 1e-3), (0.0, 6.0))
    current = np.array([5.0, -5.0])
    assert leg.on_axis(current, 0.0) == pytest.approx([8.0, -8.0])
    assert leg.on_axis(current, 30.0) == pytest.approx(np.array([12.0, -12.0]) / np.sqrt(3.0))


@pytest.mark.parametrize("motor", list(usable_motors()), ids=lambda m: m.name)
def test_the_top_current_keeps_every_published_motors_flux_under_the_limit(motor):
    limit = 0.9 * rated_flux(motor.plate, prior(motor.plate).typical.stator_resistance_ohm).stator_peak_wb
    plan = staircase(motor.plate, StaircaseLimits(motor.plate.rated_current_peak_a, limit, motor.plate.rated_voltage_v))
    machine = InverseGamma(*motor.truth)
    flux = (machine.leakage_inductance_h + machine.magnetizing_inductance_h) * plan.top_current_a
    assert flux < limit
