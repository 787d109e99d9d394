"""Page 3: what a simulation with the four parameters alone gets wrong about this motor on this drive."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from markupsafe import Markup

from commissioner.report.run.quantities import BY_FIELD, FOUR
from commissioner.report.run.subject import Record, Subject
from commissioner.report.sheet import marks
from commissioner.report.sheet.drawing import Panel
from commissioner.report.sheet.marks import Column, Text
from commissioner.report.sheet.numbers import digits, half_width, signed, with_interval
from commissioner.report.sheet.words import cause_name

_MOST_LIMITS = 30
_SHOWN: Mapping[str, tuple[tuple[float, str], ...]] = {
    "1": ((100.0, "%"),), "1/min": ((100.0, "%/min"),), "us": ((1.0, "µs"),),
    "A": ((1.0, "A"), (1e3, "mA")), "A/min": ((1.0, "A/min"), (1e3, "mA/min")), "V": ((1.0, "V"), (1e3, "mV")),
    "Wb": ((1.0, "Wb"), (1e3, "mWb")), "H": ((1.0, "H"), (1e3, "mH")), "s": ((1.0, "s"), (1e6, "µs")),
}  # fmt: skip
"""Factor and unit that a size is shown in: the first that makes it no less than a tenth."""


def plain_simulation(subject: Subject) -> Markup:
    """The third page; empty where the samples were not diagnosed."""
    diagnosis = subject.result.get("diagnosis")
    if not diagnosis:
        return Markup("")
    parts = [
        Markup("<h2>What a plain simulation gets wrong about this motor on this drive</h2>"),
        marks.paragraph(_lead(diagnosis), kind="lead"),
    ]
    if not diagnosis.get("is_complete", True):
        return Markup("\n").join(parts)
    if causes := diagnosis["causes"]:
        columns = (
            Column("Cause"), Column("Size ± 95 % interval"),
            Column(Markup("Error: 0.1 … 100 times<br>the noise (stroke)"), label="Error"),
            Column(Markup("times<br>noise"), right=True, label="times the noise"),
            Column(Markup("sure of<br>name"), right=True, label="sure of the name"),
        )  # fmt: skip
        parts.append(marks.table(columns, (_cause(cause) for cause in causes), "cards causes"))
        parts.append(marks.paragraph("Sureness is rounded down.", kind="small"))
    parts.append(marks.side_by_side(_gain(diagnosis), _cannot_tell(diagnosis)))
    if rows := list(_moved(subject, diagnosis)):
        columns = (
            Column("Without the causes these values would have come out"),
            Column(Markup("four parameters<br>alone"), right=True, label="four parameters alone"), Column("off by", right=True),
            Column(Markup("with the causes,<br>by the diagnosis"), right=True, label="with the causes"),
            Column("this run, page 1", right=True),
        )  # fmt: skip
        parts.append(marks.table(columns, rows))
        parts.append(marks.paragraph(_fluxes(subject), kind="small"))
    if next_one := _experiment(diagnosis):
        parts.append(next_one)
    if limits := _limits(diagnosis):
        parts.append(limits)
    return Markup("\n").join(parts)


_FINISH = "`commissioner diagnose` on the run’s recording.parquet finishes it."
_REST = (
    "The result on page 1 does not rest on this: the run measured the inverter’s loss, the delay and the iron itself."
)


def _lead(diagnosis: Record) -> Text:
    if not diagnosis.get("is_complete", True):
        return marks.coded(f"Not told: the search was stopped before every cause was tried. {_FINISH} {_REST}")
    gain = diagnosis.get("gain") or {}
    before, after, noise = (gain.get(key) for key in ("rmse_before_a", "rmse_after_a", "noise_floor_a"))
    if not (before and after):
        return f"{marks.capitalised(diagnosis['reason'])}. {_REST}"
    number = len(diagnosis["causes"])
    added = f"with {number} cause{'s' if number != 1 else ''} added, by {digits(1e3 * after, 3)} mA"
    of_noise = f", and the sensors’ noise is {digits(1e3 * noise, 3)} mA" if noise else ""
    alone = f"A simulation with the four parameters alone misses the current by {digits(1e3 * before, 3)} mA rms"
    return f"{alone}; {added}{of_noise}. {_REST}"


def _cause(cause: Record) -> tuple[Text, ...]:
    names = [cause.get("title") or cause_name(cause["name"]), *(cause_name(other) for other in cause["equivalent"])]
    strength = cause.get("strength_over_noise")
    return (
        ", or ".join(names), Markup(", ").join(_sizes(cause["parameters"])), _bar(strength),
        digits(strength, 2) if strength else "–", f"{math.floor(1e3 * cause['confidence']) / 10:g} %",
    )  # fmt: skip


def _sizes(parameters: Record) -> Iterator[Text]:
    many = len(parameters) > 1
    for name, size in parameters.items():
        factor, unit = _scale(size["value"], str(size["unit"]))
        shown = with_interval(factor * size["value"], half_width(size["std"], factor))
        stem = name.rpartition("_")
        words = cause_name(stem[0] if stem[2] == str(size["unit"]).lower() else name)
        yield Markup('<span class="n">{}</span>').format(f"{words + ' ' if many else ''}{shown} {unit}")


def _scale(value: float, unit: str) -> tuple[float, str]:
    choices = _SHOWN.get(unit, ((1.0, unit),))
    return next((choice for choice in choices if abs(choice[0] * value) >= 0.1), choices[-1])


def _bar(strength: float | None) -> Text:
    """0.1 to 100 times the noise, logarithmic; the stroke stands at the noise itself."""
    if not strength:
        return "–"
    panel = Panel(
        110, 12, (-1.0, 2.0), (0.0, 1.0), f"{digits(strength, 2)} times the noise", left=0, right=0, top=0, bottom=0
    )
    end = min(max(math.log10(strength), -1.0), 2.0)
    for kind, to in (("back", 2.0), ("bar1", end)):
        panel.path(kind, f"M0 3H{panel.at_x(to):.1f}V9H0Z")
    return panel.upright(0.0, "fc").drawn()


def _gain(diagnosis: Record) -> Markup:
    gain = diagnosis.get("gain") or {}
    shown = [
        (gain.get("rmse_before_a"), "four parameters alone", "bar1"),
        (gain.get("rmse_after_a"), "with the causes", "bar1"),
        (gain.get("noise_floor_a"), "noise of the sensors", "inkfill"),
    ]
    values = [(1e3 * value, words, kind) for value, words, kind in shown if value]
    if not values:
        return marks.section("Error of the simulated current", "Not measured.", level=3)
    low, high = (math.log10(pick([v for v, _, _ in values])) for pick in (min, max))
    panel = Panel(
        331,
        64,
        (low - 0.5, max(high, low + 0.3) + 0.5),
        (0.0, 3.0),
        "Error of the simulated current before and after",
        left=6,
        bottom=2,
    )
    for row, (value, words, kind) in enumerate(values):
        y = 2.5 - row
        panel.level(y, "gr").point(math.log10(value), y, kind, 4.0)
        is_left = math.log10(value) > 0.5 * sum(panel.x)
        place = panel.at_x(math.log10(value)) + (-8 if is_left else 8)
        panel.text(
            place, panel.at_y(y) + 3.3, f"{words}: {digits(value, 3)} mA", "k halo", "end" if is_left else "start"
        )
    held = gain.get("held_out")
    caption = "Logarithmic, rms, over samples left out of the fit." + (
        f" Of the error {100 * held:.3f} % is explained." if held else ""
    )
    return marks.figure("Error of the simulated current, rms", panel.drawn(), caption)


def _cannot_tell(diagnosis: Record) -> Markup:
    lines = [str(line) for line in diagnosis.get("cannot_tell") or ()]
    if not lines:
        return Markup("")
    items = Markup("").join(
        Markup("<li>{}</li>").format(marks.capitalised(line).replace(" | ", ", ")) for line in lines
    )
    return marks.section("What these data cannot tell", Markup('<ul class="lines">{}</ul>').format(items), level=3)


def _moved(subject: Subject, diagnosis: Record) -> Iterator[tuple[Text, ...]]:
    before, after = diagnosis.get("parameters_before") or {}, diagnosis.get("parameters_after") or {}
    for quantity in FOUR:
        alone, better, mine = (
            before.get(quantity.field),
            after.get(quantity.field),
            subject.parameters.get(quantity.field),
        )
        if not (alone and better and mine):
            continue
        yield (
            Markup("{} {}").format(quantity.symbol, quantity.words),
            f"{digits(quantity.factor * alone['value'], 3)} {quantity.unit}",
            f"{signed(100 * (alone['value'] / mine['value'] - 1), 2)} %",
            f"{with_interval(quantity.factor * better['value'], half_width(better['std'], quantity.factor))} {quantity.unit}",
            Markup("<b>{} {}</b>").format(
                with_interval(quantity.factor * mine["value"], half_width(mine["std"], quantity.factor)), quantity.unit
            ),
        )


def _fluxes(subject: Subject) -> Markup:
    """L_M falls with flux, and with it R_R and L_sigma, which the inverse-Gamma form takes by the rotor's share of the flux."""
    flux = digits(subject.result["holds_for_stator_flux_wb"], 3)
    names = ("magnetizing_inductance_h", "rotor_resistance_ohm", "leakage_inductance_h")
    return Markup(
        "The diagnosis gives {}, and with it {} and {} of this circuit, at small flux, page 1 at {} Wb: both are right, each at its flux."
    ).format(*(BY_FIELD[name].symbol for name in names), flux)


