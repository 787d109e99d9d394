"""Small SVG panels: one scale, thin grid, every line named where it ends. Drawn for a column of the sheet and scaled with it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from markupsafe import Markup

from commissioner.records import Signal
from commissioner.report.sheet.numbers import fixed

HATCH = Markup(
    '<svg width="0" height="0" style="position:absolute" aria-hidden="true"><defs><pattern id="hatch" width="5" height="5" '
    'patternTransform="rotate(45)" patternUnits="userSpaceOnUse"><rect width="5" height="5" fill="#f4f5f6"/>'
    '<path d="M0 0V5" stroke="#c3c8cc" stroke-width="1"/></pattern></defs></svg>'
)
"""Once in a document: what was not tested."""
Range = tuple[float, float]


def ticks(low: float, high: float, most: int = 5) -> list[float]:
    """At most `most` round values within [low, high]: steps of 1, 2 or 5 times a power of ten."""
    span = high - low
    if not (math.isfinite(span) and span > 0.0):
        return [low]
    step = 10.0 ** math.floor(math.log10(span / most))
    step *= next((k for k in (1, 2, 5, 10) if span / (k * step) <= most), 10)
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


def padded(values: Iterable[float], share: float = 0.08) -> Range:
    """The range of finite values with a margin of `share` on each side; never empty."""
    finite = [v for v in values if math.isfinite(v)] or [0.0]
    low, high = min(finite), max(finite)
    margin = share * (high - low) or 0.05 * abs(high) or 1.0
    return low - margin, high + margin


@dataclass
class Panel:
    """A rectangle with one scale each way. `x`, `y`: what is shown; margins in drawing units (673 a sheet's width)."""

    width: float
    height: float
    x: Range
    y: Range
    label: str
    """What is drawn, for those who hear the page."""
    left: float = 26.0
    right: float = 5.0
    top: float = 6.0
    bottom: float = 15.0
    parts: list[Markup] = field(default_factory=list)

    def at_x(self, x: float) -> float:
        return self.left + (x - self.x[0]) / (self.x[1] - self.x[0]) * (self.width - self.left - self.right)

    def at_y(self, y: float) -> float:
        inner = self.height - self.top - self.bottom
        return self.top + (self.y[1] - y) / (self.y[1] - self.y[0]) * inner

    def grid(self, most: int = 4, shown: Callable[[float], str] | None = None) -> Panel:
        """Horizontal lines at round values, each with its number."""
        values = ticks(*self.y, most)
        for value in values:
            self.path("gr", f"M{self.left:g} {self.at_y(value):.2f}H{self.width - self.right:g}")
            text = shown(value) if shown else number(value, values)
            self.text(self.left - 4, self.at_y(value) + 3.3, text, anchor="end")
        return self

    def axis(self, unit: str = "", most: int = 4) -> Panel:
        """The line at the bottom with round values; the last one carries the unit."""
        base = self.height - self.bottom
        self.path("ax", f"M{self.left:g} {base:g}H{self.width - self.right:g}")
        values = ticks(*self.x, most)
        for k, value in enumerate(values):
            self.path("ax", f"M{self.at_x(value):.2f} {base:g}v3")
            last = unit and k == len(values) - 1
            anchor = "end" if last and self.at_x(value) > self.width - self.right - 12 else "middle"
            place = self.at_x(value) + (5 if anchor == "end" else 0)
            self.text(place, base + 12.5, number(value, values) + (f" {unit}" if last else ""), anchor=anchor)
        return self

    def line(self, x: Sequence[float] | Signal, y: Sequence[float] | Signal, kind: str = "tr") -> Panel:
        """A polyline; values that are not finite interrupt it."""
        return self.path(kind, self._along(x, y))

    def band(
        self,
        x: Sequence[float] | Signal,
        low: Sequence[float] | Signal,
        high: Sequence[float] | Signal,
        kind: str = "bd",
    ) -> Panel:
        """The area between two lines, kept inside the panel."""
        x, low, high = (np.asarray(v, dtype=float) for v in (x, low, high))
        keep = np.isfinite(low) & np.isfinite(high)
        x, low, high = x[keep], np.clip(low[keep], *self.y), np.clip(high[keep], *self.y)
        if not x.size:
            return self
        return self.path(kind, self._along([*x, *x[::-1]], [*high, *low[::-1]]) + "Z")

    def level(self, y: float, kind: str = "lim") -> Panel:
        return self.path(kind, f"M{self.left:g} {self.at_y(y):.2f}H{self.width - self.right:g}")

    def upright(self, x: float, kind: str = "lim") -> Panel:
        return self.path(kind, f"M{self.at_x(x):.2f} {self.height - self.bottom:g}V{self.top:g}")

    def dots(self, x: Sequence[float] | Signal, y: Sequence[float] | Signal) -> Panel:
        """A point for each sample: a stroke without length."""
        pairs = zip(map(float, x), map(float, y), strict=True)
        return self.path("dots", "".join(f"M{self.at_x(a):.1f} {self.at_y(b):.1f}h0" for a, b in pairs))

    def point(self, x: float, y: float, kind: str = "inkfill", radius: float = 2.6) -> Panel:
        self.parts.append(
            Markup('<circle class="{}" cx="{}" cy="{}" r="{}"/>').format(
                kind, f"{self.at_x(x):.2f}", f"{self.at_y(y):.2f}", f"{radius:g}"
            )
        )
        return self

    def area(self, x: Range) -> Panel:
        """The whole height between two places."""
        a, b = sorted(self.at_x(min(max(v, self.x[0]), self.x[1])) for v in x)
        return self.path("none", f"M{a:.2f} {self.top:g}H{b:.2f}V{self.height - self.bottom:g}H{a:.2f}Z")

    def named(self, x: float, y: float, text: str, kind: str = "k", anchor: str = "start") -> Panel:
        """A text at a place of the scale."""
        return self.text(self.at_x(x), self.at_y(y), text, kind, anchor)

    def text(self, x: float, y: float, text: str, kind: str = "", anchor: str = "start", turn: bool = False) -> Panel:
        """A text at a place of the drawing; `turn`: upwards."""
        turned = Markup(' transform="rotate(-90 {} {})"').format(f"{x:.1f}", f"{y:.1f}") if turn else Markup("")
        self.parts.append(
            Markup('<text class="{}" x="{}" y="{}" text-anchor="{}"{}>{}</text>').format(
                kind, f"{x:.1f}", f"{y:.1f}", anchor, turned, text
            )
        )
        return self

    def path(self, kind: str, steps: str) -> Panel:
        if steps:
            self.parts.append(Markup('<path class="{}" d="{}"/>').format(kind, steps))
        return self

    def drawn(self) -> Markup:
        return Markup('<svg class="f" viewBox="0 0 {} {}" role="img" aria-label="{}">{}</svg>').format(
            f"{self.width:g}", f"{self.height:g}", self.label, Markup("").join(self.parts)
        )

    def _along(self, x: Sequence[float] | Signal, y: Sequence[float] | Signal) -> str:
        steps, pen = [], "M"
        for a, b in zip(map(float, x), map(float, y), strict=True):
            if not (math.isfinite(a) and math.isfinite(b)):
                pen = "M"
                continue
            steps.append(f"{pen}{self.at_x(a):.1f} {self.at_y(b):.1f}")
            pen = "L"
        return "".join(steps)


def envelope(time: Signal, value: Signal, window: float) -> tuple[Signal, Signal, Signal]:
    """Middle, smallest and largest value of each `window` of time: what a line of many samples looks like."""
    if not time.size:
        return time, value, value
    bins = np.floor((time - time[0]) / window).astype(int)
    starts = np.flatnonzero(np.r_[True, np.diff(bins) > 0])
    low, high = np.minimum.reduceat(value, starts), np.maximum.reduceat(value, starts)
    return time[0] + (bins[starts] + 0.5) * window, low, high


def number(value: float, beside: Sequence[float]) -> str:
    """A tick's number, with as many places as its neighbours need."""
    step = min((abs(b - a) for a, b in pairwise(beside)), default=abs(value) or 1.0)
    return fixed(value, max(0, -math.floor(math.log10(step) + 1e-9)))
