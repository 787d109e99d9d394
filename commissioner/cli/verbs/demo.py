"""`commissioner demo`: start the simulated inverter as its own process and commission it over the wire."""

from __future__ import annotations

from pathlib import Path

from commissioner.cli.angles import parse_axes
from commissioner.cli.verbs.run import run
from commissioner.operations.closing import DIAGNOSIS_S
from commissioner.operations.commission import CommissionRequest
from commissioner.paths import MOTOR
from commissioner.study.own_process import simulated_inverter


def demo(
    *,
    scenario: str,
    speed: str,
    seed: int,
    axes: str | None,
    write_back: bool,
    runs: Path,
    as_json: bool,
    diagnosis: bool,
    strict: bool,
) -> None:
    """Commission the simulated inverter; exits with the code of the outcome."""
    from commissioner.cli.screens import screen

    if not as_json:
        screen.out.print("[dim]starting the simulated inverter (its own process, Modbus TCP on loopback)[/]")

    def wait() -> None:
        if not as_json:
            screen.out.print("[dim]compiling the simulator: at the first start only, minutes on a slow computer[/]")

    with simulated_inverter(scenario, speed, seed, wait=wait) as url:
        request = CommissionRequest(
            url, "simulated", MOTOR, runs, None, parse_axes(axes), write_back,
            DIAGNOSIS_S if diagnosis else 0.0, waits=True, strict=strict,
        )  # fmt: skip
        run(request, yes=True, as_json=as_json)
