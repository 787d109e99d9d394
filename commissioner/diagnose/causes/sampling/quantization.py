"""Coarse steps of the converter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from commissioner.diagnose.causes.cause import FINE, Cause, Entry, Words
from commissioner.diagnose.causes.setting import Numbers, Setting, Sizes
from commissioner.diagnose.intake.audit import Audit
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.plant.model import Model, Term

if TYPE_CHECKING:
    from commissioner.diagnose.intake.noise import Noise

COARSE_STEP_SHARE, COARSE_STEP_NOISE = 0.0018, 0.1
"""Named as a cause: steps beyond a share of the rated peak current (12 bits over 3.7 times that, either way) that make a hundredth of the
noise power.
"""


class Quantization(Cause):
    """Found in the audit (step [A]), not by a fit: it has no waveform of its own."""

    name = "quantization"
    place = 22
    title = "Coarse steps of the converter"
    family = "noise"
    sign = 1
    found_by = "audit"
    signature = "currents lie on a grid; flat noise of step / sqrt(12), independent of level"
    source = "B. Widrow, I. Kollar, Quantization Noise, 2008"
    split_by = "look at the histogram"
    decides = "Repeat with a smaller measuring range."
    words = Words("The currents come in coarse steps ({size})", FINE, measurement="Use a smaller measuring range.")

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        return ()

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        return {}

    def seen_in(self, audit: Audit, record: Record, noise: Noise, unmarked: float) -> Sizes | None:
        step = max(audit.step_a, default=0.0)
        is_coarse = step > COARSE_STEP_SHARE * record.facts.rated_current_peak_a
        return (
            {"step_a": (step, "A")} if is_coarse and step / np.sqrt(12.0) > COARSE_STEP_NOISE * noise.floor_a else None
        )

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        return {"size": sizes["step_a"]}


CAUSE = Quantization()
