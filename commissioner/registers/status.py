"""Status words -> what the drive is doing. CiA 402 / IEC 61800-7-201 masks, or single bits named in the drive file."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum


class DriveState(Enum):
    """The value is what the technician reads."""

    NOT_READY = "not ready to switch on"
    SWITCH_ON_DISABLED = "switch-on disabled"
    READY_TO_SWITCH_ON = "ready to switch on"
    SWITCHED_ON = "switched on"
    OPERATION_ENABLED = "operation enabled"
    QUICK_STOP_ACTIVE = "quick stop active"
    FAULT_REACTION_ACTIVE = "fault reaction active"
    FAULT = "fault"
    UNKNOWN = "a status word no table explains"

    @property
    def may_be_energised(self) -> bool:
        """False only where the state says that the output is blocked."""
        return self in _POSSIBLY_ENERGISED


_POSSIBLY_ENERGISED = frozenset(
    {
        DriveState.OPERATION_ENABLED,
        DriveState.QUICK_STOP_ACTIVE,
        DriveState.FAULT_REACTION_ACTIVE,
        DriveState.UNKNOWN,
    }
)

_CIA402 = (
    (0x4F, 0x00, DriveState.NOT_READY),
    (0x4F, 0x40, DriveState.SWITCH_ON_DISABLED),
    (0x4F, 0x0F, DriveState.FAULT_REACTION_ACTIVE),
    (0x4F, 0x08, DriveState.FAULT),
    (0x6F, 0x21, DriveState.READY_TO_SWITCH_ON),
    (0x6F, 0x23, DriveState.SWITCHED_ON),
    (0x6F, 0x27, DriveState.OPERATION_ENABLED),
    (0x6F, 0x07, DriveState.QUICK_STOP_ACTIVE),
)

STATUS_BITS = ("running", "ready", "fault")
"""Names a `status_decoder = "bits"` drive must give in [status_bits]."""


def decode_state(decoder: str, word: int, bits: Mapping[str, int]) -> DriveState:
    """The state in `word` by the decoder the drive file names (`cia402` or `bits`)."""
    if decoder == "cia402":
        return next((state for mask, value, state in _CIA402 if word & mask == value), DriveState.UNKNOWN)
    is_set = {name: bool(word >> bit & 1) for name, bit in bits.items()}
    if is_set.get("running"):
        return DriveState.OPERATION_ENABLED
    if is_set.get("fault"):
        return DriveState.FAULT
    return DriveState.READY_TO_SWITCH_ON if is_set.get("ready") else DriveState.NOT_READY


def decode_bits(word: int, bits: Mapping[str, int]) -> dict[str, bool]:
    """Every named bit of `word` as a claim."""
    return {name: bool(word >> bit & 1) for name, bit in bits.items()}
