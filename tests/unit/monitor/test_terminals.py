"""What the terminals alone say of a motor that has a shorted loop; truth from phasors."""

import numpy as np
import pytest

from commissioner.monitor.intake.findings import Fundamental
from commissioner.monitor.intake.terminals import from_terminals, lost_in_loop_w
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import from_nameplate, stator_impedance

PLATE = Nameplate(18500.0, 400.0, 50.0, 31.5, 1472.0, 0.89, 2, "star")


def terminals(loop_of_rated: float, unbalance: float = 0.01) -> tuple[Fundamental, float]:
    """The plate's circuit at rated slip with a resistive loop on phase u, and its air-gap torque."""
    circuit, omega, v = from_nameplate(PLATE), 100 * np.pi, 326.6 + 0j
    negative = unbalance * v * np.exp(0.7j)
    siemens = loop_of_rated * np.sqrt(2.0) * PLATE.rated_current_a / abs(v)
    healthy = v / stator_impedance(circuit, omega, PLATE.rated_slip)
    driven = negative / stator_impedance(circuit, omega, 2.0 - PLATE.rated_slip)
    current, other = healthy + siemens * v / 3.0, driven + siemens * np.conj(v) / 3.0
    power = 1.5 * v * np.conj(current)
    torque = (1.5 * (v * np.conj(healthy)).real - 1.5 * circuit.stator_resistance_ohm * abs(healthy) ** 2) * 2 / omega
    return Fundamental(50.0, v, current, negative, other, power.real, power.imag, False), float(torque)


@pytest.mark.parametrize("loop", [0.0, 0.1, 0.4, 1.0])
def test_what_a_shorted_loop_takes_is_in_the_torques_error(loop: float) -> None:
    """A loop of 1.0 of the rated current had a torque 50 % too large, 13 stated errors."""
    seen, torque = terminals(loop)
    told = from_terminals(seen, PLATE)
    assert told is not None and abs(told.torque_nm - torque) < 2.0 * told.torque_std_nm


@pytest.mark.parametrize("unbalance", [0.0, 0.02, 0.05])
def test_what_the_mains_unbalance_drives_is_no_loop(unbalance: float) -> None:
    assert lost_in_loop_w(terminals(0.0, unbalance)[0], PLATE) == 0.0
