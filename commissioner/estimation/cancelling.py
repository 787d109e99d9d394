"""Giving a fit up in its midst: whoever asked for it says when, and is heeded within one segment's prediction, or one window's simulation."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_GO_ON: ContextVar[Callable[[], bool]] = ContextVar("go_on", default=lambda: True)


class TimeOver(Exception):
    """Raised in the midst of a computation once it is to go on no more."""


@contextmanager
def given_up_by(go_on: Callable[[], bool]) -> Iterator[None]:
    """What is computed inside asks `go_on` before every segment or window, in whichever thread, and raises TimeOver once it says no."""
    token = _GO_ON.set(go_on)
    try:
        yield
    finally:
        _GO_ON.reset(token)


def ask_for_time() -> None:
    """TimeOver where the computation is to go on no more."""
    if not _GO_ON.get()():
        raise TimeOver
