"""Why these causes and no others: every record of the search, with what was gained, wanted, and by which rule."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rich.markup import escape

from commissioner.cli.screens.screen import out as screen
from commissioner.cli.screens.screen import table
from commissioner.diagnose.search.journal import (
    Accepted,
    Dropped,
    Exchanged,
    Refined,
    Screened,
    Step,
    Tried,
    read,
    replayed,
)
from commissioner.report.diagnosis.names import said

COLUMNS = ("", "what", "gained", "wanted", "because of")


def show(document: Mapping[str, Any]) -> None:
    """One row a record; chi-squares. Nothing of a table of test points, which needs no search."""
    steps = read(document.get("search", ()))
    if not steps:
        return
    screen.print(table("the search", COLUMNS, [tuple(escape(said(x)) for x in row) for row in map(_row, steps)]))
    again = replayed(steps)
    if again.differs:
        screen.print(f"[yellow]decided again from these numbers: {escape(said('; '.join(again.differs)))}[/]")
    else:
        screen.print("[dim]decided again from these numbers: the same choices[/]")


def _row(step: Step) -> tuple[str, str, str, str, str]:
    match step:
        case Screened():
            best = sorted(step.promised, key=lambda n: -step.promised[n][0])[:3]
            promises: Iterable[str] = (f"{n} {step.promised[n][0]:.3g}" for n in best)
            return "screened", f"{len(step.promised)} causes; most promised: {', '.join(promises)}", "", "", ""
        case Tried():
            wrong = "" if step.is_sound else " (not what such a cause can be)"
            return "tried", f"{step.name} {step.how}".strip() + wrong, *_pair(step), step.wanted_by
        case Accepted():
            return "accepted", f"{step.name}; left: {step.left_sigma:.4g} x the noise", "", "", ""
        case Dropped():
            lost, wanted = f"{step.lost_chi2:.4g}", f"{step.wanted_chi2:.4g}"
            return "dropped" if step.is_taken else "stays", step.name, lost, wanted, step.wanted_by
        case Exchanged():
            return "exchanged" if step.is_taken else "not exchanged", step.says, *_pair(step), ""
        case Refined():
            return "refined" if step.is_taken else "not refined", step.says, *_pair(step), ""
        case _:
            return "", str(step).strip(), "", "", ""


def _pair(step: Tried | Exchanged | Refined) -> tuple[str, str]:
    return f"{step.gained_chi2:.4g}", f"{step.wanted_chi2:.4g}"
