"""One commissioning run from URL to run folder: open, check, carry the course out, archive, report, close."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from commissioner.errors import CommissionerError
from commissioner.link.drive_file import load_profile
from commissioner.link.facts import Action, Intent
from commissioner.link.inverter import Inverter
from commissioner.link.modbus import ModbusPort, open_port
from commissioner.link.url import parse_url, without_secrets
from commissioner.motor.nameplate import Nameplate, prior
from commissioner.procedure.checks import CheckResult, DriveLimits, judge_drive
from commissioner.procedure.course import Findings, Job, course
from commissioner.procedure.excite import warm_up
from commissioner.procedure.findings import Diagnosing, RunEnded, WarmingUp
from commissioner.procedure.plan import ProcedurePlan
from commissioner.procedure.verdict import PARAMETERS
from commissioner.records import DriveIdentity
from commissioner.registers.convention import INDUCTANCES, RESISTANCES, is_our_own
from commissioner.registers.profile import DriveProfile
from commissioner.report.run_page import run_page
from commissioner.report.summary import diagnosis_sentences, summarise
from commissioner.run.archive import RunFolder, plain, read_journal, write_recording
from commissioner.run.diagnosed import diagnose_run
from commissioner.run.runner import Present, Runner
from commissioner.safety.limits import Bounds
from commissioner.safety.watch import WatchLimits

LOST_SAMPLES_S = 0.05
"""The stream may lose this much motor time at once before the run stops."""
FLUX_FRACTION = 1.1
"""Of the guard's own limit: the guard acts first, the watch is the second line."""
LATENCY_PROBES = 20
WORST_LATENCY_FACTOR = 3.0
"""The guard predicts across this multiple of the slowest probe: later answers are slower than the first ones."""


@dataclass(frozen=True)
class Inspection:
    """What `check` saw."""

    identity: DriveIdentity
    nameplate: Mapping[str, float]
    parameters: Mapping[str, float]
    watchdog: Mapping[str, Any]
    checks: tuple[CheckResult, ...]


@dataclass(frozen=True)
class Commissioned:
    """How a run ended and where it is."""

    ended: RunEnded
    folder: Path
    result: Mapping[str, Any]


def inspect_drive(url: str, profile_name: str, nameplate: Nameplate, plan: ProcedurePlan) -> Inspection:
    """All that can be known without energising or writing."""
    import time

    profile = load_profile(profile_name)
    with _port(url, profile, plan) as port:
        inverter = Inverter(port, profile)
        identity = inverter.identify()
        plate = inverter.read_nameplate()
        statuses = [inverter.read_status()]
        time.sleep(plan.supervision.standstill_dwell_s)
        statuses.append(inverter.read_status())
        job = _job(profile, nameplate, plan, port, write_back=False)
        checks = judge_drive(identity, statuses, plate, nameplate, job.drive_limits, job.test_current_a)
        snapshot = inverter.snapshot()
    watchdog = profile.watchdog
    return Inspection(
        identity,
        plate,
        snapshot.in_use,
        dataclasses.asdict(watchdog) if watchdog else {"none": "the drive file describes none"},
        checks,
    )


def commission(
    url: str,
    profile_name: str,
    nameplate: Nameplate,
    plan: ProcedurePlan,
    *,
    write_back: bool,
    runs: Path,
    present: Present,
    diagnosis_s: float = 0.0,
) -> Commissioned:
    """The whole job. Configuration errors are raised; from the first request on, every end is a run with a folder.

    `diagnosis_s` > 0: once everything is saved and the drive is let go, the run's samples are diagnosed for about so long.
    """
    profile = load_profile(profile_name)
    parse_url(url)
    present(WarmingUp())
    warm_up(nameplate)
    folder = RunFolder.create(runs, profile_name.rsplit("/", 1)[-1].removesuffix(".toml"))
    findings = Findings()
    try:
        folder.save(
            "request.json",
            {
                "url": without_secrets(url),
                "profile": profile.file,
                "nameplate": nameplate,
                "plan": plan,
                "write_back": write_back,
            },
        )
        ended = _carry_out(url, profile, nameplate, plan, write_back, folder, findings, present)
        result = _close(folder, nameplate, findings, ended, _parameter_names(profile))
        if diagnosis_s > 0.0 and findings.identification is not None:
            present(Diagnosing(diagnosis_s))
            result = _with_diagnosis(folder, result, findings, diagnosis_s)
    finally:
        folder.close()
    return Commissioned(ended, folder.path, result)


def _carry_out(
    url: str,
    profile: DriveProfile,
    nameplate: Nameplate,
    plan: ProcedurePlan,
    write_back: bool,
    folder: RunFolder,
    findings: Findings,
    present: Present,
) -> RunEnded:
    try:
        with _port(url, profile, plan) as port:
            inverter = Inverter(port, profile, lambda intent: _announce(folder, intent))
            job = _job(profile, nameplate, plan, port, write_back=write_back)
            folder.journal("job", job, durable=True)
            runner = Runner(inverter, folder, _bounds(job, profile), _watch(job, profile), present)
            ended = runner.perform(course(job, findings))
            folder.journal("link", port.stats.as_dict())
            return ended
    except CommissionerError as error:
        folder.journal("error", error.as_dict(), durable=True)
        ended = RunEnded(error.outcome, error.what, 0.0, error.as_dict())
        folder.journal("run_ended", ended, durable=True)
        return ended


