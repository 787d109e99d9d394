"""What the search says while it works, in a technician's words; remembers what was tried."""

from __future__ import annotations

import re

from commissioner.diagnose.causes import CATALOGUE
from commissioner.operations.events import SearchSaid
from commissioner.report.diagnosis.names import said, spoken

BEGIN = "comparing with a plain simulation, then trying the causes; this takes from seconds to some minutes"
TRY = re.compile(r"^\s*try (?:a large )?(\w+):")
KEPT = re.compile(r"^accepted (\w+):")
DROPPED = re.compile(r"^\s*dropped (\w+)")
PLAIN_ERROR = re.compile(r"^nominal fit: ([\d.e+-]+) times the noise")


class Progress:
    """Call it with every record of a diagnosis."""

    def __init__(self, is_quiet: bool = False) -> None:
        self.is_quiet = is_quiet
        self.tried: list[str] = []
        self.last = ""

    def __call__(self, record: object) -> None:
        if not self.last:
            self.say(BEGIN)
        if isinstance(record, SearchSaid):
            self.say(self.translated(record.sentence))

    def say(self, text: str) -> None:
        """On stderr, unless it is quiet or was said just now."""
        if text and text != self.last and not self.is_quiet:
            from commissioner.cli.screens.screen import err

            self.last = text
            err.print(f"[dim]{text}[/]")

    def translated(self, sentence: str) -> str:
        """One line in words; empty for the search's own arithmetic."""
        if found := PLAIN_ERROR.match(sentence):
            return f"the plain simulation's error is {float(found[1]):.3g} x the noise"
        if found := TRY.match(sentence):
            if found[1] in self.tried:
                return ""
            self.tried.append(found[1])
            return f"trying {spoken(found[1])} ...  ({len(self.tried)} of {len(CATALOGUE)} causes looked likely enough so far)"
        if found := KEPT.match(sentence):
            return f"{spoken(found[1])} helps"
        if found := DROPPED.match(sentence):
            return f"{spoken(found[1])} is no longer needed"
        is_arithmetic = any(word in sentence for word in ("chi2", "promised", "gained", "round "))
        return "" if is_arithmetic else said(sentence.strip())
