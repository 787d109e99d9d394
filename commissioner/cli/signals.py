"""What Ctrl-C and SIGTERM mean to a verb: it stops, once; what has ended ends as it has."""

from __future__ import annotations

import signal
import threading
from types import FrameType

_HEARD = (signal.SIGTERM, signal.SIGINT)
_ended = threading.Event()


def listen() -> None:
    """From here on they raise KeyboardInterrupt. A shell's background job is deaf to Ctrl-C and stays so."""
    _ended.clear()
    for number in _HEARD:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupted)


def let_end() -> None:
    """From here on they change neither what is said nor the exit code."""
    _ended.set()


def be_deaf() -> None:
    """As `let_end`, and through the interpreter's own end, which handlers do not outlive."""
    let_end()
    for number in _HEARD:
        signal.signal(number, signal.SIG_IGN)


def _interrupted(number: int, _frame: FrameType | None) -> None:
    if not _ended.is_set():
        raise KeyboardInterrupt(signal.Signals(number).name)
