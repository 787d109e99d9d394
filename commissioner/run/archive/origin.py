"""Where a run comes from: program, machine, process, person and call, as the first record of its journal has it."""

from __future__ import annotations

import datetime as dt
import hashlib
import os
import platform
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from commissioner.link.wire.secrets import shown_call
from commissioner.text import is_sayable

PERSON = "COMMISSIONER_PERSON"
"""Environment: on whose behalf a run is made, where that is not the user of the process (the service's logged-in person)."""
_MACHINE_IDS = ("/etc/machine-id", "/var/lib/dbus/machine-id")


@dataclass(frozen=True)
class Origin:
    """`person` is who asked, `user` whose process it is; they differ where a service acts for somebody. `local_time` is
    that of the machine, with its offset to UTC."""

    version: str
    host: str
    machine: str
    process: int
    user: str
    person: str
    command: str
    python: str
    system: str
    local_time: str


def this_process() -> Origin:
    """Of the process that asks; its call without what is secret."""
    user = user_name()
    return Origin(
        version=program_version(),
        host=in_letters(platform.node()),
        machine=machine_part(),
        process=os.getpid(),
        user=user,
        person=in_letters(os.environ.get(PERSON, "").strip()) or user,
        command=shown_call([Path(sys.argv[0]).name, *sys.argv[1:]]),
        python=platform.python_version(),
        system=platform.platform(),
        local_time=dt.datetime.now().astimezone().isoformat(" ", "seconds"),
    )


def in_letters(name: str) -> str:
    """A name that the system handed over as bytes of another encoding than its own, by its letters: UTF-8, else those of Western Europe."""
    if is_sayable(name):
        return name
    said = os.fsencode(name)
    try:
        return said.decode("utf-8")
    except UnicodeDecodeError:
        return said.decode("cp1252", "replace")


def user_name() -> str:
    """The account of this process; a number where it has no name."""
    import getpass

    try:
        return in_letters(getpass.getuser())
    except (OSError, KeyError, ImportError):
        return str(getattr(os, "getuid", os.getpid)())


@cache
def program_version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("commissioner")
    except PackageNotFoundError:
        return "not installed"


@cache
def machine_part() -> str:
    """Six hexadecimal digits that tell this machine from others, so that runs of two laptops never share an id."""
    marks = [platform.node(), *(_text(Path(path)) for path in _MACHINE_IDS)]
    if not any(marks[1:]):
        import uuid

        marks.append(f"{uuid.getnode():012x}")
    return hashlib.sha256("\n".join(marks).encode()).hexdigest()[:6]


def _text(path: Path) -> str:
    try:
        return path.read_text("utf-8").strip()
    except (OSError, ValueError):
        return ""
