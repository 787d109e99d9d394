"""Rotor cage that warms during the test."""

from __future__ import annotations

from commissioner.diagnose.causes.cause import NO_FAULT, Confounder, Words
from commissioner.diagnose.causes.machine.warming import FASTEST_RISE, Warming
from commissioner.diagnose.causes.regressors import CAGE_HEAT, FRESH_CAGE_HEAT
from commissioner.diagnose.causes.setting import Setting
from commissioner.diagnose.kernels.kinds import ROTOR_MOD
from commissioner.diagnose.plant.model import Term


class RotorHeating(Warming):
    """R_R = R_R0 (1 + k integral i_R^2 / I_N^2 dt), k >= 0, relative rise per minute at rated current, with the leaks of the stator's;
    or in proportion to time, or settling; or anew in every segment.
    """

    name = "rotor_heating"
    place = 15
    title = "Rotor cage that warms during the test"
    spare = frozenset({ROTOR_MOD})
    signature = "rotor resistance higher in later segments; only AC content heats it"
    source = "as stator heating, driven by the rotor current of the nominal model"
    confounders = (Confounder("stator_heating"), Confounder("resistance_anisotropy"))
    split_by = "a DC-bias segment between two AC segments"
    decides = "Put a test with DC current alone between two equal tests."
    either = (CAGE_HEAT, (FRESH_CAGE_HEAT,))
    words = Words(
        "The rotor warmed during the test (its resistance rose by {size} at rated current)",
        f"{NO_FAULT} R_R holds for the temperature of the test.",
        measurement="Pause between the tests.",
        is_normal=True,
    )

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        names = CAGE_HEAT + ((FRESH_CAGE_HEAT,) if setting.spans_segments else ())
        at = setting.record.channel
        return tuple(Term(self.name, n, "1/min", ROTOR_MOD, at(n), 0.01, 0.0, FASTEST_RISE, channel=n) for n in names)


CAUSE = RotorHeating()
