"""What is left after the causes, over the record: in all, in bursts, by state."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.estimation.checks import BLOCK_S
from commissioner.estimation.fit import Fit, Machine, Problem, residuals, simulate
from commissioner.estimation.record import STATES
from commissioner.running.residual.shaft_lines import ShaftLine, without_shaft_lines

Array = NDArray[np.float64]
TRUSTED = 1.06
"""Chi-square a sample up to which nothing is left: the noise's own size is known to three hundredths."""
BURST = 7.0
"""Standard deviations of a block's chi-square that chance does not reach in thousands of blocks."""


@dataclass(frozen=True)
class Lack:
    """In units of the noise: of the whole record, and of its worst 20 ms; `by_state` likewise. `shaft_lines`: what is counted in none of these."""

    sigma: float
    burst_sigma: float
    burst_at_s: float
    by_state: Mapping[str, float]
    shaft_lines: tuple[ShaftLine, ...] = ()


def lack_of_fit(problem: Problem, machine: Machine) -> Lack:
    """From the whitened residual of the whole record, held-out part included."""
    parts, lines = without_shaft_lines(problem, machine, residuals(problem, machine))
    block = max(round(BLOCK_S / problem.period), 8)
    worst, at, total, count = 0.0, 0.0, 0.0, 0
    sums = dict.fromkeys(STATES, 0.0)
    counts = dict.fromkeys(STATES, 0)
    for w, rest in zip(problem.record.windows, parts, strict=True):
        square = np.sum(rest**2, axis=1)
        width = rest.shape[1]
        total, count = total + float(square.sum()), count + rest.size
        for k, name in enumerate(STATES):
            chosen = w.state == k
            sums[name] += float(square[chosen].sum())
            counts[name] += int(chosen.sum()) * width
        whole = square[: square.size // block * block].reshape(-1, block).mean(axis=1) / width
        limit = 1.0 + BURST * np.sqrt(2.0 / (block * width))
        if whole.size and whole.max() - limit > worst:
            worst, at = float(whole.max() - limit), float(np.argmax(whole) * block * problem.period)
    return Lack(
        float(np.sqrt(max(total / max(count, 1) - TRUSTED, 0.0))), float(np.sqrt(worst)), at,
        {n: float(np.sqrt(max(sums[n] / counts[n] - 1.0, 0.0))) for n in STATES if counts[n] > 2 * block}, lines,
    )  # fmt: skip


def rms_errors(problem: Problem, machine: Machine) -> tuple[float, float]:
    """Of the simulated current vector, A, of the fitted part and of the held-out one."""
    fitted, held = [], []
    for (run, _), w, u in zip(simulate(problem, machine), problem.record.windows, problem.until, strict=True):
        error = (w.current - run)[:, :2]
        fitted.append(error[:u])
        held.append(error[u:])
    return tuple(float(np.sqrt(np.mean(np.concatenate(x) ** 2))) if any(map(len, x)) else 0.0 for x in (fitted, held))  # type: ignore[return-value]


def not_told(fit: Fit) -> Iterator[str]:
    """A remark on the numbers that the recording leaves open."""
    if names := " and ".join(n.replace("_", " ") for n in fit.not_told()):
        yield (
            f"Open: {names}. What these data seem to tell of it is mostly noise of the measured voltage, which the intervals allow for. "
            "Record a start, a second load or the speed."
        )


def of_shaft(lack: Lack) -> Iterator[str]:
    """A remark on the lines that turn with the shaft."""
    if lack.shaft_lines:
        strongest = ", ".join(f"{line.per_turn} a turn {line.sigma:.2g}" for line in lack.shaft_lines[:3])
        yield (
            f"Lines that turn with the shaft (slots, eccentricity, a load that pulsates) stand in the currents, in units of the noise: {strongest}. "
            "Every motor has some; no number of the machine makes them, and they are not counted as unexplained."
        )
