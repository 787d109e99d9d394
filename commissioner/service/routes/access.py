"""Log in, log out, and the audit."""

from __future__ import annotations

import asyncio
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request, Response
from pydantic import BaseModel, ConfigDict, Field

from commissioner.service.access.accounts import Role
from commissioner.service.access.sessions import Session
from commissioner.service.access.visitor import Visitor, check_token
from commissioner.service.access.visitors import COOKIE, Administrator, Operator, parts_of, visitor_of
from commissioner.service.contract.description import Typed
from commissioner.service.contract.people import (
    AccountDocument,
    AccountsDocument,
    AuditDocument,
    ChainDocument,
    LoggedIn,
    LoggedOut,
    RemovedAccount,
)
from commissioner.service.parts import Parts
from commissioner.service.problems import Refusal

router = APIRouter(route_class=Typed)


class Credentials(BaseModel):
    model_config = ConfigDict(extra="forbid")
    name: Annotated[str, Field(max_length=200)]
    password: Annotated[str, Field(max_length=1000)]


class NewAccount(Credentials):
    role: Literal["viewer", "operator", "administrator"]


@router.post("/api/login")
async def login(request: Request, response: Response, credentials: Credentials) -> LoggedIn:
    """A session as a cookie; `csrf` goes into the header X-CSRF-Token of every request that changes something."""
    session = await log_in(request, credentials)
    set_cookie(parts_of(request), response, session)
    return {"person": session.person, "role": session.role.name.lower(), "csrf": session.csrf}


async def log_in(request: Request, credentials: Credentials) -> Session:
    """A new session. Refusal 401: name or password is wrong; 429: too many wrong ones. One is judged after the other: what comes at
    once is counted as what comes in turn, and only what was wrong."""
    async with parts_of(request).logging_in:
        return await _log_in(request, credentials)


async def _log_in(request: Request, credentials: Credentials) -> Session:
    parts = parts_of(request)
    address = request.client.host if request.client else ""
    keys = (f"address {address}", f"name {credentials.name}")
    wait_s = max(parts.login_tries.wait_s(key) for key in keys)
    if wait_s > 0.0:
        raise Refusal(
            429,
            "too many wrong passwords",
            step="log in",
            value=f"{wait_s:.0f} s to wait",
            limit="5 a minute",
            remedy="wait, then try again",
            headers={"retry-after": str(int(wait_s) + 1)},
        )
    account = await asyncio.to_thread(parts.accounts.verify, credentials.name, credentials.password)
    if account is None:
        for key in keys:
            parts.login_tries.count(key)
        await asyncio.to_thread(parts.audit.write, credentials.name[:40], address, "log-in refused")
        raise Refusal(
            401,
            "name or password is wrong",
            step="log in",
            value=credentials.name[:40],
            limit="an account and its password",
            remedy="try again; `commissioner accounts list` shows the names",
        )
    for key in keys:
        parts.login_tries.forget(key)
    old = visitor_of(request).session
    if old is not None:
        parts.sessions.end(old.id)
    await asyncio.to_thread(parts.audit.write, account.name, address, "logged in", role=account.role.name.lower())
    return parts.sessions.begin(account.name, account.role, is_logged_in=True)


def set_cookie(parts: Parts, response: Response, session: Session) -> None:
    response.set_cookie(
        COOKIE, session.id, httponly=True, samesite="strict", secure=parts.settings.file.tls is not None, path="/"
    )


@router.post("/api/logout")
async def logout(request: Request, response: Response) -> LoggedOut:
    """The session ends."""
    who = visitor_of(request)
    check_token(who, request.headers.get("x-csrf-token", ""))
    await log_out(parts_of(request), who)
    response.delete_cookie(COOKIE, path="/")
    return {"logged_out": who.person or None}


async def log_out(parts: Parts, who: Visitor) -> None:
    if who.session is not None:
        parts.sessions.end(who.session.id)
        if who.session.is_logged_in:
            await parts.note(who, "logged out")


@router.get("/api/accounts")
async def accounts(request: Request, _who: Administrator) -> AccountsDocument:
    """Names and roles."""
    known = await asyncio.to_thread(parts_of(request).accounts.all)
    return {"accounts": [{"name": account.name, "role": account.role.name.lower()} for account in known]}


@router.post("/api/accounts", status_code=201)
async def add_account(request: Request, wish: NewAccount, who: Administrator) -> AccountDocument:
    """Who may log in. The first one is added at the computer: `commissioner accounts add`."""
    parts = parts_of(request)
    await asyncio.to_thread(parts.accounts.add, wish.name, Role[wish.role.upper()], wish.password)
    await parts.note(who, "added an account", name=wish.name, role=wish.role)
    return {"name": wish.name, "role": wish.role}


@router.delete("/api/accounts/{name}")
async def remove_account(request: Request, name: str, who: Administrator) -> RemovedAccount:
    """No longer an account; its sessions end."""
    parts = parts_of(request)
    if await asyncio.to_thread(parts.accounts.is_last_administrator, name):
        raise Refusal(
            409, f"{name} is the last administrator", step="remove an account", value=name, limit="one that stays",
            remedy="add another one before; `commissioner accounts remove` at the computer removes any",
        )  # fmt: skip
    await asyncio.to_thread(parts.accounts.remove, name)
    parts.sessions.end_all_of(name)
    await parts.note(who, "removed an account", name=name)
    return {"removed": name}


@router.get("/api/audit")
async def audit(request: Request, _who: Operator, limit: Annotated[int, Query(ge=1, le=5000)] = 200) -> AuditDocument:
    """Newest first, and whether the whole chain is intact."""
    parts = parts_of(request)
    chain = await asyncio.to_thread(parts.audit.verify)
    entries = await asyncio.to_thread(parts.audit.newest, limit)
    facts: ChainDocument = {
        "lines": chain.lines,
        "head": chain.head,
        "is_intact": chain.is_intact,
        "broken_at": chain.broken_at,
    }
    return {"chain": facts, "entries": entries}
