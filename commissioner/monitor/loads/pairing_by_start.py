"""How the current channels are wired, from a start: below synchronous speed every machine takes active power, whatever its load does."""

from __future__ import annotations

import numpy as np

from commissioner.monitor.intake.audit import inspect
from commissioner.monitor.intake.channels import Wiring
from commissioner.monitor.intake.columns import sort_by_kind
from commissioner.monitor.intake.states.windows import cut
from commissioner.monitor.signals.supply import space_vector
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import from_nameplate, pull_out_slip, stator_impedance
from commissioner.records import RunningRecording

STARTING = 2.0
"""Of the rated current, that flows as long as a machine is far below synchronous speed."""
LEAST_PERIODS = 2.0
REACH_DEG = 25.0
"""Of the lag between standstill and pull-out; the next order lies 60 degrees away."""


def wired_in(start: RunningRecording, plate: Nameplate) -> Wiring | None:
    """The wiring in which the plate's machine starts; None where this stretch does not tell, or where a start's current, which in large
    machines exceeds the voltage in number, makes columns look exchanged: a sound 55 kW motor was refused as generating, crossed.
    """
    size = np.abs(space_vector(*(np.nan_to_num(x) for x in start.currents_a)))
    large = np.flatnonzero(size > STARTING * np.sqrt(2.0) * plate.rated_current_a)
    if large.size == 0 or (large[-1] - large[0]) * start.sample_period_s < LEAST_PERIODS / plate.rated_frequency_hz:
        return None
    inrush = cut(start, slice(int(large[0]), int(large[-1]) + 1))
    if sort_by_kind(inrush, plate)[1]:
        return None
    circuit, supply = from_nameplate(plate), plate.rated_frequency_rad_per_s
    slips = (1.0, pull_out_slip(circuit, supply))
    expected = float(np.degrees(np.mean([np.angle(stator_impedance(circuit, supply, slip)) for slip in slips])))
    seen = inspect(inrush, plate, circuit, expected)
    return seen.wired if seen.wired and abs(seen.lag_deg - expected) < REACH_DEG else None
