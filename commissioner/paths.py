"""Where runs are kept and which motor is meant unless it is told, and what is said of a path that leads to no file."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from commissioner.errors import UsageError
from commissioner.text import did_you_mean

RUNS = Path("runs")
"""The archive, in the folder that the command line is in."""
MOTOR = "motor_2kw2"
"""The one that comes along, at the drive that comes along."""


def no_file(path: Path, step: str, limit: str = "an existing file") -> UsageError:
    """What is raised where `path` is no file that can be read: a folder, a pipe, nothing at all."""
    if path.exists():
        what = "a folder" if path.is_dir() else "no regular file"
        return UsageError(
            f"{path} is {what}", step=step, value=what, limit=limit, remedy="give the path of one file",
        )  # fmt: skip
    return UsageError(f"there is no file {path}", step=step, value=str(path), limit=limit, remedy="check the path")


def no_such_name(what: str, name: str, known: Collection[str]) -> UsageError:
    """What is raised where `name` is neither the name of a `what` (motor, drive) that comes along nor a TOML file."""
    is_there = Path(name).exists()
    kind = "a folder" if Path(name).is_dir() else "a file of another kind"
    return UsageError(
        f"{name} is {kind}" if is_there else f"there is no {what} named {name!r}" + did_you_mean(name, known),
        step="read configuration", value=name, limit="a .toml file, or one of: " + ", ".join(sorted(known)),
        remedy="give one of these names or the path of a .toml file",
    )  # fmt: skip
