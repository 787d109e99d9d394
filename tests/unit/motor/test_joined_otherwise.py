"""A winding for two voltages joined otherwise (a factor of 4), two motors on one drive, a cable's resistance: each is named."""

from dataclasses import replace

import pytest

from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import check
from commissioner.motor.plate_match import mismatch, plate_match
from tests.support.standstill import usable_motors

MOTORS = [
    m
    for m in usable_motors()
    if not check(m.plate) and m.name not in ("et_19kw", "krause_3hp", "krause_50hp", "s4a_0k25", "db_0k18")
]
HALVES = "halves of its winding"


def found(motor, connection, impedances):
    plate = replace(motor.plate, connection=connection)
    return mismatch(plate_match(InverseGamma(*(impedances * v for v in motor.truth)), plate), plate)


@pytest.mark.parametrize("motor", MOTORS, ids=lambda m: m.name)
def test_four_times_names_the_halves_of_a_winding_and_three_times_the_connection(motor):
    """A 170 kW motor for the lower of two voltages was told to be wired in delta: of a plate that says star it was."""
    for connection, factor, joined in (("star", 0.25, "in parallel where"), ("delta", 4.0, "in series where")):
        assert HALVES + " " + joined in found(motor, connection, factor).what
    for connection, factor in (("star", 1.0 / 3.0), ("delta", 3.0)):
        assert (
            HALVES not in found(motor, connection, factor).what
            and "is wired in" in found(motor, connection, factor).what
        )


@pytest.mark.parametrize(("connection", "factor"), [("star", 4.0), ("delta", 0.25), ("star", 0.5), ("delta", 0.45)])
def test_the_remedy_asks_for_the_winding_and_for_the_number_of_motors(connection, factor):
    (motor,) = (m for m in MOTORS if m.name == "sps_20hp_400v_50hz")
    remedy = found(motor, connection, factor).remedy
    assert HALVES in remedy and "how many motors are connected" in remedy


def test_a_resistance_that_is_no_motors_asks_for_the_cable():
    """0.05 per unit of it in series with a 15 kW motor, whose other values were right."""
    (motor,) = (m for m in MOTORS if m.name == "sps_20hp_400v_50hz")
    r_s, *others = motor.truth
    said = mismatch(
        plate_match(InverseGamma(r_s + 0.05 * motor.plate.impedance_base_ohm, *others), motor.plate), motor.plate
    )
    assert said.what.startswith("the stator's copper loss") and "the resistance of cable and contacts" in said.remedy
