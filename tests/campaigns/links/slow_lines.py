"""Whole runs over serial lines of several rates, in motor time: `python -m tests.campaigns.links.slow_lines 115200:1 57600:2 38400:2`.

Each `BAUD:TURNAROUND_MS` is a three-axis run on the simulator's default scenario, judged by its answer key.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sim.wire.pace import Pace
from tests.support.paced import Paced, commissioned


def row(run: Paced, baud: int, turnaround_ms: float) -> str:
    """One line of the table: plan, outcome, time, stated errors and the largest true one, true flux over the limit."""
    found, link = run.findings.identification, run.findings.link
    how = f"captures of {link.captured}" if link.captured else f"means of {link.averaged}"
    flux = run.station.highest_flux_wb / run.findings.flux_limit_wb
    said = f"{baud} Bd, {turnaround_ms:g} ms | {how}, {len(link.channels)} channels | {run.ended.outcome} | {run.station.now_s:.0f} s"
    if found is None:
        return f"| {said} | none: {run.ended} | - | {flux:.3f} |"
    std = np.array(found.std) / found.parameters.as_tuple()
    errors = ", ".join(f"{100 * s:.2f}" for s in std)
    return f"| {said} | {errors} % | {np.max(np.abs(run.errors_in_std)):.1f} | {flux:.3f} |"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.links.slow_lines", description=__doc__)
    parser.add_argument("lines", nargs="+", help="BAUD:TURNAROUND_MS")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(arguments)
    print(
        "| line | plan | outcome | in all | standard errors of R_s, R_R, L_sigma, L_M | largest error in them | true flux of its limit |"
    )
    for line in options.lines:
        baud, _, turnaround = line.partition(":")
        with tempfile.TemporaryDirectory() as folder:
            run = commissioned(Path(folder), Pace(int(baud), 1e-3 * float(turnaround or 1)), seed=options.seed)
            print(row(run, int(baud), float(turnaround or 1)), flush=True)


if __name__ == "__main__":
    main()
