"""The transition table, over the whole product of states and events."""

import itertools

import pytest

from commissioner.procedure.states import (
    ENDED,
    ENERGISED,
    TRANSITIONS,
    Event,
    IllegalTransition,
    State,
    follow,
)

ORDINARY = [e for e in Event if e not in (Event.ABORT, Event.FAULT)]
EXPECTED = {
    State.IDLE: {Event.START: State.CONNECTING},
    State.CONNECTING: {Event.IDENTIFIED: State.CHECKING},
    State.CHECKING: {
        Event.CHECKS_PASSED: State.RESISTANCE,
        Event.CHECK_FAILED: State.REJECTED,
        Event.MEASURED_BEFORE: State.JUDGING,
    },
    State.RESISTANCE: {Event.RESISTANCE_KNOWN: State.EXCITING, Event.REJECT: State.REJECTED},
    State.EXCITING: {
        Event.AXIS_DONE: State.RESISTANCE,
        Event.AXES_DONE: State.JUDGING,
        Event.REJECT: State.REJECTED,
    },
    State.JUDGING: {Event.WRITE_BACK: State.WRITING, Event.KEEP: State.COMMISSIONED, Event.REJECT: State.REJECTED},
    State.WRITING: {Event.VERIFIED: State.COMMISSIONED},
}


@pytest.mark.parametrize(("state", "event"), list(itertools.product(State, ORDINARY)))
def test_each_ordinary_event_leads_where_the_procedure_says_or_is_refused(state, event):
    wanted = EXPECTED.get(state, {}).get(event)
    if wanted is None:
        with pytest.raises(IllegalTransition, match=event.name):
            follow(state, event)
    else:
        assert follow(state, event) is wanted


@pytest.mark.parametrize("state", [s for s in State if s not in ENDED])
def test_abort_and_fault_are_legal_in_every_state_that_has_not_ended(state):
    assert follow(state, Event.ABORT) is State.ABORTED
    assert follow(state, Event.FAULT) is State.FAULTED


@pytest.mark.parametrize(("state", "event"), list(itertools.product(sorted(ENDED, key=lambda s: s.name), Event)))
def test_nothing_follows_an_end(state, event):
    with pytest.raises(IllegalTransition):
        follow(state, event)


def test_the_ends_and_the_energised_states_are_these():
    assert {State.COMMISSIONED, State.REJECTED, State.ABORTED, State.FAULTED} == ENDED
    assert {State.RESISTANCE, State.EXCITING} == ENERGISED


def test_an_abort_is_never_success():
    assert not any(b is State.COMMISSIONED for (_, e), b in TRANSITIONS.items() if e in (Event.ABORT, Event.FAULT))
    assert all(e in (Event.VERIFIED, Event.KEEP) for (_, e), b in TRANSITIONS.items() if b is State.COMMISSIONED)


def test_the_table_has_every_ordinary_row_and_no_other():
    ordinary = [event for _, event in TRANSITIONS if event not in (Event.ABORT, Event.FAULT)]
    assert len(ordinary) == sum(len(events) for events in EXPECTED.values())
    assert TRANSITIONS[State.JUDGING, Event.WRITE_BACK] is State.WRITING
