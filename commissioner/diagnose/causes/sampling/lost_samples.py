"""Samples lost without a gap in the time stamps."""

from __future__ import annotations

from typing import TYPE_CHECKING

from commissioner.diagnose.causes.cause import FINE, Cause, Confounder, Entry, Words
from commissioner.diagnose.causes.setting import Numbers, Setting, Sizes
from commissioner.diagnose.intake.audit import Audit
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.plant.model import Model, Term

if TYPE_CHECKING:
    from commissioner.diagnose.intake.noise import Noise


class LostSamples(Cause):
    """Found by a scan over all instants and put right in the data (number of samples), not by a fit."""

    name = "lost_samples"
    place = 26
    title = "Samples lost without a gap in the time stamps"
    family = "drifting"
    sign = 1
    found_by = "mending"
    moves_the_clock = True
    signature = "the delay jumps by whole samples at one instant"
    source = "i(t + n T) after t_0; found by a scan over t_0"
    confounders = (Confounder("clock_drift"),)
    split_by = "number the samples in the logger"
    decides = "Let the logger number its samples."
    words = Words("Samples were lost ({size} of them)", FINE, measurement="Check the logger's connection.")

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        return ()

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        return {}

    def seen_in(self, audit: Audit, record: Record, noise: Noise, unmarked: float) -> Sizes | None:
        if not audit.holes and not unmarked:
            return None
        marked = sum(h[2] for h in audit.holes)
        return {"samples": (float(marked + unmarked), "1"), "without_gap_in_time": (float(unmarked), "1")}

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        return {"size": sizes["samples"]}


CAUSE = LostSamples()
