"""Current sensors that are not straight."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import numpy as np

from commissioner.diagnose.causes.cause import FINE, Cause, Confounder, Entry, Proposal, Standing, Words
from commissioner.diagnose.causes.sensors.sensor_gain_mismatch import CAUSE as GAINS
from commissioner.diagnose.causes.setting import PHASES, Numbers, Setting, Sizes
from commissioner.diagnose.kernels.kinds import EVEN, ODD
from commissioner.diagnose.plant import sensor_curve
from commissioner.diagnose.plant.model import Model, Term

BENDS = ("", *(f"_bend_{k}" for k in range(1, sensor_curve.COUNT)))
"""Of the names of a sensor curve's numbers: its polynomial, and bends that settle."""
SIM_RANGE = 1.5
"""The simulator's sensor range over what is called full scale here."""


class SensorNonlinearity(Cause):
    """n2 and n3 of each sensor, relative to full scale; or these and bends that settle (`sensor_curve`)."""

    name = "sensor_nonlinearity"
    place = 21
    title = "Current sensors that are not straight"
    family = "even"
    sign = 0
    signature = "even or odd lines that no impedance has filtered, in each sensor by its own current"
    source = "reported = i (1 + n2 i/I_fs + n3 (i/I_fs)^2 + ...), I_fs twice the rated peak; linearity figures of data sheets"
    confounders = (Confounder("dead_time"), Confounder("dc_link_sag"), Confounder("leakage_saturation"))
    imitates = (GAINS.name,)
    split_by = "DC staircase"
    decides = "Compare the sensors with a good meter at five DC currents of both signs."
    either = tuple(
        tuple(f"{part}_{p}{bend}" for part in ("even", "odd") for bend in bends for p in PHASES)
        for bends in (BENDS[:1], BENDS)
    )
    words = Words(
        "The current sensors are not straight ({size} at full scale)",
        FINE,
        measurement="Check that the sensors' range suits the current; compare with a good meter.",
    )

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        return tuple(
            Term(self.name, f"{part}_{PHASES[k]}{bend}", "1", kind, k + 3 * m, 1e-3)
            for part, kind in (("even", EVEN), ("odd", ODD))
            for m, bend in enumerate(BENDS)
            for k in range(setting.facts.phases)
        )

    def occasion(self, accepted: Sequence[Cause], names: Collection[str]) -> frozenset[str] | None:
        return frozenset({self.name}) if self in accepted and GAINS not in accepted and GAINS.name in names else None

    def proposals(self, here: Standing) -> Iterable[tuple[Proposal, ...]]:
        """Unlike gains, straight, where the numbers of a bend are not worth what they gain beside them: all sensors' together bend as gains differ."""
        model = here.model.without(self.name).with_terms(GAINS.terms(here.setting))
        yield (
            Proposal(
                model, (self.name,), (GAINS.name,), here.saved_chi2(model), f"{GAINS.name} in place of {self.name}"
            ),
        )

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        """Mean of the sensors, at full scale of the square and the cubic that err as much as theirs do at the largest current reported."""
        peak = setting.layout.channel_ends_a / setting.layout.nonlinearity_scale_a
        out: Sizes = {}
        for part, of, order in (("even", sensor_curve.even, 1), ("odd", sensor_curve.odd, 2)):
            errors = of(peak)[0] / peak**order
            weights = [[values.get(f"{part}_{p}{bend}", 0.0) for p in PHASES[: peak.size]] for bend in BENDS]
            seen = np.array([f"{part}_{p}" in values for p in PHASES[: peak.size]])
            mean = float((np.array(weights) * errors).sum(axis=0)[seen].mean()) if seen.any() else 0.0
            out = {**out, f"{part}_at_full_scale": (mean, "1")}
        return out

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        odd, even = sizes["odd_at_full_scale"] * SIM_RANGE**2, sizes["even_at_full_scale"] * SIM_RANGE
        return {"size": odd, "shape": "cubic", "even": even}


CAUSE = SensorNonlinearity()
