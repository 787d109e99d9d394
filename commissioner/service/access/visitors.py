"""Who makes a request: a session, its role, and whether the request carries the token that its pages hold."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

from fastapi import Depends
from starlette.requests import HTTPConnection, Request

from commissioner.service.access.accounts import Role
from commissioner.service.access.gate import SAFE
from commissioner.service.access.visitor import Visitor, check_role, check_token
from commissioner.service.parts import Parts

COOKIE = "commissioner_session"
LOCAL = "operator"
"""Whoever sits at this computer, where there are no accounts."""


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
