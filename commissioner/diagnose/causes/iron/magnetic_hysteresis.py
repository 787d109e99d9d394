"""Hysteresis of the iron."""

from __future__ import annotations

import numpy as np

from commissioner.diagnose.causes.cause import Cause, Confounder, Entry, Words
from commissioner.diagnose.causes.iron.side import split
from commissioner.diagnose.causes.setting import Numbers, Setting, Sizes, listed
from commissioner.diagnose.kernels.kinds import MEMORY, STOP
from commissioner.diagnose.kernels.memory import loop_width
from commissioner.diagnose.plant.model import Model, Term

CARRIED = Term("magnetic_hysteresis", "carried", "1", MEMORY, 0, 1.0, 0.0, 1.0, start=1.0)
"""1: the iron goes into a segment with what it remembers of the one before; 0: it has been demagnetized, or starts anew."""


class MagneticHysteresis(Cause):
    """Extra current sum h_k w_k z_k / r_k, h_k >= 0 [A], z_k memory operators of the iron flux (stops and exponential
    ones) with fixed scales r_k, some of them with a factor w_k that grows with the flux, or falls (`memory.loop_width`).

    `split` as with saturation.
    """

    name = "magnetic_hysteresis"
    place = 6
    title = "Hysteresis of the iron"
    family = "odd"
    sign = 1
    spare = frozenset({STOP})
    where = frozenset({"at_flux_wb"})
    signature = "a loop that does not depend on rate; broad odd lines falling slowly with order"
    source = (
        "stop operators: M. Brokate, J. Sprekels, Hysteresis and Phase Transitions, 1996; exponential: P. R. Dahl, 1968"
    )
    confounders = (Confounder("magnetizing_saturation"), Confounder("dead_time"))
    split_by = "repeat the lowest tone at several amplitudes"
    decides = "Repeat the test of the lowest frequency at half and at a quarter of the level."
    exchanged = (CARRIED,)
    words = Words(
        "The motor's iron has hysteresis ({size} of magnetizing current)",
        "Every iron has some. It costs a little power at low frequency and moves no parameter much.",
        is_normal=True,
    )

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        loops = tuple(
            Term(self.name, f"loop_{k}", "A", STOP, k, 0.01, 0.0, np.inf)
            for k in range(setting.layout.stop_radius_wb.shape[0])
        )
        return (*loops, split(self.name))

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        """Largest current of the memory, and the flux at which it is, of those reached."""
        rates = setting.layout.stop_radius_wb[:, 1]
        fluxes = np.linspace(setting.iron_flux_wb, 0.0, 21)
        currents = np.array([[loop_width(flux, 0.0, rate)[0] for rate in rates] for flux in fluxes]) @ listed(
            values, "loop", rates.size
        )
        widest = int(np.argmax(currents))
        return {"coercive_current_a": (float(currents[widest]), "A"), "at_flux_wb": (float(fluxes[widest]), "Wb")}

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        return {"size": sizes["coercive_current_a"], "shape": "plays"}


CAUSE = MagneticHysteresis()
