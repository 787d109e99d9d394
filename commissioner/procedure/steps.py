"""One generator per state: it yields commands, receives the drive's replies and returns the event that ends its state.

Nothing here knows a socket, a file or a clock; a scripted drive tests every path.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from typing import Any

from commissioner.errors import Aborted, CheckFailed, SamplesLost
from commissioner.identify import convergence, excitation, resistance
from commissioner.identify.analysis import Identification, identify
from commissioner.identify.excitation import Excitation, ExcitationLimits
from commissioner.identify.flux import FluxAdvice, FluxGuard
from commissioner.identify.observer import BlockEstimate, ParallelObserver
from commissioner.identify.resistance import Staircase
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import Nameplate, RatedFlux, rated_flux
from commissioner.procedure.assembly import assemble
from commissioner.procedure.checks import DriveLimits, judge_drive
from commissioner.procedure.findings import (
    AxisFinished,
    ChecksJudged,
    EstimateUpdated,
    ExcitationChosen,
    GuardActed,
    StaircaseFitted,
    VerdictReached,
)
from commissioner.procedure.plan import ProcedurePlan
from commissioner.procedure.states import Event
from commissioner.procedure.verdict import Verdict, decide
from commissioner.records import DriveIdentity, ParameterSnapshot, SampleBlock
from commissioner.safety.commands import (
    ArmWatchdog,
    Command,
    Disarm,
    Enable,
    Fetch,
    Identify,
    LoadExcitation,
    ReadNameplate,
    ReadStatus,
    SetBias,
    SetDriveLimits,
    SetScale,
    TakeSnapshot,
    Tell,
    Wait,
    WriteParameters,
)

Step = Generator[Command, Any, Event]
"""What a state's generator is: yields commands, is sent replies, returns an event."""
