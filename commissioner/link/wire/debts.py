"""Requests on a serial line whose answer was never believed: it may still come, and be taken for a later one's.

What tells RTU answers apart is their shape alone: the function, and the byte count or, for writes, the address and
number that are echoed. So a request that was lost casts doubt on answers of its shape only, until it was seen or is
too old to come.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from commissioner.link.wire.rtu import SIZE_BY_COUNT

LATEST_S = 60.0
"""No answer is expected later than this: longer than any queue of a gateway or radio modem keeps one."""

Shape = tuple[int, ...]


def shape_of(frame: bytes) -> Shape:
    """What a whole RTU answer shows of its request; of an exception only the function."""
    function = frame[1]
    if function & 0x80:
        return (function & 0x7F,)
    if function in SIZE_BY_COUNT:
        return (function, frame[2])
    return (function, int.from_bytes(frame[2:4]), int.from_bytes(frame[4:6]))


class Debts:
    """The answers still owed, oldest first, each until it is too late for it."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._owed: list[tuple[Shape, float]] = []

    def owe(self, shape: Shape) -> None:
        self._lapse()
        self._owed.append((shape, self._clock() + LATEST_S))

    def pay(self, answers: Iterable[bytes]) -> None:
        """These whole answers were seen and not believed: each pays one debt that it may belong to."""
        for frame in answers:
            paid = next((debt for debt in self._owed if _may_be(frame, debt[0])), None)
            if paid is not None:
                self._owed.remove(paid)

    def is_owed(self, shape: Shape) -> bool:
        self._lapse()
        return any(shape == owed for owed, _ in self._owed)

    def may_be_late(self, frame: bytes) -> bool:
        """Whether the answer could be one of those that are owed."""
        self._lapse()
        return any(_may_be(frame, shape) for shape, _ in self._owed)

    def _lapse(self) -> None:
        now = self._clock()
        self._owed = [debt for debt in self._owed if debt[1] > now]


def _may_be(frame: bytes, shape: Shape) -> bool:
    seen = shape_of(frame)
    return shape[: len(seen)] == seen
