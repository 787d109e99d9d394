"""The core's names as a technician reads them: checks, parameters, causes, outcomes. Every message is a catalogue's key."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from commissioner.motor.quantities import FIVE
from commissioner.procedure.checks import UNITS, check_name
from commissioner.report.sheet.marks import capitalised
from commissioner.report.sheet.words import NBSP, spoken
from commissioner.service.page.texts import Texts

SCRIPT_TEXTS = (
    "TAKE THE MOTOR AS LIVE", "This page has lost the service. The motor was energised", "cannot be sent: use the emergency stop",
    "State of the motor not known", "This page has lost the service", "not known", "no service", "sending …",
    "sent; output was off already", "sent; zero volts confirmed after %s", "sent, not confirmed: emergency stop",
    "not sent: use the emergency stop", "Not yet: confirm %s more above.", "Keep holding …", "Released before 2 s. Nothing was energised.",
    "The run is being started …", "Type %s and confirm the points above.", "done, %s", "running", "waits", "highest", "limit",
    "%s old", "%s old: stale", "Still above the wanted standard error: %s. Strip: ± 10 %.",
    "All four within the wanted standard error. Preliminary: the fit after the test decides. Strip: ± 10 %.",
    "asks for control; without an answer it passes in %s", "Test %k of %n", "between tests", "%a of %b", "%a, done", "%a, now", "again", "last word %s ago",
    "MOTOR ENERGISED", "ENERGISED SOON", "%s to correct", "energises nothing, writes nothing",
    "Reading the drive …", "begun %s ago", "The file is being sent …", "no value",
)  # fmt: skip
"""What scripts say; the page hands it to them in its own language."""


IN_THE_DRIVE = " in the drive"
"""Behind a register's name: the check that its value could be read."""


@dataclass(frozen=True)
class Quantity:
    """One of the five numbers a motor is known by."""

    key: str
    symbol: str
    name: str
    factor: float
    unit: str
    digits: int
    limit: str


_ON_THE_PAGE = (
    ("R<sub>s</sub>", 3, "resistance_std_percent"),
    ("R<sub>R</sub>", 3, "rotor_resistance_std_percent"),
    ("L<sub>σ</sub>", 3, "leakage_std_percent"),
    ("L<sub>M</sub>", 1, "magnetizing_std_percent"),
    ("T<sub>R</sub>", 1, ""),
)
QUANTITIES = tuple(
    Quantity(of.field, symbol, of.words, of.factor, of.unit, digits, limit)
    for of, (symbol, digits, limit) in zip(FIVE, _ON_THE_PAGE, strict=True)
)


def _named(text: str) -> str:
    """A sentence with the parameters' names in place of their keys."""
    for quantity in QUANTITIES:
        text = text.replace(quantity.key, quantity.name)
    return text


class Words:
    """The same in one language."""

    quantities = QUANTITIES

    def __init__(self, texts: Texts) -> None:
        self._t = texts

    def circuit(self, key: str, *values: float) -> str:
        """Values of one of the circuit's, in SI, as people read them: `214 mH`, `4 … 90 mH`."""
        quantity = next(q for q in QUANTITIES if q.key == key)
        *first, last = (quantity.factor * value for value in values)
        return " … ".join([*map(self._t.short, first), self._t.short(last, quantity.unit)])

    def check_name(self, name: str) -> str:
        """`rated_power_w in the drive` -> `Rated power in the drive`."""
        plain = check_name(name)
        item = plain.removesuffix(IN_THE_DRIVE)
        if self._t.knows(plain) or item == plain or not self._t.knows(item):
            return capitalised(self._t.tell(plain))
        return capitalised(self._t.say("%(item)s in the drive", item=self._t.tell(item)))

    def days(self, utcs: Sequence[str]) -> list[str]:
        """The day of each instant, with its time where another one is of the same day."""
        days = [utc[:10] for utc in utcs]
        return [utc[:19].replace("T", " ") if days.count(day) > 1 else day for utc, day in zip(utcs, days, strict=True)]

    def check_value(self, check: Mapping[str, Any]) -> str:
        """With its unit."""
        unit, digits = self._unit(check)
        value = check["value"]
        if isinstance(value, int | float) and not isinstance(value, bool):
            return self._t.number(float(value), digits, unit)
        return self._localised(str(value)) if value is not None else self._t.gettext("no value")

    def check_limit(self, check: Mapping[str, Any]) -> str:
        unit, digits = self._unit(check)
        limit = check["limit"]
        if isinstance(limit, int | float) and not isinstance(limit, bool):
            return self._t.number(float(limit), digits, unit)
        text = str(limit)
        if " within" in text:
            text = f"{text.split(' within', maxsplit=1)[0]} {unit} ± 5 %"
        elif unit and not text.rstrip().endswith(unit) and re.search(r"\d$", text.strip()):
            text = f"{text} {unit}"
        return self._localised(text)

    def sentence(self, text: object) -> str:
        """A sentence of the core, with its first letter as a sentence has it; one without translation says its language."""
        plain = _named(str(text))
        said = spoken(capitalised(self._t.tell(plain)))
        return said if not plain or self._t.knows(plain) else Markup('<span lang="en">{}</span>').format(said)

    def cause(self, name: str) -> str:
        from commissioner.diagnose.causes import CATALOGUE

        called = CATALOGUE[name].title if name in CATALOGUE else name.replace("_", " ").capitalize()
        return self._t.gettext(called)

    def causes(self, names: Sequence[str]) -> str:
        return ", ".join(self.cause(name) for name in names)

    def cause_advice(self, name: str) -> str:
        from commissioner.diagnose.causes import CATALOGUE

        advice = CATALOGUE[name].advice if name in CATALOGUE else ""
        return self._t.gettext(advice) if advice else ""

    def size(self, parameters: Mapping[str, Mapping[str, Any]]) -> str:
        """The first size of a cause, which is the one that its words mean, with its 95 % interval and unit; beside it what is
        measured alike, as the offsets of the other phases."""
        known = [size for size in parameters.values() if isinstance(size.get("value"), int | float)]
        alike = [size for size in known[1:] if size.get("unit") == known[0].get("unit") and size.get("std")]
        return "; ".join(self._one_size(size) for size in (known[:1] + alike)[:3])

    def _one_size(self, size: Mapping[str, Any]) -> str:
        return self._t.with_error(float(size["value"]), size.get("std"), str(size.get("unit") or ""))

    def _unit(self, check: Mapping[str, Any]) -> tuple[str, int]:
        return UNITS.get(check_name(str(check["name"])), ("", 1))

    def _localised(self, text: str) -> str:
        """`at most 120 degC` with marks, units and no-break spaces of the language."""
        if (said := self._t.tell(text)) != text:
            return said
        text = re.sub(r"(\d)\s*%", rf"\1{NBSP}%", text.replace("degC", "°C"))
        text = re.sub(r"(\d) ohm\b", rf"\1{NBSP}Ω", text)
        text = re.sub(r"(\d) (?=[A-Za-z°])", rf"\1{NBSP}", text)
        for english in ("at most", "at least", "near", "of the peak", "peak", "to"):
            text = re.sub(rf"\b{english}\b", self._t.gettext(english), text)
        return re.sub(r"(\d)\.(\d)", r"\1,\2", text) if self._t.language == "de" else text
