"""Feed an archived run through the pure layers again: the same answers must lead to the same decisions, the same commands
and the same result, bit for bit."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import TypeAdapter

from commissioner.encoding import plain
from commissioner.errors import CommissionerError, DataRefused
from commissioner.link.files.drive_file import archived_profile
from commissioner.procedure.findings import RunEnded
from commissioner.procedure.plan import Job
from commissioner.records import DriveIdentity, DriveStatus, ParameterSnapshot, SampleBlock, WrittenParameter
from commissioner.run.acting import Announcer
from commissioner.run.archive.blocks import BlockDamage, read_blocks
from commissioner.run.archive.documents import damaged, read_saved
from commissioner.run.archive.journal import read_journal
from commissioner.run.runner import JUDGED_REPLIES, kind_of
from commissioner.safety import commands as ask
from commissioner.settings import nameplate_of, plan_of

if TYPE_CHECKING:  # with the estimators behind it: who only reads an archived set starts without them
    from commissioner.procedure.course import Findings


@dataclass(frozen=True)
class Difference:
    """The first decision that came out otherwise."""

    number: int
    archived: Mapping[str, Any] | None
    replayed: Mapping[str, Any] | None

    @property
    def apart(self) -> tuple[str, object, object]:
        """Where it first differs, what was decided again, and what is archived."""
        return apart(self.replayed, self.archived)


def apart(one: object, other: object, place: str = "") -> tuple[str, object, object]:
    """Where two documents first differ, as `record.remarks.0`, and what each has there; None for what one of them lacks."""
    if isinstance(one, dict) and isinstance(other, dict):
        pairs = [(str(key), one.get(key), other.get(key)) for key in (*one, *(key for key in other if key not in one))]
    elif isinstance(one, list | tuple) and isinstance(other, list | tuple):
        pairs = [(str(number), *pair) for number, pair in enumerate(zip_longest(one, other))]
    else:
        return place, one, other
    differing = ((key, a, b) for key, a, b in pairs if a != b)
    key, a, b = next(differing, ("", one, other))
    return apart(a, b, f"{place}.{key}".strip(".")) if key else (place, one, other)


@dataclass(frozen=True)
class Replayed:
    """How many decisions were compared, and the first that differs, if any."""

    decisions: int
    difference: Difference | None

    @property
    def is_identical(self) -> bool:
        return self.difference is None


@dataclass(frozen=True)
class Decided:
    """Progress: decision `number` of `of` was made again."""

    number: int
    of: int


class _ArchiveEnds(Exception):
    pass


_NO_RUNS = (TypeError, ValueError, LookupError, ArithmeticError, AttributeError)
"""What values that no run has had make of whatever thinks with them."""


def replay(folder: Path, *, salvage: bool = False, observe: Callable[[Decided], None] | None = None) -> Replayed:
    """The decisions of the run in `folder`, made again from its archived answers; `observe` is told of each.

    A run that a guard, a fault or the operator ended is compared up to there; with `salvage` a damaged one up to the first
    loss. DataRefused: the folder holds no run.
    """
    from commissioner.procedure.course import Findings
    from commissioner.report.run.summary import summarise

    journal = read_journal(folder / "journal.jsonl")
    if not salvage:
        _check_whole(folder, journal)
    job = read_job(folder, journal)
    if not any(line["kind"] in _DECISIONS for line in journal):
        raise damaged(folder, "journal.jsonl", "no decision behind the job")
    archived = [_decision(line["kind"], line["record"]) for line in journal if _is_compared(line)]
    announcer = Announcer(archived_profile(str(read_saved(folder, "request.json", "profile")["profile"])))
    kinds = {line["kind"] for line in journal}
    is_by_itself = "run_ended" in kinds and "error" not in kinds and not salvage
    if is_by_itself:
        archived += [_end(line["record"]) for line in journal if line["kind"] == "run_ended"]
    findings = Findings()
    again = _decide_again(job, findings, journal, folder, announcer, with_end=is_by_itself)
    replayed, is_alike = _up_to_a_difference(
        archived, again if observe is None else _observed(again, len(archived), observe)
    )
    if is_alike and is_by_itself and (folder / "result.json").is_file():
        formed = summarise(findings, read_end(folder, journal), folder.name, job.parameter_names, job.parameter_factors)
        archived += _result(read_saved(folder, "result.json"), formed)
        replayed += _result(formed, formed)
    difference = _first_difference(archived, replayed, may_go_on=not is_by_itself or salvage, may_end=salvage)
    return Replayed(len(replayed) if salvage else len(archived), difference)


def _observed(again: Iterator[dict[str, Any]], of: int, observe: Callable[[Decided], None]) -> Iterator[dict[str, Any]]:
    for number, decision in enumerate(again, 1):
        observe(Decided(min(number, of), of))
        yield decision


def _is_compared(line: Mapping[str, Any]) -> bool:
    """Decisions, and what was announced as their commands were carried out; what the link adds to a command is not."""
    if line["kind"] != "about_to":
        return line["kind"] in _DECISIONS
    record = line["record"] if isinstance(line["record"], dict) else {}
    if record.get("action") == "prepare":
        return not {"mode", "control_word"} & set(record.get("values") or ())
    return record.get("action") in ("steer", "energise")


def _result(document: Mapping[str, Any], formed: Mapping[str, Any]) -> list[dict[str, Any]]:
    """What of a result stands in the run: not the folder's name, nor what a diagnosis added afterwards."""
    kept = {**_as_read(document), "remarks": _as_read(document.get("remarks") or ())[: len(formed["remarks"])]}
    return [_decision("result", {key: value for key, value in kept.items() if key not in ("run", "diagnosis")})]


