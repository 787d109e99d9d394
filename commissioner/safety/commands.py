"""Everything that may be asked of a drive. Steps yield these, the runner carries them out, `limits` judges each first."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from commissioner.identify.excitation import Tone


@dataclass(frozen=True)
class Command:
    """`energises` and `writes` commands are journalled, and the journal flushed, before they go out."""

    energises: ClassVar[bool] = False
    writes: ClassVar[bool] = False


@dataclass(frozen=True)
class Identify(Command):
    """-> DriveIdentity"""


@dataclass(frozen=True)
class ReadNameplate(Command):
    """-> mapping of the drive's own nameplate registers"""


@dataclass(frozen=True)
class ReadStatus(Command):
    """-> DriveStatus"""


@dataclass(frozen=True)
class TakeSnapshot(Command):
    """-> ParameterSnapshot, archived before it is returned"""


@dataclass(frozen=True)
class Wait(Command):
    """Let the drive's time pass while nothing is energised."""

    seconds: float


@dataclass(frozen=True)
class ArmWatchdog(Command):
    """-> the time-out read back from the drive, in seconds"""

    timeout_s: float
    writes: ClassVar[bool] = True


@dataclass(frozen=True)
class SetDriveLimits(Command):
    """Limits that the drive itself enforces -> None after read-back"""

    current_a: float
    voltage_v: float
    time_s: float
    writes: ClassVar[bool] = True


@dataclass(frozen=True)
class LoadExcitation(Command):
    """What the drive will generate once enabled; it starts with bias 0 and scale 0."""

    axis_deg: float
    tones: tuple[Tone, ...]
    bias_ramp_v_per_s: float
    scale_ramp_per_s: float
    duration_s: float
    writes: ClassVar[bool] = True


@dataclass(frozen=True)
class Enable(Command):
    """Energise. -> session id"""

    purpose: str
    energises: ClassVar[bool] = True


@dataclass(frozen=True)
class Fetch(Command):
    """-> SampleBlock, or None once the drive has ended the session; feeds the watchdog"""


@dataclass(frozen=True)
class SetScale(Command):
    scale: float
    energises: ClassVar[bool] = True


@dataclass(frozen=True)
class SetBias(Command):
    bias_v: float
    energises: ClassVar[bool] = True


@dataclass(frozen=True)
class Disarm(Command):
    """De-energise. Always permitted."""

    reason: str


@dataclass(frozen=True)
class WriteParameters(Command):
    """Stage, verify, commit, store, verify. -> tuple of WrittenParameter"""

    values: Mapping[str, float]
    writes: ClassVar[bool] = True


@dataclass(frozen=True)
class Tell(Command):
    """A decision or an estimate for the journal and the technician; nothing goes to the drive."""

    record: object
