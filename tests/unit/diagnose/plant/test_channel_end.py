"""A channel that bends towards its end: what it reports, and that the search names the channel's end and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.diagnosis import diagnose
from commissioner.diagnose.plant.channel_end import COUNT, KNOTS, current_lost, reported, slope_lost
from commissioner.diagnose.plant.prediction import predict
from tests.unit.diagnose.conftest import recording

ENDS = np.array([4.0, 10.0, 1.0])


def test_without_shares_everything_is_reported():
    current = np.linspace(-20.0, 20.0, 50) * np.ones((3, 1))
    np.testing.assert_array_equal(reported(current, np.zeros((3, COUNT)), ENDS), current)


def test_the_current_lost_is_the_integral_of_the_slope_lost():
    current = np.linspace(0.0, 2.0, 20_001) * ENDS[:, None]
    lost, slope = current_lost(current, ENDS), slope_lost(current, ENDS)
    step = current[:, 1] - current[:, 0]
    summed = np.cumsum(slope[..., :-1] + slope[..., 1:], axis=-1) * 0.5 * step[:, None]
    np.testing.assert_allclose(lost[..., 1:], summed, atol=1e-6 * 10.0)
    np.testing.assert_array_equal(current_lost(-current, ENDS), -lost)


def test_below_the_first_knot_nothing_is_lost():
    assert not current_lost(KNOTS[0] * ENDS[:, None], ENDS).any()


def bent(current, limit, form):
    """Laws that the fit does not have: hard, a hyperbolic tangent in the last tenth, a circle's arc in the last fifth."""
    size = np.abs(current)
    if form == "tanh":
        over = np.maximum(size - 0.9 * limit, 0.0) / (0.1 * limit)
        return np.sign(current) * np.where(over > 0.0, 0.9 * limit + 0.1 * limit * np.tanh(over), size)
    knee = 0.8 * limit
    over = np.maximum(size - knee, 0.0) / (limit - knee)
    return np.sign(current) * np.where(over > 0.0, knee + (limit - knee) * over / np.sqrt(1.0 + over**2), size)


@pytest.mark.parametrize(
    ("form", "phases", "share"), [("tanh", (0, 1, 2), 0.95), ("tanh", (1,), 0.8), ("root", (0, 1, 2), 0.9)]
)
def test_a_soft_limit_is_named_whatever_its_law_and_however_many_channels_have_it(
    nominal, setting, form, phases, share
):
    rows = np.concatenate([predict(nominal, setting.record, k, setting.layout).currents_a for k in range(3)], axis=1)
    limit = share * np.abs(rows).max()
    rows = np.stack([bent(row, limit, form) if p in phases else row for p, row in enumerate(rows)])
    rows = rows + 2e-3 * np.random.default_rng(7).standard_normal(rows.shape)
    seen = diagnose([recording(currents=rows)])
    assert [c.name for c in seen.causes] == ["clipping"] and seen.verdict == "explained"
    assert seen.causes[0].sizes["limit_a"][0] == pytest.approx(max(np.abs(rows[p]).max() for p in phases), rel=0.01)


def test_a_channel_that_is_hardly_bent_is_no_channel_at_its_end(nominal, setting):
    """The same curve for a loss of a tenth of the slope at the top: a nonlinearity, not an end."""
    sizes = CATALOGUE["clipping"].sizes(setting, {f"end_{p}_{k}": 0.01 for p in "uvw" for k in range(COUNT)})
    assert 0.0 < sizes["slope_lost"][0] < 0.1
    rows = np.concatenate([predict(nominal, setting.record, k, setting.layout).currents_a for k in range(3)], axis=1)
    curved = rows * (1.0 - 0.03 * (rows / np.abs(rows).max()) ** 2)
    curved = curved + 2e-3 * np.random.default_rng(7).standard_normal(rows.shape)
    seen = diagnose([replace(recording(currents=curved))])
    assert "clipping" not in [c.name for c in seen.causes]
