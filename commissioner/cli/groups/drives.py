"""The command group `drives`: drive files, and the conformance kit for firmware that implements the commissioning map."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from commissioner.cli.help import Verbs
from commissioner.cli.options import Json

drives_app = typer.Typer(
    cls=Verbs,
    no_args_is_help=True,
    help="Drive files: list, show, validate, new; conformance of firmware to the commissioning map.",
)


@drives_app.command("list")
def drives_list(json: Json = False) -> None:
    """Every drive file that comes along, its kind, and what works with it."""
    from commissioner.cli.verbs.drives.files import list_drives

    list_drives(as_json=json)


@drives_app.command("show")
def drives_show(
    name: Annotated[str, typer.Argument(help="A name in config/drives, or a .toml file.")], json: Json = False
) -> None:
    """What a drive file says and which verbs work with it, before anything is connected."""
    from commissioner.cli.verbs.drives.files import show_drive

    show_drive(name, as_json=json)


@drives_app.command("validate")
def drives_validate(file: Annotated[Path, typer.Argument(help="A drive file.")], json: Json = False) -> None:
    """Whether a drive file can be used; the first mistake by file, key, value and what would be right."""
    from commissioner.cli.verbs.drives.files import validate_drive

    validate_drive(file, as_json=json)


@drives_app.command("new")
def drives_new(
    url: Annotated[str, typer.Argument(help="tcp://host:port?device=1, rtu:///dev/ttyUSB0?baud=9600&parity=E")],
    out: Annotated[Path, typer.Option("--out", help="The drive file to write.")],
    probe_writes: Annotated[
        bool, typer.Option("--probe-writes", help="Also write one register's own value back, after asking.")
    ] = False,
    json: Json = False,
) -> None:
    """Asks for registers and label values, proves them at the drive, and writes a drive file; the rest is [unknown] in it."""
    from commissioner.cli.verbs.drives.new import new_drive

    new_drive(url, out, may_write=probe_writes, as_json=json)


@drives_app.command("conformance")
def drives_conformance(
    url: Annotated[str, typer.Argument(help="tcp://host:port?device=1, tls://..., rtu:///dev/ttyUSB0?baud=115200")],
    profile: Annotated[
        str, typer.Option("--profile", help="Drive file of kind commissioning_map: a name or a .toml file.")
    ] = "simulated",
    energise: Annotated[
        bool, typer.Option("--energise", help="Try the rules that put a voltage on the motor, too.")
    ] = False,
    rule: Annotated[list[str] | None, typer.Option("--rule", help="Only this rule; repeatable.")] = None,
    reply_timeout: Annotated[float, typer.Option(help="Seconds after which an answer counts as missing.")] = 0.5,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before energising.")] = False,
    every: Annotated[
        bool, typer.Option("--all", help="Name the rules, too, that share a reason for not being tried.")
    ] = False,
    json: Json = False,
) -> None:
    """Every rule of the commissioning map against somebody's firmware: pass, fail or not tested, with the evidence.

    Parameters are changed by 1 per cent for a moment and put back; two stores are spent. 0: nothing failed, 3: some rule did.
    """
    from commissioner.cli.verbs.drives.conformance import conformance

    conformance(
        url=url,
        profile=profile,
        energise=energise,
        rules=tuple(rule or ()),
        reply_timeout_s=reply_timeout,
        yes=yes,
        names_all=every,
        as_json=json,
    )
