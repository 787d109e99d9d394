"""How help looks: plain text that any console shows, the verbs by what they are for."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import TYPE_CHECKING

import typer
from typer.core import TyperGroup

if TYPE_CHECKING:
    from typer._click import Context, HelpFormatter

PURPOSES = {
    "Commission": ("demo", "check", "run", "tune", "write-back", "restore"),
    "Recordings": ("identify", "diagnose", "monitor", "recordings"),
    "Simulate": ("simulate", "study"),
    "Archive": ("runs", "replay"),
    "Drives and service": ("drives", "ports", "serve", "accounts", "docs"),
}


class Verbs(TyperGroup):
    """Every verb with its whole first sentence, under its purpose."""

    def format_commands(self, ctx: Context, formatter: HelpFormatter) -> None:
        """The verbs' table; those of no purpose last, as all are in a verb of verbs."""
        purposes = {} if ctx.parent else PURPOSES
        named = {name for names in purposes.values() for name in names}
        others = [name for name in self.list_commands(ctx) if name not in named]
        for purpose, names in {**purposes, "Commands": others}.items():
            found = [(name, self.commands[name].help or "") for name in names if name in self.commands]
            if found:
                with formatter.section(purpose):
                    formatter.write_dl(found)


def only(app: typer.Typer, arguments: Sequence[str]) -> typer.Typer:
    """The app with just the verb that is called for: reading the signatures of all takes 60 ms. All where none is named first."""
    verb = arguments[0] if arguments else ""
    commands = [one for one in app.registered_commands if verb in (one.name, getattr(one.callback, "__name__", None))]
    groups = [one for one in app.registered_groups if one.name == verb]
    if not commands and not groups:
        return app
    lean = copy.copy(app)
    lean.registered_commands, lean.registered_groups = commands, groups
    return lean
