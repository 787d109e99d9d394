"""Samples that are means over N control periods, taken back to control periods without losing exactness.

Averaging is linear and does not change with time: with u the voltage held over each control period and i the current at its
start, the running means

    U[n] = (u[n] + ... + u[n+N-1]) / N        I[n] = (i[n] + ... + i[n+N-1]) / N

obey the very difference equations that u and i obey. A row k of the recording holds U[kN] and I[kN]. So the model is
simulated at control rate with U as its voltage, and compared with what was measured in every N-th period. Between the rows U
follows from its sum, the volt-seconds, which is known at each row and as smooth as the tones are: cubic Hermite pieces with
slopes of fourth order. The current between the rows is only a guide for what needs one (zero crossings, largest values); no fit
counts it.

What does not commute with a mean is the inverter's loss: of the loss at a mean current and the mean of the losses the
first two moments over a zero crossing are equal.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from commissioner.records import Signal


def running_mean_v(means_v: Signal, averaged: int) -> Signal:
    """(K,) means over N control periods each -> ((K-1) N + 1,) running means, one per control period."""
    rows = means_v.size
    if rows < 2:
        return means_v.copy()
    total = np.concatenate([[0.0], np.cumsum(means_v)])
    from scipy.interpolate import CubicHermiteSpline

    volt_periods = CubicHermiteSpline(np.arange(rows + 1), total, _at_edges(means_v))
    inside = np.asarray(volt_periods(np.arange(rows * averaged + 1) / averaged))
    inside[::averaged] = total
    return np.asarray(inside[averaged:] - inside[:-averaged])


def between_rows(values: Signal, averaged: int) -> Signal:
    """(K,) -> ((K-1) N + 1,): straight lines between the rows."""
    rows = values.size
    return np.asarray(np.interp(np.arange((rows - 1) * averaged + 1) / averaged, np.arange(rows), values))


def measured(rows: int, averaged: int) -> NDArray[np.bool_]:
    """Which control periods hold a row."""
    is_row = np.zeros((rows - 1) * averaged + 1, dtype=bool)
    is_row[::averaged] = True
    return is_row


def on_its_period(means_v: Signal, averaged: int) -> Signal:
    """Voltages that hold, in a model of one step a row, over the step behind each row's current.

    The mean of U[kN] ... U[kN+N-1], by straight lines; the last row goes on as it came. For the online observer, which sees a
    block at a time; exact to what a tone bends within a row.
    """
    if averaged == 1 or means_v.size < 2:
        return means_v
    following = np.append(means_v[1:], 2.0 * means_v[-1] - means_v[-2])
    share = 0.5 * (averaged - 1) / averaged
    return np.asarray((1.0 - share) * means_v + share * following)


def _at_edges(means_v: Signal) -> Signal:
    """The voltage at the edges between means: of fourth order inside, straight at the ends."""
    if means_v.size < 4:
        inner = 0.5 * (means_v[1:] + means_v[:-1])
    else:
        inner = np.empty(means_v.size - 1)
        inner[1:-1] = (7.0 * (means_v[1:-2] + means_v[2:-1]) - means_v[:-3] - means_v[3:]) / 12.0
        inner[0], inner[-1] = 0.5 * (means_v[0] + means_v[1]), 0.5 * (means_v[-2] + means_v[-1])
    first, last = 1.5 * means_v[0] - 0.5 * means_v[1], 1.5 * means_v[-1] - 0.5 * means_v[-2]
    return np.concatenate([[first], inner, [last]])
