"""The command group `recordings`: what a file is understood as, and the same in the contract's form."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from commissioner.cli.help import Verbs
from commissioner.cli.options import Json, Map

recordings_app = typer.Typer(
    cls=Verbs, no_args_is_help=True, help="Recordings from other instruments: see what is understood, convert."
)
MOST_STATES = 12


@recordings_app.callback()
def _group() -> None:
    """Recordings from other instruments: see what is understood, convert."""


@recordings_app.command("import")
def recordings_import(
    file: Annotated[Path, typer.Argument(help="A recording of any kind that is read.")],
    mapping: Map = None,
    out: Annotated[Path | None, typer.Option("--out", help="Recording to write: .csv, .csv.gz or .parquet.")] = None,
    json: Json = False,
) -> None:
    """Show what is understood of a file: columns, units, rate, phase order; with --out write the contract's form."""
    from commissioner.cli.screens import screen
    from commissioner.recordings.imported import store, understand
    from commissioner.recordings.reading.mapping import read_mapping
    from commissioner.recordings.table import check_ending

    if out is not None:
        check_ending(out)
    table, document = understand(file, read_mapping(mapping) if mapping else None)
    if out is not None:
        document["files"] = store(table, document, out)
    if json:
        screen.emit(document)
        return
    rows = [
        (
            screen.text(c["name"]),
            c["meaning"] or "not used",
            screen.text(c["unit"]),
            f"{c['factor']:g}",
            c.get("range", ""),
        )
        for c in document["columns"]
    ]
    screen.out.print(screen.table(document["kind"], ("column", "taken as", "unit", "factor to SI", "range"), rows))
    if document["sample_period_s"]:
        screen.out.print(f"{document['rows']} rows, {document['sample_period_s']:.6g} s apart")
    if document["states"]:
        said = ", ".join(
            f"{s['state']} {s['start_s']:.3g} ... {s['end_s']:.3g} s" for s in document["states"][:MOST_STATES]
        )
        more = f" and {len(document['states']) - MOST_STATES} more" if len(document["states"]) > MOST_STATES else ""
        screen.out.print(f"state: {said}{more}")
    for kind, order in document["phase_order"].items():
        screen.out.print(f"{kind}s follow each other as {order}")
    for change in document["changes"]:
        screen.out.print(f"- {screen.text(change.what)}")
    for name, path in document.get("files", {}).items():
        screen.out.print(f"{name} {screen.text(path)}")
