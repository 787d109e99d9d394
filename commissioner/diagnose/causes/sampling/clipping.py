"""Current channel at its limit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from commissioner.diagnose.causes.cause import FINE, Cause, Confounder, Entry, Words
from commissioner.diagnose.causes.setting import PHASES, Numbers, Setting, Sizes, listed
from commissioner.diagnose.intake.audit import Audit
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.kernels.kinds import END
from commissioner.diagnose.plant.channel_end import COUNT, reported
from commissioner.diagnose.plant.model import Model, Term

if TYPE_CHECKING:
    from commissioner.diagnose.intake.noise import Noise

NEAR_THE_END, AT_THE_END = 0.985, 0.04
"""Of the largest current reported: from where, and over how much current more, a slope counts as the channel's last."""
LEAST_SLOPE_LOST = 0.25
"""A channel that loses less of its slope than this at the largest current is not straight, yet not at its end."""


class Clipping(Cause):
    """Shares of the slope that each channel loses towards its end. Samples that pile up there are masked by the audit."""

    name = "clipping"
    place = 23
    title = "Current channel at its limit"
    family = "odd"
    sign = 1
    where = frozenset({"limit_a"})
    signature = "samples pile up at one value, or bend towards it: what lies beyond is not reported"
    source = "saturated converter, amplifier or transformer core"
    confounders = (Confounder("sensor_nonlinearity"), Confounder("leakage_saturation"))
    split_by = "reduce the level"
    decides = "Repeat at a lower level or with a larger measuring range."
    words = Words(
        "The current channel was at its limit ({size})",
        FINE,
        measurement="Lower the level or use a larger measuring range.",
    )

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        return tuple(
            Term(self.name, f"end_{PHASES[p]}_{k}", "1", END, p * COUNT + k, 1e-3, 0.0, 1.0)
            for p in range(setting.facts.phases)
            for k in range(COUNT)
        )

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        """Of the channel that bends most, where it comes to the largest current it reports: slope lost, current not reported."""
        ends_a = setting.layout.channel_ends_a
        shares = np.stack([listed(values, f"end_{p}", COUNT) for p in PHASES[: ends_a.size]])
        true_a = np.linspace(0.0, 3.0, 601) * ends_a[:, None]
        seen_a = reported(true_a, shares, ends_a)
        found = []
        for true, seen, end_a in zip(true_a, seen_a, ends_a, strict=True):
            top = int(np.argmax(seen >= min(NEAR_THE_END * end_a, float(seen.max()))))
            beyond = min(top + round(AT_THE_END * end_a / float(true[1])), true.size - 1)
            slope = float((seen[beyond] - seen[top]) / max(float(true[beyond] - true[top]), 1e-12))
            found.append((1.0 - slope, float(end_a), float(true[beyond] - seen[beyond])))
        slope, limit_a, missing_a = max(found)
        return {"limit_a": (limit_a, "A"), "slope_lost": (slope, "1"), "missing_at_limit_a": (missing_a, "A")}

    def is_possible(self, sizes: Sizes, model: Model, setting: Setting) -> bool:
        return sizes["slope_lost"][0] >= LEAST_SLOPE_LOST

    def seen_in(self, audit: Audit, record: Record, noise: Noise, unmarked: float) -> Sizes | None:
        at = audit.clipped
        return {"limit_a": (at["limit_a"], "A"), "samples": (at["samples"], "1")} if at else None

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        return {"size": 0.1, "limit_a": sizes["limit_a"], "shape": "soft" if "slope_lost" in sizes else "hard"}


CAUSE = Clipping()
