"""Words and numbers in the reader's language: gettext catalogues (the English sentence is the key), babel's number formats."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from babel.messages.pofile import read_po
from babel.numbers import format_decimal
from starlette.requests import HTTPConnection

LANGUAGES = ("en", "de")
NBSP = "\u00a0"


@cache
def catalogue(language: str) -> Mapping[str, str]:
    """Message -> translation; empty for English, whose sentences are the messages."""
    path = Path(__file__).parent / "catalogues" / f"{language}.po"
    if not path.is_file():
        return {}
    with path.open("rb") as file:
        found = read_po(file, locale=language)
    return {str(message.id): str(message.string) for message in found if message.id and message.string}


class Texts:
    """One language. What has no translation stays as it is."""

    def __init__(self, language: str) -> None:
        self.language = language if language in LANGUAGES else "en"
        self._catalogue = catalogue(self.language)

    def gettext(self, message: str) -> str:
        return self._catalogue.get(message, message)

    def ngettext(self, one: str, many: str, number: int) -> str:
        return self.gettext(one if number == 1 else many)

    def say(self, message: str, **facts: object) -> str:
        """The message with its %(name)s filled in."""
        return self.gettext(message) % facts

    def number(self, value: float | None, digits: int, unit: str = "") -> str:
        """`3,716 Ω`: fixed digits, decimal mark of the language, true minus, no-break space before the unit."""
        if value is None or not math.isfinite(value):
            return self.gettext("no value")
        shown = 0.0 if round(value, digits) == 0 else value
        pattern = "0" + ("." + "0" * digits if digits else "")
        text = format_decimal(shown, format=pattern, locale=self.language, decimal_quantization=True).replace(
            "-", "\u2212"
        )
        return text + (NBSP + unit if unit else "")

    def signed(self, value: float | None, digits: int, unit: str = "") -> str:
        text = self.number(value, digits, unit)
        return f"+{text}" if value is not None and value > 0 and not text.startswith("\u2212") else text

    def short(self, value: Any, unit: str = "") -> str:
        """A value of the core as a person reads it: four digits, words translated."""
        if isinstance(value, bool):
            return self.gettext("yes" if value else "no")
        if isinstance(value, int | float):
            if not math.isfinite(value):
                return self.gettext("no value")
            digits = 0 if value == 0 or isinstance(value, int) else max(0, 3 - math.floor(math.log10(abs(value))))
            text = self.number(float(value), min(digits, 6), unit)
            mark = "," if self.language == "de" else "."
            if mark in text.split(NBSP)[0] and not isinstance(value, int):
                head, *rest = text.split(NBSP)
                text = NBSP.join([head.rstrip("0").rstrip(mark), *rest])
            return text
        return self.gettext("no value") if value is None else self.gettext(str(value))


def texts_of(connection: HTTPConnection) -> Texts:
    """By cookie, else by what the browser prefers."""
    chosen = connection.cookies.get("language") or connection.query_params.get("lang") or ""
    if chosen in LANGUAGES:
        return Texts(chosen)
    wanted = connection.headers.get("accept-language", "en").split(",")
    return Texts(next((w[:2].lower() for w in wanted if w[:2].lower() in LANGUAGES), "en"))
