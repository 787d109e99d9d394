"""Somebody who makes a request, and what that person may do."""

from __future__ import annotations

import secrets
from dataclasses import dataclass
from typing import Any

from commissioner.service.access.accounts import Role
from commissioner.service.access.sessions import Session
from commissioner.service.problems import Refusal
from commissioner.service.runs.control import Party


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
