"""Offset of the current sensors that drifts."""

from __future__ import annotations

import numpy as np

from commissioner.diagnose.causes.cause import FINE, Cause, Confounder, Entry, Procedure, Words
from commissioner.diagnose.causes.sensors.per_phase import weighted
from commissioner.diagnose.causes.setting import PHASES, Numbers, Setting, Sizes
from commissioner.diagnose.intake.record import Facts
from commissioner.diagnose.kernels.kinds import DRIFT
from commissioner.diagnose.plant.model import Model, Term

DRIFTS = {
    "": 1.0,
    "_quarter": (1.0 - np.exp(-4.0)) / 4.0,
    "_sixteenth": (1.0 - np.exp(-16.0)) / 16.0,
    "_swing": 0.0,
    "_turn": 0.0,
}
"""Part of a drift's first slope that is left as its mean slope over the whole recording: evenly, settling, swinging."""


def with_the_inverter_off(facts: Facts) -> Procedure:
    return Procedure(
        (
            "Record the three currents for some seconds with the inverter off, before the test and after it.",
            "What they show is the offset; what changes between the two is the drift. Take it off the currents.",
            "Read the corrected recording:",
        ),
        command="commissioner diagnose corrected.csv --out compared",
    )


class SensorDrift(Cause):
    """Ramp [A/min] per phase, zero at the first sample, two more that settle within the recording (a warming sensor), and a
    swing once to and fro (a door that opens).
    """

    name = "sensor_drift"
    place = 19
    title = "Offset of the current sensors that drifts"
    family = "dc"
    sign = 0
    signature = "a slow ramp of the mean over the whole recording"
    source = "temperature drift of Hall sensors"
    confounders = (
        Confounder("sensor_offset", least_share=3e-3, told_apart_by=with_the_inverter_off),
        Confounder("remanence"),
        # a shaft moves current across the axis
        Confounder("shaft_motion", least_share=3e-3),
    )
    imitates = ("sensor_offset",)
    split_by = "record one second before and after the test with the inverter off"
    decides = "Read the three currents with the inverter off, before the test and after it."
    words = Words(
        "The zero of the current sensors wanders ({size})",
        FINE,
        measurement="Let the sensors warm up; read their zero before and after the test.",
    )

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        return tuple(
            Term(self.name, PHASES[k] + shape, "A/min", DRIFT, k + 3 * m, 1e-3)
            for m, shape in enumerate(DRIFTS)
            for k in range(setting.facts.phases)
        )

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        return {
            f"drift_{p}_a_per_min": (float(sum(share * values.get(p + k, 0.0) for k, share in DRIFTS.items())), "A/min")
            for p in PHASES
            if p in values
        }

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        return weighted(values)


CAUSE = SensorDrift()
