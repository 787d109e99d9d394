"""How a function becomes a rule: its docstring is the claim, its name, with hyphens, the rule's."""

from __future__ import annotations

from collections.abc import Callable

from commissioner.conformance.drive import Drive
from commissioner.conformance.records import Rule, Steps

Course = Callable[[Drive], Steps[None]]
Decorator = Callable[[Course], Course]


def rules_of(source: str, *, energises: bool = False) -> tuple[list[Rule], Decorator]:
    """A list, and the decorator that adds a rule to it. `source`: the section of the interface the rules come from."""
    found: list[Rule] = []

    def add(course: Course) -> Course:
        claim = " ".join((course.__doc__ or "").split()).rstrip(".")
        found.append(Rule(course.__name__.replace("_", "-"), claim, source, energises, course))
        return course

    return found, add
