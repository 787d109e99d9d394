"""A drive's own standstill autotune as its file describes it: steps over registers, and what must be known before any of them.

Two forms. *remote*: the tool starts, watches and ends it; only where the standstill value, the start, what says finished and
failed, and the stop each have a source. *assisted*: a person starts it at the drive; nothing that energises leaves the tool.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

FACTS = ("standstill", "start", "finished", "failed", "stop")
REPEATS, MOST_REPEATS = 3, 20
"""How often a drive is let tune itself, where nobody says otherwise and at most."""
NO_VALUES: Mapping[int, str] = MappingProxyType({})


@dataclass(frozen=True)
class Fact:
    """A register's raw value that means something, and who said so."""

    item: str
    value: int
    source: str


@dataclass(frozen=True)
class Step:
    """One step. `expect`: the item must hold `value` under `mask`. `write`: the item, by one request, never repeated where
    `once`. `await`: until the item is one of `done`, meanwhile one of `busy`; `failed`: value -> what it means. `ask`: a
    person does `text` and says so."""

    do: str
    item: str = ""
    value: int = 0
    mask: int = 0xFFFF
    done: tuple[int, ...] = ()
    busy: tuple[int, ...] = ()
    failed: Mapping[int, str] = field(default_factory=lambda: NO_VALUES)
    within_s: float = 1.0
    every_s: float = 0.1
    once: bool = False
    why: str = ""
    text: str = ""


@dataclass(frozen=True)
class Limit:
    """An item looked at all the while: more than `most` counts either way ends the tuning."""

    item: str
    most: int
    why: str


@dataclass(frozen=True)
class Tuning:
    """The table [tune]. `proved_on`: models and firmware on which this really ran; empty: none."""

    form: str
    energises: str
    results: tuple[str, ...]
    also_changes: tuple[str, ...]
    longest_s: float
    pause_s: float
    source: str
    proved_on: tuple[str, ...]
    facts: Mapping[str, Fact]
    steps: tuple[Step, ...]
    finally_: tuple[Step, ...]
    watch: tuple[Limit, ...] = ()

    @property
    def proof(self) -> str:
        """On what this was proved, as the screen says it."""
        return "proved on " + ", ".join(self.proved_on) if self.proved_on else "proved on no physical drive yet"
