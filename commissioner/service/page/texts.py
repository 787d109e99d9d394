"""Words and numbers in the reader's language: gettext catalogues (the English sentence is the key), babel's number formats."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from babel.messages.pofile import read_po
from starlette.requests import HTTPConnection

from commissioner.motor.circuit import QUANTILE
from commissioner.motor.quantities import places
from commissioner.report.sheet.words import NBSP
from commissioner.run.stopping.operator_stop import SERVICE, SYSTEM
from commissioner.service.access.visitors import LOCAL
from commissioner.service.problems import Refusal

LANGUAGES = ("en", "de")
UNIT_SIGNS = {"ohm": "Ω", "degC": "°C", "us": "µs", "1": ""}
CORE = "core"
"""Context of the catalogue's sentences that come from the core; their %(names)s stand for what the core filled in, those that begin
with `id` for what somebody called a thing: it stays as it is, also where it is a word of the catalogue."""

_BOUND = re.compile(r"^(at least|at most) (?=-?\d)")


@dataclass(frozen=True)
class Catalogue:
    """`messages`: message -> translation; `sentences`: the core's ones with gaps, as patterns."""

    messages: Mapping[str, str]
    sentences: tuple[tuple[re.Pattern[str], str], ...]


@cache
def catalogue(language: str) -> Catalogue:
    """Empty for English, whose sentences are the messages."""
    path = Path(__file__).parent / "catalogues" / f"{language}.po"
    if not path.is_file():
        return Catalogue({}, ())
    with path.open("rb") as file:
        found = [m for m in read_po(file, locale=language) if m.id and m.string]
    messages = {str(m.id): str(m.string) for m in found}
    gaps = [m for m in found if m.context == CORE and "%(" in str(m.id)]
    gaps.sort(key=lambda m: -len(re.sub(r"%\(\w+\)s", "", str(m.id))))  # the most particular first
    return Catalogue(messages, tuple((_pattern(str(m.id)), str(m.string)) for m in gaps))


def _pattern(message: str) -> re.Pattern[str]:
    parts = re.split(r"%\((\w+)\)s", message.replace("%%", "%"))
    return re.compile("".join(f"(?P<{p}>.+?)" if k % 2 else re.escape(p) for k, p in enumerate(parts)), re.DOTALL)


def _is_name(gap: str) -> bool:
    return gap.startswith("id")


