"""Capacitance of the motor cable."""

from __future__ import annotations

from commissioner.diagnose.causes.cause import NO_FAULT, Cause, Entry, Words
from commissioner.diagnose.causes.setting import Numbers, Setting, Sizes
from commissioner.diagnose.kernels.kinds import CABLE
from commissioner.diagnose.plant.model import Model, Term

MOST_F = 1e-4
"""Per phase: a hundred times what a kilometre of shielded cable has (0.3 to 1 uF/km, data sheets of motor cables)."""


class CableCapacitance(Cause):
    """C >= 0 [F] per phase to the star point, charged by the step of the command at, before or after the sample."""

    name = "cable_capacitance"
    place = 4
    title = "Capacitance of the motor cable"
    family = "linear"
    sign = 1
    makes_late = True
    signature = "a current that leads the voltage by 90 degrees, growing with frequency; no distortion"
    source = "i_sensor = i + C dv/dt at the inverter-side sensor"
    split_by = "excite lines up to 0.4 of the sampling rate"
    decides = "Repeat one test with a much shorter cable, or add a tone near 0.4 of the sampling rate."
    words = Words(
        "The motor cable draws a current of its own ({size} per phase)",
        f"{NO_FAULT} The drive's sensors see a current that never reaches it.",
        measurement="Usual for long or shielded cables. Measure at the motor's end where it matters.",
    )

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        return tuple(
            Term(self.name, when, "F", CABLE, k, 1e-9, 0.0, MOST_F) for k, when in enumerate(("at", "before", "after"))
        )

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        return {"capacitance_nf": (sum(values.values()) * 1e9, "nF")}

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        return {"size": 1e-9 * sizes["capacitance_nf"]}


CAUSE = CableCapacitance()
