"""All that can be known of a drive without energising or writing: what `check` shows."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.url import parse_url
from commissioner.motor.nameplate import Nameplate
from commissioner.procedure.checks import CheckResult, judge_drive, judge_idle
from commissioner.procedure.plan import ProcedurePlan
from commissioner.procedure.steps import Job
from commissioner.records import DriveIdentity, DriveStatus
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
    watchdog = profile.watchdog
    known = dataclasses.asdict(watchdog) if watchdog else {"none": "the drive file describes none"}
    return Inspection(identity, plate, parameters, known, checks, job)


def _shown(profile: DriveProfile, status: DriveStatus) -> DriveStatus | None:
    return status if "status_word" in profile.items else None
