"""A running diagnosis on the terminal: the page's words, shorter."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.markup import escape

from commissioner.cli.screens.screen import out as screen
from commissioner.cli.screens.screen import signs, stacked, table
from commissioner.report.running.words import actions, class_name, headline, meaning, number, quantity, spoken, tone

COLOURS = {"good": "green", "warn": "yellow", "bad": "red"}
MOST_LIMITS = 6


def show(document: Mapping[str, Any], out: Path | None) -> None:
    """Headline, causes with sizes, what to do, what next, what would have been seen."""
    screen.print(f"[bold {COLOURS[tone(document)]}]{escape(headline(document))}[/]")
    for sentence in meaning(document):
        screen.print(escape(sentence))
    gain = document["gain"]
    if document["causes"]:
        rows = [
            (stacked(class_name(c)), quantity(next(iter(c["parameters"].values()))), f"{100 * c['gain_share']:.1f} %", f"{100 * c['confidence']:.0f} %")
            for c in document["causes"]
        ]  # fmt: skip
        screen.print(table("", ("cause", "size", "part of what they explain", "sure of the name"), rows))
    if gain["rmse_before_a"] is not None:
        after = f" to {number(1e3 * gain['rmse_after_a'])} mA" if document["causes"] else ""
        screen.print(
            f"error of the simulation, kept-aside part: {number(1e3 * gain['rmse_before_a'])} mA rms{after}; "
            f"noise {number(1e3 * gain['noise_floor_a'])} mA"
        )
    for who, what in actions(document):
        screen.print(f"[bold]{who}[/]  {escape(what)}")
    plan = document["next_experiment"]
    for k, step in enumerate(plan["steps"] if plan else (), 1):
        screen.print(f"  {k}. {escape(step)}")
    if document["verdict"] == "nothing_significant":
        limits = [f"{spoken(n)} from {quantity({**v, 'std': None})}" for n, v in document["detection_limits"].items()]
        screen.print(f"[dim]would have been seen: {', '.join(limits[:MOST_LIMITS])}[/]")
    for remark in document["remarks"]:
        screen.print(f"[dim]{escape(signs(remark))}[/]")
    if out is not None:
        screen.print(f"[dim]report[/] {escape(str(out / 'report.html'))}", soft_wrap=True)
