"""Who makes a request: a session, its role, and whether the request carries the token that its pages hold."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import Depends
from starlette.requests import HTTPConnection, Request

from commissioner.service.access.accounts import Role
from commissioner.service.access.gate import SAFE
from commissioner.service.access.sessions import Session
from commissioner.service.problems import Refusal
from commissioner.service.runs.control import Party

if TYPE_CHECKING:
    from commissioner.service.parts import Parts

COOKIE = "commissioner_session"
LOCAL = "operator"
"""Whoever sits at this computer, where there are no accounts."""


@dataclass(frozen=True)
class Visitor:
    """`role` None: nobody knows who it is. `session` None: a script without a cookie."""

    person: str
    role: Role | None
    address: str
    session: Session | None

    @property
    def party(self) -> Party:
        """As who can hold control of a drive."""
        return Party(self.session.id if self.session else "", self.person)

    def may(self, role: Role) -> bool:
        return self.role is not None and self.role >= role


def parts_of(connection: HTTPConnection) -> Parts:
    """The service's parts."""
    parts: Parts = connection.app.state.parts
    return parts


def visitor_of(connection: HTTPConnection, *, is_busy: bool = True) -> Visitor:
    """Who this is; not `is_busy`: a page that only lies open asks. Loopback without accounts acts as operator."""
    parts = parts_of(connection)
    address = connection.client.host if connection.client else ""
    session = parts.sessions.find(connection.cookies.get(COOKIE), is_busy=is_busy)
    needs_account = parts.needs_accounts
    if session is not None and session.is_logged_in:
        account = parts.accounts.find(session.person)
        if account is None:
            parts.sessions.end(session.id)
            return Visitor("", None, address, None)
        return Visitor(session.person, account.role, address, session)
    if needs_account:
        return Visitor("", None, address, None)
    return Visitor(LOCAL, Role.OPERATOR, address, session)


def require(role: Role) -> Callable[[Request], Visitor]:
    """A dependency: the visitor, who has at least this role and, where a browser asks to change something, its token."""

    def visitor(request: Request) -> Visitor:
        who = visitor_of(request)
        check_role(who, role)
        if request.method not in SAFE:
            check_token(who, request.headers.get("x-csrf-token", ""))
        return who

    return visitor


Viewer = Annotated[Visitor, Depends(require(Role.VIEWER))]
Operator = Annotated[Visitor, Depends(require(Role.OPERATOR))]
Administrator = Annotated[Visitor, Depends(require(Role.ADMINISTRATOR))]
"""Who may call a route of the API."""


def check_role(who: Visitor, role: Role) -> None:
    """Refusal 401 where nobody is logged in, 403 where the role is not enough."""
    facts: dict[str, Any] = {"step": "access", "limit": f"role {role.name.lower()}"}
    if who.role is None:
        raise Refusal(
            401,
            "nobody is logged in",
            value="no session",
            remedy="log in: POST /api/login, or the page /login",
            **facts,
        )
    if not who.may(role):
        remedy = "ask somebody whose account has the role"
        raise Refusal(403, "this needs another role", value=f"role {who.role.name.lower()}", remedy=remedy, **facts)


def check_token(who: Visitor, token: str) -> None:
    """Refusal 403 where a request with a session comes without what only its own pages know."""
    if who.session is not None and not secrets.compare_digest(token.encode(), who.session.csrf.encode()):
        raise Refusal(
            403, "the request does not carry the session's token", step="access", value="no or another token",
            limit="X-CSRF-Token, or the form's field csrf", remedy="load the page again, then repeat",
        )  # fmt: skip
