"""A rule, and how a function becomes one: its docstring is the claim, its name, with hyphens, the rule's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from commissioner.conformance.drive import Drive
from commissioner.conformance.records import Steps

Course = Callable[[Drive], Steps[None]]
Decorator = Callable[[Course], Course]


@dataclass(frozen=True)
class Rule:
    """`name` is what a report and a script hold on to; `claim` what a conforming drive does; `source` where it is asked for."""

    name: str
    claim: str
    source: str
    energises: bool
    steps: Course


def rules_of(source: str, *, energises: bool = False) -> tuple[list[Rule], Decorator]:
    """A list, and the decorator that adds a rule to it. `source`: the section of the interface the rules come from."""
    found: list[Rule] = []

    def add(course: Course) -> Course:
        claim = " ".join((course.__doc__ or "").split()).rstrip(".")
        found.append(Rule(course.__name__.replace("_", "-"), claim, source, energises, course))
        return course

    return found, add
