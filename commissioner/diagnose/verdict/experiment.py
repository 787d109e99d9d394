"""What to record next: the test that splits a tie or finds an unnamed rest, as steps a technician can follow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from commissioner.diagnose.causes import CATALOGUE, CONFOUNDED, TOGETHER, between
from commissioner.diagnose.causes.cause import READ_BOTH, SAME, Procedure
from commissioner.diagnose.contract import NextExperiment
from commissioner.diagnose.intake.record import Facts, Record
from commissioner.records import DiagnosisVerdict

HALF, PLENTY_SIGMAS = 0.5, 10.0


def what_decides(name: str, record: Record) -> str:
    """What settles a name in these data: nobody is asked to record what is recorded."""
    return CATALOGUE[name].what_decides(record) if name in CATALOGUE else ""


def next_experiment(verdict: DiagnosisVerdict, causes: Sequence[Any], record: Record) -> NextExperiment | None:
    """The most useful next test, or None where nothing is open."""
    if verdict == "unexplained":
        how = Procedure(
            (
                "Repeat every test at half the level. " + SAME,
                "Block the shaft and repeat one test at the old level.",
                READ_BOTH,
            ),
            changes_values="Perhaps. Until the unknown is found, trust none of the values further than the error shown here.",
        )
        return _plan(["unknown"], "repeat every segment at half amplitude and one with the shaft blocked", how, None)
    tied = [c for c in causes if c.equivalent]
    if tied:
        cause = max(tied, key=lambda c: c.strength_sigma)
        names = [cause.name, *cause.equivalent]
        is_legs = any(pair <= set(names) for pair in TOGETHER)
        return _plan(
            names,
            CATALOGUE[cause.name].split_by,
            procedure(names, record.facts),
            _predicted(cause) if is_legs else None,
        )
    axes = {round(s.axis_deg % 180.0, 3) for s in record.segments}
    for pair, known in CONFOUNDED.items():
        if len(axes) < known.fewest_axes:
            return _plan(sorted(pair), "add axes 60 and 120 degrees", procedure(sorted(pair), record.facts), None)
    return None


def procedure(names: Sequence[str], facts: Facts) -> Procedure:
    """How these causes are told apart; a pair without its own recipe gets what decides each of them."""
    recipe = between(*names).told_apart_by if len(names) == 2 else None
    if recipe is not None:
        return recipe(facts)
    steps = tuple(dict.fromkeys(CATALOGUE[n].decides for n in names if n in CATALOGUE))
    return Procedure((*steps, SAME, READ_BOTH))


def _plan(names: Sequence[str], do: str, how: Procedure, sigma: float | None) -> NextExperiment:
    return {
        "splits": list(names),
        "do": do,
        "predicted_sigma": sigma,
        "steps": list(how.steps),
        "command": how.command,
        "repeats": _repeats(sigma),
        "changes_values": how.changes_values,
    }


def _repeats(sigma: float | None) -> int:
    """Recordings that make the difference PLENTY_SIGMAS times its own uncertainty; two where nothing is predicted."""
    return 2 if sigma is None else min(max(int(-(-((PLENTY_SIGMAS / max(sigma, 1e-3)) ** 2) // 1)), 1), 20)


def _predicted(cause: Any) -> float:
    """Halving the switching frequency halves a dead time's voltage: half its present strength in standard deviations."""
    return float(HALF * cause.delta_chi2**0.5)
