"""A motor wired in delta for star, told by what it draws under its first tones, and how little it is given until then."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from commissioner.identify.excite.tones import ExcitationLimits, design
from commissioner.identify.inverter.staircase import IDEAL_INVERTER
from commissioner.motor.nameplate import check, prior, rated_flux
from commissioner.motor.plate_match import MOST_DRAWN, current_mismatch
from commissioner.procedure.energised.overdrawn import Drawn
from tests.support.standstill import linear_current, usable_motors

PERIOD_S = 2e-4
MOTORS = [motor for motor in usable_motors() if not check(motor.plate)]


def drawn(motor, impedances):
    """As a first test of this motor with so many times its impedances says it."""
    truth = tuple(impedances * value for value in motor.truth)
    typical = replace(prior(motor.plate).typical, stator_resistance_ohm=truth[0])
    limits = ExcitationLimits(
        0.9 * rated_flux(motor.plate, truth[0]).stator_peak_wb, 0.6 * motor.plate.rated_current_peak_a,
        0.2 * motor.plate.rated_voltage_v,
    )  # fmt: skip
    tones = design(typical, limits, PERIOD_S, IDEAL_INVERTER, 1.4).excitation
    time_s = np.arange(0.0, 0.25, PERIOD_S)
    voltage_v = tones.voltage_v(time_s, 1.0) * np.minimum(5.0 * time_s, 1.0)
    seen = Drawn(typical, IDEAL_INVERTER, 0.0, PERIOD_S)
    for volts, amperes in zip(
        np.array_split(voltage_v, 40), np.array_split(linear_current(truth, voltage_v, PERIOD_S), 40), strict=True
    ):
        seen.take(volts, amperes, 0)
    return seen.over_typical


@pytest.mark.parametrize("motor", MOTORS[::3], ids=lambda motor: motor.name)
def test_the_plates_own_motor_draws_what_its_plate_lets_expect(motor):
    assert 0.8 < drawn(motor, 1.0) < 1.3
    assert current_mismatch(drawn(motor, 1.0), motor.plate) is None


@pytest.mark.parametrize("name", ["sps_50hp_400v_50hz", "msl_18kw5", "haumer_132m04", "sps_200hp_460v_60hz"])
def test_wired_in_delta_it_draws_too_much_and_the_connection_is_named(name):
    (motor,) = (m for m in MOTORS if m.name == name)
    ratio = drawn(motor, 1 / 3)
    found = current_mismatch(ratio, motor.plate)
    assert ratio > MOST_DRAWN and "wired in delta where the plate says star" in found.what
    assert found.value == ratio and "wire the motor in star" in found.remedy
    of_delta = current_mismatch(ratio, replace(motor.plate, connection="delta"))
    assert "draws more than the plate's motor would" in of_delta.what and "wired in" not in of_delta.what


def test_lost_samples_and_a_test_that_has_not_begun_say_nothing():
    seen = Drawn(prior(MOTORS[0].plate).typical, IDEAL_INVERTER, 0.0, PERIOD_S)
    assert seen.over_typical is None
    seen.take(np.zeros(8), np.ones(8), 0)
    assert seen.over_typical is None
    seen.take(np.ones(8), np.ones(8), 0)
    assert seen.over_typical is not None
    seen.take(np.ones(8), np.ones(8), 3)
    assert seen.over_typical is None
