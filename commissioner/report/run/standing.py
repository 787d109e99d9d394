"""How a run stands: its outcome, whether the drive holds what came of it, what its axes showed. Light: lists and screens need no more."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Any


class Held(StrEnum):
    """Which parameter set a drive holds after a run, as far as the run could know."""

    RESTORED = "as before (restored)"
    AS_BEFORE = "as before"
    OLD_OR_NEW = "old or new"
    """A write-back, restore or tuning did not end: only the drive can tell."""
    NEW = "new"
    NOT_KNOWN = "not known"

    @classmethod
    def of(cls, sentence: str) -> Held:
        """The one that the sentence begins with: all that summaries of earlier versions kept."""
        return next((one for one in cls if sentence.startswith(one)), cls.NOT_KNOWN)


class Standing(StrEnum):
    """How a run can have ended, or stand since: one that ended as commissioned while the drive does not hold its values, or nobody
    knows whether it does, stands otherwise."""

    COMMISSIONED = "commissioned"
    ACCEPTED = "accepted, not written"
    RESTORED_SINCE = "commissioned, restored since"
    UNSURE = "commissioned, old or new"
    NOT_KEPT = "commissioned, result not kept"
    REJECTED = "rejected"
    ABORTED = "aborted"
    FAULTED = "faulted"
    CUT_OFF = "cut off"
    UNREADABLE = "unreadable"

    @classmethod
    def of(cls, outcome: str, held: Held, *, lacks_result: bool = False) -> Standing:
        """Of an outcome and of what the drive holds; `lacks_result`: the process ended before it had kept what it measured. An outcome
        that no run has, as somebody wrote it, cannot be read."""
        if outcome != cls.COMMISSIONED:
            return next((one for one in _ENDS if one == outcome), cls.UNREADABLE)
        if lacks_result and held is not Held.OLD_OR_NEW:
            return cls.NOT_KEPT
        return _SINCE.get(held, cls.ACCEPTED)

    @property
    def is_good(self) -> bool:
        """Every parameter was accepted, and the drive holds one set of them: as it was found, or the new one."""
        return self in (Standing.COMMISSIONED, Standing.ACCEPTED, Standing.RESTORED_SINCE)

    @property
    def is_written(self) -> bool:
        """The drive holds what the run measured."""
        return self is Standing.COMMISSIONED

    @property
    def is_unsure(self) -> bool:
        """Accepted, and only the drive can tell which set it holds."""
        return self is Standing.UNSURE

    @property
    def may_be_written(self) -> bool:
        """Accepted, and the drive holds what it held before."""
        return self in (Standing.ACCEPTED, Standing.RESTORED_SINCE)

    @property
    def has_no_end(self) -> bool:
        """The run's process ended before it could say how the run did."""
        return self is Standing.CUT_OFF

    @property
    def is_incomplete(self) -> bool:
        """The run's process ended before all of it was kept."""
        return self in (Standing.CUT_OFF, Standing.NOT_KEPT)


_ENDS = (Standing.REJECTED, Standing.ABORTED, Standing.FAULTED, Standing.CUT_OFF)
_SINCE: Mapping[Held, Standing] = {
    Held.NEW: Standing.COMMISSIONED, Held.RESTORED: Standing.RESTORED_SINCE, Held.OLD_OR_NEW: Standing.UNSURE,
}  # fmt: skip


def standing(result: Mapping[str, Any]) -> Standing:
    """The outcome; of a result that was accepted, whether it was written as well."""
    return Standing.of(str(result["outcome"]), Held.NEW if result.get("written") else Held.AS_BEFORE)


def finding_sentences(result: Mapping[str, Any]) -> list[str]:
    """What the axes' comparison saw, each with its size and 95 % interval."""
    from commissioner.report.sheet.numbers import half_width, with_interval  # with numpy behind it

    return [
        f"{f['sentence']}, by {with_interval(100 * abs(f['relative_size']), half_width(f['relative_std'], 100))} %"
        for f in result.get("findings") or ()
    ]
