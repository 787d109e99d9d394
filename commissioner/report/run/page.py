"""The report of a commissioning run: sheets to print, sign and keep, and to read on a narrow screen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import Any

from commissioner.history.motor import Trends
from commissioner.procedure.steps import Findings
from commissioner.report.run.appendix import checks_and_course, registers_and_record, uncertainty
from commissioner.report.run.certificate import certificate
from commissioner.report.run.evidence import evidence
from commissioner.report.run.plain_simulation import plain_simulation
from commissioner.report.run.subject import Subject
from commissioner.report.run.tuned import tuned_sheet
from commissioner.report.run.years import years_sheet
from commissioner.report.sheet.document import Margins, Page, document


def run_page(
    result: Mapping[str, Any],
    journal: Sequence[Mapping[str, Any]],
    findings: Findings,
    request: Mapping[str, Any] | None = None,
    digest: str | None = None,
    years: Trends | None = None,
) -> str:
    """The whole report as one self-contained HTML text, for every way a run can end. `digest`: SHA-256 of result.json; `years`: of the
    motor it was made on."""
    subject = Subject(result, journal, findings, request or {})
    first = tuned_sheet(subject) if result.get("tune") else certificate(subject)
    pages = [
        Page("result", "Result", first),
        Page("evidence", "Evidence", evidence(subject), flows=not subject.tests),
        Page("simulation", "Plain simulation", plain_simulation(subject)),
        Page("a", "A Checks", checks_and_course(subject), flows=True),
        Page("b", "B Procedure", registers_and_record(subject, digest), flows=True),
        Page("c", "C Uncertainty", uncertainty(subject), flows=True),
        Page("d", "D The motor over the years", years_sheet(years), flows=True),
    ]
    return document(f"Report {subject.run}", _margins(subject, digest), [page for page in pages if page.body])


def _margins(subject: Subject, digest: str | None) -> Margins:
    tag = subject.told("motor_tag")
    drive = subject.result.get("drive") or {}
    return Margins(
        subject=f"Commissioning report, {f'motor {tag}' if tag else 'induction motor at standstill'}",
        middle="Simulated drive and motor" if subject.is_simulated else str(drive.get("drive_type", "")),
        run=subject.run,
        below_left=f"SHA-256 of result.json: {digest[:20]}…" if digest else "",
        below_right=f"commissioner {version('commissioner')} · every ± is a 95 % interval",
    )
