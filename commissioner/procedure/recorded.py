"""Write-back of a motor that was measured before, offline: check, judge and write; nothing here can energise."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any

from commissioner.procedure.checks import check_failed, judge_idle
from commissioner.procedure.findings import ChecksJudged, RunEnded
from commissioner.procedure.plan import Job
from commissioner.procedure.states import Event, State
from commissioner.procedure.steps import Findings, Step, connect, through, told, write
from commissioner.procedure.verdict import Decision, decide, evidence_of, match_of
from commissioner.records import DriveStatus
from commissioner.safety.commands import Command, ReadNameplate, ReadStatus, TakeSnapshot, Tell


def recorded_course(job: Job, findings: Findings) -> Generator[Command, Any, RunEnded]:
    """As `course`, for a job whose `findings.identification` came from a recording."""
    return (yield from through(_STEPS, job, findings))


def _check(job: Job, findings: Findings) -> Step:
    """The drive is idle and set up for this motor; what it holds is archived."""
    plate = yield ReadNameplate()
    status: DriveStatus = yield ReadStatus()
    findings.checks = judge_idle(status, plate, job.nameplate)
    yield Tell(ChecksJudged(findings.checks))
    failure = check_failed(findings.checks)
    if failure is not None:
        raise failure
    findings.snapshot = yield TakeSnapshot()
    return Event.MEASURED_BEFORE


def _judge(job: Job, findings: Findings) -> Step:
    assert findings.identification is not None
    evidence = evidence_of(findings.identification)
    verdict = decide(evidence, job.nameplate, job.plan.acceptance, write_back=job.write_back)
    findings.verdict, findings.plate_match = verdict, match_of(evidence.combined, job.nameplate)
    yield Tell(told(verdict))
    return Event.WRITE_BACK if verdict.decision is Decision.WRITE_BACK else Event.REJECT


_STEPS: dict[State, Callable[[Job, Findings], Step]] = {
    State.CONNECTING: connect,
    State.CHECKING: _check,
    State.JUDGING: _judge,
    State.WRITING: write,
}
