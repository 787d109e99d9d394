"""`commissioner runs compare`: what moved between two runs."""

from __future__ import annotations

from pathlib import Path

from commissioner.cli.screens import screen
from commissioner.operations.compare import Compared
from commissioner.operations.compare import compare_runs as carry_out


def compare_runs(folder: Path, before: str, after: str, *, as_json: bool) -> None:
    """Same motor, changed, or another one."""
    done = carry_out(folder, before, after)
    if as_json:
        screen.emit(done)
    else:
        _show(done)


def _show(done: Compared) -> None:
    comparison = done.comparison
    rows = [(c.parameter, f"{100 * c.relative_change:+.2f} %", f"{c.sigmas:.1f}") for c in comparison.changes]
    screen.out.print(f"[bold]{comparison.verdict.value}[/]\n  {comparison.reason}")
    screen.out.print(screen.table("", ("parameter", "change", "standard errors"), rows, right=(1, 2)))
    for sentence in done.common.sentences:
        screen.out.print(f"  [dim]•[/] {screen.text(sentence)}")
