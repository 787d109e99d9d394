"""What must not be left undone, and does no harm twice: a stop, a lock, a switch put back. Asked again where its answer was lost."""

from __future__ import annotations

from collections.abc import Callable

from commissioner.errors import LinkError, RequestRefused

ATTEMPTS = 3
"""One for a connection that breaks, one while the drive still holds the broken one; so many lost in a row are a lost link."""


def insist(act: Callable[[], None]) -> None:
    """`act`, until it was answered. LinkError: not within ATTEMPTS, or the drive refused it."""
    for _ in range(ATTEMPTS - 1):
        try:
            return act()
        except LinkError as failure:
            if not is_lost(failure):
                raise
    return act()


def is_lost(failure: Exception) -> bool:
    """Whether nobody knows what became of a request. A refusal is an answer."""
    return isinstance(failure, LinkError) and not isinstance(failure, RequestRefused)
