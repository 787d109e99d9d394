"""Run rules one after the other over whatever answers requests, and judge them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator

from commissioner.conformance.drive import Drive
from commissioner.conformance.records import (
    Ask,
    Broken,
    Exchange,
    NotTested,
    Outcome,
    Reply,
    RuleResult,
    Steps,
    T,
    Wait,
)
from commissioner.conformance.registry import Rule

KEPT = 4
"""Exchanges shown with a result: the deciding one and what led to it."""
Perform = Callable[[Ask | Wait], Reply]


class Recorder:
    """Performs requests and keeps the last of them."""

    def __init__(self, perform: Perform) -> None:
        self._perform = perform
        self.requests = 0
        self.last: deque[Exchange] = deque(maxlen=KEPT)

    def run(self, steps: Steps[T]) -> T:
        """Carry a course of requests out; what it returns."""
        reply = Reply()
        try:
            step = next(steps)
            while True:
                reply = self._perform(step)
                if isinstance(step, Ask):
                    self.requests += 1
                    answer = reply.pdu.hex() if reply.pdu is not None else ""
                    self.last.append(Exchange(reply.at_s, step.pdu.hex(), answer, reply.took_s))
                step = steps.send(reply)
        except StopIteration as end:
            result: T = end.value
            return result


def judge(
    rules: Iterable[Rule], drive: Drive, perform: Perform, why_not: Callable[[Rule], str]
) -> Iterator[RuleResult]:
    """One result per rule, as they end. `why_not` names a reason not to try a rule, empty where there is none.

    After every rule that energises, the output is switched off and faults are reset before the next begins.
    """
    for rule in rules:
        recorder = Recorder(perform)
        outcome, reason = _judged(rule, drive, recorder, why_not(rule))
        evidence, requests = tuple(recorder.last), recorder.requests
        if rule.energises and requests:
            reason_after = _made_safe(drive, recorder)
            if reason_after and outcome is Outcome.PASS:
                outcome, reason, evidence = Outcome.FAIL, reason_after, tuple(recorder.last)
        yield RuleResult(rule.name, rule.claim, rule.source, rule.energises, outcome, reason, requests, evidence)


def _judged(rule: Rule, drive: Drive, recorder: Recorder, why_not: str) -> tuple[Outcome, str]:
    if why_not:
        return Outcome.NOT_TESTED, why_not
    try:
        recorder.run(rule.steps(drive))
    except Broken as broken:
        return Outcome.FAIL, str(broken)
    except NotTested as reason:
        return Outcome.NOT_TESTED, str(reason)
    return Outcome.PASS, ""


def _made_safe(drive: Drive, recorder: Recorder) -> str:
    try:
        recorder.run(drive.make_safe())
    except Broken as broken:
        return f"the drive could not be made safe after it: {broken}"
    return ""
