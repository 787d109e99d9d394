"""The interpreter of a drive file's [tune]: four kinds of steps, and the last ones that always run. No vendor is known here.

A start is never repeated: where its answer is lost the status is read. A status that is neither done, busy nor failed ends
it. Every look at the status is a request, by which a drive whose watchdog counts requests is fed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Protocol

from commissioner.errors import (
    Aborted,
    CheckFailed,
    CommissionerError,
    DriveFault,
    LinkError,
    ReplyMismatch,
    ReplyTimeout,
)
from commissioner.link.drive.facts import Action, Intent, Journal
from commissioner.link.drive.items import Items, number
from commissioner.link.drive.ordinary.insisting import ATTEMPTS, is_lost
from commissioner.link.drive.ordinary.unlocking import unlocked
from commissioner.link.drive.reading import read_status
from commissioner.records import plain_name
from commissioner.registers.profile import DriveProfile
from commissioner.registers.status import DriveState
from commissioner.registers.tuning import Step, Tuning

BEGIN_S = 2.0
"""So long a status may stand as before the start; then the drive has not begun."""
APART_S = 0.5
"""Between the two readings of a result."""
REST = "tune: finally"
"""The step of a failure to see the drive at rest at the end."""
LOST_ANSWERS = 3
"""In a row, while a tuning is watched: then the link counts as lost and the drive is stopped by every path."""


class Operator(Protocol):
    """The person at the drive."""

    def does(self, text: str) -> bool:
        """Asked to do `text`; False: not done, or not wanted."""
        ...

    def wants_stop(self) -> str:
        """Why everything is to stop; empty while nobody wants it."""
        ...


@dataclass(frozen=True)
class Tuned:
    """One tuning that ended as it should: the results by item name, read twice alike, and how long it took."""

    values: Mapping[str, float]
    seconds: float


class _Awaited:
    """What one awaited item has shown so far; `before`: as it stood before the start, None where nothing was started."""

    def __init__(self, step: Step, before: int | None, start_s: float, lost: LinkError | None) -> None:
        self._step, self._before, self._start_s, self._lost = step, before, start_s, lost
        self._has_begun = before is None
        self._first: int | None = None

    def is_over(self, seen: int, now_s: float) -> bool:
        """True: done. DriveFault: failed or too long. Aborted: it did not begin, or shows what nobody listed."""
        step, waited_s = self._step, now_s - self._start_s
        self._first = seen if self._first is None else self._first
        if seen in step.failed:
            raise DriveFault(
                f"the drive says that it failed: {step.failed[seen]}", step="tune: await", value=seen,
                limit=f"{step.item} one of {list(step.done)}", remedy="see the drive's manual for this failure; check plate and wiring",
            )  # fmt: skip
        if seen in step.done and (self._has_begun or seen != self._before):
            return True
        if seen in step.busy:
            self._has_begun = True
        elif not self._has_begun and seen == self._before:
            if waited_s > BEGIN_S:
                raise self._not_begun(seen)
        elif step.busy or seen != self._first:
            raise Aborted(
                f"{step.item} is {seen}, which nobody listed: it was ended at the drive, or is another drive than its file says",
                step="tune: await", value=seen, limit=f"one of {sorted({*step.done, *step.busy})}",
                remedy="look at the drive's display; then tune again",
            )  # fmt: skip
        if waited_s > step.within_s:
            raise DriveFault(
                f"{step.item} did not come to an end", step="tune: await", value=seen,
                limit=f"one of {list(step.done)} within {step.within_s:g} s", remedy="look at the drive's display",
            )  # fmt: skip
        return False

    def _not_begun(self, seen: int) -> CommissionerError:
        """Of a start that nobody answered the link is what failed."""
        if self._lost is None:
            return Aborted(
                "the drive did not begin to tune", step="tune: await", value=seen, limit=f"another status within {BEGIN_S:g} s",
                remedy="the start is not repeated: look at the drive, then tune again",
            )  # fmt: skip
        return DriveFault(
            "the drive did not answer the command to tune, and did not begin", step="tune: await", value=self._lost.value,
            limit=self._lost.limit, remedy=f"the start is not repeated: look at the drive, then tune again; {self._lost.remedy}",
        )  # fmt: skip


def _not_ready(step: Step, seen: int) -> CheckFailed:
    return CheckFailed(
        f"the drive is not ready to tune: {step.item} is {seen:#06x}", step="tune: expect", value=seen,
        limit=f"{step.value:#06x}" + (f": {step.why}" if step.why else ""), remedy=step.why or "see the drive's manual",
    )  # fmt: skip


class Tuner:
    """Lets one drive tune itself, once a call."""

    def __init__(
        self,
        items: Items,
        tuning: Tuning,
        operator: Operator,
        journal: Journal,
        *,
        sleep: Callable[[float], None],
        clock: Callable[[], float],
    ) -> None:
        self._items, self._tuning, self._operator, self._journal = items, tuning, operator, journal
        self._sleep, self._clock = sleep, clock
        self._shows_by_s: dict[str, float] = {}
        """Until when each item that was written shows it."""
        self._before: int | None = None
        """The status that is awaited, as it stood before the start."""
        self._lost: LinkError | None = None
        """What took the start's answer."""

    @property
    def profile(self) -> DriveProfile:
        return self._items.profile

    def once(self) -> Tuned:
        """CheckFailed: a condition did not hold and nothing was started. Aborted: a person or a status nobody listed.
        DriveFault: it failed, hung, or the drive is not at rest after it. However it ends, the last steps have run."""
        began = self._clock()
        self._journal(Intent(Action.TUNE, dict.fromkeys(self._tuning.results, "by the drive itself")))
        self._check_no_fault()
        with self._unlocked():
            self._go_through_steps()
        return Tuned(self._results(), self._clock() - began)

    def _unlocked(self) -> AbstractContextManager[None]:
        """The drive as it is where no step writes: a person at the keypad needs no unlock over the bus."""
        writes = any(step.do == "write" for step in self._tuning.steps)
        return unlocked(self._items.port, self.profile) if writes else nullcontext()

    def _go_through_steps(self) -> None:
        error: BaseException | None = None
        try:
            for index, step in enumerate(self._tuning.steps):
                self._perform(step, index)
            self._check_no_fault()
        except BaseException as failure:
            error = failure
            raise
        finally:
            self._end(error)

    # --- steps ------------------------------------------------------------------------------------------------------
    def _perform(self, step: Step, index: int) -> None:
        if step.do == "expect":
            self._expect(step)
        elif step.do == "write":
            self._write(step, index)
        elif step.do == "ask":
            self._ask(step.text)
        else:
            self._await(step)

    def _expect(self, step: Step) -> None:
        """What was written just now may show late, as in a write-back: it is waited for as long as the drive's file grants."""
        end_s = self._shows_by_s.get(step.item, -math.inf)
        while (seen := self._raw(step.item) & step.mask) != step.value & step.mask:
            if self._clock() >= end_s:
                raise self._not_taken(step, seen) if step.item in self._shows_by_s else _not_ready(step, seen)
            self._sleep(step.every_s)

    def _not_taken(self, step: Step, seen: int) -> CheckFailed:
        """Of an item that was written before it was looked at."""
        kind, called = self._tuning.facts.get("standstill"), plain_name(step.item)
        is_kind = kind is not None and kind.item == step.item
        return CheckFailed(
            f"the drive did not take {step.value} as {called}, it shows {seen}; another kind of tuning may turn the shaft, so none was started"
            if is_kind
            else f"the drive did not take {step.value} as {called}, it shows {seen}; no tuning was started", step="tune: read back", value=seen, limit=step.value,
            remedy=f"release the drive's parameter lock, or set {called} at its keypad; where it shows a new value late, give "
            "parameters.settle_s in the drive file",
        )  # fmt: skip

    def _write(self, step: Step, index: int) -> None:
        if step.once:
            self._note_status_before(index)
        item = self.profile.item(step.item)
        settle_s = self.profile.parameters.settle_s if self.profile.parameters else 0.0
        try:
            self._items.port.write(item.address, [step.value])
            self._shows_by_s[step.item] = self._clock() + settle_s
        except (ReplyTimeout, ReplyMismatch) as lost:
            if not step.once:
                raise
            self._lost = lost  # it may have arrived: what comes next is to look

    def _note_status_before(self, index: int) -> None:
        """How the status stands that will be awaited: by that a drive that did not begin is told from one that is done."""
        awaited = next((s for s in self._tuning.steps[index:] if s.do == "await"), None)
        self._before = None if awaited is None else self._raw(awaited.item) & awaited.mask

    def _ask(self, text: str) -> None:
        if not self._operator.does(text):
            raise Aborted(
                "not done at the drive", step="tune: ask", value="no", limit=text, remedy="start again when ready"
            )
        self._check_stop()

    def _await(self, step: Step) -> None:
        """Until the item is done. A value that stood there before the start means nothing until another was seen."""
        watched = _Awaited(step, self._before, self._clock(), self._lost)
        self._before, self._lost, lost = None, None, 0
        while True:
            try:
                seen = self._raw(step.item) & step.mask
                self._look_around()
                lost = 0
            except LinkError:
                lost += 1
                if lost >= LOST_ANSWERS:
                    raise
                continue
            if watched.is_over(seen, self._clock()):
                return
            self._check_stop()
            self._sleep(step.every_s)

    # --- all the while ----------------------------------------------------------------------------------------------
    def _look_around(self) -> None:
        """Faults, and what must not move."""
        for limit in self._tuning.watch:
            raw = self._raw(limit.item)
            counts = raw - 0x10000 if raw >= 0x8000 else raw
            if abs(counts) > limit.most:
                raise Aborted(
                    f"stopped: {limit.why}", step="tune: watch", value=counts, limit=f"at most {limit.most} counts of {limit.item}",
                    remedy="this is no tuning at standstill: check the kind of tuning at the drive, and what turns the shaft",
                )  # fmt: skip
        self._check_no_fault()

    def _check_no_fault(self) -> None:
        if "status_word" not in self.profile.items:
            return
        status = read_status(self._items)
        if status.fault_code or status.state in (DriveState.FAULT.value, DriveState.FAULT_REACTION_ACTIVE.value):
            raise DriveFault(
                f"the drive reports a fault: {status.fault_text}", step="tune", value=status.fault_code, limit="no fault",
                remedy="remove the cause and reset it at the drive",
            )  # fmt: skip

    def _check_stop(self) -> None:
        if why := self._operator.wants_stop():
            raise Aborted(f"stopped: {why}", step="tune", value=why, limit="no stop", remedy="start again when ready")

    # --- after ------------------------------------------------------------------------------------------------------
    def _end(self, error: BaseException | None) -> None:
        """Every last step is tried, whatever came before and whichever of them fails; all of them again where an answer was lost: one
        request that a broken connection took along must not leave the output on."""
        if error is not None and self._tuning.form == "assisted":
            self._operator.does("Stop the drive's tuning at the drive, if it still runs. Done?")
        problems = self._problems_of_end()
        for _ in range(ATTEMPTS - 1):
            if not any(map(is_lost, problems)):
                break
            problems = self._problems_of_end(is_first=False)
        if problems:
            first = problems[-1]
            raise DriveFault(
                f"the drive does not confirm that it is at rest: {first.what}", step=REST, value=first.value,
                limit=first.limit, remedy="take the motor as live: isolate the drive's supply, then look at its status",
            ) from error  # fmt: skip

    def _problems_of_end(self, *, is_first: bool = True) -> list[CommissionerError]:
        """What went wrong with the last steps; a write that is for once is not repeated."""
        problems: list[CommissionerError] = []
        for step in self._tuning.finally_:
            if step.once and not is_first:
                continue
            try:
                self._end_step(step)
            except CommissionerError as problem:
                problems.append(problem)
        return problems

    def _end_step(self, step: Step) -> None:
        if step.do == "write":
            self._items.port.write(self.profile.item(step.item).address, [step.value])
            return
        if step.do == "expect":
            self._expect(step)
            return
        end = self._clock() + step.within_s
        while (seen := self._raw(step.item) & step.mask) not in step.done:
            if self._clock() > end:
                raise DriveFault(
                    f"{step.item} is {seen:#06x}", step=REST, value=seen, limit=f"one of {list(step.done)}",
                    remedy="isolate the drive's supply",
                )  # fmt: skip
            self._sleep(step.every_s)

    def _results(self) -> dict[str, float]:
        first = self._items.read(self._tuning.results)
        self._sleep(APART_S)
        second = self._items.read(self._tuning.results)
        for name, value in first.items():
            if not self._items.same_words(name, value, second[name]):
                raise DriveFault(
                    f"{name} still changes after the tuning", step="read the results", value=second[name], limit=value,
                    remedy="wait until the drive's display is at rest, then tune again",
                )  # fmt: skip
            if not math.isfinite(number(value)):
                raise DriveFault(
                    f"the drive gives no number as {name} after the tuning", step="read the results", value="not a number",
                    limit="a number", remedy="see on the drive's display whether its tuning found it; check the item's type and word order",
                )  # fmt: skip
        return {name: number(value) for name, value in second.items()}

    def _raw(self, name: str) -> int:
        return self._items.port.read(self.profile.item(name).address, 1)[0]
