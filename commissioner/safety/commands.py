"""Everything that may be asked of a drive: steps yield these, `limits` judges them, the runner carries them out."""

from __future__ import annotations

from dataclasses import dataclass

from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import Nameplate

ALL_CHANNELS = ("voltage_axis_v", "current_u_a", "current_v_a", "current_w_a")
TWO_CURRENTS = ALL_CHANNELS[:3]


@dataclass(frozen=True)
class Command:
    """One thing to ask; what the drive answers stands behind the arrow in each docstring."""


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
    """-> None once read back"""

    timeout_s: float


@dataclass(frozen=True)
class SetDriveLimits(Command):
    """Limits that the drive itself enforces -> None after read-back"""

    current_a: float
    voltage_v: float
    time_s: float


@dataclass(frozen=True)
class LoadExcitation(Command):
    """What the drive will generate once enabled; it starts with bias 0 and scale 0.

    Tones are (amplitude in volts along the axis, frequency in Hz, phase in rad). A sample is the mean of `channels` over
    `averaged` control periods.
    """

    axis_deg: float
    tones: tuple[tuple[float, float, float], ...]
    bias_ramp_v_per_s: float
    scale_ramp_per_s: float
    duration_s: float
    channels: tuple[str, ...] = ALL_CHANNELS
    averaged: int = 1


@dataclass(frozen=True)
class Enable(Command):
    """Energise the loaded excitation."""

    purpose: str


@dataclass(frozen=True)
class Fetch(Command):
    """-> SampleBlock, or None once the drive has ended the session; feeds the watchdog"""


@dataclass(frozen=True)
class Supervise(Command):
    """Let the energised motor's time pass without samples: the watchdog is fed and the drive's status judged. -> DriveStatus"""

    seconds: float


@dataclass(frozen=True)
class SetScale(Command):
    """Steer the amplitude scale, 0 ... 1."""

    scale: float


@dataclass(frozen=True)
class SetBias(Command):
    """Steer the DC bias in volts along the axis."""

    bias_v: float


@dataclass(frozen=True)
class Disarm(Command):
    """De-energise. Always permitted."""

    reason: str


@dataclass(frozen=True)
class WriteParameters(Command):
    """The circuit in the drive's own terms: stage, verify, commit, store, verify. -> tuple of WrittenParameter

    The plate is for drives that want reactances at rated frequency or per cent.
    """

    circuit: InverseGamma
    nameplate: Nameplate


@dataclass(frozen=True)
class Tell(Command):
    """A decision or an estimate for the journal and the technician; nothing goes to the drive."""

    record: object
