"""The manual, shipped with the package: a chapter is a Markdown file beside this one, read without network and versioned with the code."""

from __future__ import annotations

from importlib.resources import files

ENDING = ".md"
SCHEMAS, SCHEMA_ENDING = "schemas", ".schema.json"
"""Folder of the JSON schemas; `commissioner.schemas` makes them."""


def chapter_names() -> tuple[str, ...]:
    """Names of the chapters there are, in alphabetical order."""
    return tuple(
        sorted(entry.name.removesuffix(ENDING) for entry in files(__name__).iterdir() if entry.name.endswith(ENDING))
    )


def read_chapter(name: str) -> str:
    """The chapter's Markdown. Raises KeyError where there is no chapter of that name."""
    if name not in chapter_names():
        raise KeyError(name)
    return (files(__name__) / f"{name}{ENDING}").read_text(encoding="utf-8")


def chapter_title(name: str) -> str:
    """The chapter's first heading, without its mark. Raises KeyError where there is no chapter of that name."""
    return read_chapter(name).partition("\n")[0].removeprefix("#").strip()


def schema_names() -> tuple[str, ...]:
    """Names of the documents that have a schema, in alphabetical order."""
    found = (entry.name for entry in (files(__name__) / SCHEMAS).iterdir())
    return tuple(sorted(name.removesuffix(SCHEMA_ENDING) for name in found if name.endswith(SCHEMA_ENDING)))


def read_schema(name: str) -> str:
    """The JSON schema of a document, as text. Raises KeyError where there is none of that name."""
    if name not in schema_names():
        raise KeyError(name)
    return (files(__name__) / SCHEMAS / f"{name}{SCHEMA_ENDING}").read_text(encoding="utf-8")
