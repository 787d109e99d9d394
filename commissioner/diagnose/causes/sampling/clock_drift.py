"""Current and voltage clocks that run apart."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from commissioner.diagnose.causes.cause import FINE, Cause, Confounder, Entry, Words
from commissioner.diagnose.causes.setting import Numbers, Setting, Sizes
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.kernels.kinds import CLOCK
from commissioner.diagnose.plant.model import Model, Term
from commissioner.diagnose.plant.sampling import clock_courses

RESTARTS, RUNS_ON = ("drift", "wander_cos", "wander_sin"), ("running",)
"""A clock that is set anew with every segment, and one that is not."""
RATES = RESTARTS + RUNS_ON
LEAST_INCONSTANT = 0.15
"""Of what an even drift's delay has that no constant one makes (0.05 to 0.25 of its power): lags and conductances that pass for a clock
have 0.04 to 0.09 of it in whole recordings, clocks 0.9 and more.
"""


class ClockDrift(Cause):
    """eps [ppm] from the start of each segment, and a rate that wanders; or from the start of the recording: a clock that runs
    on while the next segment is prepared.
    """

    name = "clock_drift"
    place = 25
    title = "Current and voltage clocks that run apart"
    family = "drifting"
    sign = 0
    moves_the_clock = True
    either = (RESTARTS, RUNS_ON)
    signature = "a delay that grows with time within the segment, or over the whole recording"
    source = "i(t - eps t), eps in ppm; crystal tolerance"
    confounders = (Confounder("stator_heating"),)
    split_by = "a longer segment"
    decides = "Record current and voltage with one instrument, or make one test ten times as long."
    words = Words(
        "The clocks of current and voltage run apart ({size})", FINE, measurement="Record both with one instrument."
    )

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        symbols = RESTARTS + (RUNS_ON if setting.spans_segments else ())
        return tuple(Term(self.name, symbol, "ppm", CLOCK, k, 0.01, -2e4, 2e4) for k, symbol in enumerate(symbols))

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        wander = float(np.hypot(values.get("wander_cos", 0.0), values.get("wander_sin", 0.0)))
        drift = values.get("drift", 0.0) + values.get("running", 0.0)
        sizes = {"drift_ppm": (drift, "ppm"), "wander_ppm": (wander, "ppm")}
        return sizes if abs(drift) >= wander else dict(reversed(sizes.items()))

    def is_possible(self, sizes: Sizes, model: Model, setting: Setting) -> bool:
        """Its delay grows: one that jumps to a value in each segment and stays there is a delay in disguise."""
        return not _is_a_delay(model.of(self.name), setting.record)

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        wander = values.get("wander_sin", 0.0)
        if abs(wander) > abs(sizes["drift_ppm"]):
            return {"size": -wander, "shape": "wandering"}
        runs_on = abs(values.get("running", 0.0)) > abs(values.get("drift", 0.0))
        return {"size": -sizes["drift_ppm"], "runs_on": float(runs_on)}


def _is_a_delay(rates: Mapping[str, float], record: Record) -> bool:
    """Whether a clock only makes currents late alike (or early, as a conductance does), beside what a drift would show."""
    return 1.0 - constancy(rates, record) < LEAST_INCONSTANT * (1.0 - constancy({"drift": 1.0}, record))


def constancy(rates: Mapping[str, float], record: Record) -> float:
    """Share of what a clock's delay does that a constant one would do as well, each instant weighed by how fast the command moves."""
    mean = square = weight = 0.0
    for segment in record.segments:
        delay = np.array([rates.get(n, 0.0) for n in RATES]) @ clock_courses(segment)
        moves = np.gradient(segment.voltage_axis_v) ** 2
        mean, square, weight = (
            total + float(x) for total, x in ((mean, moves @ delay), (square, moves @ delay**2), (weight, moves.sum()))
        )
    return float(mean**2 / (square * weight)) if square * weight > 0.0 else 0.0


CAUSE = ClockDrift()
