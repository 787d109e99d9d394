"""A running diagnosis in words: headline, what it means, what to do, sizes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from commissioner.report.page import Tone
from commissioner.report.sheet.numbers import half_width, with_interval
from commissioner.running.causes import CATALOGUE

Document = Mapping[str, Any]
LEAST_SHARE = 5e-4
"""Of the simulation's error: less is printed as none, and is none that matters."""
UNTOLD = 3.0
"""Standard deviations, in shares, of a size that says nothing: a saturation under one steady load was printed as 0 +- 58000 %."""
UNITS = {"us": "µs", "ohm": "Ω"}


def spoken(name: str) -> str:
    """`rotor_skin_effect` as `rotor skin effect`."""
    return name.replace("_", " ")


def said(text: str) -> str:
    """A sentence with the catalogue's names as people say them."""
    for name in sorted(CATALOGUE, key=len, reverse=True):
        text = text.replace(name, spoken(name))
    return text


def class_name(cause: Mapping[str, Any]) -> str:
    """The name, or the names that the data cannot tell apart."""
    return " or ".join(spoken(n) for n in (cause["name"], *cause["equivalent"]))


def number(value: float, digits: int = 3) -> str:
    """So many significant digits without an exponent where that is readable."""
    if value == 0.0 or not 1e-4 <= abs(value) < 1e6:
        return f"{value:.{digits}g}"
    places = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
    return f"{round(value, places):.{places}f}"


def quantity(entry: Mapping[str, Any]) -> str:
    """`1.23 ± 0.04 %`: relative sizes in percent, others in their unit; of a share that the data leave open, that they do."""
    is_open = entry["unit"] == "" and (entry["std"] or 0.0) > UNTOLD * max(abs(entry["value"]), 1.0)
    return "not told" if is_open else _figures(entry)


def _figures(entry: Mapping[str, Any], *, short: bool = False) -> str:
    value, std, unit = entry["value"], entry["std"], entry["unit"]
    factor, tail = (100.0, " %") if unit == "" else (1.0, f" {UNITS.get(unit, unit)}")
    if short or not std:
        return f"{number(value * factor)}{tail}"
    return f"{with_interval(value * factor, half_width(std, factor))}{tail}"


def main_size(cause: Mapping[str, Any]) -> str:
    """The one that is spoken of: its amount, or with sign and interval where that holds zero."""
    entry = next(iter(cause["parameters"].values()))
    amount = abs(entry["value"])
    if half_width(entry["std"] or 0.0) < amount:
        return _figures({**entry, "value": amount}, short=True)
    return _figures(entry)


def sentence(cause: Mapping[str, Any]) -> str:
    """What the cause does, with its size; of a class, that it is one of them."""
    said = CATALOGUE[cause["name"]].says.format(size=main_size(cause))
    key, first = next(iter(cause["parameters"].items()))
    phase = next((part for part in key.split("_") if part in ("u", "v", "w")), "")
    for one in ("phase", "line", "current sensor", "voltage sensor") if phase else ():
        for article in ("One", "A"):
            said = said.replace(f"{article} {one} ", f"{one.capitalize()} {phase} ")
    said += " (less)" if first["value"] < 0.0 and "differently" in said else ""
    if not cause["equivalent"]:
        return said
    return f"{class_name(cause).capitalize()}: these data cannot say which. The first would mean: {said[0].lower()}{said[1:]}"


def headline(document: Document) -> str:
    """The verdict in one sentence."""
    causes = document["causes"]
    if document["verdict"] == "refused":
        return "These data cannot carry an answer."
    if not document.get("is_complete", True):
        return "Not finished: stopped when its time was over, before all causes were tried. No cause is named yet."
    if document["verdict"] == "unexplained":
        known = f" Known beside it: {', '.join(class_name(c) for c in causes)}." if causes else ""
        return f"Something is in these data that no cause in the catalogue makes.{known}"
    if not causes:
        return "Nothing significant: the plain four-parameter simulation already fits to within the noise."
    share = document["gain"]["held_out"]
    share = document["gain"]["explained_share"] if share is None else share
    others = f" With {len(causes) - 1} lesser cause{'s' if len(causes) > 2 else ''} it" if len(causes) > 1 else " It"
    if share < LEAST_SHARE:
        strength = causes[0]["strength_over_noise"]
        return f"{sentence(causes[0])}.{others} is too small to matter: {strength:.2g} of the noise, beyond which the plain simulation leaves nothing."
    return f"{sentence(causes[0])}.{others} explains {100.0 * max(share, 0.0):.1f} % of the simulation's error."


def tone(document: Document) -> Tone:
    """Green where nothing is open."""
    tones: dict[str, Tone] = {"refused": "bad", "unexplained": "bad", "not_distinguishable": "warn"}
    return tones.get(document["verdict"], "good")


def meaning(document: Document) -> list[str]:
    """What each cause means, a paragraph each."""
    if document["verdict"] == "refused":
        error = document.get("error", {})
        return [
            str(document["reason"]),
            f"Seen: {error.get('value')}; expected: {error.get('limit')}; step: {error.get('step')}.",
        ]
    out = [said(str(document["reason"]))] if document["verdict"] in ("unexplained", "not_distinguishable") else []
    return out + [f"{_who(name, in_class)}: {CATALOGUE[name].meaning}" for name, in_class in _members(document).items()]


def _members(document: Document) -> dict[str, bool]:
    """Every name of every cause, and whether it is one of a class that these data do not tell apart."""
    causes = document["causes"]
    names = [(name, bool(c["equivalent"])) for c in causes for name in (c["name"], *c["equivalent"])]
    return dict.fromkeys((name for name, _ in names), False) | dict(reversed(names))


def _who(name: str, in_class: bool) -> str:
    return f"If it is {spoken(name)}" if in_class else spoken(name).capitalize()


def actions(document: Document) -> list[tuple[str, str]]:
    """Who does what: of every cause its remedy, then the next recording."""
    rows = [
        (
            "for the measurement" if CATALOGUE[name].is_of_measurement else "for the motor and drive",
            f"{_who(name, in_class)}: {CATALOGUE[name].remedy}" if in_class else CATALOGUE[name].remedy,
        )
        for name, in_class in _members(document).items()
    ]
    plan = document["next_experiment"]
    return [
        *rows,
        *(
            [("next test", f"To tell {' from '.join(spoken(n) for n in plan['splits'])}: {plan['do']}.")]
            if plan
            else []
        ),
    ]
