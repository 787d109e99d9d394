"""What the operator's Ctrl-C or Ctrl-Break, a closed terminal, the system's SIGTERM, or a word from the service means to a run."""

from __future__ import annotations

import signal
import threading
from dataclasses import dataclass
from types import FrameType
from typing import Any

STOPS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name))


@dataclass(frozen=True)
class StopAsked:
    """Who asked a run to end, and why: a guard's abort has none."""

    person: str
    reason: str

    def __str__(self) -> str:
        return f"{self.reason} ({self.person})" if self.person else self.reason


class OperatorStop:
    """A wish that the runner grants between two commands; never in the middle of one.

    So a second Ctrl-C cannot interrupt the de-energising that the first one asked for. May be entered again inside
    itself. `ask` may be called from any thread; the first wish counts.
    """

    def __init__(self) -> None:
        self.wish: StopAsked | None = None
        self._before: list[list[tuple[int, Any]]] = []

    @property
    def asked(self) -> str:
        """The wish in words; empty where there is none."""
        return "" if self.wish is None else str(self.wish)

    def ask(self, person: str, reason: str) -> None:
        """The run is to end. Later wishes change nothing."""
        if self.wish is None:
            self.wish = StopAsked(person, reason)

    def __enter__(self) -> OperatorStop:
        numbers = STOPS if threading.current_thread() is threading.main_thread() else ()
        self._before.append([(number, signal.signal(number, self._signalled)) for number in numbers])
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.pop():
            signal.signal(number, handler)

    def _signalled(self, number: int, _frame: FrameType | None) -> None:
        self.ask("", "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name)
