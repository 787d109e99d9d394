"""Options that several verbs share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Json = Annotated[bool, typer.Option("--json", help="One JSON document on stdout, nothing else there.")]
Diagnosed = Annotated[
    bool, typer.Option("--diagnosis/--no-diagnosis", help="Diagnose the run's own samples afterwards.")
]
Waits = Annotated[
    bool, typer.Option("--wait", help="End only when the diagnosis is ready; otherwise it joins the archive later.")
]
Runs = Annotated[Path, typer.Option("--runs", envvar="COMMISSIONER_RUNS", help="Folder of the run archive.")]
Trust = Annotated[
    str | None,
    typer.Option(
        "--trust",
        help="plate | data: which is right where the two contradict each other; of a manufacturer's sheet the word that its refusal names.",
    ),
]
Motor = Annotated[str, typer.Option("--motor", help="Nameplate: a name in config/motors or a .toml file.")]
Drive = Annotated[
    str,
    typer.Option(
        "--drive",
        help="tcp://HOST:PORT?device=1, tls://HOST:802?..., rtu:///dev/ttyUSB0?baud=115200 or rtu://COM3?parity=E&device=1",
    ),
]
Profile = Annotated[str, typer.Option("--profile", help="Drive file: a name in config/drives or a .toml file.")]
Axes = Annotated[str | None, typer.Option(help="Axis orientations in multiples of 30 electrical degrees, as 0,60,120.")]
Procedure = Annotated[
    Path | None, typer.Option("--procedure", help="Procedure file; config/procedure.toml if not given.")
]
Strict = Annotated[
    bool,
    typer.Option(
        "--strict", help="Reject also where axes differ by a named cause, samples were lost or the flux guard acted."
    ),
]
Seal = Annotated[
    Path | None,
    typer.Option(
        "--seal",
        envvar="COMMISSIONER_SEAL",
        help="Key file: what is archived is sealed with it, and proved by `verify`.",
    ),
]
Salvage = Annotated[
    bool, typer.Option("--salvage", help="Go on with what is whole of a damaged run; the loss is still named.")
]
Database = Annotated[
    str | None,
    typer.Option(
        "--archive",
        envvar="COMMISSIONER_ARCHIVE",
        help="Index that several computers share: postgresql+psycopg://USER@HOST/DATABASE; the password from ~/.pgpass.",
    ),
]
WhichMotor = Annotated[str, typer.Option("--motor", help="Part of the motor's tag, serial number or plate.")]
WhichDrive = Annotated[str, typer.Option("--drive", help="Part of the drive's type and number.")]
WhichSerial = Annotated[str, typer.Option("--serial", help="Serial number of the drive or the motor.")]
WhichPerson = Annotated[str, typer.Option("--person", help="Part of the name of who asked for the run.")]
WhichOutcome = Annotated[str, typer.Option("--outcome", help="commissioned, rejected, aborted, faulted, cut off ...")]
Since = Annotated[str, typer.Option("--since", help="UTC date, as 2026-11-25 or the start of one.")]
Until = Annotated[str, typer.Option("--until", help="UTC date, included.")]
Limit = Annotated[int | None, typer.Option("--limit", min=0, help="So many of the newest; 0: all.")]
TableOut = Annotated[
    Path | None, typer.Option("--out", help="Write them as a table instead: .csv or .parquet, a row a run.")
]
Run = Annotated[str, typer.Argument(help="Run id, or the start of one; `last` for the newest.")]
Map = Annotated[
    Path | None, typer.Option("--map", help='TOML file that says what channels are: [columns] "CH1" = "current_u_a".')
]
