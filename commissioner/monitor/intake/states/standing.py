"""A motor that was switched on and does not come up to speed, by its terminals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from commissioner.monitor.intake.columns import complete
from commissioner.monitor.intake.states.windows import HOPS, levels_of
from commissioner.monitor.signals.supply import phase_voltages
from commissioner.motor import standing
from commissioner.motor.nameplate import Nameplate
from commissioner.records import RunningRecording


def highest_standing_speed(start: RunningRecording, plate: Nameplate) -> float | None:
    """Of the synchronous speed, the highest that a motor reaches which is switched on at the first sample and does not start; None of any other,
    and without voltages."""
    whole, _ = complete(start)
    if whole.voltages_are_line_to_line:
        whole = replace(whole, voltages_v=phase_voltages(*whole.voltages_v), voltages_are_line_to_line=False)
    levels = levels_of(whole, plate)
    if levels is None or levels.vector_a is None or np.ptp(levels.time_s) < standing.LEAST_S:
        return None
    settled = max(round(standing.SETTLED_S / levels.hop_s), HOPS)
    ohm = (levels.vector_a.real * levels.voltage_v / np.maximum(levels.current_a, 1e-9) ** 2)[settled:]
    first, last = float(ohm[:HOPS].mean()), float(ohm[-HOPS:].mean())
    return standing.highest_speed(first, last) if standing.is_standing(first, last) else None
