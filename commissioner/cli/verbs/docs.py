"""`commissioner docs`: the chapters of the manual and the JSON schemas, as they were shipped with this version."""

from __future__ import annotations

import json
from collections.abc import Callable

from commissioner.cli.screens import screen
from commissioner.docs import SCHEMA_ENDING, chapter_names, chapter_title, read_chapter, read_schema, schema_names
from commissioner.errors import UsageError
from commissioner.text import did_you_mean


def docs(name: str | None, *, as_json: bool) -> None:
    """List what there is, or show a chapter (set for a terminal, plain Markdown into a pipe) or a schema. UsageError where it is not there."""
    if name is None:
        _list(as_json=as_json)
    elif name.endswith(SCHEMA_ENDING):
        _show_schema(_text(read_schema, name.removesuffix(SCHEMA_ENDING), schema_names()), as_json=as_json)
    else:
        _show(name, _text(read_chapter, name, chapter_names()), as_json=as_json)


def _list(*, as_json: bool) -> None:
    chapters = {name: chapter_title(name) for name in chapter_names()}
    schemas = [f"{name}{SCHEMA_ENDING}" for name in schema_names()]
    if as_json:
        listed = [{"name": name, "title": title} for name, title in chapters.items()]
        screen.emit({"chapters": listed, "schemas": schemas})
        return
    screen.out.print(screen.table("", ("chapter", "about"), chapters.items()))
    screen.out.print(f"[dim]`commissioner docs NAME` shows one; JSON schemas: {', '.join(schemas)}[/]")


def _text(read: Callable[[str], str], name: str, names: tuple[str, ...]) -> str:
    try:
        return read(name)
    except KeyError:
        everything = (*chapter_names(), *(f"{schema}{SCHEMA_ENDING}" for schema in schema_names()))
        raise UsageError(
            f"the manual has no {name!r}" + did_you_mean(name, everything), step="docs", value=name, limit="one of: " + ", ".join(names),
            remedy="`commissioner docs` lists the chapters and the schemas",
        ) from None  # fmt: skip


def _show_schema(text: str, *, as_json: bool) -> None:
    if as_json:
        screen.emit(json.loads(text))
    else:
        screen.out.print(text, markup=False, soft_wrap=True, end="")


def _show(name: str, text: str, *, as_json: bool) -> None:
    if as_json:
        screen.emit({"name": name, "text": text})
    elif screen.out.is_terminal:
        from rich.markdown import Markdown

        screen.out.print(Markdown(text))
    else:
        screen.out.print(text, markup=False, soft_wrap=True, end="")
