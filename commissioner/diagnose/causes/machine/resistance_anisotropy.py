"""Resistance that depends on the axis."""

from __future__ import annotations

import numpy as np

from commissioner.diagnose.causes.cause import Cause, Confounder, Entry, Words
from commissioner.diagnose.causes.machine.axes import larger, on_other_axes, tilt
from commissioner.diagnose.causes.setting import Numbers, Setting, Sizes
from commissioner.diagnose.kernels.kinds import PHASE_RESISTANCE, ROTOR_ANISOTROPY
from commissioner.diagnose.plant.model import Model, Term


class ResistanceAnisotropy(Cause):
    """Relative second-harmonic tensors of R_s (phase resistances) and R_R; needs at least two axes."""

    name = "resistance_anisotropy"
    place = 13
    title = "Resistance that depends on the axis"
    family = "axis"
    sign = 0
    signature = (
        "resistance differs between phases (joint, winding) or rotor directions (broken bar); excited lines only"
    )
    source = "R_x = R_s (1 + c cos 2 theta_x + s sin 2 theta_x); rotor: same tensor on R_R"
    confounders = (Confounder("inductance_anisotropy", least_share=2e-3, told_apart_by=on_other_axes),)
    split_by = "three or more axes, first axis repeated"
    decides = "Record the axes 0, 60 and 120 degrees, and the first of them again; compare with an ohmmeter."
    words = Words(
        "The resistance differs between the directions of the motor ({size})",
        "A loose terminal, an unequal winding or a broken rotor bar does this.",
        measurement="Tighten the terminals, then compare the three windings with an ohmmeter.",
    )

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        if setting.axes < 2:
            return ()
        stator = tuple(
            Term(
                self.name, f"stator_{n}", "1", PHASE_RESISTANCE, setting.record.channel(f"phase_{n}_u"), 0.01, -0.5, 0.5
            )
            for n in ("cos", "sin")
        )
        rotor = tuple(
            Term(self.name, f"rotor_{n}", "1", ROTOR_ANISOTROPY, c, 0.01, -0.5, 0.5)
            for c, n in enumerate(("cos", "sin"))
        )
        return stator + rotor

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        return {
            f"{p}_anisotropy": (float(np.hypot(values.get(f"{p}_cos", 0.0), values.get(f"{p}_sin", 0.0))), "1")
            for p in ("stator", "rotor")
            if f"{p}_cos" in values
        }

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        """Phase resistances that differ by 2 e over direction make a tensor of half that."""
        return larger(0.5 * tilt(values, "stator"), tilt(values, "rotor"), ("phases", "cage"))


CAUSE = ResistanceAnisotropy()
