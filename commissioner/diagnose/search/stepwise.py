"""Forward steps, backward deletion and exchanges, on one record: from no cause to the accepted ones, as records.

Each accepted cause enters with its full shape dictionary (splines, stop operators, rotor branches), so a later step
never has to mend the shape of an earlier one.
"""

from __future__ import annotations

from dataclasses import replace

from commissioner.diagnose.search.adjust import adjusted, with_finer_curves, with_more_to_see
from commissioner.diagnose.search.exchanges import exchange
from commissioner.diagnose.search.forward import backward, forward
from commissioner.diagnose.search.journal import Began
from commissioner.diagnose.search.screening import screen
from commissioner.diagnose.search.state import Problem, State, Steps


def stepwise(state: State, problem: Problem, *, adds: bool = True) -> Steps:
    """From a start that has some causes to one that no step makes better; `adds` False: none is added."""
    yield Began(state.accepted, state.record.samples)
    state = yield from with_finer_curves(state, problem)
    refused: frozenset[str] = frozenset()
    idle: frozenset[str] = frozenset()
    while True:
        state = _screened(state, problem)
        is_over = not adds or len(state.accepted) >= problem.rules.most_causes
        name = None
        if not is_over:
            state, name = yield from forward(state, problem, refused)
        if name is not None:
            state = yield from adjusted(state, problem, name)
            state, dropped = yield from backward(state, problem, state.accepted[:-1])
            refused = idle | dropped
            continue
        state, dropped = yield from backward(state, problem, state.accepted)
        if is_over:
            return state
        if dropped:
            # what it stood for may have another name
            idle |= dropped
            refused |= idle
            continue
        before = state
        state = yield from exchange(state, problem)
        if state.fit is before.fit and state.accepted:
            state = yield from with_more_to_see(state, problem)
        if state.fit is before.fit and state.setting is before.setting:
            return state


def _screened(state: State, problem: Problem) -> State:
    absent = [n for n in problem.names if n not in state.accepted]
    seen = screen(state.model, state.record, state.layout, problem.noise, state.setting, absent)
    return replace(state, screening=seen, first=state.first or seen)
