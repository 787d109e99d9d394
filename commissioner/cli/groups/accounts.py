"""The command group `accounts`: who may use the service."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from commissioner.cli.help import Verbs
from commissioner.cli.options import Json, Runs
from commissioner.paths import RUNS

accounts_app = typer.Typer(cls=Verbs, no_args_is_help=True, help="The service's accounts: add, list, remove.")


@accounts_app.command("add")
def accounts_add(
    name: Annotated[str, typer.Argument(help="Name to log in with.")],
    role: Annotated[str, typer.Option(help="viewer | operator | administrator")] = "operator",
    password_file: Annotated[
        Path | None, typer.Option(help="Read the password from this file; asked for if not given.")
    ] = None,
    config: Annotated[Path | None, typer.Option("--config", help="The service's TOML file.")] = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """A new account. The password comes from a prompt or a file, never from the command line."""
    from commissioner.cli.verbs.serve import add

    add(name, role=role, password_file=password_file, config=config, runs=runs, as_json=json)


@accounts_app.command("list")
def accounts_list(
    config: Annotated[Path | None, typer.Option("--config", help="The service's TOML file.")] = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Names and roles."""
    from commissioner.cli.verbs.serve import list_accounts

    list_accounts(config=config, runs=runs, as_json=json)


@accounts_app.command("remove")
def accounts_remove(
    name: Annotated[str, typer.Argument(help="Name of the account.")],
    config: Annotated[Path | None, typer.Option("--config", help="The service's TOML file.")] = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Remove an account; its sessions end at once."""
    from commissioner.cli.verbs.serve import remove

    remove(name, config=config, runs=runs, as_json=json)
