"""What to record next: a start, a load step, a second load, an exchange of probes, whichever parts what is open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from commissioner.estimation.record import Record
from commissioner.records import DiagnosisVerdict
from commissioner.running.causes import CATALOGUE, confounders_of

START = "Record from before the contactor closes to one second after the motor runs, 5000 samples a second or more, all currents and voltages and the speed."
STEPS = "Then load it in two steps, half a second or more each."
SEPARATING = "a direct start with two load steps"


@dataclass(frozen=True)
class Experiment:
    """`do` in one sentence, `steps` to follow, `splits`: the names it parts."""

    do: str
    steps: tuple[str, ...]
    splits: tuple[str, ...]
    repeats: int = 2
    command: str = "commissioner diagnose recording.csv --out diagnosis"


def next_experiment(
    verdict: DiagnosisVerdict, causes: Sequence[tuple[str, Sequence[str]]], record: Record
) -> Experiment | None:
    """Of the first tie; of what is unexplained; None where nothing is open."""
    for name, equivalent in causes:
        if equivalent:
            ways = [confounders_of(name).get(e) or confounders_of(e).get(name) or SEPARATING for e in equivalent]
            do = ways[0] if record.has_start else (SEPARATING if "start" in ways[0] else ways[0])
            steps = (START, STEPS) if "start" in do else (f"{do[0].upper()}{do[1:]}.",)
            return Experiment(do, steps, (CATALOGUE[name].name, *equivalent))
    if verdict == "unexplained" and not record.has_start:
        return Experiment(SEPARATING, (START, STEPS), ("unknown",))
    if verdict == "unexplained":
        again = "repeat the recording with voltage probes exchanged (u for v) and, if it can be, at another voltage"
        return Experiment(
            again,
            (START, "Exchange two voltage probes, tell it with --map, and record the same once more."),
            ("unknown",),
        )
    return None
