"""Offset of the current sensors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from commissioner.diagnose.causes.cause import FINE, Cause, Confounder, Entry, Form, Words
from commissioner.diagnose.causes.sensors.per_phase import weighted
from commissioner.diagnose.causes.setting import PHASES, Numbers, Setting, Sizes
from commissioner.diagnose.intake.audit import Audit
from commissioner.diagnose.kernels.kinds import OFFSET
from commissioner.diagnose.plant.model import Model, Term

TRUNCATION_SLACK = 0.15


class SensorOffset(Cause):
    """Constant [A] per phase."""

    name = "sensor_offset"
    place = 18
    title = "Offset of the current sensors"
    family = "dc"
    sign = 0
    form = Form.EXACT
    is_common = True
    signature = "a constant, also with the inverter off; the three need not add up to zero"
    source = "data sheets of open-loop Hall sensors: 0.2 to 1 % of range"
    confounders = (Confounder("remanence", least_share=1e-4), Confounder("shaft_motion"))
    split_by = "record one second before the inverter is switched on"
    decides = "Read the three currents with the inverter off: what they show then is the offset."
    words = Words(
        "The current sensors are off zero (by up to {size})",
        FINE,
        "Let the drive calibrate its current sensors at rest, if it can.",
        "Read the three currents with the inverter off, and take that off.",
    )
    advice = "Zero them at the drive if it offers that."

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        return tuple(Term(self.name, PHASES[k], "A", OFFSET, k, 1e-3) for k in range(setting.facts.phases))

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        return {f"offset_{p}_a": (values[p], "A") for p in PHASES if p in values}

    def in_truth(self, values: Sequence[float], audit: Audit) -> tuple[str, Sizes] | None:
        """A converter that cuts off instead of rounding shifts every channel by half a step: that is quantization, no offset."""
        halves = 0.5 * np.array(audit.step_a)
        if len(values) != halves.size or halves.min() <= 0.0:
            return None
        ratio = np.array(values) / halves
        is_cut_off = np.all(np.abs(np.abs(ratio) - 1.0) < TRUNCATION_SLACK) and np.all(ratio * ratio[0] > 0.0)
        return ("quantization", {"step_a": (float(halves.max()) * 2.0, "A")}) if is_cut_off else None

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        return weighted(values)


CAUSE = SensorOffset()
