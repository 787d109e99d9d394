"""Ahead of this host's other programs while a drive waits for us, and behind them where nobody does, where the system allows it."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

NICER = 10
"""Steps of POSIX's nice value; a process without the right to them stays where it is."""
HIGH_PRIORITY_CLASS, NORMAL_PRIORITY_CLASS, BELOW_NORMAL_PRIORITY_CLASS = 0x80, 0x20, 0x4000
"""Of the Win32 call SetPriorityClass."""


@contextmanager
def raised_priority() -> Iterator[None]:
    """Of this thread on Linux, of the process elsewhere; as before at the end."""
    if sys.platform == "win32":
        import ctypes

        kernel = ctypes.windll.kernel32
        kernel.SetPriorityClass(kernel.GetCurrentProcess(), HIGH_PRIORITY_CLASS)
        try:
            yield
        finally:
            kernel.SetPriorityClass(kernel.GetCurrentProcess(), NORMAL_PRIORITY_CLASS)
    else:
        before = os.getpriority(os.PRIO_PROCESS, 0)
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, max(before - NICER, -20))
        try:
            yield
        finally:
            with suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, 0, before)


def lower_priority() -> None:
    """Of this process, for the rest of its life."""
    if sys.platform == "win32":
        import ctypes

        kernel = ctypes.windll.kernel32
        kernel.SetPriorityClass(kernel.GetCurrentProcess(), BELOW_NORMAL_PRIORITY_CLASS)
    else:
        with suppress(OSError):
            os.nice(NICER)
