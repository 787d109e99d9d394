"""What the losses of a leg share, whatever makes them: numbers, sizes, what no such loss can be, and the two names as one."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from commissioner.diagnose.causes.cause import NO_FAULT, SAME, AsOne, Cause, Entry, Form, Procedure, Words
from commissioner.diagnose.causes.setting import Numbers, Setting, Sizes, listed, spline_value
from commissioner.diagnose.intake.record import Facts
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.model import Layout, Model, Term

MOST_UNEQUAL = 4.0
"""Of the mean of the three legs, by which one may differ: what a compensation leaves may have another sign in one of them."""
LATEST_KNEE, LATEST_KNEE_OF_RATED, LATEST_KNEE_AT_SMALL_CURRENT = 0.2, 0.15, 0.6
"""Of the largest current, by which a leg has lost half of its voltage; or, up to that part of the largest, of the rated peak: there the
switching's ripple ends in a test at small currents."""
HALF = 0.5
HARMLESS = (
    f"{NO_FAULT} At low speed the torque ripples a little and a stator resistance measured through this inverter can "
    "come out wrong; at higher speed it hardly matters."
)
COMPENSATE = (
    "Switch the drive's dead-time compensation on if it has one, and record again: this error must become smaller."
)


class LegLoss(Cause):
    """A voltage that every leg loses with the sign of its own current, a free curve over it; the legs' shares of it are numbers where
    several axes are recorded: along one a free curve takes what they do.
    """

    family = "odd"
    sign = 1
    form = Form.SHAPED
    split_by = "repeat one segment at half the switching frequency or another link voltage"
    decides = "Repeat one test at half the switching frequency."
    advice = "Normal for an inverter. The identification takes it off; nothing to do."
    half_over_knee = 1.0
    """Of the simulator's curve."""

    def numbers(self, kind: int, setting: Setting) -> tuple[Term, ...]:
        count = setting.layout.legs_vectors.shape[0]
        shares = tuple(
            Term(self.name, f"unequal_{leg}", "1", kinds.LEG_SHARE, k, 0.01, -MOST_UNEQUAL, MOST_UNEQUAL)
            for k, leg in ((1, "v"), (2, "w"))
            if setting.axes > 1
        )
        return (*(Term(self.name, f"leg_{k}", "V", kind, k, 0.1, 0.0, np.inf) for k in range(count)), *shares)

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        layout = setting.layout
        weights = listed(values, "leg", layout.legs_vectors.shape[0])
        top = spline_value(layout.legs_vectors, weights, layout.legs_top, layout.legs_top)
        grid = np.linspace(0.0, layout.legs_top, 200)
        curve = np.array([spline_value(layout.legs_vectors, weights, layout.legs_top, y) for y in grid])
        reached = np.flatnonzero(curve >= 0.5 * top) if top > 0 else np.array([0])
        half = float(layout.legs_knee_a * np.sinh(grid[reached[0]])) if reached.size else 0.0
        unequal = {k: (values[k], "1") for k in ("unequal_v", "unequal_w") if values.get(k)}
        return {"voltage_v": (top, "V"), "half_current_a": (half, "A"), **unequal}

    def is_possible(self, sizes: Sizes, model: Model, setting: Setting) -> bool:
        """At half its height before a fifth of the largest current, or where the switching's ripple ends in a test at small currents."""
        peak, rated_peak = setting.facts.current_peak_a, setting.facts.rated_current_peak_a
        latest = max(LATEST_KNEE * peak, min(LATEST_KNEE_OF_RATED * rated_peak, LATEST_KNEE_AT_SMALL_CURRENT * peak))
        return sizes["half_current_a"][0] < latest

    def unknown_form(self, model: Model, layout: Layout) -> Mapping[str, float]:
        return {"voltage_v": tail_of_legs(model, layout)[0]}

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        return {"size": sizes["voltage_v"], "knee_a": max(sizes["half_current_a"], 1e-6) / self.half_over_knee}


def lost_by_a_leg(model: Model, layout: Layout, share: float) -> float:
    """V, at a share of the range of currents on which its loss may bend."""
    count = layout.legs_vectors.shape[0]
    weights = model.sum_kind(kinds.LEGS, count) + model.sum_kind(kinds.LEGS_LINK, count)
    at = float(np.arcsinh(share * np.sinh(layout.legs_top)))
    return spline_value(layout.legs_vectors, weights, layout.legs_top, at)


def tail_of_legs(model: Model, layout: Layout) -> tuple[float, float]:
    """Half of what a leg's loss rises by over the upper half of the currents at which it may bend, V, and the resistance, ohm, that this
    looks like: a law that goes on rising beyond cannot be told from R_s, and its form is nobody's knowledge.
    """
    rise = 0.5 * max(lost_by_a_leg(model, layout, 1.0) - lost_by_a_leg(model, layout, 0.5), 0.0)
    return rise, rise / (0.5 * float(np.sinh(layout.legs_top)) * layout.legs_knee_a)


def at_half_the_frequency(facts: Facts) -> Procedure:
    now = facts.switching_frequency_hz
    half = f"from {now:g} to {HALF * now:g} Hz" if now else "to half"
    written = f"{HALF * now:g}" if now else "the new value in Hz"
    return Procedure(
        (
            f"Set the drive's switching (carrier) frequency {half}. If it cannot be set, change the DC-link voltage by a fifth instead.",
            f"Record one of the tests again. {SAME}",
            f"Each file must say its own at the top: the new one `# switching_frequency_hz: {written}` (or `# dc_link_v: ...`).",
            "Set the drive back.",
            "Read both recordings together:",
        ),
        changes_values="No. It only splits the voltage between dead time and device drop; worth it if you want to set "
        "the drive's dead-time compensation by number.",
    )


BOTH = AsOne(
    Words(
        "The inverter loses {size} per leg (dead time and device drop together)",
        HARMLESS,
        COMPENSATE,
        is_normal=True,
        called="dead time + device drop, together",
    ),
    {
        "voltage_v": "lost per leg",
        "half_current_a": "half of it reached at",
        "unequal_v": "leg V against the mean of the three",
        "unequal_w": "leg W against the mean of the three",
    },
)
"""Every inverter has both, and both do the same at one switching frequency and link voltage."""
