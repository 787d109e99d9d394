"""Other explanations in place of accepted ones: each is judged by its misfit and by the numbers that it needs."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.causes.cause import Proposal, Standing
from commissioner.diagnose.causes.sampling.read_late import EDGE
from commissioner.diagnose.rules import RULES
from commissioner.diagnose.search import exchanges

HERE, IRON, CABLE, LATE = 100.0, "iron_loss", "cable_capacitance", "sampling_delay"


def proposals(setting, nominal):
    """What iron loss proposes beside a cable, and how many numbers the two have."""
    iron, cable = (CATALOGUE[n].terms(setting) for n in (IRON, CABLE))
    values = (1e-3, *(0.0 for _ in (*iron[1:], *cable)))
    model = replace(nominal, terms=(*iron, *cable), values=values)
    there = Standing(model, (IRON, CABLE), tuple(CATALOGUE), setting, 1e4, RULES)
    return next(iter(CATALOGUE[IRON].proposals(there))), len(iron), len(cable)


def test_every_proposal_is_credited_with_its_own_numbers(setting, nominal):
    (shown, late), iron, cable = proposals(setting, nominal)
    assert shown.model.of(IRON)[EDGE.symbol] > 0.0 and set(late.model.of(LATE)) == {"read_late"}
    assert shown.most_chi2 == pytest.approx(RULES.floor_chi2 + RULES.number_chi2 * (cable - 1))
    assert late.most_chi2 == pytest.approx(RULES.floor_chi2 + RULES.number_chi2 * (iron + cable - 1))


@pytest.mark.parametrize(("dearer", "first"), [(0.03, LATE), (9.0, LATE), (11.0, IRON)])
def test_of_two_that_fit_alike_the_one_of_fewer_numbers_stands(monkeypatch, dearer, first):
    """A current that is read late lost 0.03 more than an iron loss with a number more, and had to gain 40 on it."""
    two = Proposal(None, (CABLE,), (), 60.0, "two numbers", lambda _: True)
    one = Proposal(None, (IRON, CABLE), (LATE,), 70.0, "one number", lambda _: True)
    fits = iter((HERE + 6.6, HERE + 6.6 + dearer))
    monkeypatch.setattr(exchanges, "refitted", lambda *_: SimpleNamespace(chi2=next(fits)))
    state = SimpleNamespace(
        fit=SimpleNamespace(chi2=HERE), setting=None, accepted=(IRON, CABLE), at=lambda _, accepted: accepted
    )
    search = exchanges.exchanged([(two, one)], state, SimpleNamespace(rules=RULES))
    with pytest.raises(StopIteration) as end:
        while True:
            next(search)
    assert end.value.value == (first,)
