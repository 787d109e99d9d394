"""The one tree of surprises. Expected failures are values; what is raised is one of these.

    CommissionerError                 exit code
    |-- UsageError                    2   a wrong call: flag, file name, verb
    |   `-- ConfigurationError        2   file, key, value and what would be right
    |-- DataRefused                   3   the data cannot carry an answer
    |-- CheckFailed                   3   a pre-energise check says no; nothing was energised
    |-- Aborted                       4   a guard or the operator stopped the run
    `-- DriveError                    5   the drive or the link failed
        |-- DriveInUse                    another run, person or computer holds the drive; nothing was sent to it
        |-- ForeignMaster                 somebody else wrote to the drive while it was ours
        |-- DriveFault                    the drive tripped, or does not do what it acknowledged
        |-- IdentityMismatch              not the drive, firmware or values that were expected
        |-- WriteBackFailed               read-back differs; says whether the snapshot was restored
        `-- LinkError                     the wire
            |-- LinkUnreachable           nothing answers at the URL
            |-- ReplyTimeout              a request without an answer
            |-- ReplyMismatch             wrong function, address, length, session or check sum
            `-- RequestRefused            the drive answered with a Modbus exception

Every error carries four facts, each one sentence or less: the step in which it happened, the value seen,
the limit or expectation it broke, and the remedy.
"""

from __future__ import annotations

import errno
import math
import reprlib
from typing import NotRequired

from typing_extensions import TypedDict

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 200
NOTHING = "nothing"
"""The value seen where there is none: a key that is missing."""
NO_SUCH_KEY = "no such key"
"""What is expected of a key that its table does not have."""
OF_DISK = frozenset({errno.ENOSPC, errno.EROFS, errno.EIO, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC)})
"""What a disk says that takes no more, or fails."""


class ErrorDocument(TypedDict):
    """An error as JSON: `kind` is its class; `value` and `limit` are numbers, words, or whatever else was seen and allowed; `unit` is
    that of those which are numbers, where they have one."""

    kind: str
    what: str
    step: str
    value: object
    limit: object
    unit: NotRequired[str]
    remedy: str


class CommissionerError(Exception):
    """What happened (`str`), where (`step`), what was seen (`value`) and allowed (`limit`), in which `unit` where they are numbers, what
    to do (`remedy`)."""

    exit_code = 5
    outcome = "faulted"

    def __init__(
        self, what: str, *, step: str, value: object = None, limit: object = None, remedy: str = "", unit: str = ""
    ) -> None:
        super().__init__(what)
        self.what = what
        self.step = step
        self.value = NOTHING if value is None else _in_words(value)
        self.limit = _in_words(limit)
        self.remedy = remedy
        self.unit = unit

    def as_dict(self) -> ErrorDocument:
        """The error as the JSON object that every verb prints under `error`."""
        document: ErrorDocument = {
            "kind": type(self).__name__,
            "what": self.what,
            "step": self.step,
            "value": self.value,
            "limit": self.limit,
            "remedy": self.remedy,
        }
        return document | {"unit": self.unit} if self.unit else document


class DiskRefused(CommissionerError):
    """The disk is full, or fails."""


class UsageError(CommissionerError):
    exit_code = 2
    outcome = "usage"


class ConfigurationError(UsageError):
    """A file said something that cannot be right."""

    def __init__(self, *, file: str, key: str, value: object, expected: str) -> None:
        shown = NOTHING if value is None else _SHORT.repr(value)
        super().__init__(
            f"{file}: {key} is missing" if value is None else f"{file}: {key} = {shown} cannot be used",
            step="read configuration",
            value=value if isinstance(value, int | float) or value == shown.strip("'") else shown,
            limit=expected,
            remedy=f"{_repair(value, expected)} {key} in {file}",
        )
        self.file = file
        self.key = key


def _in_words(value: object) -> object:
    """A number that JSON cannot say becomes its word."""
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def _repair(value: object, expected: str) -> str:
    if value is None:
        return "add"
    return "rename or remove" if expected.startswith(NO_SUCH_KEY) else "correct"


class DataRefused(CommissionerError):
    exit_code = 3
    outcome = "rejected"


class CheckFailed(CommissionerError):
    exit_code = 3
    outcome = "rejected"


class Aborted(CommissionerError):
    exit_code = 4
    outcome = "aborted"


class DriveError(CommissionerError):
    exit_code = 5
    outcome = "faulted"


class DriveInUse(DriveError):
    pass


class ForeignMaster(DriveError):
    pass


class DriveFault(DriveError):
    pass


class IdentityMismatch(DriveError):
    pass


class WriteBackFailed(DriveError):
    """`was_restored`: the snapshot was seen in the drive again; False says it was not, or could not be, verified. `is_as_found`: of a
    restore, that the drive was seen to hold what it held before it."""

    was_restored: bool = False
    is_as_found: bool = False


class LinkError(DriveError):
    pass


class LinkUnreachable(LinkError):
    pass


class ReplyTimeout(LinkError):
    pass


class ReplyMismatch(LinkError):
    pass


class RequestRefused(LinkError):
    pass
