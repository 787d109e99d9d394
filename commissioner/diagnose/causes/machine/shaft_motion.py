"""Shaft that moves during the test."""

from __future__ import annotations

import itertools

import numpy as np

from commissioner.diagnose.causes.cause import Cause, Confounder, Entry, Words
from commissioner.diagnose.causes.regressors import FINE_SPEED_SPLINE, SPEED_SPLINE
from commissioner.diagnose.causes.setting import Numbers, Setting, Sizes
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.kernels.kinds import CARRY, OMEGA
from commissioner.diagnose.plant.model import Model, Term


class ShaftMotion(Cause):
    """Electrical speed [rad/s] as a cubic spline over time, a knot every 0.4 s of each segment, or closer where the record has such
    splines; and where in the pause before a segment it carried the flux left from the segment before that.
    """

    name = "shaft_motion"
    place = 11
    title = "Shaft that moves during the test"
    family = "cross"
    sign = 0
    course = SPEED_SPLINE
    signature = "current in the axis that gets no voltage, proportional to the rotor flux"
    source = "d psi_R/dt = ... + omega J psi_R (electrical speed); W. Leonhard, Control of Electrical Drives, ch. 10"
    # a shaft that turns in the pause carries the flux elsewhere
    confounders = (Confounder("remanence", least_share=0.02),)
    split_by = "block the shaft"
    decides = "Block the shaft and repeat one test."
    words = Words(
        "The shaft moved during the test ({size})",
        "The values of a shaft that moves are not those of one at rest.",
        measurement="Block the shaft and record again.",
    )

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        record = setting.record
        speed = tuple(
            Term(self.name, f"{n}_{s.uid}", "rad/s", OMEGA, record.channel(n), 0.1, segment=s.uid, channel=n)
            for s in record.segments
            for n in _speed_splines(record)
        )
        carried = tuple(
            Term(self.name, f"{name}_{s.uid}", "1", CARRY, k, 0.01, -2.0, 2.0, segment=s.uid)
            for before, s in itertools.pairwise(record.segments)
            if before.file == s.file and s.starts_at_rest
            for k, name in enumerate(("along", "across"))
        )
        return (*speed, *carried)

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        """Root mean square over the time in which the command would show it: without flux a speed leaves no trace."""
        record = setting.record
        power, weight = 0.0, 0.0
        for k, segment in enumerate(record.segments):
            for name, value in values.items():
                spline, _, uid = name.rpartition("_")
                if uid == str(segment.uid) and spline.startswith(SPEED_SPLINE):
                    mine = record.shown(k, record.channel(spline))
                    power, weight = power + mine * value**2, weight + mine
        return {"speed_rad_per_s": (float(np.sqrt(power / weight)) if weight else 0.0, "rad/s")}

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        return {"size": sizes["speed_rad_per_s"]}


def _speed_splines(record: Record) -> list[str]:
    """Channels that a speed is made of: the finest there are."""
    splines = [n for n in record.channel_names if n.startswith(SPEED_SPLINE)]
    return [n for n in splines if n.startswith(FINE_SPEED_SPLINE)] or splines


CAUSE = ShaftMotion()
