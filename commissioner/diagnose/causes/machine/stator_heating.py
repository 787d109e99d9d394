"""Stator winding that warms during the test."""

from __future__ import annotations

from commissioner.diagnose.causes.cause import NO_FAULT, Confounder, Words
from commissioner.diagnose.causes.machine.warming import FASTEST_RISE, Warming
from commissioner.diagnose.causes.regressors import FRESH_STATOR_HEAT, STATOR_HEAT
from commissioner.diagnose.causes.setting import Setting
from commissioner.diagnose.kernels.kinds import PHASE_RESISTANCE
from commissioner.diagnose.plant.model import Term


class StatorHeating(Warming):
    """R_x = R_s (1 + k integral i_x^2 / I_N^2 dt): relative rise per minute at rated current, k >= 0, each phase by its
    own current or by the mean of the three, without a leak and with leaks of 20 and 6 s, in proportion to time, and settling (a
    dictionary); or anew in every segment.
    """

    name = "stator_heating"
    place = 14
    title = "Stator winding that warms during the test"
    spare = frozenset({PHASE_RESISTANCE})
    signature = (
        "skirts around the lowest tone, resistance higher in later segments, most in the phase that carried most"
    )
    source = "adiabatic heating, IEC 60079-7 form; copper 0.393 %/K; d theta/dt = P/C - theta/tau"
    confounders = (Confounder("resistance_anisotropy"),)
    split_by = "repeat the first segment last, axes in the order a-b-c-c-b-a"
    decides = "Repeat the first test last, at once and again after a pause of ten minutes."
    either = (STATOR_HEAT, (FRESH_STATOR_HEAT,))
    words = Words(
        "The stator winding warmed during the test (its resistance rose by {size} at rated current)",
        f"{NO_FAULT} R_s holds for the temperature of the test.",
        "Enter R_s with the winding's temperature where the drive asks for it.",
        "Pause between the tests.",
        True,
    )

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        names = STATOR_HEAT + ((FRESH_STATOR_HEAT,) if setting.spans_segments else ())
        channels = {kind: f"heat_{kind}_u" for kind in names}
        at = setting.record.channel
        return tuple(
            Term(self.name, kind, "1/min", PHASE_RESISTANCE, at(n), 0.01, 0.0, FASTEST_RISE, channel=n)
            for kind, n in channels.items()
        )


CAUSE = StatorHeating()
