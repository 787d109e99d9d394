"""Sizes of sensors that differ, as a scenario of the simulated inverter states them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from commissioner.diagnose.causes.cause import Entry
from commissioner.diagnose.causes.setting import PHASES


def weighted(values: Mapping[str, float], *, about_their_mean: bool = False) -> Entry:
    """Largest of the three phases as the size, each phase's share as its weight."""
    per_phase = np.array([values.get(p, 0.0) for p in PHASES])
    per_phase = per_phase - (per_phase.mean() if about_their_mean else 0.0)
    largest = float(np.abs(per_phase).max()) or 1.0
    return {"size": largest, **{f"weight_{p}": float(x) / largest for p, x in zip(PHASES, per_phase, strict=True)}}
