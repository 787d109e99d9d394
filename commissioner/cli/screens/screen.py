"""What goes to the terminal: one JSON document, or words and tables for a person."""

from __future__ import annotations

import json
import math
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import MappingProxyType
from typing import Any, Literal

from rich.console import Console, Group
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from commissioner.cli.console import spelled
from commissioner.cli.screens.sentence import Sentence
from commissioner.encoding import plain
from commissioner.errors import Aborted, CommissionerError, UsageError
from commissioner.motor.quantities import FIVE
from commissioner.report.run.standing import Standing, finding_sentences, standing
from commissioner.run.archive.documents import Loss
from commissioner.text import LONGEST, in_unit, visible
from commissioner.text import shown as cut

SENTENCE = 2000
"""Characters of a failure's facts: they are ours, with somebody else's inside."""


class Terminal(Console):
    """Obeys markup alone: a control character in any sentence, from wherever it comes, only shows."""

    def render_str(self, text: str, **options: Any) -> Text:
        return Sentence.of(
            super().render_str(spelled("\n".join(map(visible, text.split("\n"))), self.encoding), **options)
        )

    def print(self, *objects: Any, **options: Any) -> None:
        """As rich's; a sentence alone stays one (in company rich joins them to a plain text)."""
        if len(objects) == 1 and isinstance(objects[0], str) and not options.get("soft_wrap"):
            read = {name: options[name] for name in ("markup", "emoji", "highlight") if name in options}
            objects = (Group(self.render_str(objects[0], **read)),)
        super().print(*objects, **options)

    def on_broken_pipe(self) -> None:
        """Nobody reads any more (`| head`): silent from here on, and the verb ends with its own exit code."""
        self.quiet = True
        os.dup2(os.open(os.devnull, os.O_WRONLY), self.file.fileno())


out = Terminal(highlight=False)
err = Terminal(stderr=True, highlight=False)


def emit(document: object) -> None:
    """The one JSON document of `--json`."""
    sys.stdout.write(json.dumps(plain(document), indent=2, allow_nan=False) + "\n")
    sys.stdout.flush()


def emit_texts(name: str, documents: Sequence[str], **more: object) -> None:
    """As `emit`, of documents that are JSON texts already: ten thousand of them are not decoded to be encoded again."""
    facts = "".join(f', "{key}": {json.dumps(plain(value))}' for key, value in more.items())
    sys.stdout.write(f'{{"{name}": [\n' + ",\n".join(documents) + f"\n]{facts}}}\n")
    sys.stdout.flush()


def require_yes(yes: bool, *, as_json: bool) -> None:
    """UsageError where a question would have to be asked and nobody can be."""
    if as_json and not yes:
        raise UsageError(
            "nobody can be asked with --json", step="confirm", value="--json without --yes", limit="--yes",
            remedy="add --yes once you have made sure that the drive may be energised or written",
        )  # fmt: skip


def confirm(question: str, *, otherwise: str) -> None:
    """Aborted unless a person says yes; `otherwise` says what a no leaves behind."""
    import typer

    if not typer.confirm(question):
        raise Aborted(otherwise, step="confirm", value="no", limit="yes", remedy="start again when ready")


