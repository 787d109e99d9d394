"""Write back the parameter set that a run found in the drive."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from commissioner.errors import DataRefused, IdentityMismatch, LinkUnreachable, UsageError, WriteBackFailed
from commissioner.link.drive.facts import WriteReport
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import archived_profile
from commissioner.link.wire.modbus import open_port
from commissioner.link.wire.url import TlsUrl, parse_url
from commissioner.records import ParameterSnapshot, WrittenParameter, plain_name
from commissioner.registers.codec import held_words
from commissioner.registers.convention import staged_words_crc
from commissioner.registers.profile import DriveProfile
from commissioner.report.run.standing import Held
from commissioner.run.archive.documents import damaged, read_saved
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.journal import read_journal
from commissioner.run.archive.replay import read_snapshot
from commissioner.run.archive.summary import CALLED_OFF, RunSummary
from commissioner.run.ending import Announced, note
from commissioner.run.holding.drive_lock import DriveLock
from commissioner.run.holding.mastery import Mastery
from commissioner.run.proof import prove, prove_verdict
from commissioner.run.stopping.operator_stop import OperatorStop

RESTORING = "restore"


@dataclass(frozen=True)
class Restored:
    """What `restore` changed; empty where the drive held the snapshot's values already."""

    run: str
    written: tuple[WrittenParameter, ...]
    store_count: int | None
    wear_fraction: float | None
    is_stored: bool
    fault: str = ""
    """What the drive reports after it; empty: nothing."""


def restore(
    run: RunSummary, url: str | None, reply_timeout_s: float = 0.5, key: bytes | None = None,
    observe: Callable[[object], None] | None = None,
) -> Restored:  # fmt: skip
    """The snapshot of `run` into the drive it was taken from, verified and stored; `observe` is told of each step.

    DataRefused: the run took no snapshot, its folder is not as the run left it, or no motor of its plate has such values.
    DriveInUse: another run has the drive. IdentityMismatch: another drive or firmware answers, or it
    holds values that are neither the snapshot's nor this run's. What is restored is added to the run's own journal
    before and after.
    """
    folder = Path(run.folder)
    if not (folder / "snapshot.json").is_file():
        raise DataRefused(
            f"{run.run} holds no snapshot", step="restore", value="no snapshot.json",
            limit="a run that reached the pre-energise checks",
            remedy="choose an earlier run of this drive: `commissioner runs list`",
        )  # fmt: skip
    request = read_saved(folder, "request.json", "profile", "url")
    profile = archived_profile(str(request["profile"]))
    address = parse_url(url or request["url"])
    if isinstance(address, TlsUrl) and url is None:
        raise UsageError(
            f"the archive of {run.run} keeps no TLS files", step="restore", value=str(address),
            limit="an address with ca=, cert= and key=", remedy="give the drive's whole address with --drive",
        )  # fmt: skip
    lines = read_journal(folder / "journal.jsonl")
    snapshot = _complete(read_snapshot(folder, lines), profile, folder)
    prove_verdict(folder, prove(folder, profile, snapshot, key), observe=observe)
    with (
        DriveLock.take(address, profile, RESTORING) as lock,
        closing(RunFolder(folder, key)) as journal,
        OperatorStop(),  # a set is never left half written for a Ctrl-C
    ):
        lock.name_run(folder.name)
        try:
            port = open_port(address, profile, reply_timeout_s=reply_timeout_s)
        except LinkUnreachable as silent:
            if url is None and snapshot.identity.drive_type.startswith("SIM"):
                silent.remedy = (
                    "the run's drive was a simulated one, which ends with the demo and takes its values along: nothing is left to restore; "
                    "where one runs still, give its address with --drive"
                )
            raise
        with closing(port):
            inverter = Inverter(port, profile, announced := Announced(journal, observe))
            with Mastery(inverter, lock) as mastery:
                mastery.take(identity := inverter.identify())
                announced.begin(RESTORING, identity)
                report = _bring_back(inverter, snapshot, lines, announced, run.held)
        note(journal, "snapshot_restored", report)  # the drive holds it, whether the disk takes the record or not
    return Restored(
        run.run, report.written, report.store_count_after, report.wear_fraction, report.is_stored, report.fault
    )


