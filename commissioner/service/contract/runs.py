"""Runs: begun, listed, going on, stopped, and what became of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field
from typing_extensions import TypedDict

from commissioner.encoding import JsonObject
from commissioner.identify.contract import Measured
from commissioner.report.run.contract import RunDocument
from commissioner.service.contract.live import LiveDocument


class Health(TypedDict):
    """`runs_live`: ids of the runs that go on; `is_warm`: the first run need not compile."""

    status: str
    version: str
    runs_live: list[str]
    is_warm: bool


class Begun(TypedDict):
    """`url`: the run's page."""

    id: str
    url: str


class Answered(TypedDict):
    """What was said to question `number` of a tuning."""

    run: str
    number: int
    done: bool


@dataclass(frozen=True)
class Stopped:
    """What became of a STOP. `after_s`: from the asking until the service had read the journalled word of the drive; 0 where it was off before.
    `asked_utc` None: the run had ended before."""

    run: str
    asked_utc: str | None
    zero_volts: bool
    confirmed_utc: str | None
    after_s: float
    state: str


class StopsDocument(TypedDict):
    stopped: list[Stopped]


class RunRow(TypedDict):
    """One line of the archive. `holds`: which set the drive holds; `parameters`: null where the run did not get so far."""

    run: str
    utc: str
    motor: str
    nameplate: str
    drive: str
    person: str
    outcome: str
    standing: str
    reason: str
    energised_s: float | None
    holds: str
    parameters: Mapping[str, Measured] | None


class RunsDocument(TypedDict):
    """Newest first."""

    runs: list[RunRow]


class RunGoingOn(TypedDict):
    """A run without a result yet."""

    run: str
    outcome: None
    live: LiveDocument


class RunWithoutResult(TypedDict):
    """What the journal says of a run that left none."""

    run: str
    outcome: str
    reason: str
    energised_s: float | None
    parameters: None
    written: list[str]
    holds: str


AsArchived = Annotated[
    JsonObject, Field(description="A result of another version, or of a drive's own tuning, as it lies in the archive.")
]
RunAnswer = RunDocument | RunGoingOn | RunWithoutResult | AsArchived
