"""What the operator's Ctrl-C or Ctrl-Break, a closed terminal, or the system's SIGTERM means to a run."""

from __future__ import annotations

import signal
import threading
from types import FrameType
from typing import Any

STOPS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name))


class OperatorStop:
    """Signals, taken as a wish that the runner grants between two commands; never in the middle of one.

    So a second Ctrl-C cannot interrupt the de-energising that the first one asked for. May be entered again inside
    itself.
    """

    def __init__(self) -> None:
        self.asked = ""
        self._before: list[list[tuple[int, Any]]] = []

    def __enter__(self) -> OperatorStop:
        numbers = STOPS if threading.current_thread() is threading.main_thread() else ()
        self._before.append([(number, signal.signal(number, self._ask)) for number in numbers])
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.pop():
            signal.signal(number, handler)

    def _ask(self, number: int, _frame: FrameType | None) -> None:
        self.asked = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name
