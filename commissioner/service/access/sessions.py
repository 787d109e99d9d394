"""Sessions: who a browser is, until it has been idle for too long. Held in memory; a restart asks everybody again."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from commissioner.service.access.accounts import Role

LONGEST_S = 12 * 3600.0
"""A session ends after a working day, however busy."""
MOST = 2000
"""Sessions held at once; the longest idle one makes room."""


@dataclass
class Session:
    """One browser. `csrf` goes into every form and request that changes something."""

    person: str
    role: Role
    is_logged_in: bool
    id: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    csrf: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    begun_s: float = 0.0
    seen_s: float = 0.0


class Sessions:
    """All sessions. The clock is monotonic: a computer's clock that jumps ends none."""

    def __init__(self, idle_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._idle_s, self._clock = idle_s, clock
        self._held: dict[str, Session] = {}

    def begin(self, person: str, role: Role, *, is_logged_in: bool) -> Session:
        """A new session under a new id."""
        now = self._clock()
        session = Session(person, role, is_logged_in, begun_s=now, seen_s=now)
        self._drop_expired(now)
        self._held[session.id] = session
        return session

    def find(self, identifier: str | None, *, is_busy: bool = True) -> Session | None:
        """The session; None where it is not known or has expired. It counts as seen where somebody is busy with it; without a log-in
        there is nobody to forget, and an open page will do."""
        session = self._held.get(identifier or "")
        if session is None:
            return None
        now = self._clock()
        if self._is_over(session, now):
            del self._held[session.id]
            return None
        if is_busy or not session.is_logged_in:
            session.seen_s = now
        return session

    def end(self, identifier: str) -> None:
        self._held.pop(identifier, None)

    def end_all_of(self, person: str) -> None:
        """Where an account is gone, its sessions are, too."""
        self._held = {key: one for key, one in self._held.items() if one.person != person or not one.is_logged_in}

    def _is_over(self, session: Session, now: float) -> bool:
        return now - session.seen_s > self._idle_s or now - session.begun_s > LONGEST_S

    def _drop_expired(self, now: float) -> None:
        self._held = {key: one for key, one in self._held.items() if not self._is_over(one, now)}
        while len(self._held) >= MOST:
            del self._held[min(self._held, key=lambda key: self._held[key].seen_s)]