def _announce(folder: RunFolder, intent: Intent) -> None:
    """Every intent is with the operating system before it is carried out, so that a kill loses none. What starts or
    changes something lasting is on the disk, too; steering a running test is not: a slow disk must not starve the
    watchdog."""
    folder.journal("about_to", intent, durable=intent.action is not Action.STEER)


def _close(
    folder: RunFolder, nameplate: Nameplate, findings: Findings, ended: RunEnded, parameter_names: Mapping[str, str]
) -> Mapping[str, Any]:
    """Recording, result and report, in that order: each needs only the one before."""
    metadata: dict[str, float | str] = {
        key: value for key, value in dataclasses.asdict(nameplate).items() if value is not None
    }
    if findings.winding_degc is not None:
        metadata["winding_temperature_degc"] = findings.winding_degc
    write_recording(folder.path, metadata)
    result: dict[str, Any] = plain(summarise(findings, ended, folder.path.name, parameter_names))
    folder.save("result.json", result)
    journal = read_journal(folder.path / "journal.jsonl")
    folder.save_text("report.html", run_page(result, journal, findings))
    return result


def _with_diagnosis(
    folder: RunFolder, result: Mapping[str, Any], findings: Findings, seconds: float
) -> Mapping[str, Any]:
    """Result and report once more, with what a four-parameter simulation would have got wrong."""
    diagnosis = diagnose_run(folder, seconds)
    remarks = [*(result.get("remarks") or ()), *diagnosis_sentences(diagnosis, result["parameters"])]
    completed: dict[str, Any] = {**result, "diagnosis": diagnosis, "remarks": remarks}
    folder.save("result.json", completed)
    folder.save_text("report.html", run_page(completed, read_journal(folder.path / "journal.jsonl"), findings))
    return completed


@contextmanager
def _port(url: str, profile: DriveProfile, plan: ProcedurePlan) -> Iterator[ModbusPort]:
    port = open_port(parse_url(url), profile, reply_timeout_s=plan.supervision.reply_timeout_s)
    try:
        yield port
    finally:
        port.close()


def _job(
    profile: DriveProfile, nameplate: Nameplate, plan: ProcedurePlan, port: ModbusPort, *, write_back: bool
) -> Job:
    """The job with the link's measured latency: what the guard predicts across."""
    inverter = Inverter(port, profile)
    for _ in range(LATENCY_PROBES):
        inverter.read_status()
    return Job(
        plan=plan,
        nameplate=nameplate,
        drive_limits=_drive_limits(profile),
        parameter_names=_parameter_names(profile),
        write_back=write_back,
        link_latency_s=min(WORST_LATENCY_FACTOR * port.stats.latency_s(1.0), plan.supervision.reply_timeout_s),
    )


def _parameter_names(profile: DriveProfile) -> dict[str, str]:
    """The drive's name of each parameter that is one of the contract's, not another circuit's or in another form."""
    by_quantity = dict(zip((*RESISTANCES, *INDUCTANCES[:2]), PARAMETERS, strict=True))
    items = [profile.item(name) for name in profile.parameters.order] if profile.parameters else []
    known = {item.name: by_quantity.get(item.quantity or item.name) for item in items if is_our_own(item)}
    return {name: field for name, field in known.items() if field is not None}


def _drive_limits(profile: DriveProfile) -> DriveLimits:
    """What the drive file does not claim is not judged."""
    limits = profile.limits
    return DriveLimits(
        dc_link_min_v=-math.inf if limits.dc_link_min_v is None else limits.dc_link_min_v,
        dc_link_max_v=math.inf if limits.dc_link_max_v is None else limits.dc_link_max_v,
        heatsink_max_degc=math.inf if limits.heatsink_max_degc is None else limits.heatsink_max_degc,
        winding_max_degc=math.inf if limits.winding_max_degc is None else limits.winding_max_degc,
    )


def _bounds(job: Job, profile: DriveProfile) -> Bounds:
    return Bounds(
        max_watchdog_s=job.plan.supervision.max_watchdog_s,
        drive_current_a=job.trip_current_a,
        test_voltage_v=job.test_voltage_v,
        axis_time_s=job.axis_time_s,
        total_time_s=job.total_time_s,
        parameters=prior(job.nameplate),
    )


def _watch(job: Job, profile: DriveProfile) -> WatchLimits:
    limits = job.drive_limits
    return WatchLimits(
        current_a=job.trip_current_a,
        flux_fraction=FLUX_FRACTION,
        axis_time_s=job.axis_time_s,
        lost_samples_s=LOST_SAMPLES_S,
        dc_link_v=(limits.dc_link_min_v, limits.dc_link_max_v),
        heatsink_degc=limits.heatsink_max_degc,
        winding_degc=limits.winding_max_degc,
    )
