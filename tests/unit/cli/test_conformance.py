"""What `drives conformance` shows of a drive on which most rules cannot be tried."""

from __future__ import annotations

import pytest

from commissioner.cli.screens import screen
from commissioner.cli.verbs.drives import conformance as verb
from commissioner.conformance.kit import Conformance
from commissioner.conformance.records import Outcome, RuleResult


def ended(name, outcome, reason="", *, energises=True):
    return RuleResult(name, f"{name} holds", "the map", energises, outcome, reason, 1, ())


RESULTS = (
    ended("identity", Outcome.PASS, energises=False),
    *(ended(f"rule-{k}", Outcome.NOT_TESTED, "interlock safe_torque_off is open") for k in range(44)),
    ended("alone", Outcome.NOT_TESTED, "needs a decimation"),
)


def shown(monkeypatch, *, names_all):
    def tried(*_, on_result, **__):
        for result in RESULTS:
            on_result(result)
        return Conformance({}, RESULTS, True)

    monkeypatch.setattr(verb, "run_conformance", tried)
    with screen.out.capture() as text:
        verb.conformance(
            url="tcp://127.0.0.1:1", profile="simulated", energise=False, rules=(), reply_timeout_s=0.5, yes=True,
            names_all=names_all, as_json=False,
        )  # fmt: skip
    return text.get()


def test_rules_that_share_a_reason_are_counted_and_named_where_that_is_asked_for(monkeypatch):
    text = shown(monkeypatch, names_all=False)
    assert "44 rules not tested: interlock safe_torque_off is open" in text
    assert "rule-7" not in text
    assert len(text.splitlines()) <= 7
    assert "--all names them" in text


@pytest.mark.parametrize("name", ["rule-0", "rule-43", "alone", "identity"])
def test_all_names_them(monkeypatch, name):
    assert name in shown(monkeypatch, names_all=True)
