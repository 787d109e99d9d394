"""A drive's own standstill autotune, watched, repeated and judged; then its best set or what was there before."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from commissioner.errors import UsageError
from commissioner.link.drive.ordinary.tuning import Operator
from commissioner.link.files.drive_file import load_profile
from commissioner.operations.events import Observe, nobody
from commissioner.registers.profile import DriveProfile
from commissioner.registers.tuning import MOST_REPEATS, REPEATS
from commissioner.run.commission import Commissioned, Origin
from commissioner.run.tuning.tune import TunedOnce, TuneOrder, TuningBegan, order_of
from commissioner.run.tuning.tune import tune as carry_out
from commissioner.settings import load_motor, load_procedure

__all__ = ["REPEATS", "TuneRequest", "TunedOnce", "TuningBegan", "check_request", "tune"]


@dataclass(frozen=True)
class TuneRequest:
    """`pause_s` None: the drive file's. `hardwired_stop`: a person has a tested one in reach. `power_cycle`: the person is asked
    to switch the drive off and on after writing."""

    drive: str
    profile: str
    motor: str
    runs: Path
    repeat: int = REPEATS
    pause_s: float | None = None
    write_back: bool = False
    hardwired_stop: bool = False
    power_cycle: bool = False
    procedure: Path | None = None


def check_request(request: TuneRequest) -> DriveProfile:
    """The drive file. UsageError or ConfigurationError where this cannot be carried out on any drive of it."""
    profile = load_profile(request.profile)
    _order(request, profile)
    return profile


def tune(
    request: TuneRequest, operator: Operator, observe: Observe = nobody, origin: Origin | None = None
) -> Commissioned:
    """Lets the drive energise the motor. Configuration errors are raised; from the first request on every end is a run."""
    return carry_out(_order(request, load_profile(request.profile)), request.runs, operator, observe, origin=origin)


def _order(request: TuneRequest, profile: DriveProfile) -> TuneOrder:
    if not 1 <= request.repeat <= MOST_REPEATS:
        raise UsageError(
            "so often a drive is not tuned", step="command line", value=request.repeat, limit=f"1 ... {MOST_REPEATS}",
            remedy="give another --repeat",
        )  # fmt: skip
    if request.pause_s is not None and not 0.0 <= request.pause_s <= 3600.0:
        raise UsageError(
            "so long a pause cannot be kept", step="command line", value=request.pause_s, limit="0 ... 3600 s",
            remedy="give another --pause",
        )  # fmt: skip
    plate, plan = load_motor(request.motor), load_procedure(request.procedure)
    order = order_of(request.drive, profile, plate, plan, write_back=request.write_back)
    return TuneOrder(order, request.repeat, request.pause_s, request.hardwired_stop, request.power_cycle)
