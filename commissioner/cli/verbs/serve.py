"""`commissioner serve`: HTTP API and the technician's page; `commissioner accounts`: who may log in to it."""

from __future__ import annotations

import json
import sys
import webbrowser
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from typing_extensions import TypedDict

from commissioner.cli.screens.password import read_password
from commissioner.errors import UsageError

if TYPE_CHECKING:
    from commissioner.service.access.accounts import Accounts


class AccountRow(TypedDict):
    """`role`: what it may do."""

    account: str
    role: str


class KnownAccounts(TypedDict):
    """Who may log in."""

    accounts: list[AccountRow]


def serve(*, host: str, port: int, config: Path | None, open_page: bool, runs: Path, as_json: bool) -> None:
    """Serve until stopped. The first line on stdout says where."""
    require_extra()
    from commissioner.service.configuration import load_settings
    from commissioner.service.serving import serve_until_stopped

    def ready(url: str) -> None:
        sys.stdout.write((json.dumps({"url": url}) if as_json else f"serving {url}") + "\n")
        sys.stdout.flush()
        if open_page:
            webbrowser.open(url)

    with suppress(KeyboardInterrupt):  # Ctrl-C and SIGTERM are how a service ends
        serve_until_stopped(load_settings(config, host=host, port=port, runs=runs), ready)


def add(name: str, *, role: str, password_file: Path | None, config: Path | None, runs: Path, as_json: bool) -> None:
    """A new account; the password from a file or a prompt."""
    from commissioner.service.access.accounts import Role

    if role.upper() not in Role.__members__:
        raise UsageError(
            f"there is no role {role!r}",
            step="accounts",
            value=role,
            limit="viewer, operator or administrator",
            remedy="give one of these",
        )
    _accounts(config, runs).add(name, Role[role.upper()], read_password(password_file, "accounts", is_new=True))
    _said({"account": name, "role": role.lower()}, f"{name} may log in as {role.lower()}", as_json)


def list_accounts(*, config: Path | None, runs: Path, as_json: bool) -> None:
    """Names and roles."""
    from commissioner.cli.screens import screen

    known = [AccountRow(account=a.name, role=a.role.name.lower()) for a in _accounts(config, runs).all()]
    if as_json:
        screen.emit(KnownAccounts(accounts=known))
    elif known:
        screen.out.print(screen.table("", ("account", "role"), [(a["account"], a["role"]) for a in known]))
    else:
        screen.out.print("no accounts: whoever sits at this computer acts as operator, no other host is served")


def remove(name: str, *, config: Path | None, runs: Path, as_json: bool) -> None:
    """No longer an account."""
    _accounts(config, runs).remove(name)
    _said({"removed": name}, f"{name} is removed", as_json)


def _accounts(config: Path | None, runs: Path) -> Accounts:
    require_extra()
    from commissioner.service.access.accounts import Accounts
    from commissioner.service.configuration import load_settings

    settings = load_settings(config, host="127.0.0.1", port=0, runs=runs)
    return Accounts(settings.data / "accounts.json")


def require_extra() -> None:
    """UsageError where the packages of the extra `serve` are not installed."""
    try:
        import argon2  # noqa: F401
        import fastapi  # noqa: F401
        import uvicorn  # noqa: F401
    except ImportError as missing:
        raise UsageError(
            "the service is not installed",
            step="serve",
            value=str(missing.name),
            limit="the extra `serve`",
            remedy='pip install ".[serve]" in the folder of this program',
        ) from missing


def _said(document: dict[str, str], words: str, as_json: bool) -> None:
    from commissioner.cli.screens import screen

    if as_json:
        screen.emit(document)
    else:
        screen.out.print(words, markup=False)
