"""Channels of a running recording before they become vectors: three that are the lines of one motor, single samples that stand out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from commissioner.errors import DataRefused
from commissioner.estimation.numbers import Scales
from commissioner.records import RunningRecording, Signal

Array = NDArray[np.float64]
OPEN_SUM, OPEN_SUM_OF_PHASES = 0.12, 0.3
"""Share of three channels that their sum holds, from which one is no line of this motor (a gain of 1.4); voltages to a star point may hold that of the
mains' own zero sequence."""
FED = 0.3
"""Of the rated peak, in all three together: with less the motor is not fed, and noise has no sum."""
MOSTLY = 0.75
"""Quantile of what is compared: neither spikes nor a pause before the start count."""
SAME, ALIKE = 0.9999, 0.98
"""Correlation of two channels that are one, and of one with what the others leave for it, from which a gain says all."""
SPIKE, SPIKE_SIGMA, SHAPE = 0.1, 20.0, 0.12
"""Of the channel's usual size, and of what its samples usually differ from the cubic through their neighbours, by which a spike does; by how much
of it the neighbours may differ from what a single one makes of them: at a corner, where a contactor closes, a sixth."""
MOST_SPIKES = 0.005
"""Of the samples: more are another kind of signal."""


def check_sums(one: RunningRecording, scales: Scales) -> None:
    """DataRefused where three currents, or voltages, cannot be those of one motor's lines: a doubled export, a wrong range, a dead sensor's noise."""
    lines = ["uv", "vw", "wu"] if one.voltages_are_line_to_line else list("uvw")
    most = OPEN_SUM if one.voltages_are_line_to_line else OPEN_SUM_OF_PHASES
    for kind, names, group, limit in (
        ("current", list("uvw"), one.currents_a, OPEN_SUM),
        ("voltage", lines, one.voltages_v, most),
    ):
        there = np.all(np.isfinite(group), axis=0)
        if there.sum() < 2:
            continue
        x = np.array(group)[:, there]
        x -= np.median(x, axis=1, keepdims=True)
        size = float(np.quantile(np.abs(x).sum(axis=0), MOSTLY))
        if size < FED * (scales.current_a if kind == "current" else scales.voltage_v):
            continue
        share = float(np.quantile(np.abs(x.sum(axis=0)), MOSTLY)) / max(size, 1e-12)
        if share > limit:
            raise DataRefused(
                f"{one.source}: the three {kind}s do not add up to zero: {_which(x, kind, names)}", step="read running recording",
                value=f"{share:.2f} of them is left", limit=f"at most {limit:g}",
                remedy=f"check the export, and range, ratio and turns of each sensor, and that the three {kind}s are the three lines of one motor",
            )  # fmt: skip


def _which(x: Array, kind: str, names: list[str]) -> str:
    alike = np.atleast_2d(np.corrcoef(x))
    for j, k in ((0, 1), (1, 2), (0, 2)):
        if alike[j, k] > SAME:
            return f"{kind}s {names[j]} and {names[k]} are one and the same"
    left = x - x.sum(axis=0)  # minus the two others
    with_left = [float(np.corrcoef(own, other)[0, 1]) for own, other in zip(x, left, strict=True)]
    k = int(np.argmax(np.nan_to_num(with_left)))
    if with_left[k] < ALIKE:
        return "one of them at least is something else"
    return (
        f"{kind} {names[k]} is {float(x[k] @ left[k] / (left[k] @ left[k])):.3g} times what the other two leave for it"
    )


def without_spikes(one: RunningRecording) -> tuple[RunningRecording, list[str]]:
    """The recording with the samples that stand out alone as their neighbours tell them, and what is said of them."""
    currents, voltages = (tuple(_mended(x) for x in group) for group in (one.currents_a, one.voltages_v))
    count = sum(n for _, n in (*currents, *voltages))
    if not count:
        return one, []
    (u, v, w), (a, b, c) = ([x for x, _ in group] for group in (currents, voltages))
    said = f"{one.source}: {count} samples stand out of their neighbours alone (spikes): taken as the neighbours tell them."
    return replace(one, currents_a=(u, v, w), voltages_v=(a, b, c)), [said]


def _mended(x: Signal) -> tuple[Signal, int]:
    if x.size < 9:
        return x, 0
    told = x.copy()  # by the cubic through its neighbours
    told[2:-2] = (4.0 * (x[1:-3] + x[3:-1]) - x[:-4] - x[4:]) / 6.0
    at = np.fromiter(_spikes(x, np.nan_to_num(x - told)), dtype=np.int64)
    if at.size == 0 or at.size > MOST_SPIKES * x.size:
        return x, 0
    out = x.copy()
    out[at] = told[at]
    return out, int(at.size)


def _spikes(x: Signal, off: Array) -> Iterator[int]:
    """Where one sample alone is `off` its neighbours."""
    if not np.isfinite(x).any():
        return
    usual = float(np.median(np.abs(off))) / 0.6745
    least = max(SPIKE_SIGMA * usual, SPIKE * float(np.nanquantile(np.abs(x), MOSTLY)))
    for k in np.flatnonzero(np.abs(off) > least):
        if 4 <= k < x.size - 4:
            around = off[[k - 2, k - 1, k + 1, k + 2]] / off[k]
            if np.all(np.abs(around - np.array([1.0, -4.0, -4.0, 1.0]) / 6.0) < SHAPE):
                yield int(k)
