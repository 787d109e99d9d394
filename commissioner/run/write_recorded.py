"""A motor identified from recordings, written into its drive: for drives that have no test mode of their own."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

from commissioner.identify.analysis import Identification
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.url import parse_url
from commissioner.motor.nameplate import Nameplate
from commissioner.procedure.plan import ProcedurePlan
from commissioner.procedure.recorded import recorded_course
from commissioner.procedure.steps import Findings
from commissioner.run.archive.seal import cover
from commissioner.run.commission import Commissioned, Order, carry_out, close_run
from commissioner.run.holding.drive_lock import ACT, DriveLock
from commissioner.run.runner import Present
from commissioner.run.stopping.operator_stop import OperatorStop


def write_recorded(
    url: str,
    profile_name: str,
    nameplate: Nameplate,
    plan: ProcedurePlan,
    identification: Identification,
    recordings: Sequence[Path],
    *,
    runs: Path,
    present: Present,
) -> Commissioned:
    """Check, snapshot, verdict, write, read back, as a run with a folder, which `restore` takes. Energises nothing."""
    profile = load_profile(profile_name)
    profile.require("write_back")
    order = Order(url, profile, nameplate, plan, write_back=True)
    findings = Findings(identification=identification)
    with DriveLock.take(parse_url(url), profile, ACT) as lock:
        folder = order.open_folder(runs, lock, recordings={str(path): cover(path)["sha256"] for path in recordings})
        with closing(folder), OperatorStop() as stop:
            ended = carry_out(order, folder, findings, present, recorded_course, "job_on_recordings", stop, lock)
            result = close_run(order, folder, findings, ended)
    return Commissioned(ended, folder.path, result)
