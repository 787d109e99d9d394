"""Columns before phases: currents and voltages under each other's names, and a third one that follows from two."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from commissioner.monitor.intake.findings import Finding, Findings
from commissioner.motor.computed import is_negative_sum
from commissioner.motor.nameplate import Nameplate
from commissioner.records import ONE_CURRENT, ReadingNote, RunningRecording, Signal

CURRENT_RANGE = (0.02, 3.0)
"""Of the rated current, rms."""
VOLTAGE_RANGE = (0.1, 2.5)
"""Of a phase's rated voltage, rms: an inverter at reduced frequency, or line to line."""
HILBERT_S, HILBERT_KAISER = 0.2, 6.0
"""Reach of the filter that turns one current by a quarter of a turn, to either side, and its window: what lies above 10 Hz passes."""
APART = 2.0
"""Factor between the smallest of one kind and the largest of the other, or the columns stay as they are named."""


def sort_by_kind(recording: RunningRecording, plate: Nameplate) -> tuple[RunningRecording, list[Finding]]:
    """Currents and voltages by their size where the columns as named cannot be what they are named; else as it is.

    Absent columns (nothing in them) have no kind: where both groups are exchanged, the hole goes along.
    """
    signals = [*recording.currents_a, *recording.voltages_v]
    size = np.array([float(np.std(good)) if (good := signal[np.isfinite(signal)]).size else 0.0 for signal in signals])
    if _is_plausible(size, (3, 4, 5), plate):
        return recording, []
    others = [
        kinds for kinds in combinations(range(6), 3) if _is_plausible(size, kinds, plate) and _is_clear(size, kinds)
    ]
    if len(others) != 1:
        return recording, []
    wrong_i = [k for k in others[0] if k < 3]
    wrong_v = [k - 3 for k in range(3, 6) if k not in others[0]]
    for i, v in zip(wrong_i, wrong_v, strict=True):
        signals[i], signals[3 + v] = signals[3 + v], signals[i]
    names = ", ".join(f"current {'uvw'[i]} and voltage {'uvw'[v]}" for i, v in zip(wrong_i, wrong_v, strict=True))
    exchanged = Finding(
        "crossed_channels",
        "corrected",
        f"columns of currents and voltages are exchanged: {names}",
        names,
        "currents and voltages in their own columns",
        "correct the column names",
    )
    a, b, c, d, e, f = signals
    return replace(recording, currents_a=(a, b, c), voltages_v=(d, e, f)), [exchanged]


def _is_plausible(size: Signal, voltages: tuple[int, ...], plate: Nameplate) -> bool:
    """Every column that holds something lies in the range of its kind."""
    scale = np.full(6, plate.rated_current_a)
    low, high = np.full(6, CURRENT_RANGE[0]), np.full(6, CURRENT_RANGE[1])
    kinds = list(voltages)
    scale[kinds] = plate.rated_voltage_v / np.sqrt(3.0)
    low[kinds], high[kinds] = VOLTAGE_RANGE
    share = size / scale
    return bool(np.all((size == 0) | ((share > low) & (share < high))))


def _is_clear(size: Signal, voltages: tuple[int, ...]) -> bool:
    """The two kinds lie a factor `APART` from each other."""
    v = [size[k] for k in voltages if size[k] > 0]
    i = [size[k] for k in range(6) if k not in voltages and size[k] > 0]
    return bool(v and i and (min(v) > APART * max(i) or min(i) > APART * max(v)))


def _is_computed(group: list[Signal], kind: str, line_to_line: bool) -> bool:
    """Whether the third only repeats the other two; phase voltages of a balanced system do so by themselves."""
    return (kind == "current" or line_to_line) and is_negative_sum(group[0], group[1], group[2])


def complete(recording: RunningRecording) -> tuple[RunningRecording, list[Finding]]:
    """A recording of two currents, or of two line-to-line voltages, with the third as minus their sum; else as it is.

    Without a neutral the three sum to zero. A phase voltage's missing third is not known: the star point may move.
    """
    findings = Findings()
    groups = [list(recording.currents_a), list(recording.voltages_v)]
    for group, kind in zip(groups, ("current", "voltage"), strict=True):
        if is_computed := _is_computed(group, kind, recording.voltages_are_line_to_line):
            group[2] = -(group[0] + group[1])
            findings.add(
                f"computed_{kind}",
                "note",
                f"third {kind} computed from two: not used as a sensor. Which of the three was computed cannot be told from the sum: the "
                "gain of a sensor stands in it as well",
                3,
                2,
                f"record all three {kind}s",
            )
        absent = [] if is_computed else [k for k, signal in enumerate(group) if not np.any(np.nan_to_num(signal))]
        if len(absent) != 1 or (kind == "voltage" and not recording.voltages_are_line_to_line):
            continue
        k = absent[0]
        group[k] = -(group[k - 1] + group[k - 2])
        findings.add(
            f"third_{kind}",
            "corrected",
            f"one {kind} was not recorded: taken as minus the sum of the other two",
            k + 1,
            3,
            f"record all three {kind}s",
        )
    i, v = groups
    return replace(recording, currents_a=(i[0], i[1], i[2]), voltages_v=(v[0], v[1], v[2])), findings


def from_one_current(recording: RunningRecording) -> RunningRecording:
    """A recording of one current with the three whose vector is its analytic signal, and a note of it; else as it is. Its ends
    have none (NaN).

    The vector keeps what modulates the current; what turns backwards in the motor's own is mirrored, and the phases are alike.
    """
    there = [k for k, x in enumerate(recording.currents_a) if np.any(np.nan_to_num(x))]
    if len(there) != 1:
        return recording
    (k,) = there
    own, rows = recording.currents_a[k], np.arange(recording.time_s.size)
    good = np.isfinite(own)
    vector = np.where(good, _analytic(np.interp(rows, rows[good], own[good]), recording.sample_period_s), np.nan)
    u, v, w = (np.real(vector * np.exp(-2j * np.pi / 3 * (j - k))) for j in range(3))
    note = ReadingNote(
        ONE_CURRENT,
        f"one current only, of phase {'uvw'[k]}: the phases are taken for alike. A line at f Hz in it may be the mirror image of one at "
        "twice the supply's frequency less or more f: two or three currents tell",
    )
    return replace(recording, currents_a=(u, v, w), notes=(*recording.notes, note))


def _analytic(x: Signal, period_s: float) -> NDArray[np.complex128]:
    """The signal without its mean, with its Hilbert transform as the imaginary part (a filter of finite length: that of the whole
    signal carries what its ends lack through all of it); NaN where the filter reaches beyond an end."""
    reach = min(round(HILBERT_S / period_s) if period_s > 0.0 else 0, x.size // 4)
    n = np.arange(-reach, reach + 1)
    kernel = np.where(n % 2 == 1, 2.0 / (np.pi * np.where(n == 0, 1, n)), 0.0) * np.kaiser(n.size, HILBERT_KAISER)
    size = x.size + n.size
    turned = np.fft.irfft(np.fft.rfft(x, size) * np.fft.rfft(kernel, size), size)[2 * reach : x.size]
    vector = np.full(x.size, np.nan + 0j)
    inner = slice(reach, x.size - reach)
    vector[inner] = (x - x.mean())[inner] + 1j * turned
    return vector
