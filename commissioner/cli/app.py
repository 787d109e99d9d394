"""The command line: the verbs and their options. Verbs import what they need when they are called: `--help` stays fast."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from commissioner.cli.console import degrade_output
from commissioner.cli.failures import run_to_exit
from commissioner.cli.groups.accounts import accounts_app
from commissioner.cli.groups.drives import drives_app
from commissioner.cli.groups.recordings import recordings_app
from commissioner.cli.groups.runs import runs_app
from commissioner.cli.help import Verbs, only
from commissioner.cli.options import (
    Axes,
    Diagnosed,
    Drive,
    Json,
    Map,
    Motor,
    Procedure,
    Profile,
    Run,
    Runs,
    Salvage,
    Seal,
    Strict,
    Trust,
    Waits,
)
from commissioner.paths import MOTOR, RUNS

app = typer.Typer(
    name="commissioner",
    cls=Verbs,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Commission an induction motor at standstill: identify it through its drive, judge the result, write it back.",
)
app.add_typer(runs_app, name="runs")
app.add_typer(drives_app, name="drives")
app.add_typer(recordings_app, name="recordings")
app.add_typer(accounts_app, name="accounts")


def _say_version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        typer.echo(f"commissioner {version('commissioner')}")
        raise typer.Exit


@app.callback()
def every_verb(
    version: Annotated[
        bool, typer.Option("--version", callback=_say_version, is_eager=True, help="Which version this is.")
    ] = False,
) -> None:
    """Commission an induction motor at standstill: identify it through its drive, judge the result, write it back."""


@app.command()
def demo(
    json: Json = False,
    runs: Runs = RUNS,
    scenario: Annotated[
        str, typer.Option(help="Scenario of the simulated inverter: a name or a .toml file.")
    ] = "default",
    speed: Annotated[str, typer.Option(help="Pace of the simulated inverter: 1, N or max.")] = "max",
    seed: Annotated[int, typer.Option(min=0, help="Seed of the simulated noise.")] = 1,
    axes: Axes = None,
    write_back: Annotated[bool, typer.Option(help="Write the accepted parameters into the simulated drive.")] = True,
    diagnosis: Diagnosed = True,
    strict: Strict = False,
) -> None:
    """The whole job against the simulated inverter, started as its own process on loopback."""
    from commissioner.cli.verbs.demo import demo as verb

    verb(
        scenario=scenario,
        speed=speed,
        seed=seed,
        axes=axes,
        write_back=write_back,
        runs=runs,
        as_json=json,
        diagnosis=diagnosis,
        strict=strict,
    )


@app.command()
def check(
    drive: Drive,
    profile: Profile = "simulated",
    motor: Motor = MOTOR,
    procedure: Procedure = None,
    axes: Axes = None,
    json: Json = False,
) -> None:
    """Connect, identify the drive, read nameplate, interlocks and watchdog. Energises nothing, writes nothing."""
    from commissioner.cli.angles import parse_axes
    from commissioner.cli.verbs.check import check as verb
    from commissioner.operations.check import CheckRequest

    verb(CheckRequest(drive, profile, motor, procedure, parse_axes(axes)), as_json=json)


@app.command()
def run(
    drive: Drive,
    motor: Motor,
    profile: Profile = "simulated",
    axes: Axes = None,
    write_back: Annotated[bool, typer.Option("--write-back", help="Write accepted parameters into the drive.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before energising.")] = False,
    procedure: Procedure = None,
    runs: Runs = RUNS,
    diagnosis: Diagnosed = True,
    wait: Waits = False,
    seal: Seal = None,
    strict: Strict = False,
    tag: Annotated[str, typer.Option("--tag", help="Which motor this is: its tag, kept with the run.")] = "",
    motor_serial: Annotated[
        str, typer.Option("--motor-serial", help="The motor's serial number, kept with the run.")
    ] = "",
    place: Annotated[str, typer.Option("--place", help="Where this is, kept with the run.")] = "",
    cable: Annotated[
        str,
        typer.Option("--cable", help="Cable and load, as `30 m, 4 x 2.5 mm2, coupled to the pump`, kept with the run."),
    ] = "",
    dead_man: Annotated[
        bool,
        typer.Option(
            "--dead-man",
            help="Held by a service: standard input says begin, beats, says stop; its end or 2 s of silence mean zero volts.",
        ),
    ] = False,
    json: Json = False,
) -> None:
    """Commission a drive. Asks before it energises; writes only with --write-back."""
    from commissioner.cli.angles import parse_axes
    from commissioner.cli.verbs.run import run as verb
    from commissioner.operations.closing import DIAGNOSIS_S
    from commissioner.operations.commission import CommissionRequest

    request = CommissionRequest(
        drive, profile, motor, runs, procedure, parse_axes(axes), write_back, DIAGNOSIS_S if diagnosis else 0.0, wait, seal,
        strict, tag, motor_serial, place, cable,
    )  # fmt: skip
    verb(request, yes=yes, as_json=json, dead_man=dead_man)


@app.command()
def study(
    file: Annotated[
        Path, typer.Argument(help="Study file (.toml): kind, runs, motors, spread, effects, links, faults, seed.")
    ],
    out: Annotated[Path, typer.Option("--out", help="Folder for rows, table and page.")] = Path("study"),
    workers: Annotated[
        int | None, typer.Option(min=1, max=256, help="Processes of this computer; its cores if not given.")
    ] = None,
    scheduler: Annotated[str | None, typer.Option(help="A Dask scheduler instead, as tcp://HOST:8786.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Do only the cases that are missing in --out.")] = False,
    json: Json = False,
) -> None:
    """A campaign of simulated commissionings, or of recordings: a table, a summary and a page."""
    from commissioner.cli.verbs.study import study as verb
    from commissioner.study.campaign import StudyRequest

    verb(StudyRequest(file, out, workers, scheduler, resume), as_json=json)


@app.command()
def tune(
    drive: Drive,
    profile: Profile,
    motor: Motor,
    repeat: Annotated[int, typer.Option(help="How often the drive tunes itself.")] = 3,
    pause: Annotated[
        float | None, typer.Option(help="Seconds between two tunings; the drive file's if not given.")
    ] = None,
    write_back: Annotated[
        bool, typer.Option("--write-back", help="Leave the tuning nearest to the medians in the drive, stored.")
    ] = False,
    hardwired_stop: Annotated[
        bool, typer.Option("--hardwired-stop", help="A tested stop circuit or disconnect is in the operator's reach.")
    ] = False,
    power_cycle: Annotated[
        bool, typer.Option("--power-cycle", help="Ask for the drive to be switched off and on, then read it again.")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before energising.")] = False,
    dead_man: Annotated[
        bool,
        typer.Option(
            "--dead-man", help="Held by a service, as `run`; it answers what the person at the drive is asked."
        ),
    ] = False,
    procedure: Procedure = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """An ordinary drive's own standstill autotune, repeated, watched and judged; then its best set, or what was there before."""
    from commissioner.cli.verbs.tune import tune as verb
    from commissioner.operations.tune import TuneRequest

    request = TuneRequest(
        drive, profile, motor, runs, repeat, pause, write_back, hardwired_stop, power_cycle, procedure
    )
    verb(request, yes=yes, as_json=json, dead_man=dead_man)


