"""`commissioner study FILE.toml`: a campaign of simulated commissionings, or of recordings."""

from __future__ import annotations

from commissioner.cli.screens import screen
from commissioner.errors import CommissionerError
from commissioner.report.sheet.numbers import spelled
from commissioner.study.campaign import CaseEnded, Studied, StudyRequest, carry_out
from commissioner.study.rows import DEFECT


def study(request: StudyRequest, *, as_json: bool) -> None:
    """Progress on stderr's terminal, the summary on stdout."""
    done = carry_out(request, lambda ended: None if as_json else _progress(ended))
    if as_json:
        screen.emit(done)
    else:
        _show(done)
    if defects := done.outcomes.get(DEFECT, 0):
        what = f"{defects} of {done.cases} cases ended in a defect of this program: their rows in the table say which"
        screen.err.print(f"[red]{what}; please report it[/]", soft_wrap=True)
        raise SystemExit(CommissionerError.exit_code)


def _progress(ended: CaseEnded) -> None:
    if ended.done == ended.cases or ended.done % max(1, ended.cases // 100) == 0:
        screen.out.print(f"[dim]{ended.done} of {ended.cases}  {screen.text(ended.outcome)}[/]")


def _show(done: Studied) -> None:
    screen.out.print(f"[bold]{spelled(done.cases, 'case')}[/], {done.per_minute:.1f} a minute")
    rows = [(outcome, str(number), f"{100 * number / done.cases:.1f} %") for outcome, number in done.outcomes.items()]
    screen.out.print(screen.table("", ("outcome", "cases", "share"), rows, right=(1, 2)))
    errors = [
        (e.field, *(f"{100 * q:.2g} %" for q in e.quantiles), f"{100 * e.coverage:.1f} %") for e in done.summary.errors
    ]
    if errors:
        header = ("parameter", "median", "95 % within", "worst", "in 95 % interval")
        screen.out.print(screen.table("", header, errors, right=(1, 2, 3, 4)))
    if done.summary.worst_flux_fraction is not None:
        screen.out.print(f"worst true flux {done.summary.worst_flux_fraction:.3f} of the guard's limit")
    for what, path in (("table", done.table), ("page", done.report)):
        screen.out.print(f"{what}  {screen.text(path)}", soft_wrap=True)
