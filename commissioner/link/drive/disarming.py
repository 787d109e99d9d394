"""De-energise a drive by every path it has, and say what its own status confirms."""

from __future__ import annotations

from collections.abc import Callable

from commissioner.errors import CommissionerError
from commissioner.link.drive.facts import Attempt, DisarmReport
from commissioner.link.drive.items import Items
from commissioner.link.drive.reading import read_state
from commissioner.registers.codec import Value
from commissioner.registers.status import DriveState

DISABLE_VOLTAGE, QUICK_STOP, SHUTDOWN, NO_MODE = 0x00, 0x02, 0x06, 0
AFTER_WATCHDOG_S = 0.1
PATHS: tuple[tuple[str, dict[str, Value]], ...] = (
    ("disable voltage", {"control_word": DISABLE_VOLTAGE}),
    ("quick stop", {"control_word": QUICK_STOP}),
    ("shut down", {"control_word": SHUTDOWN}),
    ("leave the test mode", {"mode": NO_MODE}),
)


def de_energise(items: Items, watchdog_s: float, sleep: Callable[[float], None]) -> DisarmReport:
    """Path after path until the status confirms a blocked output; else wait for the drive's watchdog and look again.

    Never raises an Exception: whatever breaks one path, the next is tried.
    """
    if "control_word" not in items.profile.items:
        return DisarmReport(True, "this service cannot energise this drive", (), False)
    attempts: list[Attempt] = []
    for path, values in PATHS:
        attempts.append(_attempt(items, path, values))
        state = _blocked_state(items, attempts)
        if state is not None:
            attempts.append(_attempt(items, *PATHS[-1]))
            return DisarmReport(True, state.value, tuple(attempts), False)
    sleep(watchdog_s + AFTER_WATCHDOG_S)
    state = _blocked_state(items, attempts)
    described = state.value if state else "not confirmed by the drive"
    return DisarmReport(state is not None, described, tuple(attempts), True)


def _attempt(items: Items, path: str, values: dict[str, Value]) -> Attempt:
    try:
        items.write(values)
    except Exception as error:
        return Attempt(path, _said(error))
    return Attempt(path, "acknowledged")


def _blocked_state(items: Items, attempts: list[Attempt]) -> DriveState | None:
    """The state, where the drive's own status says that the output is blocked."""
    try:
        state = read_state(items)
    except Exception as error:
        attempts.append(Attempt("read the status", _said(error)))
        return None
    attempts.append(Attempt("read the status", state.value))
    return None if state.may_be_energised else state


def _said(error: Exception) -> str:
    return error.what if isinstance(error, CommissionerError) else f"{type(error).__name__}: {error}"
