"""The catalogue of causes, one file each, in rooms by where they act; a new one is a file here, and its test.

Nothing lists them: `CATALOGUE` finds every module that ends with `CAUSE` and puts them in the order of their `place`.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType

from commissioner.diagnose.causes import inverter, iron, machine, sampling, sensors
from commissioner.diagnose.causes.cause import Cause, Confounder, Form
from commissioner.diagnose.causes.setting import Setting

ROOMS = (sampling, sensors, iron, machine, inverter)
"""From the sample back to the source."""


def _in(room: ModuleType) -> list[Cause]:
    modules = (import_module(f"{room.__name__}.{m.name}") for m in iter_modules(room.__path__))
    return sorted((m.CAUSE for m in modules if hasattr(m, "CAUSE")), key=lambda c: c.place)


def _once(items: Iterable[tuple[frozenset[str], Confounder]]) -> dict[frozenset[str], Confounder]:
    """ValueError where a pair is stated twice."""
    out: dict[frozenset[str], Confounder] = {}
    for pair, confounder in items:
        if pair in out or len(pair) != 2:
            raise ValueError(f"{' and '.join(sorted(pair))}: a pair of causes is stated once")
        out[pair] = confounder
    return out


FROM_THE_SAMPLE: tuple[Cause, ...] = tuple(c for room in ROOMS for c in _in(room))
CATALOGUE: dict[str, Cause] = {c.name: c for c in sorted(FROM_THE_SAMPLE, key=lambda c: c.place)}
"""In a fixed order, on which replays and last digits depend."""
CONFOUNDED = _once((frozenset({c.name, x.name}), x) for c in CATALOGUE.values() for x in c.confounders)
"""Every pair of causes that is mistaken for one another, and what is known of it."""
LINEAR = tuple(c.name for c in FROM_THE_SAMPLE if c.family == "linear")
"""Causes that only turn and scale the excited lines: any two of them can look like a third."""
LINES = {c.line: c.name for c in CATALOGUE.values() if c.line}
"""The causes that ride on each kind of mains-bound line."""
MENDED = frozenset(c.name for c in CATALOGUE.values() if c.found_by == "mending")
TOGETHER = frozenset(pair for pair, x in CONFOUNDED.items() if x.is_always_tied)
"""Pairs that every inverter has, and that do the same in most recordings."""
UNRELATED = Confounder("")


def between(one: str, other: str) -> Confounder:
    """What is known of the pair; `UNRELATED` where nothing is."""
    return CONFOUNDED.get(frozenset({one, other}), UNRELATED)


def confounders_of(name: str) -> frozenset[str]:
    return frozenset().union(*(pair for pair in CONFOUNDED if name in pair)) - {name}


__all__ = [
    "CATALOGUE", "CONFOUNDED", "FROM_THE_SAMPLE", "LINEAR", "LINES", "MENDED", "TOGETHER", "UNRELATED", "Cause", "Confounder", "Form",
    "Setting", "between", "confounders_of",
]  # fmt: skip
