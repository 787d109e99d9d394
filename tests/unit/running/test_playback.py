"""A model file played on ideal mains."""

import numpy as np
import pytest

from commissioner.running.export import FORMAT, machine_of
from commissioner.running.playback import play
from tests.running_effects.start import FOUR, PLATE

PERIOD = 2e-4


def played(**numbers):
    document = {
        "format": FORMAT,
        "nameplate": PLATE.known(),
        "numbers": {**FOUR, **numbers},
        "has_shaft": True,
        "effect_numbers": {},
    }
    machine, scales, plate = machine_of(document, is_plain=False)
    return play(machine, scales, plate, PERIOD, None, {}, 0.0, 1), scales


def negative_sequence(columns, frequency_rad_per_s):
    """Amplitude over the last whole periods, at the last load."""
    u, v, w = (columns[f"current_{p}_a"][-1000:] for p in "uvw")
    vector = 2.0 / 3.0 * (u + v * np.exp(2j * np.pi / 3) + w * np.exp(-2j * np.pi / 3))
    return abs(np.mean(vector * np.exp(1j * frequency_rad_per_s * columns["time_s"][-1000:])))


@pytest.mark.parametrize("susceptance", [0.0, 0.01])
def test_a_shorted_loop_draws_half_of_its_current_as_negative_sequence(susceptance):
    """Along one axis: half turns forward and half backward, whatever of it is behind a leakage."""
    columns, scales = played(loop_conductance_u=0.02, loop_susceptance_u=susceptance)
    healthy, _ = played()
    drawn = [negative_sequence(c, scales.frequency_rad_per_s) for c in (columns, healthy)]
    assert drawn[0] == pytest.approx(0.5 * np.hypot(0.02, susceptance) * scales.current_a, rel=0.03)
    assert drawn[1] < 1e-3 * drawn[0]
