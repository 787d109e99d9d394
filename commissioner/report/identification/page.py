"""Two sheets: the values and what they hold for; what was measured, against what the model makes of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from typing import Any

from markupsafe import Markup

from commissioner.identify.analysis import Identification
from commissioner.procedure.steps import Findings
from commissioner.records import Signal
from commissioner.report.run import evidence
from commissioner.report.run.certificate import conditions, sentence
from commissioner.report.run.quantities import QUANTITIES
from commissioner.report.run.subject import Record, Session, Subject, Test
from commissioner.report.sheet import marks
from commissioner.report.sheet.document import Margins, Page, document
from commissioner.report.sheet.marks import Column, Text
from commissioner.report.sheet.numbers import digits, half_width, with_interval
from commissioner.report.sheet.words import spoken

_COLUMNS = (
    Column("Parameter"),
    Column("Value ± 95 % interval", right=True),
    Column("Interval in %", right=True),
)


@dataclass(frozen=True)
class Recorded(Subject):
    """Recordings instead of a run: no drive, no plan, no limits; the samples are those that the fits were made from."""

    @cached_property
    def tests(self) -> list[Test]:
        """Every test, in the order of the fits."""
        found = self.findings.identification
        assert found is not None
        return [
            Test(number, axis.axis_deg, tuple(_sessions(fit.stretches, axis.batch)), axis.batch.noise_a)
            for number, (axis, fit) in enumerate(zip(found.axes, found.fits, strict=True), start=1)
        ]

    @cached_property
    def _currents(self) -> list[Signal]:
        return [session.current_a for test in self.tests for session in test.sessions]


def _sessions(stretches: Sequence[Any], batch: Any) -> Iterator[Session]:
    for stretch, flux, residual in zip(stretches, batch.stator_flux_wb, batch.residuals, strict=True):
        yield Session.fitted(stretch.current_a, batch.sample_period_s, flux, residual)


def identification_page(found: Identification, result: Mapping[str, Any], name: str) -> str:
    """The report of a standstill identification as one self-contained HTML text. `result`: its document; `name`: of the files."""
    without_guard = {key: value for key, value in result.items() if key != "flux_guard"} | {"run": name}
    subject = Recorded(without_guard, (), Findings(identification=found), {})
    margins = Margins(
        f"Identification from {name}",
        "",
        name,
        "",
        f"commissioner {version('commissioner')} · every ± is a 95 % interval",
    )
    return document(
        f"Identification of {name}",
        margins,
        [Page("result", "Result", _values(subject)), Page("evidence", "Evidence", _pictures(subject))],
    )


def _values(subject: Subject) -> Markup:
    result = subject.result
    total_s = sum(float(axis["energised_s"]) for axis in result["axes"])
    parts = [
        Markup("<h1>Identified from {}</h1>").format(subject.run),
        marks.strip(_strip(subject, total_s)),
        marks.table(_COLUMNS, _rows(subject.parameters)),
        marks.section("What the values hold for", marks.facts(_conditions(subject))),
    ]
    if result["remarks"]:
        remarks = (sentence(spoken(str(remark))) for remark in result["remarks"])
        parts.append(marks.section("Remarks", *(marks.paragraph(remark, kind="small") for remark in remarks)))
    return Markup("\n").join(parts)


def _conditions(subject: Subject) -> Iterator[tuple[Text, Text]]:
    """As of a run, without its appendix."""
    for name, text in conditions(subject):
        yield name, Markup(str(text).replace(" T circuit: appendix B.", "")) if isinstance(text, Markup) else text


def _strip(subject: Subject, total_s: float) -> Iterator[tuple[Text, str, str]]:
    tests, gaps = len(subject.tests), subject.gaps
    yield "Tests", str(tests), f"energised {total_s:.1f} s"
    peak_a = subject.peak_current_a
    yield "Highest current", f"{digits(peak_a, 3)} A" if peak_a else "none", "along the axis"
    highest = max(float(axis["peak_stator_flux_wb"]) for axis in subject.result["axes"])
    rated = float(subject.result["rated_flux_wb"]["stator_peak"])
    yield "Highest stator flux", f"{digits(highest, 3)} Wb", f"{100 * highest / rated:.0f} % of rated"
    noise_a = max(test.noise_a for test in subject.tests)
    yield "Left by the model", f"{digits(1e3 * noise_a, 2)} mA rms", "worst test"
    yield "Samples lost", str(gaps.lost_samples) if gaps else "not known", f"in {gaps.count if gaps else 0} gaps"


def _rows(parameters: Record) -> Iterator[tuple[Text, ...]]:
    for quantity in (q for q in QUANTITIES if q.field in parameters):
        measured = parameters[quantity.field]
        value, half = quantity.factor * measured["value"], half_width(measured["std"] or 0.0, quantity.factor)
        yield (
            Markup("{} {}").format(quantity.symbol, quantity.words),
            Markup('<span class="val">{}</span> <span class="u">{}</span>').format(
                with_interval(value, half), quantity.unit
            ),
            f"± {digits(100 * half / abs(value), 2)} %" if half else "–",
        )


def _pictures(subject: Subject) -> Markup:
    """The same drawings as of a run; where there are no limits none is drawn."""
    caption = f"Filled: smallest to largest of each {1e3 * evidence.WINDOW_S:.0f} ms. Flux is that of the fitted model."
    measured = marks.figure("What was measured", evidence.over_time(subject), caption, aside=evidence.ABOVE_AND_BELOW)
    parts = [Markup("<h2>The evidence</h2>"), measured, evidence.against_simulation(subject), evidence.beside(subject)]
    return Markup("\n").join(parts)
