"""Runs pushed by other computers."""

from __future__ import annotations

from typing_extensions import TypedDict


class FileHere(TypedDict):
    """What is here of a file."""

    bytes: int
    sha256: str


class JournalHere(FileHere):
    """Of the archive's journal; `sha256` of as many bytes as were asked about."""

    is_damaged: bool


class OfferedRun(TypedDict):
    """`journal`: null where the archive has no such run; `begun`: by name, what an earlier push began."""

    run: str
    journal: JournalHere | None
    begun: dict[str, FileHere]


class KeptPiece(TypedDict):
    """`bytes`: of the file, as far as it is here now."""

    run: str
    file: str
    bytes: int