def _as_read(value: Any) -> Any:
    """As it is read back from a file."""
    return json.loads(json.dumps(plain(value)))


def _check_whole(folder: Path, journal: list[dict[str, Any]]) -> None:
    """DataRefused: a line before the last is no record, or the numbers have a gap. A kill tears only the last line."""
    path = folder / "journal.jsonl"
    lines = path.read_text("utf-8", errors="replace").split("\n") if path.is_file() else []
    if len(journal) < len(lines) - 1:
        raise damaged(folder, path.name, f"line {len(journal) + 1} of {len(lines) - 1} is no record")
    for number, line in enumerate(journal):
        if line.get("n") != number:
            raise damaged(folder, path.name, f"record {line.get('n')} where {number} belongs")


def read_end(folder: Path, journal: list[dict[str, Any]]) -> RunEnded:
    """How the run ended, of a journal that says so. DataRefused: damaged."""
    record = next(line["record"] for line in journal if line["kind"] == "run_ended")
    try:
        return RunEnded(**record)
    except TypeError as error:
        raise damaged(folder, "journal.jsonl", f"its end: {error}") from error


def _end(record: Any) -> dict[str, Any]:
    """How a run ended by itself; the time under voltage is the runner's to count."""
    ended = record if isinstance(record, dict) else {}
    return _decision("run_ended", {key: ended.get(key) for key in ("outcome", "reason")})


def learn_again(folder: Path) -> tuple[Job, Findings]:
    """The job of a run, and all that it had learnt by its end, also where it was cut off. DataRefused as `replay`."""
    from commissioner.procedure.course import Findings

    journal = read_journal(folder / "journal.jsonl")
    job, findings = read_job(folder, journal), Findings()
    for _ in _decide_again(job, findings, journal, folder):
        pass
    return job, findings


def read_job(folder: Path, journal: list[dict[str, Any]]) -> Job:
    """What the run was to do, from its journal."""
    record = next((line["record"] for line in journal if line["kind"] == "job"), None)
    if record is None:
        raise DataRefused(
            f"{folder.name} cannot be replayed", step="replay", value="no job in the journal",
            limit="a run that reached its drive and tested the motor", remedy="replay another run",
        )  # fmt: skip
    try:
        return _job(record, f"{folder.name}/journal.jsonl")
    except (CommissionerError, *_NO_RUNS) as error:
        raise damaged(folder, "journal.jsonl", f"its job: {error}") from error


_DECISIONS = frozenset(
    {
        "state_entered", "drive_identified", "checks_judged", "link_planned", "first_current_seen", "staircase_fitted", "first_look",
        "excitation_chosen",
        "bias_chosen", "estimate_updated", "guard_acted", "axis_finished", "verdict_reached", "step_progress",
    }
)  # fmt: skip


def _decision(kind: str, record: object) -> dict[str, Any]:
    return {"kind": kind, "record": record}


def _decide_again(
    job: Job,
    findings: Findings,
    journal: list[dict[str, Any]],
    folder: Path,
    announcer: Announcer | None = None,
    *,
    with_end: bool = False,
) -> Iterator[dict[str, Any]]:
    from commissioner.procedure.course import course

    replies = iter([line["record"] for line in journal if line["kind"] == "reply"])
    blocks = _blocks_to_the_first_loss(folder / "blocks.bin")
    steps, reply = course(job, findings), None
    try:
        while True:
            command = steps.send(reply)
            if isinstance(command, ask.Tell):
                yield _as_read(_decision(kind_of(command.record), command.record))
            for intent in announcer.announced(command) if announcer else ():
                yield _as_read(_decision("about_to", intent))
            reply = _answer(command, replies, blocks)
    except StopIteration as stop:
        if with_end:
            yield _end(plain(stop.value))
    except (_ArchiveEnds, CommissionerError):
        return
    except _NO_RUNS as error:
        raise damaged(folder, "journal.jsonl", f"its answers: {type(error).__name__}: {error}") from error


def _blocks_to_the_first_loss(path: Path) -> Iterator[SampleBlock]:
    damage: list[BlockDamage] = []
    for _, block in read_blocks(path, damage):
        if damage:
            return
        yield block


