"""Flux left in the iron before the test."""

from __future__ import annotations

import numpy as np

from commissioner.diagnose.causes.cause import NO_FAULT, Cause, Confounder, Entry, Form, Words
from commissioner.diagnose.causes.setting import Numbers, Setting, Sizes
from commissioner.diagnose.kernels.kinds import INITIAL_FLUX
from commissioner.diagnose.plant.model import Model, Term

SAME_FLUX = 0.2
"""Of their mean: fluxes left before the segments that differ by less are one."""


class Remanence(Cause):
    """Initial flux vector (alpha, beta) [Wb] of every segment that starts at rest."""

    name = "remanence"
    place = 7
    title = "Flux left in the iron before the test"
    family = "start"
    sign = 1
    form = Form.EXACT
    signature = "a transient at the start of a segment that decays with the rotor time constant"
    source = "initial state of the flux equation; P. Vas, Sensorless Vector and Direct Torque Control, 1998"
    confounders = (Confounder("magnetic_hysteresis"),)
    split_by = "wait longer before the segment, or start it with the opposite polarity"
    decides = "Wait ten seconds with the inverter off before the test, or begin it with the opposite sign."
    words = Words(
        "The iron still held flux when the test began ({size})",
        NO_FAULT,
        measurement="Wait ten seconds with the inverter off between two tests.",
    )

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        step = 0.01 * max(setting.iron_flux_wb, 1e-6)
        return tuple(
            Term(self.name, f"{axis}_{s.uid}", "Wb", INITIAL_FLUX, c, step, segment=s.uid)
            for s in setting.record.segments
            if s.starts_at_rest
            for c, axis in enumerate(("alpha", "beta"))
        )

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        """The one flux that is left before every segment (their mean), or the largest."""
        pairs: dict[str, list[float]] = {}
        for name, value in values.items():
            pairs.setdefault(name.rpartition("_")[2], []).append(value)
        vectors = np.array([p for p in pairs.values() if len(p) == 2]).reshape(-1, 2)
        mean = vectors.mean(axis=0) if vectors.size else np.zeros(2)
        apart = np.linalg.norm(vectors - mean, axis=1).max(initial=0.0)
        is_one = apart < SAME_FLUX * np.linalg.norm(mean)
        size = np.linalg.norm(mean) if is_one else np.linalg.norm(vectors, axis=1).max(initial=0.0)
        return {"flux_wb": (float(size), "Wb")}

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        first = setting.record.segments[0].uid
        flux = complex(values.get(f"alpha_{first}", 0.0), values.get(f"beta_{first}", 0.0))
        return {"size": abs(flux), "angle_deg": float(np.degrees(np.angle(flux)))}


CAUSE = Remanence()
