"""What a page of a recording says: headline, sections, tables, figures; shown as one sheet."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Literal, TypedDict

from markupsafe import Markup, escape

from commissioner.report.sheet import marks
from commissioner.report.sheet.document import Margins, document
from commissioner.report.sheet.document import Page as Sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Tone = Literal["good", "warn", "bad", "plain"]

INK, MUTED, RULE = "#1b2330", "#667085", "#d8dde5"
BLUE, ORANGE, GREEN, RED, PURPLE = "#194c87", "#e27627", "#318954", "#bb281f", "#3c2c5a"
"""The figures' colours, apart in hue and in lightness (they survive grey printing and red-green blindness)."""
STROKES: dict[str, Any] = {
    BLUE: "-", ORANGE: "--", GREEN: "-.", PURPLE: ":", RED: (0, (6, 1, 1, 1, 1, 1)), INK: (0, (8, 2)),
}  # fmt: skip
"""The line of each colour, where smooth curves share a panel."""

PLOT_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": RULE,
    "grid.linewidth": 0.6,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "text.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.2,
    "figure.dpi": 110,
    "svg.fonttype": "none",
    "svg.hashsalt": "commissioner",
    "figure.constrained_layout.use": True,
}


class Stroke(TypedDict):
    """As matplotlib calls them."""

    color: str
    linestyle: Any


def told_apart(colour: str) -> Stroke:
    """Colour and stroke of one curve among several: a print in black and white has the stroke."""
    return {"color": colour, "linestyle": STROKES[colour]}


@dataclass(frozen=True)
class Table:
    """Rows of cells; a cell is shown as it stands. `tones[i]` marks row i."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    tones: Sequence[Tone] = ()
    caption: str = ""


@dataclass(frozen=True)
class Picture:
    """An inline SVG or PNG with the sentence that says what to see in it."""

    markup: str
    caption: str


@dataclass(frozen=True)
class Folded:
    """Paragraphs and pictures under one line that opens them; open on paper."""

    summary: str
    parts: Sequence[str | Picture]


class Section:
    """Paragraphs, tables, pictures and what is folded under a title."""

    def __init__(self, title: str, *parts: str | Table | Picture | Folded) -> None:
        self.title, self.parts = title, parts


@dataclass(frozen=True)
class Page:
    """`headline` is the one sentence that must be read; `facts` are the few numbers beside it."""

    title: str
    headline: str
    tone: Tone
    facts: Sequence[tuple[str, str]]
    sections: Sequence[Section]
    footer: str = ""


def figure_of(rows: int, columns: int, height: float, **options: Any) -> tuple[Figure, Any]:
    """A figure in the pages' style, and its axes `(rows, columns)`."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(PLOT_STYLE):
        figure = Figure(figsize=(9.2, height), layout="constrained")
        return figure, figure.subplots(rows, columns, squeeze=False, **options)


def plain_decades(axis: Any) -> None:
    """A logarithmic axis named at 1, 2, 5 of each decade, and nowhere with an exponent."""
    from matplotlib.ticker import LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def legend_above(axes: Any) -> None:
    """The legend in one line over the upper right corner, where it hides nothing that is drawn."""
    axes.legend(ncols=9, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1, fontsize=7, frameon=False)


def picture(figure: Figure, caption: str, *, raster: bool = False) -> Picture:
    """The figure as inline SVG, or as an inline PNG where it holds more points than a browser likes."""
    import base64

    buffer = io.BytesIO()
    if raster:
        figure.savefig(buffer, format="png", dpi=150)
        data = base64.b64encode(buffer.getvalue()).decode()
        return Picture(f'<img alt="" src="data:image/png;base64,{data}">', caption)
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue().decode()
    head, _, rest = text[text.index("<svg") :].partition("<metadata>")  # matplotlib's, with links to elsewhere
    return Picture(head + rest.partition("</metadata>")[2], caption)


_NOTICE, _NOTICE_ENDS = '<section class="notice"><p>', "</p></section>"


def with_notice(page: str, sentence: str) -> str:
    """A rendered page with a sentence above its headline, for what has happened since."""
    return page.replace("<main>", f"<main>{_NOTICE}{escape(sentence)}{_NOTICE_ENDS}", 1)


def with_notices_of(before: str, page: str) -> str:
    """A rendered page that takes another's place, with what stood above that one's headline."""
    notices = "".join(f"{_NOTICE}{part.partition(_NOTICE_ENDS)[0]}{_NOTICE_ENDS}" for part in before.split(_NOTICE)[1:])
    return page.replace("<main>", f"<main>{notices}", 1)


def render(page: Page) -> str:
    """The page as one sheet. Text is escaped; only pictures made by `picture` pass as markup."""
    parts = [
        _verdict(page),
        *([marks.facts((name, Markup("<b>{}</b>").format(v)) for name, v in page.facts)] if page.facts else []),
    ]
    parts += (marks.section(one.title, *map(_shown, one.parts), kind="part") for one in page.sections)
    parts.append(Markup('<div class="id"><p>{}</p><p>{}</p></div>').format(page.title, page.footer))
    margins = Margins(page.title, "", "", "", f"commissioner {version('commissioner')}")
    return document(page.title, margins, [Sheet("result", "Result", Markup("\n").join(parts))])


def _verdict(page: Page) -> Markup:
    title = Markup("<h1>{}</h1>").format(page.headline)
    if page.tone == "plain":
        return title
    kind, mark = {"good": ("ok", marks.GOOD), "warn": ("warn", marks.WARN), "bad": ("bad", marks.BAD)}[page.tone]
    return Markup('<div class="verdict"><span class="{}" style="display:contents">{}</span>{}</div>').format(
        kind, mark, title
    )


def _shown(part: str | Table | Picture | Folded) -> Markup:
    match part:
        case Table():
            columns = [marks.Column(name) for name in part.header]
            return _WIDE.format(marks.table(columns, part.rows, tones=part.tones, caption=part.caption))
        case Picture():
            return marks.figure("", _WIDE.format(Markup(part.markup)), part.caption)
        case Folded():
            inside = Markup("").join(map(_shown, part.parts))
            return Markup('<details class="part"><summary>{}</summary>{}</details>').format(part.summary, inside)
    return marks.paragraph(part)


_WIDE = Markup('<div class="wide" tabindex="0">{}</div>')
"""A frame that scrolls sideways where what it holds is wider than the sheet."""
