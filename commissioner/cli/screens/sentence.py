"""How a sentence breaks where the terminal is narrower: below its own beginning, and never between a number and its unit."""

from __future__ import annotations

import re
from typing import Any

from rich.console import Console
from rich.containers import Lines
from rich.text import Text

LEAD = re.compile(r" *(?:[•*–✓✗] |remedy |\w+ {2,})?")
"""What a line begins with and its next line goes on below of: a margin, a bullet, a label."""
BOUND = re.compile(r"(?:(?:±|\+-) )?\S*\d (?:[kmµu]?(?:Ω|ohm|H|V|A|W|s|K|Hz|Wb|m)|%|°C|1/min|kg|N m)(?!\w)")
KEPT = "\ue000"
"""Stands for the blank inside a quantity while its line is cut: rich breaks at a no-break space, too."""


class Sentence(Text):
    """A text that knows where it may be cut; otherwise as rich's."""

    @classmethod
    def of(cls, text: Text) -> Sentence:
        """The same text, its styles with it."""
        return cls(text.plain, text.style, justify=text.justify, overflow=text.overflow, spans=text.spans)

    def wrap(self, console: Console, width: int, **options: Any) -> Lines:
        """Its lines, each at most `width` cells wide; one that fits, or that nothing may cut, is as rich lays it."""
        lines = Lines()
        for line in self.split("\n", allow_blank=True):
            begin = LEAD.match(line.plain)
            lead = begin.end() if begin else 0
            if options.get("no_wrap") or line.cell_len <= width or 2 * lead > width:
                lines.extend(line.wrap(console, width, **options))
                continue
            head, rest = line.divide([lead]) if lead else (Text(), line)
            rest.plain = _bound(rest.plain, width - lead)
            for number, part in enumerate(rest.wrap(console, width - lead, **options)):
                part.plain = part.plain.replace(KEPT, " ")
                lines.append(Text.assemble(head if number == 0 else " " * lead, part))
        return lines


def _bound(text: str, width: int) -> str:
    """With every quantity as one word, if a line of `width` has room for it."""
    return BOUND.sub(
        lambda quantity: quantity[0].replace(" ", KEPT) if len(quantity[0]) <= width else quantity[0], text
    )
