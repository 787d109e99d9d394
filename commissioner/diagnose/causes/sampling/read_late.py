"""A current that is read after its instant, and the iron loss that shows its instant's voltage: the same to the terminals."""

from __future__ import annotations

from dataclasses import replace

from commissioner.diagnose.kernels.kinds import CABLE, DELAY, IRON_LOSS
from commissioner.diagnose.plant.model import Model, Term

EARLY = Term("sampling_delay", "read_late", "s", DELAY, 0, 1e-6, -1e-3, 0.0)
"""Delay below zero: the current is read after the instant that it is recorded for."""
CONDUCTANCE = Term("iron_loss", "conductance", "S", IRON_LOSS, 0, 1e-4, 0.0, 0.2)
EDGE = Term("iron_loss", "edge", "F", CABLE, 0, 1e-9, 0.0, 1e-3)
"""Charge per volt of a step of the command that a sample at that instant has seen already: conductance times period, all of it."""


def read_late(model: Model) -> Model:
    """The model that begins with a current read so late as makes what its iron loss does."""
    start = max(-model.total(IRON_LOSS) * model.nominal[2], EARLY.lower)
    return model.without(EDGE.effect).with_terms([replace(EARLY, start=start)])


def shown_at_its_instant(model: Model) -> Model:
    """The model that begins with such an iron loss as makes what its current that is read late does."""
    start = min(-model.total(DELAY) / model.nominal[2], CONDUCTANCE.upper)
    return model.without(EARLY.effect).with_terms([replace(CONDUCTANCE, start=start), EDGE])
