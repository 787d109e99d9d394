"""The DC bias of a test: what is planned stays under the limits, and the guard sees a flux that does not change."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from commissioner.identify.excite.bias import ABOVE_TONES, BiasGuard, plan_bias
from commissioner.identify.excite.tones import Excitation, ExcitationLimits, Tone
from commissioner.identify.inverter.staircase import DcLevel, knee_shape
from commissioner.motor.circuit import InverseGamma
from tests.support.standstill import linear_response

PERIOD_S = 2e-4
MACHINE = InverseGamma(0.62, 0.376, 0.0107, 0.19)
TONES = Excitation((Tone(18.0, 0.7, 0.0), Tone(15.0, 4.1, 1.5), Tone(4.5, 44.6, 1.6)), 0.0, 4.6)
LIMITS = ExcitationLimits(0.9, 18.0, 98.0)
LOSS = knee_shape(14.4, 0.2, 5.0)
LEVELS = [
    DcLevel(s * (0.62 * i + float(LOSS.on_axis(np.array([i]), 0.0)[0])), s * i, 0.0)
    for i in (4.2, 2.5, 1.3)
    for s in (1, -1)
]


def played(plan, machine=MACHINE, seconds=6.0):
    """(current, stator flux) of the linear machine behind legs of constant loss: the bias drives its current, the tones all."""
    time = np.arange(round(seconds / PERIOD_S)) * PERIOD_S
    loss = plan.voltage_v - 0.62 * plan.current_a
    voltage = replace(TONES, dc_bias_v=plan.voltage_v - loss).voltage_v(time, plan.scale)
    current, rotor = linear_response(machine.as_tuple(), voltage, PERIOD_S)
    return current, rotor + machine.leakage_inductance_h * current


def test_bias_and_tones_stay_under_the_flux_limit_and_no_leg_changes_its_sign():
    plan = plan_bias(MACHINE, TONES, LIMITS, LEVELS, PERIOD_S)
    current, flux = played(plan)
    assert 0.6 * LIMITS.flux_wb < np.max(np.abs(flux)) <= plan.peak_flux_wb <= 0.86 * LIMITS.flux_wb
    settled = current[-round(2.0 / 0.7 / PERIOD_S) :]
    assert np.min(settled) > 0.0
    assert plan.current_a == pytest.approx(np.mean(settled), rel=0.05)


def test_the_bias_is_left_out_where_none_worth_its_time_fits():
    weak = [DcLevel(level.voltage_v, 0.1 * level.current_a, 0.0) for level in LEVELS]
    assert plan_bias(MACHINE, TONES, LIMITS, weak, PERIOD_S) is None
    assert plan_bias(MACHINE, TONES, replace(LIMITS, voltage_v=10.0), LEVELS, PERIOD_S) is None


def test_the_bias_is_above_the_tones():
    plan = plan_bias(MACHINE, TONES, LIMITS, LEVELS, PERIOD_S)
    alone = replace(TONES, dc_bias_v=0.0).voltage_v(np.arange(20_000) * PERIOD_S, plan.scale)
    tones = linear_response(MACHINE.as_tuple(), alone, PERIOD_S)[0]
    assert plan.current_a >= 0.99 * ABOVE_TONES * np.max(np.abs(tones))


@pytest.mark.parametrize("start_wb", [-0.4, 0.0, 0.4])
def test_the_guard_sees_a_constant_flux_whatever_it_was_told_to_begin_with(start_wb):
    plan = plan_bias(MACHINE, TONES, LIMITS, LEVELS, PERIOD_S)
    current, flux = played(plan)
    guard = BiasGuard(MACHINE, LIMITS.flux_wb, 0.02, TONES, plan.scale, plan.voltage_v, PERIOD_S, LOSS, 0.0, start_wb)
    seen = [guard.advance(current[a : a + 50], (a + 50) * PERIOD_S)[0] for a in range(0, current.size, 50)]
    true = [float(np.max(np.abs(flux[a : a + 50]))) for a in range(0, current.size, 50)]
    late = len(seen) // 2
    assert np.all(np.array(seen[late:]) >= 0.99 * np.array(true[late:]))  # L_M is taken 5 % to the bad side
    assert np.all(np.array(seen[late:]) <= 1.07 * np.array(true[late:]))


def test_the_guard_looks_ahead_by_the_links_latency():
    plan = plan_bias(MACHINE, TONES, LIMITS, LEVELS, PERIOD_S)
    current, flux = played(plan)
    ahead = []
    for latency_s in (0.005, 0.1):
        guard = BiasGuard(
            MACHINE, LIMITS.flux_wb, latency_s, TONES, plan.scale, 2.0 * plan.voltage_v, PERIOD_S, LOSS, 0.0, 0.0
        )
        ahead.append(guard.advance(current[:500], 0.1)[1])
    assert ahead[1] > 1.5 * ahead[0] > 0.0
    assert ahead[0] >= np.max(np.abs(flux[:500]))
