"""Columns before phases: a third one that follows from two, and currents and voltages under each other's names."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from commissioner.monitor.channels import Entry
from commissioner.motor.nameplate import Nameplate
from commissioner.records import RunningRecording, Signal


def complete(recording: RunningRecording) -> tuple[RunningRecording, list[Entry]]:
    """A recording of two currents, or of two line-to-line voltages, with the third as minus their sum; else as it is.

    Without a neutral the three sum to zero. A phase voltage's missing third is not known: the star point may move.
    """
    entries: list[Entry] = []
    groups = [list(recording.currents_a), list(recording.voltages_v)]
    for group, kind in zip(groups, ("current", "voltage"), strict=True):
        absent = [k for k, signal in enumerate(group) if not np.any(np.nan_to_num(signal))]
        if len(absent) != 1 or (kind == "voltage" and not recording.voltages_are_line_to_line):
            continue
        k = absent[0]
        group[k] = -(group[k - 1] + group[k - 2])
        name = f"third_{kind}"
        entries.append(
            (
                name,
                "corrected",
                f"one {kind} was not recorded: taken as minus the sum of the other two",
                k + 1,
                3,
                f"record all three {kind}s",
            )
        )
    i, v = groups
    return replace(recording, currents_a=(i[0], i[1], i[2]), voltages_v=(v[0], v[1], v[2])), entries


def sort_by_kind(
    currents: list[Signal], voltages: list[Signal], plate: Nameplate
) -> tuple[list[Signal], list[Signal], list[Entry]]:
    """Currents and voltages by their size where a column of one kind holds the other; as given where that is not clear.

    Clear: exactly three channels between 0.2 and 2.5 times the rated voltage of a phase, the rest at most twice the rated
    current, and these two ranges apart by a factor of two.
    """
    rms = np.array([float(np.std(signal)) for signal in (*currents, *voltages)])
    phase_v = plate.rated_voltage_v / np.sqrt(3.0)
    largest_current, least_voltage = 2.0 * plate.rated_current_a, 0.2 * phase_v
    is_voltage = (rms > least_voltage) & (rms < 2.5 * phase_v)
    clear = least_voltage > 2 * largest_current and is_voltage.sum() == 3 and np.all(rms[~is_voltage] < largest_current)
    wrong_i, wrong_v = np.flatnonzero(is_voltage[:3]), np.flatnonzero(~is_voltage[3:])
    if not clear or wrong_i.size == 0:
        return currents, voltages, []
    new_i, new_v = list(currents), list(voltages)
    for i, v in zip(wrong_i, wrong_v, strict=True):
        new_i[i], new_v[v] = voltages[v], currents[i]
    names = ", ".join(f"current {'uvw'[i]} and voltage {'uvw'[v]}" for i, v in zip(wrong_i, wrong_v, strict=True))
    entry: Entry = (
        "crossed_channels",
        "corrected",
        f"columns of currents and voltages are exchanged: {names}",
        names,
        "currents and voltages in their own columns",
        "correct the column names",
    )
    return new_i, new_v, [entry]
