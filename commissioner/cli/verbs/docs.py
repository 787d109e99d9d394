"""`commissioner docs`: the chapters of the manual, as they were shipped with this version."""

from __future__ import annotations

from commissioner.cli.screens import screen
from commissioner.docs import chapter_names, chapter_title, read_chapter
from commissioner.errors import UsageError


def docs(name: str | None, *, as_json: bool) -> None:
    """List the chapters, or show one: set for a terminal, plain Markdown into a pipe. UsageError where there is no such chapter."""
    if name is None:
        _list(as_json=as_json)
        return
    _show(name, _text(name), as_json=as_json)


def _list(*, as_json: bool) -> None:
    chapters = {name: chapter_title(name) for name in chapter_names()}
    if as_json:
        screen.emit({"chapters": [{"name": name, "title": title} for name, title in chapters.items()]})
        return
    screen.out.print(screen.table("", ("chapter", "about"), chapters.items()))
    screen.out.print("[dim]`commissioner docs NAME` shows one[/]")


def _text(name: str) -> str:
    try:
        return read_chapter(name)
    except KeyError:
        raise UsageError(
            f"there is no chapter {name!r}", step="docs", value=name, limit="one of: " + ", ".join(chapter_names()),
            remedy="`commissioner docs` lists the chapters",
        ) from None  # fmt: skip


def _show(name: str, text: str, *, as_json: bool) -> None:
    if as_json:
        screen.emit({"name": name, "text": text})
    elif screen.out.is_terminal:
        from rich.markdown import Markdown

        screen.out.print(Markdown(text))
    else:
        screen.out.print(text, markup=False, soft_wrap=True, end="")
