"""The search: no decision leaves a cause with a size that physics does not allow, and it gives up whenever it is told to."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.estimation.fit import Column, Fit, plain_machine, problem_of
from commissioner.estimation.numbers import AT
from commissioner.estimation.record import prepare
from commissioner.estimation.told import Slopes
from commissioner.report.running.page import page_of
from commissioner.running import search as module
from commissioner.running.causes import CATALOGUE
from commissioner.running.contract import as_document
from commissioner.running.diagnosis import diagnose
from commissioner.running.search import BEYOND, OF_NOISE, Named, Search, so_far
from tests.running_effects.start import FOUR, PLATE, started

IRON = Named("iron_loss", CATALOGUE["iron_loss"].forms[0])
BARS = Named("rotor_asymmetry", CATALOGUE["rotor_asymmetry"].forms[0])
LOOP = Named("stator_asymmetry", CATALOGUE["stator_asymmetry"].forms[0])


@pytest.fixture(scope="module")
def problem():
    return problem_of(prepare([started(PLATE)], PLATE))


def fit_of(problem, chi2, **numbers):
    """A fit that ended at these numbers, each sure to 1e-4, with so much chi-square."""
    machine = plain_machine(list(FOUR.values()), problem.record).with_values(numbers)
    columns = tuple(Column("p", AT[n]) for n in numbers)
    return Fit(machine, columns, chi2, np.zeros(1000), Slopes.known(1e4 * np.eye(len(columns), 1000)), 0.0, 0)


def searching(problem, monkeypatch, *, ends=None):
    """A search whose refits without a cause end as `ends` says, by the causes that stay."""
    seeking = Search(problem, fit_of(problem, 1e6), frozenset(), lambda _: None)
    monkeypatch.setattr(Search, "fitted", lambda _, start, causes, near: ends[tuple(c.cause for c in causes)])
    monkeypatch.setattr(module, "refreshed", lambda _, fit: fit)
    return seeking


def test_a_cause_is_needed_where_without_it_another_has_no_size_in_physics(problem, monkeypatch):
    """A saturation of -0.14 was stated: the needless cause beside it was dropped, and nobody looked at what that left."""
    both = fit_of(problem, 1000.0, iron_conductance=1e-3, cage_asymmetry_re=0.01, cage_asymmetry_im=0.0)
    for iron, stays in ((-1e-3, ("iron_loss", "rotor_asymmetry")), (1e-3, ("iron_loss",))):
        ends = {
            ("iron_loss",): fit_of(problem, 1001.0, iron_conductance=iron),
            ("rotor_asymmetry",): fit_of(problem, 9e5, cage_asymmetry_re=0.01, cage_asymmetry_im=0.0),
        }
        _, accepted = module._backward(searching(problem, monkeypatch, ends=ends), both, (IRON, BARS))
        assert tuple(c.cause for c in accepted) == stays


def test_a_cause_that_other_weights_leave_no_size_in_physics_is_not_taken(problem, monkeypatch):
    first = fit_of(problem, 1000.0, iron_conductance=1e-3)
    for moved, stays in ((-1e-3, ()), (2e-3, (IRON,))):
        seeking = searching(problem, monkeypatch)
        seeking.accept(module.Tried(IRON, first, 1e5, ""))
        monkeypatch.setattr(module, "with_noise_of", lambda problem, _: problem)
        monkeypatch.setattr(
            module,
            "refine",
            lambda _, machine, columns, moved=moved: fit_of(
                problem, 1000.0, iron_conductance=moved if columns else 0.0
            ),
        )
        fit, accepted = module._weighted(seeking, first, (IRON,))
        assert accepted == stays and seeking.is_plausible(fit, accepted)
        assert so_far(seeking.steps) == tuple(c.cause for c in stays)
        assert (fit is seeking.base) == (not stays)


def test_what_the_noise_of_the_input_makes_alone_is_no_cause(problem, monkeypatch):
    """An iron that takes 4 W, of which the voltage's noise makes 5, is none; the broken bar beside it stays."""
    both = fit_of(problem, 1000.0, iron_conductance=4e-4, cage_asymmetry_re=0.01, cage_asymmetry_im=0.0)
    bars = fit_of(problem, 1100.0, cage_asymmetry_re=0.01, cage_asymmetry_im=0.0)
    seeking = searching(problem, monkeypatch, ends={("rotor_asymmetry",): bars})
    seeking.steps += [module.Step("accepted", c.cause, "", 1.0) for c in (IRON, BARS)]

    def unbiased(_, fit):
        takes = {"iron_conductance": -1e-4} if fit is both else {}
        return replace(fit, machine=fit.machine.with_values(takes))

    monkeypatch.setattr(module, "unbiased", unbiased)
    shown, fit, accepted = module._shown(seeking, both, (IRON, BARS))
    assert accepted == (BARS,) and fit is bars and seeking.is_plausible(shown, accepted)
    assert (seeking.steps[-1].what, seeking.steps[-1].why) == ("dropped", BEYOND)
    assert so_far(seeking.steps) == ("rotor_asymmetry",)


def test_a_limit_that_only_the_correction_passes_keeps_the_fit_as_it_was(problem, monkeypatch):
    """A loop whose angle is at its limit is a loop still: nothing is taken off."""
    found = fit_of(problem, 1000.0, loop_conductance_u=0.03, loop_susceptance_u=0.0509)
    seeking = searching(problem, monkeypatch)
    past = {"loop_susceptance_u": 0.0511}
    monkeypatch.setattr(module, "unbiased", lambda _, fit: replace(fit, machine=fit.machine.with_values(past)))
    assert not seeking.is_plausible(module.unbiased(problem, found), (LOOP,))
    shown, fit, accepted = module._shown(seeking, found, (LOOP,))
    assert shown is fit is found and accepted == (LOOP,)


@pytest.mark.parametrize("times", [0, 1, 20])
def test_a_diagnosis_is_given_up_within_its_first_fit(times):
    """It fitted the four numbers to the end, minutes without a speed column, before anybody was asked."""
    asked = []

    def go_on():
        asked.append(len(asked))
        return len(asked) <= times

    seen = diagnose([started(PLATE)], PLATE, go_on=go_on)
    assert len(asked) == times + 1, "asked until the first no, and obeyed at once"
    assert seen.found is None and seen.record is not None and not seen.parameters_after
    document = as_document(seen)
    assert (document["verdict"], document["causes"], document["is_complete"]) == ("unexplained", [], False)
    assert document["reason"].startswith("Not finished") and document["next_experiment"] is None
    assert any("diagnose the recording again without a limit" in r for r in document["remarks"])
    assert page_of(seen, document, "start.csv").headline.startswith("Not finished")


@pytest.mark.parametrize(("size", "stays"), [(0.5e-2, ()), (2e-2, ()), (4e-2, (IRON,))])
def test_a_cause_within_three_standard_deviations_of_nothing_is_no_name(problem, monkeypatch, size, stays):
    """A healthy motor behind a filtered inverter had a delay of -17 +- 480 us, 0.99 sure: 480 was what the carrier in the voltage makes; another, under a
    load that ripples, a voltage gain of 0.028 +- 0.014 %."""
    fit = fit_of(problem, 1000.0, iron_conductance=size)
    seeking = searching(problem, monkeypatch)
    aside = np.array([[1e-2]])
    monkeypatch.setattr(module, "unbiased", lambda _, one: replace(one, aside=aside))
    _, _, accepted = module._shown(seeking, fit, (IRON,))
    assert accepted == stays
    assert [s.why for s in seeking.steps] == ([] if stays else [OF_NOISE])