def _answer(command: ask.Command, replies: Iterator[dict[str, Any]], blocks: Iterator[Any]) -> Any:
    if isinstance(command, ask.Fetch):
        block = next(blocks, None)
        if block is None:
            raise _ArchiveEnds
        return block
    if not isinstance(command, JUDGED_REPLIES):
        return None
    held = next(replies, None)
    if not isinstance(held, dict) or held.get("command") != type(command).__name__:
        raise _ArchiveEnds
    try:
        return _READ[held["command"]](held["reply"])
    except _NO_RUNS:  # cut short or changed: it is compared up to here
        raise _ArchiveEnds from None


def _up_to_a_difference(
    archived: list[dict[str, Any]], again: Iterator[dict[str, Any]]
) -> tuple[list[dict[str, Any]], bool]:
    """What is decided again, up to the first that differs: what comes behind that costs a minute and tells nothing."""
    replayed: list[dict[str, Any]] = []
    for decision in again:
        replayed.append(decision)
        if archived[len(replayed) - 1 : len(replayed)] != [decision]:
            return replayed, False
    return replayed, True


def _first_difference(
    archived: list[dict[str, Any]], replayed: list[dict[str, Any]], *, may_go_on: bool, may_end: bool
) -> Difference | None:
    for number, (old, new) in enumerate(zip(archived, replayed, strict=False)):
        if old != new:
            return Difference(number, old, new)
    if len(replayed) < len(archived) and not may_end:
        return Difference(len(replayed), archived[len(replayed)], None)
    if len(replayed) > len(archived) and not may_go_on:
        return Difference(len(archived), None, replayed[len(archived)])
    return None


def _job(record: Mapping[str, Any], source: str) -> Job:
    """Held to what a motor's and a procedure's file are held to: nobody can have asked for another one."""
    plan = dict(record["plan"])
    axes = {"orientations_deg": plan.pop("axes_deg"), "repeat_first": plan.pop("repeat_first")}
    return TypeAdapter(Job).validate_python(
        {
            **record,
            "plan": plan_of({"axes": axes, **plan}, source),
            "nameplate": nameplate_of(record["nameplate"], source),
            "drive_limits": {
                k: _number(v, -math.inf if "_min_" in k else math.inf) for k, v in record["drive_limits"].items()
            },
        }
    )


def _number(value: Any, otherwise: float) -> Any:
    return otherwise if value is None else value


def _status(record: Mapping[str, Any]) -> DriveStatus:
    return DriveStatus(**{k: _number(v, math.nan) for k, v in record.items()})


def _snapshot(record: Mapping[str, Any]) -> ParameterSnapshot:
    return ParameterSnapshot(**(dict(record) | {"identity": DriveIdentity(**record["identity"])}))


def read_snapshot(folder: Path, journal: list[dict[str, Any]]) -> ParameterSnapshot:
    """The snapshot a run archived before it wrote anything. DataRefused: damaged, or not as its `journal` has it.

    A run that was killed between the two copies has only the first; it wrote nothing.
    """
    document = read_saved(folder, "snapshot.json", "identity", "in_use", "stored")
    taken = [
        line["record"]["reply"]
        for line in journal
        if line["kind"] == "reply"
        and isinstance(line["record"], dict)
        and line["record"].get("command") == "TakeSnapshot"
    ]
    if taken and document != taken[-1]:
        raise damaged(folder, "snapshot.json", _otherwise(document, taken[-1]))
    try:
        return _checked(_snapshot(document))
    except (TypeError, ValueError, AttributeError) as error:
        raise damaged(folder, "snapshot.json", str(error)) from error


def _otherwise(saved: Mapping[str, Any], journalled: Any) -> str:
    """The first place where the file and the run's journal differ."""
    for key, here in saved.items():
        there = journalled.get(key) if isinstance(journalled, dict) else None
        if here == there:
            continue
        if isinstance(here, dict) and isinstance(there, dict):
            name = next(name for name in (*here, *there) if here.get(name) != there.get(name) or name not in here)
            return f"{key}.{name} = {here.get(name)}, in journal.jsonl {there.get(name)}"
        return f"{key} = {here}, in journal.jsonl {there}"
    return "without a key that journal.jsonl has"


def _checked(snapshot: ParameterSnapshot) -> ParameterSnapshot:
    """Refuse what is no set of finite numbers: it is going to be written into a drive."""
    for name, value in (*snapshot.in_use.items(), *snapshot.stored.items()):
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise ValueError(f"{name} = {value!r}")
    return snapshot


_READ: dict[str, Callable[[Any], Any]] = {
    "Identify": lambda record: DriveIdentity(**record),
    "ReadNameplate": dict,
    "ReadStatus": _status,
    "Supervise": _status,
    "TakeSnapshot": _snapshot,
    "WriteParameters": lambda rows: tuple(WrittenParameter(**row) for row in rows),
}
