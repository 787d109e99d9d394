"""Where the four parameters are looked for: around the impedance of the tones, whatever noise lies beside them."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.diagnose.intake.audit import prepare
from commissioner.diagnose.plant.model import NO_DICTIONARY, Model
from commissioner.diagnose.plant.prediction import predict
from commissioner.diagnose.search.nominal import bare_layout, impedance_starts, is_outside_the_box
from tests.unit.diagnose.conftest import recording

LARGE = (0.4, 0.3, 0.008, 0.2)
"""Resistance an order below the reactance at the highest tone: the skirt of that tone is mostly noise."""


def under_noise(bare, share, seed):
    """The record of LARGE under this command, with white noise of a share of its peak current."""
    blank, _ = prepare([bare])
    silent = np.concatenate([
        predict(Model(LARGE), blank, k, NO_DICTIONARY).currents_a for k in range(len(blank.segments))
    ], axis=1)  # fmt: skip
    u, v, w = silent + share * np.abs(silent).max() * np.random.default_rng(seed).standard_normal(silent.shape)
    record, _ = prepare([replace(bare, current_u_a=u, current_v_a=v, current_w_a=w)])
    return record


def assert_box_holds_the_machine(record):
    for (low, high), true in zip(bare_layout(record).nominal_box, LARGE, strict=True):
        assert 3.0 * low < true < high / 1.5


@pytest.mark.parametrize("seed", range(12))
def test_box_holds_the_machine_under_noise(seed):
    record = under_noise(recording(), 0.04, seed)
    stator, rotor, leakage, _ = impedance_starts(record)[0]
    assert 0.7 < (stator + rotor) / (LARGE[0] + LARGE[1]) < 1.4
    assert 0.8 < leakage / LARGE[2] < 1.25
    assert_box_holds_the_machine(record)


@pytest.mark.parametrize("seed", range(12))
def test_lines_of_a_random_command_that_noise_covers_are_not_read(seed):
    """A random binary command asks at every frequency; the leakage lets no current through at the upper ones."""
    bare = recording(axes=(0.0,), seconds=3.0)
    levels = 20.0 * np.random.default_rng(seed).choice([-1.0, 1.0], bare.time_s.size // 20 + 1)
    command = np.where(bare.time_s < 0.1, 0.0, np.repeat(levels, 20)[: bare.time_s.size])
    record = under_noise(replace(bare, voltage_axis_v=command), 0.03, seed)
    leakage = impedance_starts(record)[0][2]
    assert 0.5 < leakage / LARGE[2] < 2.0
    assert_box_holds_the_machine(record)


@pytest.mark.parametrize(
    ("four", "expected"),
    [
        ((0.4, 0.3, 0.008, 0.2), False), ((0.4, 0.3, 0.008, 0.0075), True), ((0.4, 2.4, 0.008, 0.2), True), ((2.8, 0.3, 0.008, 0.2), True),
        ((0.4, 0.3, 0.03, 0.2), False),
    ],
)  # fmt: skip
def test_four_numbers_that_no_motor_has_are_astray(four, expected):
    layout = replace(NO_DICTIONARY, nominal_box=((0.007, 2.8), (0.007, 2.4), (2e-4, 0.04), (3e-3, 10.0)))
    assert is_outside_the_box(Model(four), layout) is expected
