"""The one seam to the wire: what the inverter asks of a port, and what a port remembers about itself."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

import numpy as np

from commissioner.errors import ReplyMismatch, ReplyTimeout

Words = tuple[int, ...]
T = TypeVar("T")
MOST_AGAIN = 5
"""Times that a read is asked again while there is patience."""
MAY_BE_CARRIED_OUT = frozenset({5, 11})
"""Still at work, or no answer from behind a gateway: only what may be repeated without harm is asked again."""


@dataclass
class LinkStats:
    """Counts since the port was opened, and the latency of the last answered requests.

    `latency_s(0.99)` is what a guard must predict across: the time from sending a request to holding its answer.
    """

    requests: int = 0
    timeouts: int = 0
    mismatches: int = 0
    refusals: int = 0
    resynchronisations: int = 0
    connections: int = 0
    waits: int = 0
    """Requests put again because the drive or a gateway was busy."""
    longest_gap_s: float = 0.0
    """Longest time in which this host stood still: between an answer and the next request, or past every deadline of a request. Whoever
    measures sets it to 0."""
    latencies_s: deque[float] = field(default_factory=lambda: deque(maxlen=2048))
    turns_s: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=2048))
    """Of the latest requests: how long this host let pass since the answer before, and how long the answer took."""

    def latency_s(self, quantile: float) -> float:
        """The quantile (0 ... 1) of the latest 2048 latencies; NaN before the first answer."""
        return float(np.quantile(np.array(self.latencies_s), quantile)) if self.latencies_s else float("nan")

    def shares_s(self, span_s: float) -> tuple[float, float]:
        """What of the latest `span_s`, or a little more, passed in this host and on the link."""
        host_s = link_s = 0.0
        for gap_s, took_s in reversed(self.turns_s):
            if host_s + link_s >= span_s:
                break
            host_s, link_s = host_s + gap_s, link_s + took_s
        return host_s, link_s

    def as_dict(self) -> dict[str, float]:
        """Counts and latency quantiles, for the journal and the report."""
        counts = ("requests", "timeouts", "mismatches", "refusals", "resynchronisations", "connections", "waits")
        quantiles = {"latency_p50_s": 0.5, "latency_p99_s": 0.99, "latency_max_s": 1.0}
        return {name: float(getattr(self, name)) for name in counts} | {
            name: self.latency_s(q) for name, q in quantiles.items()
        }


def ask_again(ask: Callable[[], T], least: int, patience_s: float, now_s: Callable[[], float]) -> T:
    """`ask`, which only reads, again where its answer was lost: `least` times whatever it takes, and more often, MOST_AGAIN times, while
    `patience_s` have not passed since it was asked first. A damaged answer is known at once, one that nobody sends only after its time."""
    until_s = now_s() + patience_s
    again = 0
    while True:
        try:
            return ask()
        except (ReplyTimeout, ReplyMismatch):
            if again >= least and (again >= MOST_AGAIN or now_s() >= until_s):
                raise
        again += 1


class Port(Protocol):
    """Registers over some wire. One owner, no threads; every call ends within the deadline or raises a LinkError.

    No call is ever repeated, except a read, by `ask_again` with `read_retries` and `patience_s`; a write or an exchange never. What was refused as
    busy was not carried out, and is asked again for as long as a reply may take; exceptions 5 and 11 only where twice does
    no harm (reads, exchanges).
    """

    stats: LinkStats
    read_retries: int
    patience_s: float
    reply_timeout_s: float

    def read(self, address: int, count: int) -> Words:
        """`count` holding registers from `address` (FC03)."""
        ...

    def write(self, address: int, values: Sequence[int]) -> None:
        """Write the registers in one transaction: FC06 where there is one and the drive file names it, else FC16."""
        ...

    def exchange(
        self, write_address: int, values: Sequence[int], read_address: int, count: int, *, proves_itself: bool = False
    ) -> Words:
        """Write, then read, in one transaction (FC23), or FC16 and FC03 where the drive has no FC23.

        `proves_itself`: the caller can tell from the content that the answer is his; no other proof is asked for.
        """
        ...

    def write_coil(self, address: int, value: bool) -> None:
        """Set one coil (FC05)."""
        ...

    def read_coil(self, address: int) -> bool:
        """One coil (FC01)."""
        ...

    def doubt(self) -> None:
        """The caller saw from its content that the last answer was an older request's: the right one may still come."""
        ...

    def close(self) -> None:
        """Give the wire back. Idempotent."""
        ...
