"""Second-harmonic tensors over the axes of the motor, and the test that tells them from one another."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from commissioner.diagnose.causes.cause import READ_BOTH, SAME, Entry, Procedure
from commissioner.diagnose.intake.record import Facts


def on_other_axes(facts: Facts) -> Procedure:
    return Procedure(
        (
            f"Record the same test on the axes 60 and 120 degrees too, then on the first axis once more. {SAME}",
            READ_BOTH,
        ),
        changes_values="Perhaps by the difference between the axes, mostly below 1 %.",
    )


def tilt(values: Mapping[str, float], part: str) -> complex:
    """A tensor as a complex number."""
    return complex(values.get(f"{part}_cos", 0.0), values.get(f"{part}_sin", 0.0))


def larger(one: complex, other: complex, shapes: tuple[str, str]) -> Entry:
    """The larger of two tensors as size and direction."""
    most, shape = (other, shapes[1]) if abs(other) > abs(one) else (one, shapes[0])
    return {"size": abs(most), "angle_deg": float(np.degrees(np.angle(most)) / 2.0) % 180.0, "shape": shape}
