"""Inductance that depends on the axis."""

from __future__ import annotations

import numpy as np

from commissioner.diagnose.causes.cause import Cause, Confounder, Entry, Words
from commissioner.diagnose.causes.machine.axes import larger, tilt
from commissioner.diagnose.causes.setting import Numbers, Setting, Sizes
from commissioner.diagnose.kernels.kinds import ANISOTROPY_SPLIT, LEAKAGE_ANISOTROPY, MAGNETIZING_ANISOTROPY
from commissioner.diagnose.plant.model import Model, Term


class InductanceAnisotropy(Cause):
    """1/L_sigma times (1 + [c s; s -c]), and the same for 1/L_M; needs at least two axes.

    R_R tilts with the two: K = L_m / (L_m + L_rl) turns the T circuit into this one, R_R = K^2 R_r, so that with the share
    y = 0.5 + split of the leakage on the rotor's side its tilt is 2 y x / (1 + x) (leakage - magnetizing), x = L_sigma / L_M.
    """

    name = "inductance_anisotropy"
    place = 12
    title = "Inductance that depends on the axis"
    family = "axis"
    sign = 0
    signature = "leakage differs with the axis angle (period 180 degrees) and couples the axes; no distortion"
    source = "second-harmonic tensor of eccentricity and slotting: M. Linke, R. Kennel, J. Holtz, IEEE IECON 2003"
    confounders = (Confounder("shaft_motion"),)
    split_by = "three or more axes"
    decides = "Record the axes 0, 60 and 120 degrees, and the first of them again."
    words = Words(
        "The inductance differs with the direction in the motor ({size})",
        "A few per cent are built in (slots, winding). A change against an older recording can mean a rotor or bearing fault.",
        measurement="Keep this recording to compare with later.",
    )

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        if setting.axes < 2:
            return ()
        tilts = tuple(
            Term(self.name, f"{part}_{name}", "1", kind, c, 0.01, -0.5, 0.5)
            for part, kind in (("leakage", LEAKAGE_ANISOTROPY), ("magnetizing", MAGNETIZING_ANISOTROPY))
            for c, name in enumerate(("cos", "sin"))
        )
        return (*tilts, Term(self.name, "split", "1", ANISOTROPY_SPLIT, 0, 0.1, -0.5, 0.5))

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        parts = {p: [values.get(f"{p}_{c}", 0.0) for c in ("cos", "sin")] for p in ("leakage", "magnetizing")}
        return {
            f"{p}_anisotropy": (float(np.linalg.norm(pair)), "1")
            for p, pair in parts.items()
            if any(pair) or p == "leakage"
        }

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        """The Gamma circuit's tensors of 1/L_leak and 1/L_s that tilt 1/L_sigma and 1/L_M as found."""
        leakage, main = tilt(values, "leakage"), tilt(values, "magnetizing")
        ratio = model.nominal[2] / model.nominal[3]
        both = ratio / (1.0 + ratio) * (leakage - main)
        return larger(leakage + both, main + both, ("leakage", "main"))


CAUSE = InductanceAnisotropy()
