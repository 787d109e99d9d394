"""A short piece of each campaign, and proof that the campaigns can fail: defects put into the product are seen."""

import ast
from pathlib import Path

import pytest

from commissioner.link.drive.facts import DisarmReport
from commissioner.link.drive.inverter import Inverter
from commissioner.run import runner
from tests.campaigns import mutants
from tests.campaigns.faults import campaign, report
from tests.campaigns.short_run.one_run import run_one, run_until_undisturbed, short_scenario
from tests.campaigns.short_run.sequences import Sequence
from tests.campaigns.short_run.short_course import Script

SCENARIO = short_scenario()
SEQUENCES, SHARE, FIRST_SEED = 24, 6, 100_000


@pytest.mark.timeout(1800)
def test_random_faults_break_no_invariant():
    print(f"repeat: python -m tests.campaigns.faults --sequences {SEQUENCES} --share {SHARE} --seed {FIRST_SEED}")
    outcomes = campaign(SEQUENCES, FIRST_SEED, "both", size=SHARE, processes=4)
    print(report(outcomes))
    assert not [(outcome.sequence, outcome.broken) for outcome in outcomes if outcome.broken]
    assert len(outcomes) == SEQUENCES


def sequence(*faults, wire="tcp", decision="write back", rogue="", rogue_at=0):
    return Sequence(7, wire, Script(decision, 1, 1.0, rogue, rogue_at), faults, None)


@pytest.mark.parametrize("wire", ["tcp", "rtu"])
@pytest.mark.parametrize(
    ("faults", "outcome"),
    [
        ((), "commissioned"),
        (("lost@90+",), "faulted"),
        (("half_open@90", "lost_request@91+"), "faulted"),
        (("earth_fault@e0.2s",), "faulted"),
        (("overrun:600@e0.1s",), "faulted"),
        (("sample_gap:400@e0.2s",), "faulted"),
        (("sample_gap:3@e0.2s",), "commissioned"),
        (("ignore:control_word@80",), "faulted"),
        (("store_fails",), "faulted"),
        (("power_cycle@store",), "faulted"),
        (("runs_away@e0.1s",), "faulted"),
        (("ignore:watchdog_ms",), "faulted"),
        (("refuse:watchdog_ms",), "rejected"),
    ],
)
def test_each_grave_fault_ends_as_it_must(tmp_path, wire, faults, outcome):
    done = run_until_undisturbed(sequence(*faults, wire=wire), SCENARIO, tmp_path)
    assert not done.broken
    assert done.ended.outcome == outcome, done.ended


def test_a_run_that_leaves_a_runaway_drive_live_must_say_so(tmp_path, monkeypatch):
    left = sequence("runs_away@e0.1s")
    done = run_until_undisturbed(left, SCENARIO, tmp_path)
    assert done.ended.outcome == "faulted" and "isolate" in done.ended.error["remedy"]
    claimed = DisarmReport(True, "switch-on disabled", (), False)
    monkeypatch.setattr(Inverter, "disarm", lambda self: claimed)
    done = run_one(left, SCENARIO, tmp_path)
    assert any("the drive is live" in broken for broken in done.broken), done


def test_a_commit_that_never_ends_ends_as_a_fault_with_the_old_parameters(tmp_path):
    done = run_until_undisturbed(sequence("stuck_commit"), SCENARIO, tmp_path)
    assert not done.broken
    assert done.ended.outcome == "faulted"


def test_a_service_that_does_not_disarm_is_seen(tmp_path, monkeypatch):
    claimed = DisarmReport(True, "switch-on disabled", (), False)
    monkeypatch.setattr(Inverter, "disarm", lambda self: claimed)
    done = run_one(sequence("overrun:600@45"), SCENARIO, tmp_path)
    assert any("after the run had ended" in broken for broken in done.broken), done


@pytest.mark.parametrize(
    ("rogue", "decision", "at", "says"),
    [
        ("writes unasked", "keep", 18, "wrote"),
        ("slow watchdog", "keep", 14, "a watchdog of"),
        ("too much bias", "keep", 40, "a bias of"),
    ],
)
def test_a_gate_that_lets_everything_through_is_seen(tmp_path, monkeypatch, rogue, decision, at, says):
    done = run_one(sequence(decision=decision, rogue=rogue, rogue_at=at), SCENARIO, tmp_path)
    assert not done.broken
    monkeypatch.setattr(runner, "permit", lambda *_: None)
    done = run_one(sequence(decision=decision, rogue=rogue, rogue_at=at), SCENARIO, tmp_path)
    assert any(says in broken for broken in done.broken), done


def test_the_mutator_changes_one_thing_at_a_time():
    source = "def f(a):\n    return a <= 3 and not a\n"
    made = list(mutants.mutants("m", source))
    texts = [ast.unparse(mutant.tree) for mutant in made]
    assert len(texts) == len(set(texts)) == 9
    assert ast.unparse(ast.parse(source)) not in texts


def test_every_explained_survivor_is_still_in_the_code():
    made = {module: _read(module) for module, _ in mutants.EXPLAINED}
    for module, part in mutants.EXPLAINED:
        assert part in made[module], part


def _read(module: str) -> str:
    """Every mutant of a module by name, and the lines themselves."""
    source = (mutants.ROOT / Path(module.replace(".", "/") + ".py")).read_text(encoding="utf-8")
    changes = [(node, changed) for node in ast.walk(ast.parse(source)) for changed in mutants._changes(node)]
    return "\n".join([source, *(f"{ast.unparse(node)} -> {ast.unparse(changed)}" for node, changed in changes)])
