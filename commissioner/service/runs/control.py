"""Who operates a drive: one session at a time; others watch, may ask for control, and may always STOP."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

from commissioner.service.problems import Refusal

LEFT_S = 2.0
"""Whose page is gone for longer than a reload takes asks for nothing any more."""


@dataclass(frozen=True)
class Party:
    """A session, or a script without one (empty id): whoever can hold control."""

    session: str
    person: str


class Pages:
    """Which sessions have a page open, and since when the others have none."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._open: Counter[str] = Counter()
        self._closed_s: dict[str, float] = {}

    def opened(self, session: str) -> None:
        self._open[session] += 1
        self._closed_s.pop(session, None)

    def closed(self, session: str) -> None:
        self._open[session] -= 1
        if self._open[session] <= 0:
            del self._open[session]
            self._closed_s[session] = self._clock()
        if len(self._closed_s) > 5000:
            self._closed_s.pop(next(iter(self._closed_s)))

    def lost_for_s(self, session: str) -> float:
        """Seconds since the session's last page went away; 0 where one is open or there never was one."""
        since = self._closed_s.get(session)
        return 0.0 if since is None else self._clock() - since

    def has_page(self, session: str) -> bool:
        return self._open[session] > 0


class Control:
    """Of one drive. Taken by the first who acts; asked for, then granted, or taken after `hand_over_s`."""

    def __init__(self, pages: Pages, hand_over_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._pages, self._hand_over_s, self._clock = pages, hand_over_s, clock
        self.holder: Party | None = None
        self._asking: Party | None = None
        self._asked_s = 0.0

    @property
    def asking(self) -> Party | None:
        """Who asks for control, until it was granted, refused or taken."""
        self._settle()
        return self._asking

    @property
    def wait_s(self) -> float:
        """Seconds until the one who asks gets it by itself."""
        return max(0.0, self._asked_s + self._hand_over_s - self._clock()) if self._asking else 0.0

    def is_held_by(self, party: Party) -> bool:
        self._settle()
        return self.holder == party

    def take(self, party: Party) -> None:
        """Control where it is free. Refusal 409 names who has it."""
        self._settle()
        holder = self.holder
        if holder is None or holder == party or (not self._pages.has_page(holder.session)):
            self.holder, self._asking = party, None
            return
        raise Refusal(
            409, f"{holder.person} operates this drive", step="control", value=holder.person, limit="one operator at a time",
            remedy=f"ask for control; without an answer it is yours after {self._hand_over_s:g} s",
        )  # fmt: skip

    def ask(self, party: Party) -> None:
        """Control at once where it is free, else a question to its holder."""
        self._settle()
        if self.holder is None or self.holder == party:
            self.take(party)
        elif self._asking is None or self._asking == party:
            if self._asking is None:
                self._asked_s = self._clock()
            self._asking = party
        else:
            raise Refusal(409, f"{self._asking.person} has asked for control before you", step="control",
                          value=self._asking.person, limit="one at a time", remedy="wait for the answer")  # fmt: skip

    def answer(self, party: Party, *, grants: bool) -> None:
        """The holder's answer to who asks; without effect where nobody does."""
        self._settle()
        if self.holder != party:
            raise Refusal(409, "you do not have control", step="control", value=party.person,
                          limit=self.holder.person if self.holder else "nobody", remedy="ask for control")  # fmt: skip
        if grants and self._asking is not None:
            self.holder = self._asking
        self._asking = None

    def release(self) -> None:
        """Free again."""
        self.holder, self._asking = None, None

    def _settle(self) -> None:
        """Control passes to who asked and is still there: else a page that was closed would take it along, and end the run."""
        if self._asking is None:
            return
        lost_s = self._pages.lost_for_s(self._asking.session)
        if lost_s > LEFT_S:
            self._asking = None
        elif lost_s == 0.0 and self._clock() - self._asked_s >= self._hand_over_s:
            self.holder, self._asking = self._asking, None
