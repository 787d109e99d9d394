"""A password from a file or a prompt, never from the command line."""

from __future__ import annotations

import getpass
import sys
from pathlib import Path

from commissioner.errors import UsageError


def read_password(file: Path | None, step: str, *, is_new: bool) -> str:
    """The first line of `file`, or what a person types; a new one twice. UsageError: nobody can be asked."""
    if file is not None:
        return file.read_text("utf-8").splitlines()[0] if file.stat().st_size else ""
    if not sys.stdin.isatty():
        raise UsageError(
            "nobody can be asked for a password",
            step=step,
            value="no terminal",
            limit="a terminal, or --password-file",
            remedy="write the password into a file that only you may read and give it with --password-file",
        )
    first = getpass.getpass("Password: ")
    if is_new and first != getpass.getpass("Again: "):
        raise UsageError("the two passwords differ", step=step, value=None, limit="twice the same", remedy="try again")
    return first
