"""All that can be known of a drive without energising or writing: what `check` shows."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from commissioner.errors import RequestRefused
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.modbus import ModbusPort
from commissioner.link.wire.url import parse_url
from commissioner.motor.nameplate import RATED_VALUES, Nameplate
from commissioner.procedure.checks import CheckResult, NotChecked, judge_drive, judge_idle
from commissioner.procedure.plan import Job, ProcedurePlan
from commissioner.records import DriveIdentity, DriveStatus
from commissioner.registers.convention import parameter_limits
from commissioner.registers.profile import DriveProfile
from commissioner.run.holding.drive_lock import LOOK, DriveLock
from commissioner.run.holding.mastery import Mastery
from commissioner.run.job import make_job, open_drive


@dataclass(frozen=True)
class Inspection:
    """What `check` saw; `job`: what a run would do, of a drive that can energise for us."""

    identity: DriveIdentity
    nameplate: Mapping[str, float]
    parameters: Mapping[str, float]
    watchdog: Mapping[str, Any]
    checks: tuple[CheckResult, ...]
    job: Job | None = None
    not_checked: tuple[NotChecked, ...] = ()


def inspect_drive(url: str, profile_name: str, nameplate: Nameplate, plan: ProcedurePlan) -> Inspection:
    """Identity, plate, parameters and checks. Of a drive that cannot energise for us, what its file describes."""
    profile = load_profile(profile_name)
    with DriveLock.take(parse_url(url), profile, LOOK) as lock, open_drive(url, profile, plan) as port:
        inverter = Inverter(port, profile)
        identity, plate = inverter.identify(), inverter.read_nameplate()
        lock.identified(identity, profile)
        Mastery(inverter, lock).look()
        statuses = [inverter.read_status()]
        time.sleep(plan.supervision.standstill_dwell_s)
        statuses.append(inverter.read_status())
        job = None
        if "excite" in profile.capabilities:
            job = make_job(profile, nameplate, plan, port, write_back=False)
            checks = judge_drive(identity, statuses, plate, nameplate, job.drive_limits, job.test_current_a, job.pace)
        else:
            checks = judge_idle(_shown(profile, statuses[-1]), plate, nameplate)
        parameters = inverter.snapshot().in_use
        checks += (*_found(inverter, parameters, nameplate), *_others(inverter), _answered(port))
    watchdog = profile.watchdog
    known = dataclasses.asdict(watchdog) if watchdog else {"none": "the drive file describes none"}
    return Inspection(identity, plate, parameters, known, checks, job, tuple(_not_checked(profile)))


def _answered(port: ModbusPort) -> CheckResult:
    """Nothing is known of a drive that was not asked, or did not answer."""
    answers = len(port.stats.latencies_s) - port.stats.refusals
    return CheckResult(
        "a drive answers", answers > 0, f"{answers} answered requests", "at least 1",
        "the drive file knows no register to read: take one that does, or look registers up in the manual",
    )  # fmt: skip


def _found(inverter: Inverter, held: Mapping[str, float], nameplate: Nameplate) -> Iterator[CheckResult]:
    """What the drive holds must be a motor's values, or its file reads another register or width than it says."""
    if inverter.profile.kind == "commissioning_map":
        return
    doubtful = {d.name: d.as_error() for d in inverter.implausible(held, nameplate)}
    for name, (low, high) in parameter_limits(inverter.profile, nameplate).items():
        error = doubtful.get(name)
        unit = inverter.profile.item(name).unit
        if error is None:
            yield CheckResult(
                f"{name} in the drive", True, f"{held[name]:.6g} {unit}", f"near {low:.4g} ... {high:.4g} {unit}", ""
            )
        else:
            yield CheckResult(error.what, False, error.value, error.limit, error.remedy)


def _others(inverter: Inverter) -> Iterator[CheckResult]:
    """Every other register that an ordinary drive's file describes is there, and what it holds."""
    if inverter.profile.kind == "commissioning_map":
        return
    for name, value in inverter.read_others().items():
        unit = inverter.profile.item(name).unit
        is_there = not isinstance(value, RequestRefused)
        seen = f"{value} {'' if unit == 'raw' else unit}".rstrip() if is_there else str(value)
        remedy = "" if is_there else "the drive refuses a register of its file: take the file of its model and firmware"
        yield CheckResult(f"{name} in the drive", is_there, seen, "an answer", remedy)


WHICH = "which drive this is: nothing in its registers tells two of this type apart"
TELLING = ("serial_number", "drive_type", "magic")


def _not_checked(profile: DriveProfile) -> Iterator[NotChecked]:
    """What this drive file leaves open."""
    if profile.kind == "commissioning_map":
        return
    if not any(name in profile.items for name in TELLING):
        why = profile.unknown.get("identity", "the drive file knows no register for type, firmware or serial number")
        yield NotChecked(WHICH, why)
    if "status_word" not in profile.items or profile.status_decoder == "none":
        why = profile.unknown.get("status_word", "the drive file knows no status word")
        yield NotChecked("no fault, output off", why)
    for name in RATED_VALUES:
        if name not in profile.items:
            yield NotChecked(
                f"{name} in the drive", profile.unknown.get(name, "the drive file knows no register for it")
            )
    for name in profile.parameter_names:
        if not profile.item(name).convention:
            yield NotChecked(
                f"{name} in the drive", "its unit or convention has no source: it is shown as the drive counts"
            )
    if profile.parameters is None:
        yield NotChecked(
            "motor parameters in the drive", profile.unknown.get("parameters", "no register is known for them")
        )
    if profile.watchdog is None:
        yield NotChecked("watchdog", profile.unknown.get("watchdog", "the drive file describes none"))


def _shown(profile: DriveProfile, status: DriveStatus) -> DriveStatus | None:
    return status if "status_word" in profile.items else None
