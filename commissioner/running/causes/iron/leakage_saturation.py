"""The leakage paths saturate at starting current: less leakage inductance, more starting current."""

from __future__ import annotations

from commissioner.estimation.numbers import Scales
from commissioner.running.causes.cause import Cause, Confounder, Form, Sizes, Values

LEAST_KNEE = 1.5
"""Of rated current: a leakage that saturates below is a main flux' curve, or noise (two healthy motors of 200, at 0.6 and 1.1)."""


def _sizes(v: Values, _: Scales) -> Sizes:
    softness = v["leakage_softness"] + v["rotor_leakage_softness"]
    knee = v["leakage_knee"] ** 2
    q = 36.0 / (knee + 36.0)
    return {
        "lost_at_six_times_rated": (1.0 - 1.0 / (1.0 + softness * q * (1.0 + v["leakage_bend"] * q)), ""),
        "knee_of_rated_current": (v["leakage_knee"], ""),
    }


CAUSE = Cause(
    name="leakage_saturation",
    title="Saturation of the leakage",
    says="At starting current {size} of the leakage inductance is lost",
    meaning="Normal for closed or semi-closed slots. Starting current is higher than a constant leakage predicts.",
    remedy="Use the leakage of the working current for control, that of the start for protection settings.",
    physics="i = (psi_s - psi_R) / L_sigma + (d / L_sigma) psi_l q (1 + b q), q = z / (1 + z), z = (psi_l / (L_sigma k I_rated))^2; d, b, k are fitted; "
    "psi_l = psi_s - psi_R (stator), or psi_s - psi_R (1 + L_sigma / L_M), which is in proportion to the rotor current (rotor)",
    signature="start, strongest in the first cycles; nothing at working currents",
    source="Lipo, Consoli, IEEE Trans. Ind. Appl. 20(1), 1984 (leakage path saturation); limits in the manual's chapter `running`",
    forms=(
        Form("stator", ("leakage_softness",), ("leakage_knee", "leakage_bend")),
        Form("rotor", ("rotor_leakage_softness",), ("leakage_knee", "leakage_bend")),
    ),
    sizes=_sizes,
    range=(0.0, 0.8),
    allows=lambda v, _: v["leakage_softness"] == v["rotor_leakage_softness"] == 0.0 or v["leakage_knee"] >= LEAST_KNEE,
    confounders=(Confounder("speed_sensor_lag", "a start and load steps"), Confounder("rotor_skin_effect", "a start")),
    scenario=lambda v, s: {"size": _sizes(v, s)["lost_at_six_times_rated"][0]},
)
