"""The flux level that L_M is told for is every run's, where the tests came near it."""

import dataclasses
import math

import pytest

from commissioner.errors import DataRefused
from commissioner.identify import analysis
from commissioner.identify.analysis import BEYOND_DOUBT, LEVEL, NEAR, axis_at, told_level_wb
from commissioner.motor.circuit import InverseGamma

RATED_WB = 0.974


@pytest.mark.parametrize("reached_wb", [0.685, 0.7, 0.716, 0.7217, 0.78])
def test_runs_that_reached_other_fluxes_tell_one_level(reached_wb):
    assert told_level_wb(reached_wb, RATED_WB) == LEVEL * RATED_WB


@pytest.mark.parametrize("share", [0.3, LEVEL * (1 - NEAR) - 0.001, LEVEL * (1 + NEAR) + 0.001, 1.0])
def test_what_is_far_from_it_is_told_where_it_was(share):
    assert told_level_wb(share * RATED_WB, RATED_WB) == share * RATED_WB


@dataclasses.dataclass(frozen=True)
class Batch:
    """Iron whose L_M falls by a tenth of a henry per weber."""

    def inverse_gamma_at(self, flux_wb):
        return InverseGamma(3.7, 2.2, 0.02, 0.4 - 0.1 * flux_wb), 1e-12 * analysis.np.eye(4)


@dataclasses.dataclass(frozen=True)
class Axis:
    peak_stator_flux_wb: float
    axis_deg: float = 0.0
    law_error: float = 0.0
    batch: Batch = Batch()

    @property
    def parameters(self):
        return self.batch.inverse_gamma_at(self.peak_stator_flux_wb)[0]


def test_beyond_what_was_reached_a_part_of_the_way_is_error():
    level_wb = LEVEL * RATED_WB
    short, far = (axis_at(Axis(peak_wb), level_wb) for peak_wb in (level_wb - 0.05, level_wb + 0.05))
    assert short.parameters.magnetizing_inductance_h == pytest.approx(0.4 - 0.1 * level_wb)
    assert math.sqrt(short.covariance[3, 3]) == pytest.approx(BEYOND_DOUBT * 0.1 * 0.05, rel=1e-3)
    assert math.sqrt(far.covariance[3, 3]) == pytest.approx(1e-6)


def test_iron_that_leaves_no_inductance_at_the_level_is_refused():
    """A 37 kW motor behind a converter of two steps: its look's L_M was -0.25 H, and the next limits were no numbers."""
    with pytest.raises(DataRefused, match="does not fix L_M") as refusal:
        axis_at(Axis(0.5), 4.5)
    assert (refusal.value.value, refusal.value.limit) == ("-0.05 at a peak stator flux of 4.5 Wb", "above zero")
