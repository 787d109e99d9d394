"""Who is logged in, who may, and what was done."""

from __future__ import annotations

from typing import NotRequired

from typing_extensions import TypedDict


class LoggedIn(TypedDict):
    """`csrf` goes into the header X-CSRF-Token of every request that changes something."""

    person: str
    role: str
    csrf: str


class LoggedOut(TypedDict):
    """Who was; null: nobody."""

    logged_out: str | None


class AccountDocument(TypedDict):
    """`role`: viewer | operator | administrator."""

    name: str
    role: str


class AccountsDocument(TypedDict):
    accounts: list[AccountDocument]


class RemovedAccount(TypedDict):
    """The name of it."""

    removed: str


class ChainDocument(TypedDict):
    """The whole audit, followed by its hashes. `broken_at`: number of the first line that does not follow its predecessor."""

    lines: int
    head: str
    is_intact: bool
    broken_at: int | None


_From = TypedDict("_From", {"from": NotRequired[str]})


class AuditEntry(_From):
    """`n`: number of the line; null, and with `what` alone, of one that cannot be read. `from`: the address. `before`, `hash`: of the
    chain. The rest as it belongs to what was done."""

    n: int | None
    what: str
    utc: NotRequired[str]
    person: NotRequired[str]
    before: NotRequired[str]
    hash: NotRequired[str]
    name: NotRequired[str]
    role: NotRequired[str]
    drive: NotRequired[str]
    motor: NotRequired[str]
    scenario: NotRequired[str]
    procedure: NotRequired[str]
    run: NotRequired[str]
    reason: NotRequired[str]
    by: NotRequired[str]
    zero_volts: NotRequired[bool]
    write_back: NotRequired[bool]
    tune: NotRequired[int]
    table: NotRequired[str]
    registers: NotRequired[int]


class AuditDocument(TypedDict):
    """Newest first."""

    chain: ChainDocument
    entries: list[AuditEntry]
