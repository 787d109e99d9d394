"""The command group `runs`: the archive."""

from __future__ import annotations

from inspect import Signature, signature
from pathlib import Path
from typing import Annotated, Any

import typer

from commissioner.cli.help import Verbs
from commissioner.cli.options import (
    Database,
    Json,
    Limit,
    Run,
    Runs,
    Salvage,
    Seal,
    Since,
    TableOut,
    Until,
    WhichDrive,
    WhichMotor,
    WhichOutcome,
    WhichPerson,
    WhichSerial,
)
from commissioner.paths import RUNS

runs_app = typer.Typer(
    cls=Verbs,
    no_args_is_help=True,
    help="The archive of runs: list, find, show, compare, motors, trend, report, export.",
)


def runs_find(
    text: Annotated[
        list[str], typer.Argument(help="Words, each anywhere in run, motor, drive, person, outcome or reason.")
    ],
    motor: WhichMotor = "",
    drive: WhichDrive = "",
    serial: WhichSerial = "",
    person: WhichPerson = "",
    outcome: WhichOutcome = "",
    since: Since = "",
    until: Until = "",
    limit: Limit = None,
    out: TableOut = None,
    archive: Database = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """The runs that hold all of these words."""
    from commissioner.cli.verbs.archived.runs import find
    from commissioner.operations.history.runs import Archive, Wanted

    wanted = Wanted(motor, drive, serial, person, outcome, since, until, " ".join(text))
    find(Archive(runs, archive), wanted, limit, out, as_json=json)


def runs_list(**options: Any) -> None:
    """Every run in the archive, newest first, also those that were cut off."""
    runs_find([], **options)


_words, *_options = signature(runs_find, eval_str=True).parameters.values()
vars(runs_list)["__signature__"] = Signature(_options)
runs_app.command("list")(runs_list)
runs_app.command("find")(runs_find)


@runs_app.command("index")
def runs_index(
    rebuild: Annotated[
        bool, typer.Option("--rebuild", help="From the folders alone, whatever the index held.")
    ] = False,
    archive: Database = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """The archive's index in step with the folders, which are the truth: it can be deleted at any time."""
    from commissioner.cli.verbs.archived.runs import index

    index(runs, rebuild=rebuild, database=archive, as_json=json)


@runs_app.command("show")
def runs_show(
    run: Run = "last",
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """One run: outcome, reason, parameters, what was written, where the report is."""
    from commissioner.cli.verbs.archived.runs import show_run

    show_run(runs, run, as_json=json)


@runs_app.command("report")
def runs_report(run: Run = "last", runs: Runs = RUNS, json: Json = False) -> None:
    """Where the HTML report of a run is; made again from its archive where it is missing."""
    from commissioner.cli.verbs.archived.runs import report_run

    report_run(runs, run, as_json=json)


@runs_app.command("export")
def runs_export(
    run: Run,
    out: Annotated[
        Path,
        typer.Argument(
            help="Target. Samples: .csv, .csv.gz, .parquet, .mat. Parameters: .csv, .json, .py (motulator), .mat (matlab), .mo (modelica)."
        ),
    ],
    form: Annotated[str, typer.Option("--form", help="samples, csv, json, motulator, matlab or modelica.")] = "samples",
    salvage: Salvage = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """The samples of a run as one recording, or its parameters in the form of another program (--form)."""
    from commissioner.cli.verbs.archived.runs import export_run

    export_run(runs, run, out, form, as_json=json, salvage=salvage)


@runs_app.command("compare")
def runs_compare(
    before: Run,
    after: Run = "last",
    recording: Annotated[
        list[Path] | None, typer.Option("--recording", help="Instead of a second run: a recording; repeatable.")
    ] = None,
    motor: Annotated[str | None, typer.Option("--motor", help="Nameplate of the recordings.")] = None,
    held: Annotated[
        bool, typer.Option("--held", help="Instead of a second run: what the run's drive holds now.")
    ] = False,
    drive: Annotated[
        str | None, typer.Option("--drive", help="Drive URL for --held; the run's own if not given.")
    ] = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Two runs, or a run and recordings, or a run and its drive: which parameter moved, how surely, what explains it."""
    from commissioner.cli.verbs.archived.comparing import compare_drive, compare_runs

    if held:
        compare_drive(runs, before, drive, as_json=json)
    else:
        compare_runs(runs, before, after, as_json=json, recordings=tuple(recording or ()), motor=motor)


@runs_app.command("motors")
def runs_motors(
    run: Annotated[
        str | None, typer.Argument(help="Run id: on which of the known motors can it have been made?")
    ] = None,
    tag: Annotated[str, typer.Option("--tag", help="The run was made on the motor with this tag.")] = "",
    motor_serial: Annotated[str, typer.Option("--motor-serial", help="The motor's serial number.")] = "",
    confirm: Annotated[
        bool, typer.Option("--confirm", help="It is the same motor, though its parameters say another.")
    ] = False,
    archive: Database = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """The motors of the archive; which of them a run was made on, by its parameters; or saying so."""
    from commissioner.cli.verbs.archived.motors import motors
    from commissioner.operations.history.runs import Archive

    motors(Archive(runs, archive), run, tag=tag, serial=motor_serial, confirm=confirm, as_json=json)


@runs_app.command("trend")
def runs_trend(
    motor: Annotated[str | None, typer.Argument(help="The motor's tag, serial number or file name.")] = None,
    baseline: Annotated[
        Path | None, typer.Option("--baseline", help="Indicators of this baseline of `monitor`.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Picture to draw: .svg or .png.")] = None,
    archive: Database = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """A motor over the years at one flux and temperature: intervals, drift, steps, alarms at a stated false-alarm rate."""
    from commissioner.cli.verbs.archived.motors import show_trend
    from commissioner.operations.history.runs import Archive

    show_trend(Archive(runs, archive), motor, baseline, out, as_json=json)


@runs_app.command("push")
def runs_push(
    target: Annotated[
        str,
        typer.Argument(help="Folder of another archive, also on a mounted share; or http(s)://HOST:PORT of a service."),
    ],
    run: Annotated[list[str] | None, typer.Argument(help="Runs; all if not given.")] = None,
    account: Annotated[str, typer.Option(help="Name of an account of the service, an operator's.")] = "",
    password_file: Annotated[
        Path | None, typer.Option(help="Read its password from this file; asked for if not given.")
    ] = None,
    ca: Annotated[Path | None, typer.Option(help="PEM file of who vouches for the service's certificate.")] = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Run folders to another archive, proved by their chain; goes on where it broke off."""
    from commissioner.cli.verbs.archived.moving import push

    push(runs, target, run or (), account=account, password_file=password_file, ca=ca, as_json=json)


@runs_app.command("pull")
def runs_pull(
    source: Annotated[str, typer.Argument(help="Folder of another archive, also on a mounted share.")],
    run: Annotated[list[str] | None, typer.Argument(help="Runs; all if not given.")] = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Run folders from another archive, proved by their chain; goes on where it broke off."""
    from commissioner.cli.verbs.archived.moving import pull

    pull(runs, source, run or (), as_json=json)


@runs_app.command("diagnose")
def runs_diagnose(
    run: Run = "last",
    seconds: Annotated[
        float | None, typer.Option(min=0.0, help="Given up, unfinished, after so long; 600 if not given.")
    ] = None,
    seal: Seal = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """What a plain simulation gets wrong about a run's own samples: into its result and report. `run` begins this by itself."""
    from commissioner.cli.verbs.archived.deciding import diagnose_run

    diagnose_run(runs, run, seconds, seal=seal, as_json=json)


@runs_app.command("verify")
def runs_verify(
    run: Annotated[str | None, typer.Argument(help="Run id, or the start of one; `last` for the newest.")] = None,
    everything: Annotated[bool, typer.Option("--all", help="Every run in the archive.")] = False,
    seal: Seal = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Files and hash chain: exit 0 intact (a run that was killed is cut off, not damaged), 3 something lost or changed."""
    from commissioner.cli.verbs.archived.verify import verify_runs

    verify_runs(runs, run, everything=everything, seal=seal, as_json=json)
