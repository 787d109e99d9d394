"""What the service is made of, put together once."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field
from typing import Any

from commissioner.service.access.accounts import Accounts
from commissioner.service.access.sessions import Sessions
from commissioner.service.access.throttle import Throttle
from commissioner.service.access.visitor import Visitor
from commissioner.service.archive import Archive
from commissioner.service.audit import Audit
from commissioner.service.configuration import Settings
from commissioner.service.contract.drives import CheckedDocument
from commissioner.service.library import Library
from commissioner.service.recordings import Recordings
from commissioner.service.runs.desk import Desk
from commissioner.service.runs.incoming import Incoming
from commissioner.service.simulator import Simulator
from commissioner.service.warm import WarmUp

LOGIN_TRIES, LOGIN_WITHIN_S = 5, 60.0
STOPS, STOPS_WITHIN_S = 60, 1.0
"""STOP acts however often it is pressed; what comes faster than this from one address is a defect, not a hand."""


@dataclass(frozen=True)
class Writing:
    """A write-back or restore that goes on, into a drive of the library, or none of it: what it journals stands behind `offset` bytes
    of its run's journal."""

    what: str
    drive: str
    offset: int
    began_s: float


@dataclass
class Parts:
    """Everything that lives as long as the service."""

    settings: Settings
    accounts: Accounts
    sessions: Sessions
    audit: Audit
    library: Library
    desk: Desk
    archive: Archive
    recordings: Recordings
    incoming: Incoming
    simulator: Simulator
    warm: WarmUp
    login_tries: Throttle = field(default_factory=lambda: Throttle(LOGIN_TRIES, LOGIN_WITHIN_S))
    stop_tries: Throttle = field(default_factory=lambda: Throttle(STOPS, STOPS_WITHIN_S))
    logging_in: asyncio.Lock = field(default_factory=asyncio.Lock)
    checks: dict[str, CheckedDocument] = field(default_factory=dict)
    """Newest checks by drive and motor, for the page."""
    writing: dict[str, Writing] = field(default_factory=dict)
    """Write-backs and restores that go on, by run."""
    closing: asyncio.Event = field(default_factory=asyncio.Event)

    async def note(self, who: Visitor, what: str, **facts: Any) -> None:
        """Into the audit, in a thread: it waits for the disk."""
        await asyncio.to_thread(self.audit.write, who.person, who.address, what, **facts)

    @property
    def needs_accounts(self) -> bool:
        """Where there is an account, everybody needs one; on another host than this computer anyway."""
        return not self.settings.is_loopback or bool(self.accounts.all())


def make_parts(settings: Settings) -> Parts:
    """The parts, nothing started yet."""
    data = settings.data
    library = Library(settings)
    audit = Audit(data / "audit.jsonl")
    return Parts(
        settings,
        Accounts(data / "accounts.json"),
        Sessions(settings.file.service.session_idle_s),
        audit,
        library,
        Desk(settings, library, audit),
        Archive(settings.runs),
        Recordings(data / "recordings"),
        Incoming(data / "incoming", settings.runs),
        Simulator(settings.file.simulator, library, data / "logs"),
        WarmUp(data / "logs"),
    )
