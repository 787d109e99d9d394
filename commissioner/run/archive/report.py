"""The report of a run: as it ends, made later from what its archive holds, and marked with what has happened since."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from contextlib import closing, suppress
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from commissioner.encoding import plain
from commissioner.errors import CommissionerError, UsageError
from commissioner.motor.nameplate import Nameplate, plate_doubts
from commissioner.procedure.findings import RunEnded
from commissioner.report.page import with_notice, with_notices_of
from commissioner.report.run.contract import RunDocument
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.journal import read_journal
from commissioner.run.archive.replay import learn_again, read_end
from commissioner.run.archive.summary import RunSummary, lacks_result, read_file

if TYPE_CHECKING:
    from commissioner.procedure.steps import Findings


def write_report(folder: RunFolder, result: RunDocument, findings: Findings) -> None:
    """`result.json`, and the page that names its digest; what an earlier page says on top stays."""
    digest = hashlib.sha256(folder.save("result.json", result).read_bytes()).hexdigest()
    page, before = _page(folder.path, result, findings, digest), folder.path / "report.html"
    if before.is_file():
        page = with_notices_of(before.read_text("utf-8"), page)
    folder.save_text("report.html", page)


def mark_restored(run: RunSummary, key: bytes | None = None) -> None:
    """The report says on top that the drive holds its old values again."""
    _mark(run, "Restored on {}: the drive took back the values it had before this run.", key)


def mark_written(run: RunSummary, key: bytes | None = None) -> None:
    """The report says on top that the drive holds the values that were only accepted when it was made."""
    _mark(
        run,
        "Written on {}, after this report was made: the drive took its values, read back. Where it says `not written`, that was before.",
        key,
    )


def _mark(run: RunSummary, sentence: str, key: bytes | None) -> None:
    """A disk that is full, or another process that goes on writing there, leaves the report as it is."""
    page = Path(run.folder) / "report.html"
    when = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    with suppress(OSError, UsageError), closing(RunFolder(page.parent, key)) as folder:
        folder.save_text(page.name, with_notice(page.read_text("utf-8"), sentence.format(when)))


def keep_result(
    folder: RunFolder, nameplate: Nameplate, names: tuple[Mapping[str, str], Mapping[str, float]], findings: Findings, ended: RunEnded
) -> RunDocument:  # fmt: skip
    """Recording, result and report of a run that has ended, in that order: each needs only the one before. `names`: of the drive's
    parameters and their factors, as `job.names_of` tells them."""
    from commissioner.report.run.summary import summarise

    metadata: dict[str, float | str] = {key: value for key, value in asdict(nameplate).items() if value is not None}
    if findings.winding_degc is not None:
        metadata["winding_temperature_degc"] = findings.winding_degc
    folder.write_recording(metadata)
    result: RunDocument = plain(summarise(findings, ended, folder.path.name, *names))
    result["remarks"] = [*result["remarks"], *plate_doubts(nameplate), *findings.of_the_archive]
    write_report(folder, result, findings)
    return result


def make_report(run: RunSummary) -> None:
    """`report.html` of the run, and its result where the run had judged and could not keep it. DataRefused where it never reached its drive."""
    from commissioner.report.run.summary import summarise

    path = Path(run.folder)
    journal = read_journal(path / "journal.jsonl")
    job, findings = learn_again(path)
    if lacks_result(path, journal):
        with closing(RunFolder(path)) as folder:
            if lacks_result(path, read_journal(path / "journal.jsonl")):  # nobody has kept it meanwhile
                names = (job.parameter_names, job.parameter_factors)
                keep_result(folder, job.nameplate, names, findings, read_end(path, journal))
        return
    errors = [line["record"] for line in journal if line["kind"] == "error"]
    ended = RunEnded(
        run.outcome, f"{run.reason}; parameters in the drive: {run.written}", run.energised_s, errors[-1] if errors else None
    )  # fmt: skip
    result = plain(summarise(findings, ended, run.run, job.parameter_names, job.parameter_factors))
    page = _page(path, result, findings, None)
    with closing(RunFolder(path)) as folder:
        folder.save_text("report.html", page)


def _page(path: Path, result: RunDocument, findings: Findings, digest: str | None) -> str:
    from commissioner.report.run.page import run_page
    from commissioner.run.index.years import over_years

    journal, request, years = read_journal(path / "journal.jsonl"), read_file(path / "request.json"), None
    with suppress(CommissionerError, OSError):  # an archive that cannot be looked through spoils no report
        years = over_years(path)
    return run_page(result, journal, findings, request, digest, years)
