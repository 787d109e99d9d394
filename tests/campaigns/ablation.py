"""Which choices each rule of the search makes, from the journals of diagnoses and without a fit.

    python -m tests.campaigns.ablation runs/*/diagnosis.json

For every threshold the number of choices that are made otherwise where it asks for nothing (0) and for ten times as much, and the
first of them: what is printed there was chosen by this rule. A journal does not ask the rules of what is refined and of what is
named in the end: these are listed.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

from commissioner.diagnose.rules import RULES, Rules
from commissioner.diagnose.search.journal import Step, read, replayed


def changed(steps: Sequence[Step], name: str, factor: float) -> tuple[str, ...]:
    """Choices of a journal that are made otherwise with this rule times the factor."""
    value = getattr(RULES, name)
    return replayed(steps, replace(RULES, **{name: type(value)(factor * value)})).differs


def asked(steps: Sequence[Step]) -> set[str]:
    """The rules that the choices of a journal depend on at all."""
    seen: set[str] = set()

    class Overheard(Rules):
        def __getattribute__(self, name: str) -> object:
            seen.add(name)
            return super().__getattribute__(name)

    replayed(steps, Overheard())
    return seen & {rule.name for rule in fields(Rules)}


def main(paths: Sequence[str]) -> None:
    journals = [read(json.loads(Path(p).read_text(encoding="utf-8"))["search"]) for p in paths]
    judges = set().union(*map(asked, journals))
    for rule in (r for r in fields(Rules) if r.name in judges):
        found = [[d for j in journals for d in changed(j, rule.name, factor)] for factor in (0.0, 10.0)]
        first = next((some[0] for some in found if some), "")
        print(f"{rule.name:26} {getattr(RULES, rule.name):9.4g}  {len(found[0]):4d} {len(found[1]):4d}  {first}")
        print(f"{'':26} {rule.metadata['decides']}")
    print(f"not asked by these journals: {', '.join(r.name for r in fields(Rules) if r.name not in judges)}")


if __name__ == "__main__":
    main(sys.argv[1:])
