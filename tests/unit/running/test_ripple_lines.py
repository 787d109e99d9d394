"""A steady motor under a load that pulsates, without a speed column: the load's lines tell the slip, the shaft's lines are no unknown cause."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from commissioner.estimation.fit import problem_of
from commissioner.estimation.record import prepare
from commissioner.running.nominal import nominal
from commissioner.running.residual.lack import lack_of_fit
from commissioner.running.residual.shaft_lines import _multiples
from tests.support.running import taken_with

RATE_HZ = 2500.0
BARS = 28


@pytest.fixture(scope="module")
def steady():
    """The compressor's motor at 2.5 kHz for 5 s, the inertia of the rotor alone known (half of all): its nominal fit."""
    recording, plate, _ = taken_with("running_compressor", 3, 5.0, {"recording": {"rate_hz": RATE_HZ}})
    plate = replace(plate, inertia_kg_m2=0.015)
    problem, fit = nominal(problem_of(prepare([recording], plate), 0.0))
    return problem, fit


def test_the_loads_lines_tell_the_slip_and_the_rotors_resistance(steady):
    _, fit = steady
    # the scenario's T circuit as the inverse-Gamma one
    circuit = {"stator_resistance": 3.7, "rotor_resistance": 2.296 * (0.2243 / 0.235) ** 2}
    for name, true in circuit.items():
        assert fit.machine.value(name) == pytest.approx(true, rel=0.03), name


def test_what_is_left_are_the_rotors_slots_and_nothing_else(steady):
    problem, fit = steady
    left = lack_of_fit(problem, fit.machine)
    assert left.shaft_lines[0].per_turn == BARS
    assert left.sigma < 0.1
    assert left.burst_sigma < 0.2


def test_lines_beside_the_shafts_multiples_are_left_alone():
    turns = 120.0
    of_shaft = turns * 1.0005 * np.array([1.0, -28.0, 28.0])
    told = _multiples(np.append(of_shaft, [3.4 * turns, 12.5 * turns]), np.ones(5), turns)
    assert told.tolist() == [1, -28, 28, 0, 0]
    assert not _multiples(turns * np.array([3.4, 12.5]), np.ones(2), turns).any()
    assert _multiples(np.zeros(0), np.zeros(0), turns).size == 0
