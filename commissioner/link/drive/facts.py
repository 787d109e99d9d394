"""What the inverter says about itself: intents before it acts, reports after."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum

from commissioner.records import WrittenParameter
from commissioner.registers.codec import Value


class Action(Enum):
    """What an intent is about to do."""

    PREPARE = "set up the drive"
    ENERGISE = "energise the motor"
    STEER = "change the live excitation"
    STAGE = "stage motor parameters"
    COMMIT = "bring the staged parameters into use"
    STORE = "store the parameters in non-volatile memory"
    TUNE = "let the drive tune itself"


@dataclass(frozen=True)
class Intent:
    """Journalled before the act: the items about to be written, by name, in the items' units."""

    action: Action
    values: Mapping[str, Value]


Journal = Callable[[Intent], None]


def keep_no_journal(_: Intent) -> None:
    """For tests and for verbs that neither energise nor write."""


@dataclass(frozen=True)
class Attempt:
    """One way the drive was told to stop, and what came of it."""

    path: str
    outcome: str


@dataclass(frozen=True)
class DisarmReport:
    """How de-energising went. `is_confirmed`: the drive's own status said that its output is blocked."""

    is_confirmed: bool
    state: str
    attempts: tuple[Attempt, ...]
    waited_for_watchdog: bool


@dataclass(frozen=True)
class WriteReport:
    """What a write-back or a restore changed. `written` is empty where the drive had the values already."""

    written: tuple[WrittenParameter, ...]
    is_stored: bool
    store_count_before: int | None
    store_count_after: int | None
    endurance_writes: int | None
    fault: str = ""
    """What the drive reports now that it is done; empty: no fault, or no register that would tell."""

    @property
    def wear_fraction(self) -> float | None:
        """Part of the non-volatile memory's rated life that is used up."""
        if self.store_count_after is None or not self.endurance_writes:
            return None
        return self.store_count_after / self.endurance_writes
