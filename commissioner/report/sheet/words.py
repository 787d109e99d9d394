"""What the core writes for every console, as a page sets it: names without keys, symbols, signs, numbers in their units."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from markupsafe import Markup, escape

from commissioner.motor.quantities import FIVE
from commissioner.procedure.checks import check_name, check_unit
from commissioner.report.sheet.numbers import digits
from commissioner.text import in_unit

NBSP = "\u00a0"
_SIGNS = (("+-", "±"), ("sqrt(3)", "√3"), ("cos(phi)", "cos φ"), ("cos phi", "cos φ"), ("->", "→"))
_MOST_DIGITS = 9
UNIT_ENDINGS = ("_a_per_min", "_rad_per_s", "_ppm", "_us", "_ms", "_wb", "_nf", "_hz_a", "_v", "_a", "_s")


def cause_name(name: str) -> str:
    """`dc_link_sag` as `DC link sag`."""
    words = name.replace("_", " ")
    return f"DC{words[2:]}" if words.startswith("dc ") else words


def typeset(text: str) -> str:
    """Signs, and no break before a unit; an angle's sign stands at its number."""
    for plain, sign in _SIGNS:
        text = text.replace(plain, sign)
    text = re.sub(r"(\d) ohm\b", rf"\1{NBSP}Ω", re.sub(r"(\d) deg\b", r"\1°", text))
    return re.sub(r"([\d…]) us\b", rf"\1{NBSP}µs", re.sub(r"([\d…]) ?%", rf"\1{NBSP}%", text))


def with_symbols(text: str) -> Markup:
    """`L_M` as it is set; everything else escaped."""
    marked = re.sub(r"\b([RLT])_(sigma|σ|s|R|M|r)\b", r"\1<sub>\2</sub>", str(escape(text)))
    return Markup(marked.replace("<sub>sigma</sub>", "<sub>σ</sub>"))


def check_words(check: Mapping[str, Any]) -> tuple[str, str, str]:
    """A check's name, what it saw and what it wanted, each number in its unit: 479.8 V that failed are not the 480 V of the limit."""
    unit = check_unit(str(check["name"]))
    seen, limit = seen_and_limit(check, unit)
    if not check["has_passed"] and isinstance(check["value"], float):
        seen = in_unit(f"{check['value']:.{_MOST_DIGITS}g}", check["value"], unit)
    return check_name(str(check["name"])), seen, limit.replace(" within", f" {unit}".rstrip() + " within")


def spoken(text: str) -> Markup:
    """A sentence of the core as a page has it: signs and symbols, no key of a parameter."""
    for quantity in FIVE:
        text = text.replace(quantity.field, quantity.symbol or quantity.words)
    return with_symbols(typeset(text))


def seen_and_limit(facts: Mapping[str, Any], unit: str = "") -> tuple[str, str]:
    """What was seen and what was allowed; two numbers have as many digits, three at least, as tell them apart."""
    value, limit = facts.get("value"), facts.get("limit")
    count = 3
    while count < _MOST_DIGITS and value != limit and _shown(value, count) == _shown(limit, count):
        count += 1
    return in_unit(_shown(value, count), value, unit), in_unit(_shown(limit, count), limit, unit)


def _shown(value: object, count: int) -> str:
    if value is None or value == "":
        return "—"
    return digits(value, count) if isinstance(value, float) else typeset(str(value))


def quantity_name(key: str) -> str:
    """`half_current_a` without the unit that the value carries anyway."""
    for ending in UNIT_ENDINGS:
        if key.endswith(ending):
            key = key.removesuffix(ending) + ("_hz" if ending == "_hz_a" else "")
            break
    words = key.replace("_", " ").replace(" hz", " Hz")
    return words.removeprefix("gain ").replace(" over ", " against ") if words.startswith("gain ") else words
