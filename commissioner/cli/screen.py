"""What goes to the terminal: one JSON document, or words and tables for a person."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Sequence

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from commissioner.errors import CommissionerError
from commissioner.run.archive import plain

out = Console(highlight=False)
err = Console(stderr=True, highlight=False)


def emit(document: object) -> None:
    """The one JSON document of `--json`."""
    sys.stdout.write(json.dumps(plain(document), indent=2, allow_nan=False) + "\n")
    sys.stdout.flush()


def failure(error: CommissionerError) -> None:
    """What happened, where, value, limit, remedy: a line each."""
    err.print(f"[bold red]{escape(error.what)}[/]")
    for name, text in (("step", error.step), ("value", error.value), ("limit", error.limit), ("remedy", error.remedy)):
        if text not in (None, ""):
            err.print(f"  [dim]{name:<7}[/]{escape(shown(text))}")


def table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]], *, right: Iterable[int] = ()) -> Table:
    """A rich table; `right` lists the columns that hold numbers."""
    made = Table(title=title or None, title_justify="left", title_style="bold", header_style="dim", box=None, pad_edge=False)
    for index, name in enumerate(header):
        made.add_column(name, justify="right" if index in set(right) else "left", no_wrap=index == 0)
    for row in rows:
        made.add_row(*row)
    return made


def shown(value: object) -> str:
    """A value as a person reads it: four digits, no tails."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def quantity(value: float, std: float, unit: str) -> str:
    """`3.702 +- 0.011 ohm`, rounded to two digits of the standard error."""
    import math  # noqa: PLC0415

    if not (math.isfinite(std) and std > 0):
        return f"{value:.4g} {unit}"
    digits = max(0, 1 - math.floor(math.log10(std)))
    return f"{value:.{digits}f} ± {std:.{digits}f} {unit}"
