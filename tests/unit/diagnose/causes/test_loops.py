"""Memory operators of the iron: a loop that the flux does not fill is no loop."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.prediction import predict
from commissioner.diagnose.search.dictionaries import respread
from commissioner.diagnose.search.nominal import largest_fluxes
from commissioner.diagnose.search.refinement import widest_loop, with_closer_loops

TERMS = CATALOGUE["magnetic_hysteresis"].terms


def looping(setting, nominal, radii_wb, currents_a):
    """The conftest machine with loops of these radii alone, its iron on the rotor's side, where 1 / L_M is; and the setting they need."""
    layout = replace(setting.layout, stop_radius_wb=np.column_stack([radii_wb, np.zeros(len(radii_wb))]))
    there = replace(setting, layout=layout)
    values = [-0.5 if t.kind == kinds.NU else currents_a[t.index] for t in TERMS(there)]
    return replace(nominal, terms=TERMS(there), values=tuple(values)), there


def currents(model, setting):
    return np.concatenate(
        [predict(model, setting.record, k, setting.layout).currents_a for k in range(len(setting.record.segments))],
        axis=1,
    )


def test_a_loop_that_the_flux_no_longer_fills_is_inductance(setting, nominal):
    """A large motor's flux had been taken for twice what it was: a stop of 1.8 times the flux carried 31 A, and L_M was twice the true one."""
    flux = setting.iron_flux_wb
    model, there = looping(setting, nominal, [0.2 * flux, 1.8 * flux], [0.05, 0.6])
    there = replace(
        there, layout=replace(there.layout, iron_top_wb=2.0 * there.layout.iron_top_wb), iron_flux_wb=2.0 * flux
    )
    fresh, spread = respread(model, there)
    assert fresh.of("magnetic_hysteresis") == {"loop_0": 0.05, "split": -0.5}
    assert spread.layout.stop_radius_wb == pytest.approx(np.array([[0.2 * flux, 0.0]]))
    assert 1.0 / fresh.nominal[3] == pytest.approx(1.0 / nominal.nominal[3] + 0.6 / (1.8 * flux))
    assert currents(fresh, spread) == pytest.approx(
        currents(model, there), abs=1e-3 * np.abs(currents(model, there)).max()
    )


def test_closer_radii_are_looked_for_where_the_flux_fills_them(setting, nominal):
    flux = largest_fluxes(setting.record, nominal, setting.layout)[0]
    model, there = looping(setting, nominal, [0.06 * flux, 0.6 * flux], [0.05, 0.05])
    _, layout = with_closer_loops(model, there.layout, 1.45)
    radii = np.abs(layout.stop_radius_wb[:, 0])
    assert radii.max() < widest_loop(1.08 * flux)
    assert sorted(radii / flux) == pytest.approx([0.06 / 1.45, 0.06, 0.06 * 1.45, 0.6 / 1.45, 0.6], rel=0.01)