@contextmanager
def busy(doing: str) -> Iterator[Callable[[str], None]]:
    """A moving bar and the time gone by on stderr, while something takes longer than a person likes to wait; what is called with other
    words shows these from then on."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("    {task.description}"), BarColumn(bar_width=24), TimeElapsedColumn())
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as progress:
        task = progress.add_task(doing, total=None)
        yield lambda text: progress.update(task, description=visible(text))


def failure(error: CommissionerError) -> None:
    """What happened, where, value, limit, remedy: a line each."""
    err.print(f"[bold red]{text(error.what, SENTENCE)}[/]")
    for name, fact in (("step", error.step), ("value", error.value), ("limit", error.limit), ("remedy", error.remedy)):
        if fact not in (None, ""):
            err.print(f"  [dim]{name:<7}[/]{text(shown(fact, error.unit), SENTENCE)}")


_SIGNS = (
    (r"\+-", "±"), (r"->", "→"), (r"\b([LT])_sigma\b", r"\1_σ"), (r"(\d) us\b", r"\1 µs"), (r"(\d) ohm\b", r"\1 Ω"),
    (r"(\d) deg\b", r"\1°"), *((rf"\b{q.field}\b", q.name) for q in FIVE),
)  # fmt: skip


def signs(sentence: str) -> str:
    """A document's sentence with the names and signs that the tables beside it have; a console that lacks them spells them out."""
    for spelt, sign in _SIGNS:
        sentence = re.sub(spelt, sign, sentence)
    return sentence


def text(value: object, longest: int = LONGEST) -> str:
    """Whatever comes from outside, as it may stand in a line with markup: shown, never obeyed."""
    return escape(cut(value, longest))


def table(
    title: str,
    header: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    right: Iterable[int] = (),
    widths: Mapping[int, int] = MappingProxyType({}),
) -> Table:
    """A rich table; `right` lists the columns that hold numbers, `widths` those of a fixed width. A word wider than its column goes on in the next line: nothing
    is cut off."""
    made = Table(
        title=title or None, title_justify="left", title_style="bold", header_style="dim", box=None, pad_edge=False
    )
    for index, name in enumerate(header):
        side: Literal["left", "right"] = "right" if index in set(right) else "left"
        made.add_column(
            name,
            justify=side,
            width=widths.get(index),
            no_wrap=index == 0,
            overflow="ellipsis" if index == 0 else "fold",
        )
    for row in rows:
        made.add_row(*row)
    return made


def stacked_rows(rows: Iterable[Sequence[str]]) -> None:
    """What is too wide for a table: the first cell of each row whole, the others below it."""
    from rich.padding import Padding

    for first, *others in rows:
        out.print(first, soft_wrap=True, highlight=False)
        out.print(Padding("; ".join(" ".join(cell.split()) for cell in others if cell), (0, 0, 0, 4)))


def stacked(names: str) -> str:
    """The names of a class below each other: in one line they leave the columns beside them no room."""
    return names.replace(" or ", " or\n")


def shown(value: object, unit: str = "") -> str:
    """A value as a person reads it: four digits, no tails, a number in its unit."""
    return in_unit(f"{value:.4g}" if isinstance(value, float) else str(value), value, unit)


def quantity(value: float, std: float | None, unit: str) -> str:
    """`3.702 ± 0.011 ohm`: half of the 95 % interval, and both to two digits of it."""
    from commissioner.report.sheet.numbers import half_width, with_interval  # with numpy behind it

    half = half_width(std)
    return f"{with_interval(value, half) if 0.0 < half < math.inf else f'{value:.4g}'} {unit}"


def share(measured: Mapping[str, Any], std: str = "std") -> str:
    """Half of the 95 % interval in per cent of the value; nothing where no error is known."""
    from commissioner.report.sheet.numbers import half_width  # with numpy behind it

    half = half_width(measured[std])
    return f"{100 * half / abs(measured['value']):.2g} %" if half else "not known"


def kept(is_stored: bool) -> str:
    """How lasting a write is, in words."""
    return (
        "read back and stored" if is_stored else "read back, not stored: save at the drive or it is lost at power-off"
    )


def wear(count: int, fraction: float) -> str:
    """How much of the drive's memory is used up."""
    return f"writes of the drive's memory so far: {count}, {fraction:.3%} of its life"


_MARKS: Mapping[str, tuple[str, str]] = {
    Standing.COMMISSIONED: ("green", "✓"), Standing.ACCEPTED: ("yellow", "✓"), Standing.RESTORED_SINCE: ("yellow", "✓"),
    Standing.REJECTED: ("yellow", "✗"), Standing.ABORTED: ("yellow", "■"), Standing.FAULTED: ("red", "✗"),
}  # fmt: skip
"""Colour and sign; of any other red and a question."""


