"""The accepted result of an archived run into the drive it was measured on: first as a table, then, if that still holds, for good."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import cast

from commissioner.errors import Aborted, DataRefused, IdentityMismatch, UsageError, WriteBackFailed
from commissioner.link.drive.facts import WriteReport
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import archived_profile
from commissioner.link.wire.modbus import open_port
from commissioner.link.wire.url import TlsUrl, parse_url
from commissioner.motor.circuit import PARAMETERS, InverseGamma
from commissioner.motor.nameplate import Nameplate, believable
from commissioner.records import DriveIdentity, ParameterSnapshot, drive_words
from commissioner.registers.convention import as_in_drive, drive_values, our_values
from commissioner.registers.profile import DriveProfile
from commissioner.report.run.contract import PlanRow, WritePlan
from commissioner.report.run.standing import Standing
from commissioner.run.archive.documents import read_saved
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.journal import read_journal
from commissioner.run.archive.replay import read_snapshot
from commissioner.run.archive.summary import NO_RESULT, RunSummary
from commissioner.run.archive.verify import Verified, refuse_damage
from commissioner.run.ending import Announced, note
from commissioner.run.holding.drive_lock import LOOK, DriveLock
from commissioner.run.holding.mastery import Mastery
from commissioner.run.index.results import flux_level
from commissioner.run.proof import prove, prove_verdict, read_plate
from commissioner.run.stopping.operator_stop import OperatorStop
from commissioner.safety.commands import WriteParameters
from commissioner.safety.limits import Bounds, SafetyFacts, permit

REPLY_TIMEOUT_S = 0.5
STEP = "write parameters"


@dataclass(frozen=True)
class PlannedRow:
    """One register: what the drive holds now and what it would hold, in the drive's own unit and convention."""

    name: str
    register: int
    now: float
    will_be: float
    unit: str
    convention: str


@dataclass(frozen=True)
class Plan:
    """A table that somebody is asked to agree to. `token` stands for exactly this table. `holds_for_stator_flux_wb`: the peak stator
    flux of the L_M and T_R that would be written; at which the drive's hold, it does not say."""

    run: str
    what: str
    drive_type: str
    serial_number: int | None
    rows: tuple[PlannedRow, ...]
    holds_for_stator_flux_wb: float | None = None

    @property
    def token(self) -> str:
        text = json.dumps([self.run, self.what, self.serial_number, [asdict(row) for row in self.rows]])
        return hashlib.sha256(text.encode()).hexdigest()[:20]


@dataclass(frozen=True)
class _Ready:
    """All that is needed to act, read from the run's folder."""

    folder: Path
    profile: DriveProfile
    url: str
    plate: Nameplate
    snapshot: ParameterSnapshot
    verified: Verified

    @property
    def base(self) -> Nameplate:
        """The plate that the drive's own per cent and reactances are of."""
        return as_in_drive(self.plate, self.snapshot.plate)


def plan_write_back(run: RunSummary, url: str | None) -> Plan:
    """What writing this run's result would change. Reads the drive, changes nothing."""
    ready, circuit = _ready(run, url), _circuit(run)
    with _drive(ready) as inverter:
        plan = _plan(run, ready, inverter, "write back", drive_values(ready.profile, circuit, ready.base).values)
    return replace(plan, holds_for_stator_flux_wb=flux_level(run.parameters))


def plan_restore(run: RunSummary, url: str | None) -> Plan:
    """What restoring the set this run found would change. Reads the drive, changes nothing."""
    ready = _ready(run, url)
    with _drive(ready) as inverter:
        return _plan(run, ready, inverter, "restore", ready.snapshot.in_use)


def held_by_drive(run: RunSummary, url: str | None) -> tuple[str, Mapping[str, float]]:
    """The run's drive in words, and what it holds in use by the contract's names. Reads the drive, changes nothing.
    IdentityMismatch: another drive answers."""
    ready = _ready(run, url)
    with _drive(ready) as inverter:
        _require_the_runs_drive(inverter, ready, "compare")
        snapshot = inverter.snapshot()
    ours = our_values(ready.profile, snapshot.in_use, ready.base)
    held = {one.field: one.value for one in ours.values()}
    return drive_words(snapshot.identity.drive_type, snapshot.identity.serial_number), held


def write_accepted(
    run: RunSummary,
    url: str | None,
    token: str,
    key: bytes | None = None,
    observe: Callable[[object], None] | None = None,
) -> WriteReport:
    """The run's result into its drive, verified and stored, where the table of `token` still holds; `observe` is told of each step.

    Aborted: it does not. DataRefused: the folder is not as its run left it, or its samples lead to another result. IdentityMismatch:
    another drive. The run's journal says so before and after. `key`: of a sealed folder.
    """
    ready, circuit = _ready(run, url, key), _circuit(run)
    refuse_damage(ready.folder, ready.verified, STEP, "blocks.bin")  # what is lost of the samples proves no result
    prove_verdict(ready.folder, ready.verified, STEP, observe)
    _check_bounds(circuit, ready.plate)
    address = parse_url(ready.url)
    with (
        DriveLock.take(address, ready.profile, "write back") as lock,
        closing(RunFolder(ready.folder, key)) as journal,
        OperatorStop(),
    ):
        lock.name_run(ready.folder.name)
        port = open_port(address, ready.profile, reply_timeout_s=REPLY_TIMEOUT_S)
        inverter = Inverter(port, ready.profile, announced := Announced(journal, observe))
        with closing(port), Mastery(inverter, lock) as mastery:
            mastery.take(identity := inverter.identify())
            announced.begin("write back", identity)
            wanted = drive_values(ready.profile, circuit, ready.base).values
            check_token(_plan(run, ready, inverter, "write back", wanted), token)
            try:
                report = inverter.write_circuit(circuit, ready.plate, ready.snapshot)
            except WriteBackFailed as failed:
                if failed.was_restored:
                    note(journal, "snapshot_restored", failed.as_dict())
                raise
            except OSError as failure:
                raise announced.lost(failure) from failure
        note(journal, "parameters_written", report)
    return report