@app.command()
def identify(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Recordings at standstill, or of a running motor (a start, loads): CSV, CSV.gz, Parquet, MATLAB, TDMS, MDF 4, COMTRADE, XLSX; the "
            "three tests of a textbook; or a manufacturer's sheet (values by their names)."
        ),
    ],
    motor: Annotated[str | None, typer.Option("--motor", help="Nameplate; overrides the recording's metadata.")] = None,
    estimator: Annotated[str, typer.Option(help="pao | lyapunov | nls")] = "pao",
    write_back: Annotated[
        bool, typer.Option("--write-back", help="Write an accepted result into the drive at --drive.")
    ] = False,
    drive: Annotated[str | None, typer.Option("--drive", help="Drive URL, for --write-back.")] = None,
    profile: Annotated[str | None, typer.Option("--profile", help="Drive file, for --write-back.")] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before writing.")] = False,
    procedure: Procedure = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for the report with its pictures.")] = None,
    runs: Runs = RUNS,
    mapping: Map = None,
    trust: Trust = None,
    json: Json = False,
) -> None:
    """The same estimators on a recording, offline; with --write-back its result into a drive without a test mode."""
    from commissioner.cli.verbs.identify import identify as verb
    from commissioner.cli.verbs.identify import identify_and_write
    from commissioner.operations.recordings.identify import IdentifyRequest

    request = IdentifyRequest(tuple(files), motor, estimator, mapping, trust, out)
    if write_back:
        identify_and_write(request, drive=drive, profile=profile, yes=yes, procedure=procedure, runs=runs, as_json=json)
    else:
        verb(request, as_json=json)