class Texts:
    """One language. What has no translation stays as it is."""

    def __init__(self, language: str) -> None:
        self.language = language if language in LANGUAGES else "en"
        self._catalogue = catalogue(self.language)

    def gettext(self, message: str) -> str:
        return self._catalogue.messages.get(message, message)

    def ngettext(self, one: str, many: str, number: int) -> str:
        return self.gettext(one if number == 1 else many)

    def say(self, message: str, **facts: object) -> str:
        """The message with its %(name)s filled in."""
        return self.gettext(message) % facts

    def tell(self, text: object) -> str:
        """A word or sentence of the core, its values among it, or several after one another: never a format, never markup."""
        said = str(text)
        if (whole := self._catalogue.messages.get(said)) is not None:
            return whole
        if len(parts := said.split("; ")) > 1 and all(map(self.knows, parts)):
            return "; ".join(map(self.tell, parts))
        translation, gaps = self._known(said)
        return translation % {k: v if _is_name(k) else self._value(v) for k, v in gaps.items()} if translation else said

    def seen(self, what: str, value: Any, unit: str = "") -> str:
        """The value of a refusal `what`, as `short` says it; one that the sentence names is no word to translate."""
        _, gaps = self._known(what)
        is_name = any(_is_name(k) and value in (v, v.strip("'")) for k, v in gaps.items())
        return str(value) if is_name else self.short(value, unit)

    def _known(self, said: str) -> tuple[str, dict[str, str]]:
        """The translation of the sentence that this is, and what the core filled in; nothing of one that the catalogue lacks."""
        found = ((pattern.fullmatch(said), translation) for pattern, translation in self._catalogue.sentences)
        return next(((translation, match.groupdict()) for match, translation in found if match is not None), ("", {}))

    def person(self, name: str) -> str:
        """Who did it; whoever sits at this computer without an account is called by what they do, the service and the system by what
        they are."""
        return self.gettext(name) if name in (LOCAL, SERVICE, SYSTEM) else name

    def why(self, person: str, reason: str) -> str:
        """Why somebody stopped a run: in their own words, the service's in the reader's language."""
        return self.tell(reason) if person == SERVICE else reason

    def knows(self, text: object) -> bool:
        """Whether `tell` has it in this language."""
        return self.language == "en" or self.tell(text) != str(text)

    @property
    def _mark(self) -> str:
        return "," if self.language == "de" else "."

    def _value(self, text: str) -> str:
        """What stood in a sentence's gap: words that are known, or as it was, its numbers with this language's mark. An address, a
        version of three parts and a file's name are no number."""
        known = self._catalogue.messages
        said = known.get(text) or "".join(known.get(word, word) for word in re.split("(, | or )", text))
        said = self.tell(text) if said == text and " " in text else said  # a sentence within a sentence
        said = _BOUND.sub(lambda side: self.gettext(side[1]) + " ", said)
        return (
            re.sub(r"(?<![\w./])(\d+)\.(\d+(?:e[+-]?\d+)?)(?![\w./])", r"\1,\2", said)
            if self.language == "de"
            else said
        )

    def number(self, value: float | None, digits: int, unit: str = "") -> str:
        """`3,716 Ω`: fixed digits, decimal mark of the language, true minus, no-break space before the unit."""
        if value is None or not math.isfinite(value):
            return self.gettext("no value")
        shown = 0.0 if round(value, digits) == 0 else value
        text = f"{round(shown, digits):.{max(0, digits)}f}".replace("-", "\u2212").replace(".", self._mark)
        return text + (NBSP + unit if unit else "")

    def typed(self, value: float) -> str:
        """A number as it stands in a form's field."""
        return f"{value:.10g}".replace(".", self._mark)

    def with_error(self, value: float, std: float | None, unit: str) -> str:
        """`0.025640 ± 0.000097 A`: the 95 % interval to two digits, the value as far as these."""
        half = QUANTILE * (std or 0.0)
        if not 0.0 < half < math.inf:
            return self.short(value, unit)
        digits = min(places(half), 9)
        return f"{self.number(value, digits)} ± {self.number(half, digits, UNIT_SIGNS.get(unit, unit))}"

    def signed(self, value: float | None, digits: int, unit: str = "") -> str:
        text = self.number(value, digits, unit)
        return f"+{text}" if value is not None and value > 0 and not text.startswith("\u2212") else text

    def short(self, value: Any, unit: str = "") -> str:
        """A value of the core as a person reads it: four digits, words translated, units by their signs."""
        unit = UNIT_SIGNS.get(unit, unit)
        if isinstance(value, bool):
            return self.gettext("yes" if value else "no")
        if isinstance(value, int | float):
            if not math.isfinite(value):
                return self.gettext("no value")
            digits = 0 if value == 0 or isinstance(value, int) else max(0, 3 - math.floor(math.log10(abs(value))))
            text = self.number(float(value), min(digits, 6), unit)
            if self._mark in text.split(NBSP)[0] and not isinstance(value, int):
                head, *rest = text.split(NBSP)
                text = NBSP.join([head.rstrip("0").rstrip(self._mark), *rest])
            return text
        if value is None:
            return self.gettext("no value")
        said = self.tell(value)
        return said if said != str(value) else self._value(said)


def texts_of(connection: HTTPConnection) -> Texts:
    """By cookie, else by what the browser prefers."""
    chosen = connection.cookies.get("language") or connection.query_params.get("lang") or ""
    if chosen in LANGUAGES:
        return Texts(chosen)
    wanted = connection.headers.get("accept-language", "en").split(",")
    return Texts(next((w[:2].lower() for w in wanted if w[:2].lower() in LANGUAGES), "en"))


def told(refusal: Refusal, texts: Texts) -> Refusal:
    """The same refusal in the language of a page's script."""
    facts = refusal.problem.model_dump(exclude={"status", "title"})
    facts |= {key: texts.tell(facts[key]) for key in ("detail", "step", "remedy") if facts[key]}
    return Refusal(refusal.problem.status, texts.tell(refusal.problem.title), headers=refusal.headers, **facts)
