"""The whole run: follow the transition table, one step generator per state, until a state that has ended."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any

from commissioner.procedure.energised.excite import excite
from commissioner.procedure.energised.staircase import measure_resistance
from commissioner.procedure.findings import RunEnded
from commissioner.procedure.plan import Job
from commissioner.procedure.states import State
from commissioner.procedure.steps import Findings, Step, check, connect, judge, through, write
from commissioner.safety.commands import Command

__all__ = ["Findings", "Job", "course"]

_STEPS: dict[State, Callable[[Job, Findings], Step]] = {
    State.CONNECTING: connect,
    State.CHECKING: check,
    State.RESISTANCE: measure_resistance,
    State.EXCITING: excite,
    State.JUDGING: judge,
    State.WRITING: write,
}


def course(job: Job, findings: Findings) -> Generator[Command, Any, RunEnded]:
    """Yields every command of a run; what it learns is in `findings`, also when it is stopped half-way."""
    return (yield from through(_STEPS, job, findings))