def _bring_back(
    inverter: Inverter, snapshot: ParameterSnapshot, lines: list[dict[str, Any]], announced: Announced, before: Held
) -> WriteReport:
    """The snapshot, into the drive. `before`: what was known of it; of a drive that was seen to hold that still, it is known again."""
    present = inverter.snapshot().in_use
    _check_known(present, snapshot, inverter.profile, lines)
    try:
        return inverter.restore(snapshot, present)
    except WriteBackFailed as failed:
        if failed.is_as_found:
            note(announced.folder, CALLED_OFF, failed.as_dict() | {"held": before.value})
        raise
    except OSError as failure:
        raise announced.lost(failure) from failure


def _complete(snapshot: ParameterSnapshot, profile: DriveProfile, folder: Path) -> ParameterSnapshot:
    """The snapshot where it holds exactly the drive file's parameters; no `stored` where the drive cannot show it."""
    names = set(profile.parameter_names)
    for which, values in (("in_use", snapshot.in_use), ("stored", snapshot.stored or dict.fromkeys(names, 0.0))):
        wrong = sorted(names.symmetric_difference(values))
        if wrong:
            is_missing = wrong[0] in names
            raise damaged(
                folder, "snapshot.json", f"{which}: {wrong[0]} {'is missing' if is_missing else 'is not known'}"
            )
    return snapshot


def _check_known(
    present: Mapping[str, float], snapshot: ParameterSnapshot, profile: DriveProfile, lines: list[dict[str, Any]]
) -> None:
    """IdentityMismatch where a value in use was neither found by this run nor announced by it."""
    tuned = [line["record"]["values"] for line in lines if line["kind"] == "tuned_once"]
    if len(tuned) < sum(_is_tuning(line) for line in lines):
        return  # what the drive found by itself in a tuning that did not end as it should nobody has seen
    announced = [*_announced(lines), *tuned]
    if (
        profile.parameters
        and profile.parameters.staged_crc
        and staged_words_crc(present, profile) in {values.get(profile.parameters.staged_crc) for values in announced}
    ):
        return  # a set that this run committed, also where parts of it lay staged before
    changed = profile.tuning.also_changes if tuned and profile.tuning else ()
    for name, held in present.items():
        if name in changed:
            continue
        known = [snapshot.in_use.get(name), snapshot.stored.get(name)]
        known += [values.get(key) for values in announced for key in (name, f"staged_{name}")]
        item = profile.item(name)
        words = [held_words(item, value) for value in known if isinstance(value, int | float)]
        if held_words(item, held) not in words:
            raise IdentityMismatch(
                f"the drive holds a {plain_name(name)} that this run neither found nor wrote", step="restore", value=held, unit=item.unit,
                limit=" or ".join(dict.fromkeys(f"{v:.6g} {item.unit}".strip() for v in known if isinstance(v, int | float))),
                remedy="someone changed the drive after this run, or it is another drive of its type: restore the newest run of this drive first, or "
                "enter the values at the drive",
            )  # fmt: skip


def _is_tuning(line: dict[str, Any]) -> bool:
    """Whether the drive was about to tune itself."""
    return line["kind"] == "about_to" and isinstance(line["record"], dict) and line["record"].get("action") == "tune"


def _announced(lines: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """What each intent to stage or commit said, journalled before it went out."""
    for line in lines:
        record = line["record"]
        if line["kind"] == "about_to" and isinstance(record, dict) and record.get("action") in ("stage", "commit"):
            values = record.get("values")
            yield values if isinstance(values, dict) else {}
