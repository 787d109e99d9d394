"""Write back the parameter set that a run found in the drive."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from commissioner.errors import DataRefused, UsageError
from commissioner.link.drive_file import load_profile
from commissioner.link.inverter import Inverter
from commissioner.link.modbus import open_port
from commissioner.link.url import TlsUrl, parse_url
from commissioner.records import WrittenParameter
from commissioner.run.archive import RunFolder, read_saved
from commissioner.run.catalogue import RunSummary
from commissioner.run.operator_stop import OperatorStop
from commissioner.run.replay import read_snapshot


@dataclass(frozen=True)
class Restored:
    """What `restore` changed; empty where the drive held the snapshot's values already."""

    run: str
    written: tuple[WrittenParameter, ...]
    store_count: int
    wear_fraction: float | None
    is_stored: bool


def restore(run: RunSummary, url: str | None, reply_timeout_s: float = 0.5) -> Restored:
    """The snapshot of `run` into the drive it was taken from, verified and stored.

    DataRefused: the run took no snapshot. IdentityMismatch: another drive or firmware answers. What is restored is
    added to the run's own journal before and after.
    """
    folder = Path(run.folder)
    if not (folder / "snapshot.json").is_file():
        raise DataRefused(
            f"{run.run} holds no snapshot", step="restore", value="no snapshot.json",
            limit="a run that reached the pre-energise checks",
            remedy="choose an earlier run of this drive: `commissioner runs list`",
        )  # fmt: skip
    request = read_saved(folder, "request.json", "profile", "url")
    profile = load_profile(request["profile"])
    address = parse_url(url or request["url"])
    if isinstance(address, TlsUrl) and url is None:
        raise UsageError(
            f"the archive of {run.run} keeps no TLS files", step="restore", value=str(address),
            limit="an address with ca=, cert= and key=", remedy="give the drive's whole address with --drive",
        )  # fmt: skip
    snapshot = read_snapshot(folder)
    with closing(RunFolder(folder)) as journal, OperatorStop():  # a set is never left half written for a Ctrl-C
        port = open_port(address, profile, reply_timeout_s=reply_timeout_s)
        with closing(port):
            inverter = Inverter(port, profile, lambda intent: journal.journal("about_to", intent, durable=True))
            report = inverter.restore(snapshot)
        journal.journal("snapshot_restored", report, durable=True)
    return Restored(run.run, report.written, report.store_count_after, report.wear_fraction, report.is_stored)