OUTCOME_WIDTH, NARROW = 14, 100
"""Of `commissioned` with its mark; of a terminal on which the columns share too little, and words would break."""


def outcome_width(header: Sequence[str]) -> Mapping[int, int]:
    """`widths` of a table with a column `outcome`: where the terminal is narrow its words stay whole."""
    return {header.index("outcome"): OUTCOME_WIDTH} if out.width < NARROW else {}


def outcome_cell(standing: str) -> str:
    """As `outcome_mark`, in a column of `outcome_width`."""
    mark = outcome_mark(standing)
    return mark.replace("commissioned, ", "commissioned\n") if out.width < NARROW else mark


def outcome_mark(standing: str) -> str:
    """The outcome in its colour; a run that was cut off is red."""
    colour, sign = _MARKS.get(standing, ("red", "?"))
    return f"[{colour}]{sign} {text(standing)}[/]"


_WRITTEN: Mapping[str, str] = {Standing.RESTORED_SINCE: "restored", Standing.UNSURE: "not known"}
"""Whether what was written is in the drive now; else it is."""


def result(document: Mapping[str, Any], standing_now: str = "") -> None:
    """A run's result as the technician reads it; `standing_now` where something has happened since."""

    out.print()
    out.print(f"[bold]{outcome_mark(standing_now or standing(document))}[/]  {escape(signs(str(document['reason'])))}")
    error = document.get("error")
    if error:
        for name in ("step", "value", "limit", "remedy"):
            if error.get(name) not in (None, ""):
                out.print(f"  [dim]{name:<7}[/]{escape(signs(shown(error[name], error.get('unit', ''))))}")
    if document.get("parameters"):
        out.print(
            table(
                "",
                ("", "value", "± 95 %", "in the drive before", "change", "written"),
                _rows(document, _WRITTEN.get(standing_now, "yes")),
                right=(1, 2, 3, 4),
            )
        )
        for remark in (*finding_sentences(document), *document.get("remarks", ())):
            out.print(f"  [dim]•[/] {escape(signs(remark))}")
        if (standing_now or standing(document)) == Standing.ACCEPTED:
            again = "" if document.get("tune") else f"`commissioner write-back {escape(str(document['run']))}` or "
            out.print(
                f"  [dim]•[/] the drive still holds its old values; {again}the same call with --write-back writes the new ones"
            )
    out.print(f"  energised {seconds(document['energised_s'], ' in all')}")


def losses(run: str, found: Sequence[Loss]) -> None:
    """That a run's folder is not as the run left it, where it is not."""
    if found:
        what = "; ".join(f"{loss.file}: {loss.what}" for loss in found[:3])
        err.print(f"[red]damaged[/] {escape(what)}; `commissioner runs verify {escape(run)}` says all", soft_wrap=True)


def seconds(energised_s: float | None, of: str = "") -> str:
    """How long the motor was energised; a drive that tuned itself, or a run that was cut off, does not say it."""
    return "for how long is not known" if energised_s is None else f"{energised_s:.1f} s{of}"


def _rows(document: Mapping[str, Any], done: str) -> Iterable[Sequence[str]]:
    before = document.get("before") or {}
    written = {row["field"] for row in document.get("written", ())}
    for q in FIVE:
        quantity_ = document["parameters"].get(q.field)
        if quantity_ is None:
            continue
        value = quantity_["value"]
        old = before.get(q.field)
        yield (
            q.name,
            f"{q.factor * value:.4g} {q.unit}",
            share(quantity_),
            "" if old is None else f"{q.factor * old:.4g} {q.unit}",
            "" if not old else f"{100 * (value / old - 1):+.1f} %",
            done if q.field in written else "",
        )
