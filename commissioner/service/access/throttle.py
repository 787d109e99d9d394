"""How often something may be tried: so many times within a time, by key."""

from __future__ import annotations

import time
from collections import OrderedDict, deque
from collections.abc import Callable

MOST_KEYS = 5000


class Throttle:
    """`most` tries within `within_s` for each key; the oldest keys are forgotten."""

    def __init__(self, most: int, within_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._most, self._within_s, self._clock = most, within_s, clock
        self._tries: OrderedDict[str, deque[float]] = OrderedDict()

    def wait_s(self, key: str) -> float:
        """Seconds until the next try is taken; 0 where it is taken now. Does not count one."""
        tries = self._tries.get(key)
        if tries is None:
            return 0.0
        now = self._clock()
        while tries and now - tries[0] > self._within_s:
            tries.popleft()
        return self._within_s - (now - tries[0]) if len(tries) >= self._most else 0.0

    def count(self, key: str) -> None:
        """One try."""
        tries = self._tries.setdefault(key, deque(maxlen=self._most))
        self._tries.move_to_end(key)
        tries.append(self._clock())
        while len(self._tries) > MOST_KEYS:
            self._tries.popitem(last=False)

    def forget(self, key: str) -> None:
        self._tries.pop(key, None)
