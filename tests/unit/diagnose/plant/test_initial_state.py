"""What a segment inherits: how a flux decays between open terminals, in straight and in bent iron, and its sensitivities."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import BSpline
from scipy.linalg import expm

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.causes.iron.magnetic_hysteresis import CARRIED
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.kernels.memory import replayed
from commissioner.diagnose.plant.flux_before import with_flux_before
from commissioner.diagnose.plant.initial_state import per_ampere, slopes_of_start
from commissioner.diagnose.plant.model import Model
from commissioner.diagnose.plant.prediction import predict, trajectory
from commissioner.diagnose.search.nominal import CARRY
from tests.unit.diagnose.causes.test_effects import central_slope

BEFORE_WB = np.array([0.4, -0.3])
TILTED = {"leakage_cos": 0.02, "leakage_sin": -0.03, "magnetizing_cos": 0.04, "split": 0.2}


@pytest.fixture
def behind(setting):
    """The setting whose second segment follows one that ended with `BEFORE_WB`."""
    segments = list(setting.record.segments)
    segments[1] = replace(segments[1], flux_before_wb=tuple(BEFORE_WB))
    return replace(setting, record=replace(setting.record, segments=tuple(segments)))


def model_of(nominal, setting, effects, held):
    terms = (*(t for e in effects for t in CATALOGUE[e].terms(setting) if t.segment in (-1, 1)), *CARRY)
    return Model(nominal.nominal, terms, tuple(held.get(t.symbol, 0.0) for t in terms))


def start_of(model, behind):
    return trajectory(model, behind.record, 1, behind.layout, model.terms).states[0]


def bent(share=0.4, across=0.0):
    """Iron whose extra current grows to several times that of L_M (3.3 A/Wb)."""
    return {"curve_3": 4.0, "curve_8": 12.0, "flux_carried_over": share, "flux_carried_over_turned": across}


def extra_current_per_wb(model, layout):
    """G of the iron's curve, by another spline than the product's."""
    weights = model.sum_kind(kinds.IRON_CURVE, layout.iron_vectors.shape[0]) @ layout.iron_vectors
    count = weights.size - 3
    knots = (np.arange(count + 7) - 3) * layout.iron_top_wb / count
    return BSpline(knots, weights, 3, extrapolate=True)


@pytest.mark.parametrize("share", [0.9, 0.4, 0.03])
def test_in_bent_iron_flux_decays_as_its_own_magnetizing_current_demands(nominal, behind, share):
    """d psi/dt = -R_R i_m(psi), over the time in which straight iron would keep that share."""
    model = model_of(nominal, behind, ["magnetizing_saturation"], bent(share))
    curve = extra_current_per_wb(model, behind.layout)
    _, r_r, _, l_m = nominal.nominal
    size = float(np.hypot(*BEFORE_WB))
    assert l_m * curve(size) > 1.0, "iron that is hardly bent tells nothing"
    seconds = -np.log(share) * l_m / r_r
    decay = solve_ivp(lambda _, y: -r_r * (y / l_m + curve(abs(y)) * y), (0.0, seconds), [size], rtol=1e-10, atol=1e-12)
    left = decay.y[0, -1] / size * BEFORE_WB
    assert start_of(model, behind) == pytest.approx([*left, *left], rel=1e-3)
    assert np.hypot(*left) < 0.98 * share * size


@pytest.mark.parametrize(
    "held", [{"flux_carried_over": 0.3}, {"flux_carried_over": -0.2, "flux_carried_over_turned": 0.4}]
)
def test_in_straight_iron_a_share_is_left_and_may_have_turned(nominal, behind, held):
    along, across = held["flux_carried_over"], held.get("flux_carried_over_turned", 0.0)
    left = np.array([[along, -across], [across, along]]) @ BEFORE_WB
    assert start_of(model_of(nominal, behind, [], held), behind) == pytest.approx([*left, *left])


def test_in_iron_that_turns_meanwhile_the_size_decays_all_the_same(nominal, behind):
    straight = start_of(model_of(nominal, behind, ["magnetizing_saturation"], bent(0.5)), behind)
    turned = start_of(model_of(nominal, behind, ["magnetizing_saturation"], bent(0.3, 0.4)), behind)
    assert np.hypot(*turned[2:]) == pytest.approx(np.hypot(*straight[2:]))


def test_flux_that_tilts_is_what_an_open_machine_keeps(nominal, behind):
    """psi(t) = exp(-t R_R / L_M (1 + tilt)) psi(0), the tilt of the rate that of both."""
    held = {"magnetizing_cos": 0.03, "magnetizing_sin": 0.02, "split": -0.5, "flux_carried_over": 0.4}
    start = start_of(model_of(nominal, behind, ["inductance_anisotropy"], held), behind)
    rate = np.log(0.4) * (np.eye(2) + np.array([[0.03, 0.02], [0.02, -0.03]]))
    assert start[2:4] == pytest.approx(expm(rate) @ BEFORE_WB, rel=2e-3)


@pytest.mark.parametrize(
    "symbol",
    ["leakage_cos", "leakage_sin", "magnetizing_cos", "magnetizing_sin", "split", "curve_3", "flux_carried_over"],
)
def test_sensitivities_of_the_currents_hold_with_flux_from_the_segment_before(nominal, behind, symbol):
    """What is left of that flux tilts with the open machine's rate, and the cage's resistance by the share of the leakage."""
    effects, iron = (
        (["magnetizing_saturation"], bent())
        if symbol == "curve_3"
        else (["inductance_anisotropy"], {"flux_carried_over": 0.4})
    )
    model = model_of(nominal, behind, effects, {**TILTED, **iron})
    row = 4 + [t.symbol for t in model.terms].index(symbol)
    jacobian = predict(model, behind.record, 1, behind.layout, wanted=model.terms).jacobian[row]
    slope = central_slope(model, behind, row, 1e-3)
    assert np.sqrt(np.mean((jacobian - slope) ** 2)) < 0.01 * np.sqrt(np.mean(slope**2))


@pytest.mark.parametrize("share", [(0.4, 0.0), (0.3, -0.2), (-0.3, 0.1), (2e-4, 0.0), (0.0, 0.0), (1.2, 0.0)])
@pytest.mark.parametrize("effects", [(), ("magnetizing_saturation",), ("inductance_anisotropy", "remanence")])
def test_slopes_of_the_start_are_those_of_the_start(nominal, behind, effects, share):
    """By every number, against central differences: 1/L_M among the four, and all of the terms."""
    model = model_of(nominal, behind, effects, {**bent(*share), **TILTED})
    path = trajectory(model, behind.record, 1, behind.layout, model.terms)
    slopes = slopes_of_start(model, behind.record.segments[1], path.machine, behind.layout, model.terms)
    scale = np.array(
        [
            model.nominal[0],
            model.nominal[1],
            -1.0 / model.nominal[2],
            -1.0 / model.nominal[3],
            *(t.step for t in model.terms),
        ]
    )
    for row in range(slopes.shape[0]):
        h = 1e-4 * np.eye(slopes.shape[0])[row]
        more, less = (start_of(model.moved(model.theta + sign * h), behind) for sign in (1.0, -1.0))
        expected = (more - less) / 2e-4
        about = model.terms[row - 4].symbol if row > 3 else row
        assert scale[row] * slopes[row] == pytest.approx(
            expected, rel=0.02, abs=2e-3 * np.abs(expected).max(initial=1e-3)
        ), about


@pytest.fixture
def remembering(setting):
    """The setting whose second segment follows one in which the iron went up and down along 40 degrees."""
    size = setting.iron_flux_wb * np.array([0.0, 0.9, -0.7, 0.5, -0.1, 0.0])
    path = np.outer(
        [np.cos(np.deg2rad(40.0)), np.sin(np.deg2rad(40.0))],
        np.interp(np.linspace(0.0, 5.0, 400), np.arange(6.0), size),
    )
    segments = list(setting.record.segments)
    segments[1] = replace(segments[1], iron_before_wb=path)
    return replace(setting, record=replace(setting.record, segments=tuple(segments)))


def loops_that_remember(nominal, setting, split=0.3):
    terms = (*CATALOGUE["magnetic_hysteresis"].terms(setting), CARRIED)
    held = {
        "loop_1": 0.05,
        "loop_3": 0.03,
        "loop_7": 0.04,
        "loop_9": 0.02,
        "loop_13": 0.03,
        "split": split,
        "carried": 1.0,
    }
    return Model(nominal.nominal, terms, tuple(held.get(t.symbol, 0.0) for t in terms))


def test_iron_that_remembers_keeps_a_flux_without_any_current(nominal, remembering):
    path = trajectory(loops_that_remember(nominal, remembering), remembering.record, 1, remembering.layout, ())
    assert np.hypot(*path.states[0, 2:4]) > 1e-3
    # loops that widen or narrow are taken as they are near no flux
    held_a = np.hypot(*path.states[0, 2:4]) / nominal.nominal[3]
    assert np.abs(path.current[:, 0]).max() < 1e-3 * held_a and np.abs(path.rotor_current[:, 0]).max() < 1e-3 * held_a


def test_slopes_of_what_memory_keeps_up_are_those_of_the_start(nominal, remembering):
    model = loops_that_remember(nominal, remembering)
    path = trajectory(model, remembering.record, 1, remembering.layout, model.terms)
    slopes = slopes_of_start(model, remembering.record.segments[1], path.machine, remembering.layout, model.terms)
    for row, per_theta in (
        (3, -1.0 / model.nominal[3]),
        *((4 + k, t.step) for k, t in enumerate(model.terms) if t.symbol.startswith("loop")),
    ):
        h = 1e-4 * np.eye(slopes.shape[0])[row]
        more, less = (start_of(model.moved(model.theta + sign * h), remembering) for sign in (1.0, -1.0))
        expected = (more - less) / 2e-4
        assert per_theta * slopes[row] == pytest.approx(
            expected, rel=0.02, abs=2e-3 * np.abs(expected).max(initial=1e-6)
        ), row


def test_the_flux_that_stays_is_where_the_memory_and_the_magnetizing_current_cancel(nominal, remembering):
    """Its loops then hold what they had: told once more they keep the same flux."""
    model = loops_that_remember(nominal, remembering, split=-0.5)
    told = with_flux_before(remembering.record, model, remembering.layout)
    radius = remembering.layout.stop_radius_wb
    for segment in told.segments[1:]:
        kept = segment.iron_before_wb[:, -1]
        z = replayed(segment.iron_before_wb, np.ascontiguousarray(radius[:, 0]))
        memory_a = (model.sum_kind(kinds.STOP, len(radius)) * per_ampere(radius)) @ z
        assert kept / model.nominal[3] + memory_a == pytest.approx(0.0, abs=1e-4 * np.abs(memory_a).max())
        assert np.abs(memory_a).max() > 1e-3
