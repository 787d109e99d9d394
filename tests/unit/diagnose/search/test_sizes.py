"""Sizes and their spread, against closed forms and against the truth that made the currents."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.fit.gauss_newton import Fit, fit, inverse
from commissioner.diagnose.fit.normal_equations import Normal
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.plant.model import Model
from commissioner.diagnose.plant.prediction import predict
from commissioner.diagnose.search.refinement import leakage_side, without_idle_numbers
from commissioner.diagnose.verdict.evidence import sizes_with_spread, slopes_of

SIGMA_A = 0.01
WHITE = Noise(np.full(3, SIGMA_A), np.array([1.0, 1000.0]), np.ones((3, 2)), "given", True, 0.0, True)


def test_covariance_keeps_numbers_whose_unit_makes_their_information_small():
    """A capacitance in nF beside logarithms of resistances: 13 decades apart, and correlated by a half."""
    information = np.diag([2.6e10, 8.7e-3])
    information[0, 1] = information[1, 0] = 0.5 * np.sqrt(2.6e10 * 8.7e-3)
    assert inverse(information) == pytest.approx(np.linalg.inv(information), rel=1e-9)


def test_what_nothing_tells_is_left_out_of_the_covariance():
    assert inverse(np.diag([4.0, 0.0])) == pytest.approx(np.diag([0.25, 0.0]), abs=1e-12)


def test_a_steady_creep_is_not_enlarged_by_the_noise_of_its_course(setting, nominal):
    """Speed as a free course over time: some of it is hardly seen, and squares of noise do not pass for speed."""
    terms = CATALOGUE["shaft_motion"].terms(setting)
    splines = np.array([t.symbol.startswith("hat_") for t in terms])
    random = np.random.default_rng(5)
    root = random.normal(size=(len(terms) + 4, len(terms) + 4)) / np.sqrt(len(terms))
    shown = np.r_[np.full(4, 1e3), np.where(splines, random.choice([1e-3, 8.0], len(terms)), 2.0)]
    information = shown[:, None] * (root @ root.T + np.eye(len(shown))) * shown
    speed, draws = 0.06, []
    truth = np.r_[np.log(nominal.nominal), np.where(splines, speed, 0.0) / [t.step for t in terms]]
    spread = np.linalg.cholesky(np.linalg.inv(information))
    for _ in range(300):
        model = nominal.with_terms(terms).moved(truth + spread @ random.normal(size=truth.size))
        normal = Normal(information[None], np.zeros((1, truth.size)), np.zeros(1), np.full(1, 10_000))
        draws.append(sizes_with_spread(Fit(model, normal, True, 1), "shaft_motion", setting)["speed_rad_per_s"])
    value, std, _ = zip(*draws, strict=True)
    power = np.square(value)
    assert abs(power.mean() - speed**2) < 4.0 * power.std() / np.sqrt(len(draws)) + 0.01 * speed**2
    assert np.std(value) == pytest.approx(np.mean(std), rel=0.2)


@pytest.fixture(scope="module")
def looped(setting, nominal):
    """A record of iron on the stator's side with one stop and one exponential operator, and white noise."""
    terms = CATALOGUE["magnetic_hysteresis"].terms(setting)
    held = {"loop_3": 0.06, "loop_7": 0.09, "split": 0.5}
    model = Model(nominal.nominal, terms, tuple(held.get(t.symbol, 0.0) for t in terms))
    random = np.random.default_rng(11)
    segments = []
    for k, segment in enumerate(setting.record.segments):
        clean = predict(model, setting.record, k, setting.layout).currents_a
        segments.append(replace(segment, currents_a=clean + random.normal(0.0, SIGMA_A, clean.shape)))
    return replace(setting.record, segments=tuple(segments)), model


def test_memory_operators_that_are_not_there_are_dropped(setting, looped):
    record, truth = looped
    start = Model(truth.nominal, truth.terms, tuple(0.01 if t.symbol != "split" else 0.3 for t in truth.terms))
    full = fit(start, record, setting.layout, WHITE, rounds=40)
    sparse = without_idle_numbers(full, record, setting.layout, WHITE)
    loops = {k: v for k, v in sparse.model.of("magnetic_hysteresis").items() if k.startswith("loop")}
    assert len(loops) <= 4
    assert sparse.chi2 - full.chi2 < 12 * np.log(record.samples * 3)
    size, std, _ = sizes_with_spread(sparse, "magnetic_hysteresis", setting)["coercive_current_a"]
    assert abs(size - 0.15) < max(3.0 * std, 0.05 * 0.15)


def test_a_path_that_began_on_the_wrong_side_is_put_right(setting, looped):
    record, truth = looped
    start = replace(truth, values=tuple(-0.5 if t.symbol == "split" else 0.02 for t in truth.terms))
    stuck = fit(start, record, setting.layout, WHITE, rounds=3)
    best = fit(truth, record, setting.layout, WHITE)
    seen = leakage_side(stuck, record, setting.layout, WHITE)
    assert seen.chi2 <= stuck.chi2
    assert seen.chi2 - best.chi2 < 30.0
    assert seen.model.total(truth.terms[-1].kind) > 0.3


@pytest.mark.parametrize(("border", "wanted"), [(1.0, 2.0), (0.1, 2.0), (1e-3, 2.0)])
def test_a_size_that_is_said_otherwise_across_a_border_has_the_slope_of_its_own_side(border, wanted):
    """A sag on a recorded link is said at rated power, or as a part of the recorded swing."""

    def sizes_at(x):
        return {"part": (0.9 + 2.0 * x, "1")} if border - x > -1e-9 and x > -border / 2 else {"sag": (0.1, "1")}

    assert slopes_of(sizes_at(0.0), sizes_at, 0.3)["part"] == pytest.approx(wanted)


def test_a_size_that_no_step_keeps_has_no_slope():
    assert slopes_of({"part": (0.9, "1")}, lambda _: {"sag": (0.1, "1")}, 0.3) == {"part": 0.0}
