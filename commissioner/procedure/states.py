"""The one transition table. Every pair of state and event that is not in it is refused.

A run ends in exactly one of commissioned | rejected | aborted | faulted. ABORT and FAULT are legal in every state that
has not ended; an abort is never success.
"""

from __future__ import annotations

from enum import Enum
from types import MappingProxyType


class State(Enum):
    """The value is what the technician reads."""

    IDLE = "idle"
    CONNECTING = "connecting and identifying the drive"
    CHECKING = "checking before energising"
    RESISTANCE = "measuring DC resistance and inverter voltage error"
    EXCITING = "exciting the axis and identifying"
    JUDGING = "judging the result"
    WRITING = "writing the parameters back"
    COMMISSIONED = "commissioned"
    REJECTED = "rejected"
    ABORTED = "aborted"
    FAULTED = "faulted"


class Event(Enum):
    START = "start"
    IDENTIFIED = "drive identified"
    CHECKS_PASSED = "all checks passed"
    CHECK_FAILED = "a check failed"
    MEASURED_BEFORE = "drive idle, the motor was measured before"
    RESISTANCE_KNOWN = "resistance known"
    AXIS_DONE = "axis done, another follows"
    AXES_DONE = "all axes done"
    WRITE_BACK = "verdict: write back"
    KEEP = "verdict: good, writing was not asked for"
    REJECT = "verdict: reject"
    VERIFIED = "written, read back and stored"
    ABORT = "abort"
    FAULT = "fault"


ENDED = frozenset({State.COMMISSIONED, State.REJECTED, State.ABORTED, State.FAULTED})
ENERGISED = frozenset({State.RESISTANCE, State.EXCITING})
"""The only states in which the drive's output may be enabled."""

_COURSE = {
    (State.IDLE, Event.START): State.CONNECTING,
    (State.CONNECTING, Event.IDENTIFIED): State.CHECKING,
    (State.CHECKING, Event.CHECKS_PASSED): State.RESISTANCE,
    (State.CHECKING, Event.CHECK_FAILED): State.REJECTED,
    (State.CHECKING, Event.MEASURED_BEFORE): State.JUDGING,
    (State.RESISTANCE, Event.RESISTANCE_KNOWN): State.EXCITING,
    (State.RESISTANCE, Event.REJECT): State.REJECTED,
    (State.EXCITING, Event.AXIS_DONE): State.RESISTANCE,
    (State.EXCITING, Event.AXES_DONE): State.JUDGING,
    (State.EXCITING, Event.REJECT): State.REJECTED,
    (State.JUDGING, Event.WRITE_BACK): State.WRITING,
    (State.JUDGING, Event.KEEP): State.COMMISSIONED,
    (State.JUDGING, Event.REJECT): State.REJECTED,
    (State.WRITING, Event.VERIFIED): State.COMMISSIONED,
}

TRANSITIONS = MappingProxyType(
    _COURSE
    | {(state, Event.ABORT): State.ABORTED for state in State if state not in ENDED}
    | {(state, Event.FAULT): State.FAULTED for state in State if state not in ENDED}
)


class IllegalTransition(Exception):
    """An event came in a state that has no row for it."""


def follow(state: State, event: Event) -> State:
    """The state after `event`. Raises IllegalTransition where the table has no row."""
    try:
        return TRANSITIONS[state, event]
    except KeyError:
        raise IllegalTransition(f"{event.name} is not legal in {state.name}") from None
