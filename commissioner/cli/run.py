"""`commissioner run`: commission a drive, after asking."""

from __future__ import annotations

from pathlib import Path

from commissioner.cli import screen
from commissioner.cli.angles import parse_axes
from commissioner.cli.live import LiveView
from commissioner.run.commission import Commissioned, commission
from commissioner.settings import load_motor, load_procedure

DIAGNOSIS_S = 20.0
EXIT_CODES = {"commissioned": 0, "rejected": 3, "aborted": 4, "faulted": 5}


def run(
    *,
    drive: str,
    profile: str,
    motor: str,
    axes: str | None,
    write_back: bool,
    yes: bool,
    procedure: Path | None,
    runs: Path,
    as_json: bool,
    diagnosis: bool,
) -> None:
    """Commission the drive; exits with the code of the outcome."""
    commission_and_show(
        url=drive,
        profile=profile,
        motor=motor,
        axes=parse_axes(axes),
        write_back=write_back,
        yes=yes,
        procedure=procedure,
        runs=runs,
        as_json=as_json,
        diagnosis=diagnosis,
    )


def commission_and_show(
    *,
    url: str,
    profile: str,
    motor: str,
    axes: tuple[float, ...] | None,
    write_back: bool,
    yes: bool,
    procedure: Path | None,
    runs: Path,
    as_json: bool,
    diagnosis: bool,
) -> None:
    """The part that `run` and `demo` share."""
    nameplate = load_motor(motor)
    plan = load_procedure(procedure, axes_deg=axes)
    screen.require_yes(yes, as_json=as_json)
    if not yes:
        _ask(url, plan.total_seconds, write_back)
    with LiveView(screen.err if as_json else screen.out) as view:
        done = commission(
            url, profile, nameplate, plan, write_back=write_back, runs=runs, present=view,
            diagnosis_s=DIAGNOSIS_S if diagnosis else 0.0,
        )
    show_and_exit(done, as_json=as_json)


def _ask(url: str, seconds: float, write_back: bool) -> None:
    """A person says yes, or nothing is energised."""
    import typer

    screen.out.print(
        f"[bold yellow]The motor at {url} will be energised[/] at standstill on one axis at a time, for about "
        f"{seconds:.0f} s in all.\nNo torque is made on purpose, but the shaft may still move slightly. "
        "Guards on, people away, emergency stop tested?"
    )
    screen.out.print(
        "Accepted parameters will be written into the drive."
        if write_back
        else "Nothing will be written into the drive."
    )
    typer.confirm("Energise?", abort=True)


def show_and_exit(done: Commissioned, *, as_json: bool) -> None:
    """The result, and the exit code of its outcome."""
    if as_json:
        screen.emit(dict(done.result) | {"folder": str(done.folder)})
    else:
        screen.result(dict(done.result))
        for what, name in (("report", "report.html"), ("samples", "recording.parquet")):
            if (done.folder / name).is_file():
                screen.out.print(f"[dim]{what:<9} {done.folder / name}[/]", soft_wrap=True)
    if code := EXIT_CODES[done.ended.outcome]:
        raise SystemExit(code)
