"""Current sensors of unequal gain."""

from __future__ import annotations

from commissioner.diagnose.causes.cause import FINE, Cause, Confounder, Entry, Form, Words
from commissioner.diagnose.causes.machine.axes import on_other_axes
from commissioner.diagnose.causes.sensors.per_phase import weighted
from commissioner.diagnose.causes.setting import PHASES, Numbers, Setting, Sizes
from commissioner.diagnose.kernels.kinds import GAIN
from commissioner.diagnose.plant.model import Model, Term


class SensorGainMismatch(Cause):
    """Relative gain of v (and w) against u."""

    name = "sensor_gain_mismatch"
    place = 20
    title = "Current sensors of unequal gain"
    family = "axis"
    sign = 0
    form = Form.EXACT
    signature = "currents that do not add up to zero in proportion to the signal; R and L differ alike with the axis"
    source = "gain tolerance 0.5 to 2 %; the common gain is not visible from terminals"
    confounders = (
        Confounder("inductance_anisotropy", fewest_axes=3, told_apart_by=on_other_axes),
        Confounder("resistance_anisotropy", told_apart_by=on_other_axes),
        Confounder("stator_heating"),
        Confounder("rotor_heating"),
    )
    split_by = "three sensors, three or more axes"
    decides = "Send one current through all three sensors in series, or record the axes 0, 60 and 120 degrees."
    words = Words(
        "The current sensors differ in gain (by up to {size})",
        FINE,
        measurement="Send one current through all three sensors in series and calibrate them against each other.",
    )
    advice = "Values change with the axis. Beyond 1 %: have the sensors compared."

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        return tuple(Term(self.name, PHASES[k], "1", GAIN, k, 1e-3, -0.5, 0.5) for k in range(1, setting.facts.phases))

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        return {f"gain_{p}_over_u": (values[p], "1") for p in PHASES if p in values}

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        return weighted(values, about_their_mean=True)


CAUSE = SensorGainMismatch()