def check_token(plan: Plan, token: str) -> None:
    """Aborted where somebody agreed to another table than this one."""
    if plan.token != token:
        raise Aborted(
            "the table has changed since it was shown; nothing was written",
            step="compare with the table",
            value="the token of another table",
            limit="the token of the table as it is now",
            remedy="look at the new table, then decide again",
        )


def _ready(run: RunSummary, url: str | None, key: bytes | None = None) -> _Ready:
    folder = Path(run.folder)
    request = read_saved(folder, "request.json", "profile", "url", "nameplate")
    if not (folder / "snapshot.json").is_file():
        raise DataRefused(
            f"{run.run} holds no snapshot",
            step=STEP,
            value="no snapshot.json",
            limit="a run that reached its checks",
            remedy="choose another run",
        )
    address = url or str(request["url"])
    if isinstance(parse_url(address), TlsUrl) and url is None:
        raise UsageError(
            f"the archive of {run.run} keeps no TLS files",
            step=STEP,
            value=address,
            limit="an address with ca=, cert= and key=",
            remedy="give the drive's whole address with --drive",
        )
    snapshot = read_snapshot(folder, read_journal(folder / "journal.jsonl"))
    profile = archived_profile(str(request["profile"]))
    verified = prove(folder, profile, snapshot, key, STEP)
    return _Ready(folder, profile, address, read_plate(folder), snapshot, verified)


def _circuit(run: RunSummary) -> InverseGamma:
    """The accepted values. DataRefused: the run accepted none, the drive holds them already, or it may hold half of them."""
    parameters = (run.result or {}).get("parameters") or {}
    if run.is_unknown:
        raise DataRefused(
            f"a write-back or restore of {run.run} did not end: the drive holds its old or its new parameters", step=STEP, value=run.written,
            limit="a drive that was read since", remedy=f"`commissioner restore {run.run}` first, then write back",
        )  # fmt: skip
    if run.lacks_result:
        raise DataRefused(
            f"{run.run} has no result: {NO_RESULT}", step=STEP, value=run.standing.value, limit=Standing.ACCEPTED.value,
            remedy=f"`commissioner runs report {run.run}` makes it from the samples, where the run took some",
        )  # fmt: skip
    if not run.standing.may_be_written or not all(name in parameters for name in PARAMETERS):
        raise DataRefused(
            f"{run.run} has nothing to write",
            step=STEP,
            value=run.standing.value,
            limit=Standing.ACCEPTED.value,
            remedy="choose a run whose result was accepted and is not in the drive",
        )
    return InverseGamma(*(float(parameters[name]["value"]) for name in PARAMETERS))


def _check_bounds(circuit: InverseGamma, plate: Nameplate) -> None:
    """The same last gate as in a run."""
    facts = SafetyFacts(checks_passed=True, snapshot_taken=True, writing_allowed=True)
    bounds = Bounds(0.0, 0.0, 0.0, 0.0, 0.0, believable(plate))
    refusal = permit(WriteParameters(circuit, plate), facts, bounds)
    if refusal is not None:
        raise Aborted(
            f"not sent: {refusal.what}",
            step="WriteParameters",
            value=refusal.value,
            limit=refusal.limit,
            remedy=refusal.remedy,
        )


@contextmanager
def _drive(ready: _Ready) -> Iterator[Inverter]:
    """The drive, open for reading."""
    address = parse_url(ready.url)
    with DriveLock.take(address, ready.profile, LOOK) as lock:
        port = open_port(address, ready.profile, reply_timeout_s=REPLY_TIMEOUT_S)
        with closing(port):
            inverter = Inverter(port, ready.profile)
            Mastery(inverter, lock).look()
            yield inverter


def _plan(run: RunSummary, ready: _Ready, inverter: Inverter, what: str, wanted: Mapping[str, float]) -> Plan:
    identity = _require_the_runs_drive(inverter, ready, what)
    present = inverter.snapshot().in_use
    rows = tuple(_row(ready.profile, name, present[name], value) for name, value in wanted.items())
    return Plan(run.run, what, identity.drive_type, identity.serial_number, rows)


def _require_the_runs_drive(inverter: Inverter, ready: _Ready, step: str) -> DriveIdentity:
    """Who answers. IdentityMismatch: another one than the run was made on."""
    identity = inverter.identify()
    if identity.words != ready.snapshot.identity.words:
        raise IdentityMismatch(
            "this is not the drive of the run",
            step=step,
            value=identity.words,
            limit=ready.snapshot.identity.words,
            remedy="connect the drive that was measured, or measure this one",
        )
    return identity


def _row(profile: DriveProfile, name: str, now: float, will_be: float) -> PlannedRow:
    item = profile.item(name)
    return PlannedRow(name, item.place, now, will_be, item.unit, item.convention)


def as_document(plan: Plan) -> WritePlan:
    """The plan with its token."""
    return {
        "run": plan.run,
        "what": plan.what,
        "drive_type": plan.drive_type,
        "serial_number": plan.serial_number,
        "holds_for_stator_flux_wb": plan.holds_for_stator_flux_wb,
        "rows": [cast("PlanRow", asdict(row)) for row in plan.rows],
        "token": plan.token,
    }
