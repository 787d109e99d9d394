"""Eddy-current loss of the iron."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from commissioner.diagnose.causes.cause import Cause, Confounder, Entry, Procedure, Proposal, Standing, Words
from commissioner.diagnose.causes.in_points import InPoints
from commissioner.diagnose.causes.sampling.read_late import CONDUCTANCE, EARLY, EDGE, read_late
from commissioner.diagnose.causes.setting import Array, Numbers, Setting, Sizes
from commissioner.diagnose.intake.points import Points
from commissioner.diagnose.intake.record import Facts
from commissioner.diagnose.kernels.kinds import BRANCH, IRON_LOSS
from commissioner.diagnose.plant.model import Model, Term

if TYPE_CHECKING:
    from commissioner.diagnose.fit.gauss_newton import Fit

SAME_STEP = 0.03
"""Of conductance times period: a capacitance so near is the conductance's own."""
IMITATORS = ("clock_drift", "cable_capacitance")
"""They make up for some of what a current does that is read late."""


def in_table(x: Array, points: Points, scale: Mapping[str, float]) -> dict[str, float]:
    return {"share_of_loss_growing_with_flux": float(x[0]), "exponent": float(x[1])}


def at_no_load(facts: Facts) -> Procedure:
    return Procedure(
        (
            "Uncouple the motor and run it at no load, rated frequency, at five to eight voltages from 30 to 110 % of rated.",
            "Note voltage, current and power of each in a table. What the core loses there is iron loss, not skin effect.",
            "Read the table:",
        ),
        command="commissioner diagnose no_load.csv --out no_load",
        changes_values="Hardly. R_R at the slip of a running motor is the value at low frequency, and that stays.",
    )


class IronLoss(Cause):
    """Conductance g >= 0 [S] fed by the stator's induced voltage, and eddy paths g_k / (1 + s T_k) that lag behind it, with
    corners from 150 Hz to 1 kHz.
    """

    name = "iron_loss"
    place = 10
    title = "Eddy-current loss of the iron"
    family = "linear"
    sign = 1
    spare = frozenset({BRANCH})
    signature = "resistance rises with the square of frequency up to more than 1 kHz; looks like a lead"
    source = "conductance across the stator flux: E. Levi, IEEE Trans. Energy Convers. 10(2), 1995"
    confounders = (
        Confounder("rotor_skin_effect", least_share=0.1, tied_share=2e-3, is_same_order=True, told_apart_by=at_no_load),
        Confounder("cable_capacitance"),
    )
    split_by = "tones above 1 kHz, or a running no-load test"
    decides = "Add tones above 1 kHz, or run a no-load test and give its points to `commissioner diagnose`."
    exchanged = (EDGE,)
    words = Words(
        "The iron loses power to eddy currents",
        "Every motor does. The loss grows with flux and frequency.",
        "Enter an iron loss only where the drive asks for one.",
        is_normal=True,
    )
    advice = "Normal."
    in_points = InPoints(
        "loss", (0.6, 2.0), (0.0, 1.0), (1.0, 6.0),
        lambda x, flux, speed: 1.0 - x[0] + x[0] * speed**-0.5 * flux ** x[1], in_table,
    )  # fmt: skip

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        paths = tuple(
            Term(self.name, f"eddy_{k}", "S", BRANCH, k, 1e-4, 0.0, 0.2)
            for k, time in enumerate(setting.layout.branch_time_s)
            if time < 0.0
        )
        return (CONDUCTANCE, *paths)

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        """At low frequency, where eddy currents fill the sheet."""
        return {"conductance_ms": (sum(v for k, v in values.items() if k != EDGE.symbol) * 1e3, "mS")}

    def occasion(self, accepted: Sequence[Cause], names: Collection[str]) -> frozenset[str] | None:
        return frozenset(c.name for c in accepted if c.family == "linear") if self in accepted else None

    def proposals(self, here: Standing) -> Iterable[tuple[Proposal, ...]]:
        """A current that is read after its instant, or a conductance's that shows the step of that instant, in place of what imitates it.

        After d seconds the current has taken d / L_sigma of the new voltage: a conductance g of that size and a capacitance g T, or a clock
        that makes up for some of it. A conductance whose current at an instant is that of the new voltage has the capacitance g T too.
        """
        mine, delay = here.model.of(self.name), EARLY.effect
        if mine.get("conductance", 0.0) <= 0.0 or EDGE.symbol in mine or delay in here.accepted:
            return
        beside = tuple(n for n in IMITATORS if n in here.accepted)
        period = here.setting.facts.sample_period_s
        for gone in dict.fromkeys((beside, beside[1:])):
            bare = here.model
            for name in gone:
                bare = bare.without(name)
            clearly = here.rules.floor_chi2 if gone else -here.rules.floor_chi2
            group = []
            if gone:
                shown = bare.with_terms([replace(EDGE, start=bare.total(IRON_LOSS) * period)])
                says = f"iron_loss that shows its instant's voltage in place of {'+'.join(gone)}"
                most = clearly + here.saved_chi2(shown)
                group.append(Proposal(shown, gone, (), most, says, lambda f: is_its_own(f, period)))
            if delay in here.names:
                every = (self.name, *gone)
                says = f"a current that is read late in place of {'+'.join(every)}"
                late = read_late(bare)
                most = clearly + here.saved_chi2(late)
                group.append(
                    Proposal(late, every, (delay,), most, says, lambda f: f.model.of(delay)[EARLY.symbol] < 0.0)
                )
            yield tuple(group)

    def rivals(self, model: Model, absent: Collection[str]) -> Iterable[tuple[str, Model]]:
        if EDGE.symbol in model.of(self.name) and EARLY.effect in absent:
            yield EARLY.effect, read_late(model)

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        return {"size": 1e-3 * sizes["conductance_ms"]}


def is_its_own(fitted: Fit, period_s: float) -> bool:
    """Whether the charge per volt of a step is what the iron's conductance draws in a period, as far as the data tell."""
    edge = fitted.model.of(IronLoss.name)[EDGE.symbol]
    _, information = fitted.information_of(IronLoss.name, EDGE.symbol)
    spread = EDGE.step / float(np.sqrt(max(information[0, 0], 1e-300)))
    charge = fitted.model.total(IRON_LOSS) * period_s
    return abs(edge - charge) < SAME_STEP * charge + 3.0 * spread


CAUSE = IronLoss()