@app.command()
def monitor(
    file: Annotated[
        Path, typer.Argument(help="Recording of a running motor: three currents, three voltages, fixed rate.")
    ],
    motor: Annotated[str | None, typer.Option("--motor", help="Nameplate; overrides the recording's metadata.")] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for waveforms and the report.")] = None,
    baseline: Annotated[
        Path | None, typer.Option("--baseline", help="Baseline of this machine to compare with.")
    ] = None,
    learn: Annotated[bool, typer.Option("--learn", help="Add this recording to the baseline.")] = False,
    start: Annotated[Path | None, typer.Option("--start", help="Result of a commissioning run, to start from.")] = None,
    load_hz: Annotated[
        list[float] | None, typer.Option("--load-hz", help="A known load frequency; repeatable.")
    ] = None,
    inertia: Annotated[float | None, typer.Option("--inertia", help="Total inertia in kg m2, for load torque.")] = None,
    mapping: Map = None,
    trust: Trust = None,
    json: Json = False,
) -> None:
    """Speed and load torque of a running motor within a revolution, from its terminals; load faults."""
    from commissioner.cli.verbs.monitor import monitor as verb
    from commissioner.operations.recordings.monitor import MonitorRequest

    request = MonitorRequest(file, motor, start, tuple(load_hz or ()), inertia, baseline, learn, out, mapping, trust)
    verb(request, as_json=json)


@app.command()
def diagnose(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Recordings of one motor, at standstill or running (a start tells most), or tables of locked-rotor or no-load points: columns frequency_hz, "
            "voltage_line_v, current_line_a, power_w, and winding_resistance_uv_ohm where it is known."
        ),
    ],
    motor: Annotated[str | None, typer.Option("--motor", help="Nameplate; overrides the recording's metadata.")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for report.html, model.json, diagnosis.json.")
    ] = None,
    mapping: Map = None,
    trust: Trust = None,
    why: Annotated[
        bool, typer.Option("--why", help="Show every step of the search, with what was gained and wanted.")
    ] = False,
    json: Json = False,
) -> None:
    """What the simulation gets wrong about a recording, by name, with the measured gain."""
    from commissioner.cli.verbs.diagnose import diagnose as verb
    from commissioner.operations.recordings.diagnose import DiagnoseRequest

    verb(DiagnoseRequest(tuple(files), motor, out, mapping=mapping, trust=trust), as_json=json, why=why)


