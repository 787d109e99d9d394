"""One self-contained HTML page: headline, sections, tables, figures. No script, no font, no image from elsewhere."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypedDict

from jinja2 import Environment
from markupsafe import Markup, escape

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
    """Rows of cells; a cell is shown as it stands. `tones[i]` colours row i."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    tones: Sequence[Tone] = ()
    caption: str = ""


@dataclass(frozen=True)
class Picture:
    """An inline SVG or PNG with the sentence that says what to see in it."""

    markup: str
    caption: str


class Section:
    """Paragraphs, tables and pictures under a title."""

    def __init__(self, title: str, *parts: str | Table | Picture) -> None:
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
    """The page as HTML. Text is escaped; only pictures made by `picture` pass as markup."""
    return _TEMPLATE.render(page=page, kind=lambda part: type(part).__name__, markup=Markup)


_TEMPLATE = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ page.title }}</title><style>
:root { --ink:#1b2330; --muted:#667085; --rule:#d8dde5; --good:#2c7a4b; --warn:#a15c07; --bad:#b3261e; --plain:#1f5fa8; }
* { box-sizing:border-box } body { font:15px/1.5 system-ui,"DejaVu Sans",sans-serif; color:var(--ink); background:#f4f6f9; margin:0 }
main { max-width:1020px; margin:0 auto; padding:28px 20px 60px }
header,section { background:#fff; border:1px solid var(--rule); border-radius:10px; padding:20px 26px; margin:0 0 16px }
.notice { border-left:6px solid var(--warn); font-weight:600 } .notice p { margin:0 }
header { border-top:6px solid var(--{{ page.tone }}) } h1 { font-size:15px; color:var(--muted); margin:0 0 6px; font-weight:600 }
.headline { font-size:22px; line-height:1.3; font-weight:650; margin:0 0 14px } h2 { font-size:17px; margin:0 0 10px }
dl { display:grid; grid-template-columns:repeat(auto-fit,minmax(170px,1fr)); gap:10px 22px; margin:0 }
dt { color:var(--muted); font-size:12.5px } dd { margin:0; font-weight:600; font-variant-numeric:tabular-nums }
table { border-collapse:collapse; width:100%; font-variant-numeric:tabular-nums; margin:6px 0 12px; font-size:14px }
th { text-align:left; color:var(--muted); font-weight:600; border-bottom:2px solid var(--rule); padding:5px 10px 5px 0; vertical-align:bottom }
td { border-bottom:1px solid var(--rule); padding:5px 10px 5px 0; vertical-align:top } caption { caption-side:bottom; text-align:left; color:var(--muted); font-size:13px; padding-top:4px }
tr.good td:first-child { box-shadow:inset 3px 0 var(--good); padding-left:10px } tr.warn td:first-child { box-shadow:inset 3px 0 var(--warn); padding-left:10px }
tr.bad td:first-child { box-shadow:inset 3px 0 var(--bad); padding-left:10px } figure { margin:8px 0 16px } figure svg,figure img { width:100%; height:auto }
figcaption { color:var(--muted); font-size:13px } p { margin:0 0 10px; max-width:80ch } footer { color:var(--muted); font-size:12.5px }
.wide { overflow-x:auto } @media print { body { background:#fff; font-size:12px } header,section { border-color:#bbb; padding:12px 16px; margin-bottom:10px } main { padding:0 }
  .headline { font-size:18px } h2 { font-size:14px } table,caption,figcaption,footer,dt { font-size:11px } figure { margin:4px 0 8px }
  header,figure,tr,section:not(:has(figure,table)) { break-inside:avoid } h2,thead { break-after:avoid }
  summary,p:has(+ figure) { break-after:avoid } .wide { overflow:visible } summary { list-style:none; font-weight:600 } details::details-content { content-visibility:visible; display:block } }
</style></head><body><main>
<header><h1>{{ page.title }}</h1><p class="headline">{{ page.headline }}</p>
<dl>{% for name, value in page.facts %}<div><dt>{{ name }}</dt><dd>{{ value }}</dd></div>{% endfor %}</dl></header>
{% for section in page.sections %}<section><h2>{{ section.title }}</h2>
{% for part in section.parts %}
{% if kind(part) == "Table" %}<div class="wide"><table>{% if part.caption %}<caption>{{ part.caption }}</caption>{% endif %}
<thead><tr>{% for cell in part.header %}<th scope="col">{{ cell }}</th>{% endfor %}</tr></thead><tbody>
{% for row in part.rows %}<tr class="{{ part.tones[loop.index0] if part.tones else 'plain' }}">{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>
{% endfor %}</tbody></table></div>
{% elif kind(part) == "Picture" %}<figure>{{ markup(part.markup) }}<figcaption>{{ part.caption }}</figcaption></figure>
{% else %}<p>{{ part }}</p>
{% endif %}{% endfor %}</section>
{% endfor %}<footer>{{ page.footer }}</footer></main></body></html>
""")
