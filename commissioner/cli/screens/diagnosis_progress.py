"""What the search does while it works, in a technician's words; remembers what was tried."""

from __future__ import annotations

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.search.journal import Accepted, Dropped, Nominal, Said, Tried
from commissioner.report.diagnosis.names import said
from commissioner.report.sheet.words import cause_name

BEGIN = "comparing with a plain simulation, then trying the causes; this takes from seconds to some minutes"


class Progress:
    """Call it with every record of a diagnosis."""

    def __init__(self, is_quiet: bool = False) -> None:
        self.is_quiet = is_quiet
        self.tried: list[str] = []
        self.last = ""

    def __call__(self, record: object) -> None:
        if not self.last:
            self.say(BEGIN)
        self.say(self.words_for(record))

    def say(self, text: str) -> None:
        """On stderr, unless it is quiet or was said just now."""
        if text and text != self.last and not self.is_quiet:
            from commissioner.cli.screens.screen import err

            self.last = text
            err.print(f"[dim]{text}[/]")

    def words_for(self, record: object) -> str:
        """One line; empty for the search's own arithmetic."""
        match record:
            case Nominal(sigma=sigma):
                return f"the plain simulation's error is {sigma:.3g} x the noise"
            case Tried(name=name) if name not in self.tried:
                self.tried.append(name)
                count = f"{len(self.tried)} of {len(CATALOGUE)} causes looked likely enough so far"
                return f"trying {cause_name(name)} ...  ({count})"
            case Accepted(name=name):
                return f"{cause_name(name)} helps"
            case Dropped(name=name, is_taken=True):
                return f"{cause_name(name)} is no longer needed"
            case Said(sentence=sentence):
                return said(sentence.strip())
            case _:
                return ""
