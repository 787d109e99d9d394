"""What one segment leaves to the next of its file: rotor flux, and the path of the iron's flux that it remembers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.kernels.memory import at_rest, replayed
from commissioner.diagnose.plant.initial_state import per_ampere
from commissioner.diagnose.plant.model import Layout, Model
from commissioner.diagnose.plant.prediction import predict

Array = NDArray[np.float64]
PATH_STEPS, MOST_OF_THE_PATH = 6000, 20_000
"""Points of a segment, and of all before one, at which the iron's flux is kept for what it remembers."""


def with_flux_before(record: Record, model: Model, layout: Layout) -> Record:
    """Every segment told the rotor flux at which the one before it ended (same file), above what the iron keeps, and the iron's
    flux since the file's first, by the model, one after the other.
    """
    before, path, file = np.zeros(2), np.zeros((2, 1)), -1
    for k, segment in enumerate(record.segments):
        inherits = segment.file == file and segment.starts_at_rest
        if not inherits:
            before, path = np.zeros(2), np.zeros((2, 1))
        told = replace(
            segment, flux_before_wb=(float(before[0]), float(before[1])), iron_before_wb=path if inherits else None
        )
        record = replace(record, segments=(*record.segments[:k], told, *record.segments[k + 1 :]))
        seen = predict(model, record, k, layout)
        steps = np.r_[0 : segment.count : max(segment.count // PATH_STEPS, 1), segment.count - 1]
        path = np.hstack([path, seen.iron_flux_wb[:, steps]])[:, -MOST_OF_THE_PATH:]
        kept = _kept_flux(model, layout, path)
        path = np.hstack([path, kept[:, None]])
        before, file = np.array(seen.last_rotor_flux_wb) - kept, segment.file
    return record


def _kept_flux(model: Model, layout: Layout, path: Array) -> Array:
    """(2,) flux that the iron's memory keeps up once all currents have decayed, after this path of its flux (2, m)."""
    radius = np.ascontiguousarray(layout.stop_radius_wb[:, 0])
    stiffness = model.sum_kind(kinds.STOP, radius.size) * per_ampere(layout.stop_radius_wb)
    if not model.total(kinds.MEMORY) or not stiffness.any():
        return np.zeros(2)
    return np.array(at_rest(path[0, -1], path[1, -1], replayed(path, radius), stiffness, radius, model.nominal[3]))
