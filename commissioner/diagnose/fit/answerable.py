"""Data that carry no answer: a command that does not make the current, files of different motors or states."""

from __future__ import annotations

import numpy as np

from commissioner.diagnose.fit.gauss_newton import Fit
from commissioner.diagnose.fit.normal_equations import whiten
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.intake.refusal import ONE_BY_ONE, refused
from commissioner.motor.circuit import SYMBOLS

MOST_UNANSWERED, FAINT = 0.5, 0.1
"""Refused: currents, not below a tenth of the noise's power, of which the four-parameter model explains no more than half."""


def check_before_search(nominal: Fit, record: Record, noise: Noise) -> None:
    """The currents answer the command at all; and a leakage that differs by half between files is no effect of level. DataRefused."""
    count = float(nominal.normal.count.sum())
    white = (whiten(s.currents_a, s.is_good, noise, record.facts.sample_period_s) for s in record.segments)
    flowing = sum(float(w @ w) for w in white) - count
    if nominal.chi2 - count > MOST_UNANSWERED * flowing > FAINT * count:
        explained = max(1.0 - (nominal.chi2 - count) / flowing, 0.0)
        raise refused(
            f"the command explains only {explained:.0%} of the current's power: voltage and current do not belong together, or "
            "something else drives the motor",
            explained,
            f"at least {1.0 - MOST_UNANSWERED:.0%}",
            "check that both columns are of one test, on one time axis, and that the shaft stands still",
        )
    _compare_files(nominal, record, slice(2, 3), 0.4)


def check_one_state(fitted: Fit, record: Record) -> None:
    _compare_files(fitted, record, slice(0, 3), 0.2)


def _compare_files(fitted: Fit, record: Record, which: slice, most: float) -> None:
    """Raises when the files' own four-parameter fits (one step from the common one) differ by more than `most`."""
    files = sorted({s.file for s in record.segments})
    if len(files) < 2:
        return
    estimates = []
    for file in files:
        rows = [k for k, s in enumerate(record.segments) if s.file == file]
        gram, slope = fitted.normal.gram[rows].sum(axis=0)[:4, :4], fitted.normal.slope[rows].sum(axis=0)[:4]
        estimates.append(np.linalg.pinv(gram) @ slope)
    spread = np.ptp(np.array(estimates), axis=0)
    worst = which.start + int(np.argmax(spread[which]))
    if spread[worst] > most:
        raise refused(
            f"the files are not of one motor in one state: {SYMBOLS[worst]} differs by {spread[worst]:.0%} between them "
            f"(fitted together: {fitted.model.nominal[worst]:.4g})",
            float(spread[worst]),
            f"at most {most:.0%}",
            ONE_BY_ONE,
        )
