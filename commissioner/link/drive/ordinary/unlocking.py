"""Drives that take parameters only after an unlock: the writes that their files name, before, and the lock after, whatever came."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import partial

from commissioner.errors import LinkError
from commissioner.link.drive.ordinary.insisting import insist
from commissioner.link.wire.port import Port
from commissioner.registers.profile import DriveProfile


@contextmanager
def unlocked(port: Port, profile: DriveProfile) -> Iterator[None]:
    """Nothing where the drive file has no [unlock]. LinkError: it could not be unlocked, or locked after all went well;
    what went wrong in between is told and not what the lock met after it."""
    if profile.unlock is None:
        yield
        return
    _put(port, profile.unlock.writes)
    try:
        yield
    except BaseException:
        with suppress(LinkError):
            _lock(port, profile.unlock.locks)
        raise
    _lock(port, profile.unlock.locks)


def _put(port: Port, writes: Iterable[tuple[int, int]]) -> None:
    for address, value in writes:
        port.write(address, [value])


def _lock(port: Port, writes: Iterable[tuple[int, int]]) -> None:
    for one in writes:
        insist(partial(_put, port, [one]))
