"""Is the stretch steady enough, and does it hold enough periods, for waveforms that repeat?"""

from __future__ import annotations

import numpy as np

from commissioner.monitor import periods
from commissioner.monitor.combs import Found
from commissioner.monitor.findings import Finding
from commissioner.monitor.supply import TurningFrame

LARGEST_FREQUENCY_WANDER = 0.004
"""Of the mean, within the stretch analysed: the grid's own drift is ten times smaller."""
LEAST_TURNS = 30
LEAST_LOAD_PERIODS = 8


def frequency_wander(frame: TurningFrame, part: slice) -> Finding:
    """How far the supply frequency moves inside the segment."""
    frequency = frame.supply_rad_per_s[part]
    share = float(np.ptp(frequency) / frequency.mean())
    kind = "refused" if share > LARGEST_FREQUENCY_WANDER else "note"
    return Finding(
        "frequency_wander",
        kind,
        f"the supply frequency moves by {share:.2%} within the quietest stretch: "
        + ("the motor is not in a steady state" if kind == "refused" else "steady"),
        share,
        LARGEST_FREQUENCY_WANDER,
        "record at a steady set point",
    )


def too_little(frame: TurningFrame, part: slice, found: Found) -> Finding | None:
    length = float(np.ptp(frame.time_s[part]))
    if found.shaft is None and not found.loads:
        return Finding(
            "no_period",
            "refused",
            "the currents show neither the shaft nor any periodic load",
            float(found.spectrum.power.max()),
            periods.SIGNIFICANT,
            "record longer, with better sensors, or at a load that turns",
        )
    slowest = min([f.frequency_hz for f in (found.shaft, *found.loads) if f is not None])
    turns = length * slowest
    least = LEAST_TURNS if found.loads == () else LEAST_LOAD_PERIODS
    if turns < least:
        return Finding(
            "too_few_periods",
            "refused",
            f"only {turns:.1f} load periods in {length:.2f} s",
            turns,
            float(least),
            "record 30-60 s at steady load",
        )
    if found.shaft is None:
        return Finding(
            "no_shaft_line",
            "refused",
            "periodic loads are seen but no shaft line: the mean speed is not fixed",
            None,
            None,
            "record longer or with better current sensors; give the rotor slots",
        )
    return None
