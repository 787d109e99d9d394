"""What the operator's Ctrl-C or Ctrl-Break, a closed terminal, the system's SIGTERM, or a word from the service means to a run."""

from __future__ import annotations

import _thread
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any

STOPS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name))

SERVICE = "service"
"""Who asks where no person did: the service lost its operator's page, is shut down, or is gone."""
SYSTEM = "system"
"""Who sends SIGTERM: the computer that is shut down, a container that is stopped, another program."""
_BY = {SERVICE: "stopped by the service", SYSTEM: "stopped by the operating system"}


@dataclass(frozen=True)
class StopAsked:
    """Who asked a run to end, and why: a guard's abort has none."""

    person: str
    reason: str

    @property
    def what(self) -> str:
        """How the run ended by it."""
        return _BY.get(self.person, "stopped by the operator")

    @property
    def remedy(self) -> str:
        first = "see that the service runs and the operator's page stays open, then " if self.person == SERVICE else ""
        return f"{first}start again when ready"

    def __str__(self) -> str:
        return f"{self.reason} ({self.person})" if self.person else self.reason


class Abandoned(Exception):
    """Computing was given up because the operator wants the run to end."""


class OperatorStop:
    """A wish that the runner grants between two commands; never in the middle of one. Computing is given up at once.

    So a second Ctrl-C cannot interrupt the de-energising that the first one asked for. May be entered again inside
    itself. `ask` may be called from any thread; the first wish counts.
    """

    def __init__(self) -> None:
        self.wish: StopAsked | None = None
        self._computes_in: int | None = None
        self._before: list[list[tuple[int, Any]]] = []

    @property
    def asked(self) -> str:
        """The wish in words; empty where there is none."""
        return "" if self.wish is None else str(self.wish)

    def ask(self, person: str, reason: str) -> None:
        """The run is to end. Later wishes change nothing."""
        if self.wish is None:
            self.wish = StopAsked(person, reason)
            if self._computes_in is not None and self._computes_in != threading.get_ident():
                _thread.interrupt_main(signal.SIGINT)  # runs our handler there, between two of its instructions

    @contextmanager
    def computing(self) -> Iterator[None]:
        """What happens inside touches neither drive nor file: a wish raises Abandoned in its midst.

        Only where the signals are ours; a kernel that is compiled is finished first.
        """
        is_ours = bool(self._before and self._before[-1]) and threading.current_thread() is threading.main_thread()
        self._computes_in = threading.get_ident() if is_ours else None
        try:
            yield
        finally:
            self._computes_in = None

    def __enter__(self) -> OperatorStop:
        numbers = STOPS if threading.current_thread() is threading.main_thread() else ()
        self._before.append([(number, signal.signal(number, self._signalled)) for number in numbers])
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.pop():
            signal.signal(number, handler)

    def _signalled(self, number: int, _frame: FrameType | None) -> None:
        by = SYSTEM if number == signal.SIGTERM else ""
        self.ask(by, "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name)
        if self._computes_in is not None:
            self._computes_in = None
            raise Abandoned
