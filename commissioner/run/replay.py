"""Feed an archived run through the pure layers again: the same answers must lead to the same decisions, bit for bit."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from commissioner.errors import CommissionerError, DataRefused
from commissioner.motor.nameplate import Nameplate
from commissioner.procedure.checks import DriveLimits
from commissioner.procedure.course import Findings, Job, course
from commissioner.procedure.plan import Acceptance, ExcitationPlan, Limits, ProcedurePlan, Supervision
from commissioner.records import DriveIdentity, DriveStatus, ParameterSnapshot, WrittenParameter
from commissioner.run.archive import plain, read_blocks, read_journal
from commissioner.run.runner import JUDGED_REPLIES, kind_of
from commissioner.safety import commands as ask


@dataclass(frozen=True)
class Difference:
    """The first decision that came out otherwise."""

    number: int
    archived: Mapping[str, Any] | None
    replayed: Mapping[str, Any] | None


@dataclass(frozen=True)
class Replayed:
    """How many decisions were compared, and the first that differs, if any."""

    decisions: int
    difference: Difference | None

    @property
    def is_identical(self) -> bool:
        return self.difference is None


class _ArchiveEnds(Exception):
    pass


def replay(folder: Path) -> Replayed:
    """The decisions of the run in `folder`, made again from its archived answers.

    A run that a guard, a fault or the operator ended is compared up to there. DataRefused: the folder holds no run.
    """
    journal = read_journal(folder / "journal.jsonl")
    job = next((line["record"] for line in journal if line["kind"] == "job"), None)
    if job is None:
        raise DataRefused(
            f"{folder.name} cannot be replayed", step="replay", value="no job in the journal",
            limit="a run that reached its drive", remedy="replay another run",
        )  # fmt: skip
    archived = [_decision(line["kind"], line["record"]) for line in journal if line["kind"] in _DECISIONS]
    replayed = list(_decide_again(_job(job), journal, folder))
    return Replayed(len(archived), _first_difference(archived, replayed))


_DECISIONS = frozenset(
    {
        "state_entered", "drive_identified", "checks_judged", "staircase_fitted", "first_look", "excitation_chosen",
        "estimate_updated", "guard_acted", "axis_finished", "verdict_reached", "step_progress",
    }
)  # fmt: skip


def _decision(kind: str, record: Mapping[str, Any]) -> dict[str, Any]:
    return {"kind": kind, "record": record}


def _decide_again(job: Job, journal: list[dict[str, Any]], folder: Path) -> Iterator[dict[str, Any]]:
    replies = iter([line["record"] for line in journal if line["kind"] == "reply"])
    blocks = (block for _, block in read_blocks(folder / "blocks.bin"))
    steps, reply = course(job, Findings()), None
    try:
        while True:
            command = steps.send(reply)
            if isinstance(command, ask.Tell):
                yield json.loads(json.dumps(_decision(kind_of(command.record), plain(command.record))))
            reply = _answer(command, replies, blocks)
    except (StopIteration, _ArchiveEnds, CommissionerError):
        return


def _answer(command: ask.Command, replies: Iterator[dict[str, Any]], blocks: Iterator[Any]) -> Any:
    if isinstance(command, ask.Fetch):
        block = next(blocks, None)
        if block is None:
            raise _ArchiveEnds
        return block
    if not isinstance(command, JUDGED_REPLIES):
        return None
    held = next(replies, None)
    if held is None or held["command"] != type(command).__name__:
        raise _ArchiveEnds
    return _READ[held["command"]](held["reply"])


def _first_difference(archived: list[dict[str, Any]], replayed: list[dict[str, Any]]) -> Difference | None:
    for number, (old, new) in enumerate(zip(archived, replayed, strict=False)):
        if old != new:
            return Difference(number, old, new)
    if len(replayed) < len(archived):
        return Difference(len(replayed), archived[len(replayed)], None)
    return None


def _job(record: Mapping[str, Any]) -> Job:
    plan = record["plan"]
    return Job(
        plan=ProcedurePlan(
            axes_deg=tuple(plan["axes_deg"]), repeat_first=plan["repeat_first"],
            supervision=Supervision(**plan["supervision"]), limits=Limits(**plan["limits"]),
            excitation=ExcitationPlan(**plan["excitation"]), acceptance=Acceptance(**plan["acceptance"]),
        ),
        nameplate=Nameplate(**record["nameplate"]),
        drive_limits=DriveLimits(
            **{k: _number(v, -math.inf if "_min_" in k else math.inf) for k, v in record["drive_limits"].items()}
        ),
        parameter_names=record["parameter_names"],
        write_back=record["write_back"],
        link_latency_s=record["link_latency_s"],
    )  # fmt: skip


def _number(value: Any, otherwise: float) -> Any:
    return otherwise if value is None else value


def _status(record: Mapping[str, Any]) -> DriveStatus:
    return DriveStatus(**{k: _number(v, math.nan) for k, v in record.items()})


def _snapshot(record: Mapping[str, Any]) -> ParameterSnapshot:
    return ParameterSnapshot(**(dict(record) | {"identity": DriveIdentity(**record["identity"])}))


def read_snapshot(path: Path) -> ParameterSnapshot:
    """The snapshot a run archived before it wrote anything."""
    return _snapshot(json.loads(path.read_text("utf-8")))


_READ: dict[str, Callable[[Any], Any]] = {
    "Identify": lambda record: DriveIdentity(**record),
    "ReadNameplate": dict,
    "ReadStatus": _status,
    "TakeSnapshot": _snapshot,
    "WriteParameters": lambda rows: tuple(WrittenParameter(**row) for row in rows),
}
