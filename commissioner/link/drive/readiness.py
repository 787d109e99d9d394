"""May this drive be enabled now? Asked of the drive itself, right before the command that energises."""

from __future__ import annotations

from collections.abc import Mapping

from commissioner.errors import CheckFailed
from commissioner.link.drive.items import Items
from commissioner.link.drive.reading import read_status
from commissioner.records import DriveStatus
from commissioner.registers.codec import Value
from commissioner.registers.status import DriveState


def check_ready(items: Items, supervision: Mapping[str, Value], watchdog_s: float) -> DriveStatus:
    """The status before enabling. CheckFailed where energising would not be supervised or not be obeyed.

    `supervision`: watchdog and limits as they were set; the drive must still hold them.
    """
    _check_supervision(items, supervision, watchdog_s)
    status = read_status(items)
    if status.is_energised:
        raise not_ready("the drive is energised already", status.state, "a blocked output", "disarm it first")
    if status.fault_code or status.state == DriveState.FAULT.value:
        raise not_ready(f"the drive reports: {status.fault_text}", status.fault_code, "no fault", "remove it")
    for name, holds in status.interlocks.items():
        if not holds:
            raise not_ready(f"interlock {name} is open", name, "all interlocks closed", "see the drive's manual")
    return status


def _check_supervision(items: Items, supervision: Mapping[str, Value], watchdog_s: float) -> None:
    if items.port.reply_timeout_s >= watchdog_s:
        raise not_ready(
            "a lost answer would outlast the watchdog", items.port.reply_timeout_s,
            f"less than the watchdog's {watchdog_s:g} s", "use a faster link or a longer watchdog",
        )  # fmt: skip
    held = items.read(supervision)
    for name, wanted in supervision.items():
        if not items.same_words(name, held[name], wanted):
            raise not_ready(f"{name} has changed since it was set", held[name], wanted, "keep other masters off")


def not_ready(what: str, value: object, limit: object, remedy: str) -> CheckFailed:
    return CheckFailed(what, step="check before energising", value=value, limit=limit, remedy=remedy)
