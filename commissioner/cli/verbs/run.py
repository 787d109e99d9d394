"""`commissioner run`: commission a drive, after asking."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from rich.markup import escape

from commissioner.cli.angles import parse_axes
from commissioner.cli.screens import screen
from commissioner.cli.screens.live import LiveView
from commissioner.link.files.drive_file import load_profile
from commissioner.motor.nameplate import Nameplate
from commissioner.procedure.checks import check_failed
from commissioner.procedure.plan import ProcedurePlan
from commissioner.run.archive.seal import read_key
from commissioner.run.commission import Commissioned, commission, require_capabilities
from commissioner.run.inspection import inspect_drive
from commissioner.run.stopping.dead_man import DeadMan
from commissioner.run.stopping.operator_stop import OperatorStop
from commissioner.settings import load_motor, load_procedure

DIAGNOSIS_S = 60.0
"""Four tests with five causes in them take 40 s on two cores."""
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
    seal: Path | None = None,
    dead_man: bool = False,
) -> None:
    """Commission the drive; exits with the code of the outcome."""
    if dead_man:
        hold_and_commission(
            url=drive, profile=profile, motor=motor, axes=parse_axes(axes), write_back=write_back, procedure=procedure,
            runs=runs, diagnosis=diagnosis,
        )  # fmt: skip
        return
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
        seal=seal,
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
    seal: Path | None = None,
) -> None:
    """The part that `run` and `demo` share."""
    key = read_key(seal) if seal is not None else None
    nameplate = load_motor(motor)
    plan = load_procedure(procedure, axes_deg=axes)
    screen.require_yes(yes, as_json=as_json)
    if not yes:
        _ask(url, profile, nameplate, plan, write_back=write_back)
    with LiveView(screen.err if as_json else screen.out) as view:
        done = commission(
            url,
            profile,
            nameplate,
            plan,
            write_back=write_back,
            runs=runs,
            present=view,
            diagnosis_s=DIAGNOSIS_S if diagnosis else 0.0,
            key=key,
        )
    show_and_exit(done, as_json=as_json)


def hold_and_commission(
    *,
    url: str,
    profile: str,
    motor: str,
    axes: tuple[float, ...] | None,
    write_back: bool,
    procedure: Path | None,
    runs: Path,
    diagnosis: bool,
) -> None:
    """A run that a service holds by the pipe at our standard input. Nobody is asked here; nothing is shown but two JSON
    documents: the folder as soon as there is one, on a line of its own, and the result."""
    nameplate = load_motor(motor)
    plan = load_procedure(procedure, axes_deg=axes)
    stop = OperatorStop()
    held = DeadMan(sys.stdin.fileno(), stop)
    held.start()
    origin = held.wait_for_begin()
    done = commission(
        url, profile, nameplate, plan, write_back=write_back, runs=runs, present=lambda _record: None,
        diagnosis_s=DIAGNOSIS_S if diagnosis else 0.0, stop=stop, begun=_say_folder, origin=origin,
    )  # fmt: skip
    show_and_exit(done, as_json=True)


def _say_folder(folder: Path) -> None:
    sys.stdout.write(json.dumps({"run": folder.name, "folder": str(folder)}) + "\n")
    sys.stdout.flush()


def _ask(url: str, profile: str, nameplate: Nameplate, plan: ProcedurePlan, *, write_back: bool) -> None:
    """A person sees which drive answers and what will happen, and says yes; or nothing is energised."""
    require_capabilities(load_profile(profile), write_back=write_back)
    with screen.busy("asking the drive"):
        inspection = inspect_drive(url, profile, nameplate, plan)
    drive, job = inspection.identity, inspection.job
    assert job is not None, "a drive with excitation has a job"
    if failure := check_failed(inspection.checks):
        failure.what = f"{drive.drive_type} #{drive.serial_number}: {failure.what}; nothing was energised"
        raise failure
    stretched = f", stretched {job.stretch:.1f} times for a slow rotor" if job.stretch > 1.0 else ""
    screen.out.print(
        f"[bold]{escape(drive.drive_type)} #{drive.serial_number}[/], motor of {1e-3 * nameplate.rated_power_w:g} kW, "
        f"{nameplate.rated_voltage_v:g} V, {nameplate.rated_current_a:g} A; {len(inspection.checks)} of "
        f"{len(inspection.checks)} checks passed.\n"
        f"[bold yellow]The motor will be energised[/] at standstill, one axis at a time: {len(plan.tests_deg)} tests, about "
        f"{job.stretch * plan.total_seconds:.0f} s in all{stretched}, never more than {job.total_time_s:.0f} s; up to "
        f"{job.test_current_a:.1f} A peak, direct current included.\n"
        "The output goes on and off by itself between the tests. No torque is made on purpose, but the shaft may move."
    )
    screen.out.print(
        "Accepted parameters will be written into the drive."
        if write_back
        else "Nothing will be written into the drive."
    )
    screen.out.print("Energise only with guards on, people away and the emergency stop tested.")
    screen.confirm("Energise?", otherwise="nothing was energised or written")


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