def _experiment(diagnosis: Record) -> Markup | None:
    experiment = diagnosis.get("next_experiment")
    if not experiment:
        return None
    *steps, last = (str(step) for step in experiment["steps"])
    steps.append(f"{last} `{experiment['command']}`" if last.endswith(":") else last)
    effect = marks.paragraph(f"Does it change the values of page 1? {experiment['changes_values']}", kind="small")
    doing = marks.actions(marks.coded(step) for step in steps)
    return marks.section("The next experiment, if one is wanted", doing, effect, kind="first slim", level=3)


def _limits(diagnosis: Record) -> Markup | None:
    limits = diagnosis.get("detection_limits") or {}
    found = {cause["name"] for cause in diagnosis["causes"]} | {
        o for cause in diagnosis["causes"] for o in cause["equivalent"]
    }
    rows = []
    for name, limit in list(limits.items())[:_MOST_LIMITS]:
        if name in found or not isinstance(limit, dict):
            continue
        size = next(iter(limit.values())) if limit and isinstance(next(iter(limit.values())), dict) else limit
        if {"value", "unit"} <= set(size):
            factor, unit = _scale(size["value"], str(size["unit"]))
            shown = (marks.capitalised(cause_name(name)), digits(factor * size["value"], 2), unit)
            rows.append(Markup("<div><dt>{}</dt><dd>{} {}</dd></div>").format(*shown))
    if not rows:
        return None
    return Markup("<section><h3>Looked for and not found; this much would have been seen</h3>") + Markup(
        '<dl class="seen">{}</dl></section>'
    ).format(Markup("").join(rows))
