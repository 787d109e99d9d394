"""Accounts: name, role, and the argon2 hash of a password. The file is read again whenever it has changed."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from pathlib import Path

from argon2 import PasswordHasher
from argon2.exceptions import Argon2Error, InvalidHashError

from commissioner.encoding import read_json
from commissioner.errors import UsageError

SHORTEST, LONGEST = 8, 200
"""Characters of a password."""


class Role(IntEnum):
    """What one may do; each may what the ones before it may."""

    VIEWER = 1
    OPERATOR = 2
    ADMINISTRATOR = 3


@dataclass(frozen=True)
class Account:
    name: str
    role: Role
    password_hash: str


class Accounts:
    """The accounts of one service, in one JSON file that only its user may read."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._hasher = PasswordHasher()
        self._read_at: float | None = None
        self._known: dict[str, Account] = {}

    @cached_property
    def _nobody(self) -> str:
        """Made at the first log-in: it takes a fifth of a second, as it should."""
        return self._hasher.hash("nobody has this password")

    def all(self) -> list[Account]:
        """By name."""
        self._refresh()
        return sorted(self._known.values(), key=lambda account: account.name)

    def find(self, name: str) -> Account | None:
        self._refresh()
        return self._known.get(name)

    def add(self, name: str, role: Role, password: str) -> None:
        """A new account. UsageError: it exists, or name or password cannot be taken."""
        _check(name, password)
        if self.find(name) is not None:
            raise _refused("there is an account of this name", name, "a new name", "remove it first")
        self._known[name] = Account(name, role, self._hasher.hash(password))
        self._save()

    def is_last_administrator(self, name: str) -> bool:
        return [account.name for account in self.all() if account.role is Role.ADMINISTRATOR] == [name]

    def remove(self, name: str) -> None:
        """UsageError: there is none of this name."""
        if self.find(name) is None:
            known = ", ".join(account.name for account in self.all()) or "none"
            raise _refused("there is no account of this name", name, known, "give one of these names")
        del self._known[name]
        self._save()

    def verify(self, name: str, password: str) -> Account | None:
        """The account where the password is right. A name that is not known takes as long to refuse."""
        account, nobody = self.find(name), self._nobody
        try:
            self._hasher.verify(account.password_hash if account else nobody, password[:LONGEST])
        except (Argon2Error, InvalidHashError):
            return None
        return account

    def _refresh(self) -> None:
        changed = self._path.stat().st_mtime_ns if self._path.is_file() else None
        if changed == self._read_at and (self._known or changed is None):
            return
        self._known = _read(self._path) if changed is not None else {}
        self._read_at = changed

    def _save(self) -> None:
        self._path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        rows = [
            {"name": a.name, "role": a.role.name.lower(), "password": a.password_hash} for a in self._known.values()
        ]
        part = self._path.with_name(self._path.name + ".part")
        with open(part, "w", encoding="utf-8", opener=lambda path, flags: os.open(path, flags, 0o600)) as file:
            json.dump({"accounts": rows}, file, indent=1)
            file.flush()
            os.fsync(file.fileno())
        part.replace(self._path)
        self._read_at = self._path.stat().st_mtime_ns


def _read(path: Path) -> dict[str, Account]:
    try:
        rows = read_json(path.read_text("utf-8"))["accounts"]
        return {row["name"]: Account(row["name"], Role[row["role"].upper()], row["password"]) for row in rows}
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise UsageError(
            f"{path} holds no accounts", step="read accounts", value=type(error).__name__,
            limit="the file as `commissioner accounts` writes it", remedy="restore it from a copy, or remove it and add the accounts again",
        ) from error  # fmt: skip


def _check(name: str, password: str) -> None:
    if not (1 <= len(name) <= 40 and name.isprintable() and name == name.strip()):
        raise _refused("not a name of an account", name[:60], "1 to 40 printable characters", "choose another name")
    if not SHORTEST <= len(password) <= LONGEST:
        limit = f"{SHORTEST} to {LONGEST} characters"
        raise _refused("the password cannot be taken", f"{len(password)} characters", limit, "choose another one")


def _refused(what: str, value: str, limit: str, remedy: str) -> UsageError:
    return UsageError(what, step="accounts", value=value, limit=limit, remedy=remedy)