@app.command()
def simulate(
    model: Annotated[
        str,
        typer.Argument(
            help="A model.json of diagnose or identify, a manufacturer's sheet, or a motor's or drive's name or TOML file."
        ),
    ],
    out: Annotated[Path, typer.Option("--out", help="The recording to write: .csv, .csv.gz or .parquet.")],
    like: Annotated[Path | None, typer.Option("--like", help="Take the command of this recording.")] = None,
    seconds: Annotated[float, typer.Option(help="Length of each segment.")] = 6.0,
    axes: Annotated[str, typer.Option(help="Axis orientations in electrical degrees, as 0,60,120.")] = "0,60,120",
    noise_a: Annotated[float, typer.Option(help="White noise on the currents, rms.")] = 0.0,
    seed: Annotated[int, typer.Option(help="Seed of the noise.")] = 1,
    plain: Annotated[bool, typer.Option(help="Leave the named effects out.")] = False,
    json: Json = False,
) -> None:
    """Play a drive or motor configuration, plain or extended by diagnose, into a recording."""
    from commissioner.cli.angles import parse_axes
    from commissioner.cli.verbs.simulate import simulate as verb
    from commissioner.operations.recordings.simulate import SimulateRequest

    angles = parse_axes(axes) or ()
    verb(SimulateRequest(model, out, like, seconds, angles, noise_a, seed, plain), as_json=json)


@app.command()
def restore(
    run: Run,
    drive: Annotated[str | None, typer.Option("--drive", help="Drive URL; the run's own if not given.")] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before writing.")] = False,
    seal: Seal = None,
    plan: Annotated[bool, typer.Option("--plan", help="Only show what would change.")] = False,
    token: Annotated[str | None, typer.Option(help="Write only if the table of --plan still holds.")] = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Write back the parameter set a run found in the drive, verified and stored."""
    from commissioner.cli.verbs.archived.deciding import restore_run

    restore_run(runs, run, drive, yes=yes, as_json=json, plan=plan, token=token, seal=seal)


@app.command("write-back")
def write_back_run(
    run: Run = "last",
    drive: Annotated[str | None, typer.Option("--drive", help="Drive URL; the run's own if not given.")] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before writing.")] = False,
    seal: Seal = None,
    plan: Annotated[bool, typer.Option("--plan", help="Only show what would change.")] = False,
    token: Annotated[str | None, typer.Option(help="Write only if the table of --plan still holds.")] = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Write an accepted result of a run that was made without --write-back into its drive, verified and stored."""
    from commissioner.cli.verbs.archived.deciding import write_run

    write_run(runs, run, drive, yes=yes, as_json=json, plan=plan, token=token, seal=seal)


@app.command()
def serve(
    host: Annotated[
        str, typer.Option(help="Where to listen; another host than this computer needs TLS and accounts.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="0 picks a free one.")] = 8321,
    config: Annotated[
        Path | None, typer.Option("--config", help="TOML file: drives, TLS, folders. None: the simulator.")
    ] = None,
    open_page: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """The service: HTTP API and the technician's page."""
    from commissioner.cli.verbs.serve import serve as verb

    verb(host=host, port=port, config=config, open_page=open_page, runs=runs, as_json=json)


@app.command()
def replay(run: Run = "last", salvage: Salvage = False, runs: Runs = RUNS, json: Json = False) -> None:
    """Feed the archived blocks through the pure layers; decisions must come out identical."""
    from commissioner.cli.verbs.archived.deciding import replay_run

    replay_run(runs, run, as_json=json, salvage=salvage)


@app.command()
def docs(
    name: Annotated[str | None, typer.Argument(help="Chapter, or schema; all are listed without it.")] = None,
    json: Json = False,
) -> None:
    """The manual: its chapters and the JSON schemas, or one of them."""
    from commissioner.cli.verbs.docs import docs as verb

    verb(name, as_json=json)


@app.command()
def ports(json: Json = False) -> None:
    """The serial adapters of this computer, each with its --drive URL. Opens none."""
    from commissioner.cli.verbs.ports import ports as verb

    verb(as_json=json)


def main() -> None:
    """Entry point of the console script."""
    degrade_output()
    run_to_exit(only(app, sys.argv[1:]), sys.argv[1:])
