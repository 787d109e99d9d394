"""`commissioner run`: commission a drive, after asking."""

from __future__ import annotations

from dataclasses import replace

from rich.markup import escape

from commissioner.cli.held import held_by_a_service
from commissioner.cli.screens import screen
from commissioner.cli.screens.ending import show_and_exit
from commissioner.cli.screens.live import LiveView
from commissioner.cli.signals import let_end
from commissioner.motor.quantities import plate_words
from commissioner.operations.check import CheckRequest, check
from commissioner.operations.commission import CommissionRequest, check_request, commission
from commissioner.run.commission import Origin
from commissioner.run.stopping.operator_stop import OperatorStop
from commissioner.text import counted


def run(request: CommissionRequest, *, yes: bool, as_json: bool, dead_man: bool = False) -> None:
    """Commission the drive; exits with the code of the outcome."""
    if dead_man:
        hold_and_commission(request)
        return
    check_request(request)
    screen.require_yes(yes, as_json=as_json)
    if not yes:
        _ask(request)
    with OperatorStop() as stop:
        with LiveView(screen.err if as_json else screen.out) as view:
            done = commission(request, view, Origin(stop=stop))
        let_end()
    show_and_exit(done, as_json=as_json)


def hold_and_commission(request: CommissionRequest) -> None:
    """A run that a service holds: two JSON documents, the folder and the result."""
    check_request(request)
    with held_by_a_service() as (_, _, origin):
        done = commission(replace(request, waits=True), origin=origin)
    show_and_exit(done, as_json=True)


def _ask(request: CommissionRequest) -> None:
    """A person sees which drive answers and what will happen, and says yes; or nothing is energised."""
    asked = CheckRequest(request.drive, request.profile, request.motor, request.procedure, request.axes_deg)
    with screen.busy("asking the drive"):
        seen = check(asked)
    drive, job, plan, plate = seen.drive, seen.job, seen.plan, seen.nameplate
    assert job is not None, "a drive with excitation has a job"
    if failure := seen.failure:
        failure.what = f"{drive.words}: {failure.what}; nothing was energised"
        raise failure
    stretched = f", stretched {job.stretch:.1f} times for a slow rotor" if job.stretch > 1.0 else ""
    screen.out.print(
        f"[bold]{escape(drive.words)}[/], motor of {plate_words(plate.known())}; {len(seen.checks)} of "
        f"{len(seen.checks)} checks passed.\n"
        f"[bold yellow]The motor will be energised[/] at standstill, one axis at a time: {counted(len(plan.tests_deg), 'test')}, about "
        f"{job.stretch * plan.total_seconds:.0f} s in all{stretched}, never more than {job.total_time_s:.0f} s; up to "
        f"{job.test_current_a:.1f} A peak, direct current included.\n"
        "The output goes on and off by itself between the tests. No torque is made on purpose, but the shaft may move."
    )
    screen.out.print(
        "Accepted parameters will be written into the drive."
        if request.write_back
        else "Nothing will be written into the drive."
    )
    screen.out.print("Energise only with guards on, people away and the emergency stop tested.")
    screen.confirm("Energise?", otherwise="nothing was energised or written")
