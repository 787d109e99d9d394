"""Files that are written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from commissioner.errors import UsageError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary name to write to: renamed to `path` at the end, gone after any failure (a full disk, Ctrl-C)."""
    temporary = path.with_name(path.name + ".part")
    try:
        yield temporary
        temporary.replace(path)
    except BaseException as error:
        if isinstance(error, OSError) and error.errno and str(error.filename or temporary) == str(temporary):
            error.filename, error.strerror = str(path), os.strerror(error.errno)  # the name that the person gave
        temporary.unlink(missing_ok=True)
        raise


def folder_to_write(path: Path) -> Path:
    """The folder, made if need be. UsageError where it cannot be: said before hours of work, not after."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        trial = path / ".writable"
        trial.touch()
        trial.unlink()
    except OSError as error:
        raise UsageError(
            f"{path} is no folder that can be written to",
            step="write results",
            value=error.strerror or str(error),
            limit="a writable folder",
            remedy="choose another --out",
        ) from error
    return path


def write_text(path: Path, text: str) -> None:
    """The text in UTF-8, whole."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_texts(folder: Path, texts: Mapping[str, str]) -> None:
    """Each text under its name, whole."""
    for name, text in texts.items():
        write_text(folder / name, text)
