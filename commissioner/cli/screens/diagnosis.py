"""A diagnosis on the terminal: the page's words, shorter."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.markup import escape

from commissioner.cli.screens.screen import out as screen
from commissioner.cli.screens.screen import signs, stacked, table
from commissioner.diagnose.causes import CATALOGUE
from commissioner.report.diagnosis.names import (
    class_name,
    is_together,
    main_quantity,
    members,
    said,
    sure_words,
)
from commissioner.report.diagnosis.numbers import PLUS_MINUS, limit_words, number, part_word, sure
from commissioner.report.diagnosis.words import (
    actions,
    headline,
    meaning,
    next_promise,
    ordered,
    remarks,
    tone,
)
from commissioner.report.sheet.words import cause_name

COLOURS = {"good": "green", "warn": "yellow", "bad": "red"}
COMMON = tuple(sorted(name for name, cause in CATALOGUE.items() if cause.is_common))
MOST_LIMITS = 6


def show(document: Mapping[str, Any], out: Path | None) -> None:
    """Headline, meaning, causes, uncertain names, what to do, what next; of several tables one after the other."""
    for name, one in document.get("tables", {}).items():
        screen.print(f"[bold]{escape(name)}[/]")
        _one(one, is_on_page=out is not None)
    if "tables" not in document:
        _one(document, is_on_page=out is not None)
    if out is not None:
        screen.print(
            f"[dim]report[/] {escape(str(out if 'tables' in document else out / 'report.html'))}", soft_wrap=True
        )


def _one(document: Mapping[str, Any], *, is_on_page: bool) -> None:
    screen.print(f"[bold {COLOURS.get(tone(document), 'red')}]{escape(headline(document))}[/]")
    for sentence in meaning(document):
        screen.print(escape(sentence))
    if document["causes"]:
        _causes(document)
    else:
        _error(document)
    _uncertain(document)
    if document["kind"] == "points":
        _parameters(document)
    if document["verdict"] == "nothing_significant" and (limits := _limits(document)):
        screen.print(f"[dim]would have been seen: {escape(limits)}[/]")
    for who, what in actions(document):
        screen.print(f"[bold]{who}[/]  {escape(what)}")
    if not (is_on_page and _is_only_together(document)):
        _next(document)
    for sentence in (*remarks(document), *document.get("audit", ())):
        screen.print(f"[dim]{escape(signs(said(sentence)))}[/]")


def _is_only_together(document: Mapping[str, Any]) -> bool:
    """The next test would only part what every inverter has anyway; its steps are on the page."""
    plan = document["next_experiment"]
    return bool(plan) and is_together(plan["splits"])


def _error(document: Mapping[str, Any]) -> None:
    gain = document["gain"]
    if gain["rmse_before_a"] is not None:
        noise = f", noise {number(gain['noise_floor_a'] * 1e3)} mA" if gain["noise_floor_a"] else ""
        screen.print(f"error of the plain simulation {number(gain['rmse_before_a'] * 1e3)} mA rms{noise}")


def _parameters(document: Mapping[str, Any]) -> None:
    """R and L of test points, per phase of the star equivalent."""
    rows = [
        (name, f"{q['value']:.5g}", "not known" if q["std"] is None else f"± {2.0 * q['std']:.2g}")
        for name, q in document["parameters_after"].items()
    ]
    if rows:
        screen.print(table("per star phase", ("parameter", "value", "±"), rows))
        screen.print(f"[dim]{PLUS_MINUS}[/]")


def _causes(document: Mapping[str, Any]) -> None:
    found = ordered(document)
    largest = max(c["gain_share"] for c in found)
    rows = []
    for cause in found:
        is_fit = cause.get("found_by") != "audit"
        rows.append(
            (
                stacked(class_name(cause)),
                main_quantity(cause),
                part_word(cause["gain_share"], largest) if is_fit else "-",
                sure(cause["confidence"]),
            )
        )
    screen.print(table("", ("cause", "size", "part of the error", "sure of the name"), rows))
    for cause in found:
        if cause["equivalent"]:
            screen.print(f"[dim]{escape(class_name(cause))}: {escape(sure_words(cause))}.[/]")
    if any("±" in row[1] for row in rows):
        screen.print(f"[dim]{PLUS_MINUS}[/]")


def _uncertain(document: Mapping[str, Any]) -> None:
    some = document.get("uncertain", ())
    seen, hidden = ([u for u in some if u["is_seen"] is one] for one in (True, False))
    if seen:
        screen.print("[bold]seen, but the name is uncertain[/]")
    for one in seen:
        screen.print(f"  {cause_name(one['name'])}: {escape(one['decides'])}")
    if hidden:
        screen.print(
            f"[dim]not seen, but could hide behind a named cause: {', '.join(cause_name(u['name']) for u in hidden)}[/]"
        )


def _next(document: Mapping[str, Any]) -> None:
    plan = document["next_experiment"]
    if not plan:
        return
    for k, step in enumerate(plan.get("steps", ()), 1):
        screen.print(f"  {k}. {escape(step)}")
    if plan.get("command"):
        screen.print(f"  {escape(plan['command'])}", soft_wrap=True)
    screen.print(f"  {escape(next_promise(plan))}")


def _limits(document: Mapping[str, Any]) -> str:
    """The smallest detectable sizes of the commonest causes that were not found and are not in doubt."""
    known = document.get("detection_limits", {})
    apart = {u["name"] for u in document.get("uncertain", ())} | {n for c in document["causes"] for n in members(c)}
    names = [n for n in dict.fromkeys((*COMMON, *known)) if n in known and n not in apart]
    return ", ".join(f"{cause_name(n)} from {limit_words(document, n)}" for n in names[:MOST_LIMITS])
