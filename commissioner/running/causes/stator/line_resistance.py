"""A bad contact or an unequal cable between the voltage's tap and the motor: resistance in one line."""

from __future__ import annotations

from commissioner.estimation.numbers import Scales
from commissioner.running.causes.cause import PHASES, Cause, Confounder, Form, Sizes, Values, in_phases, one_of_three


def _sizes(v: Values, _: Scales) -> Sizes:
    k, apart = one_of_three(in_phases(v["line_re"], v["line_im"]))
    added = apart * v["stator_resistance"]
    return {f"in_{PHASES[k]}_ohm": (added, "ohm"), "of_stator_resistance": (apart, "")}


def _scenario(v: Values, s: Scales) -> dict[str, float]:
    k, apart = one_of_three(in_phases(v["line_re"], v["line_im"]))
    return {"size": apart, "phase": k}


def _leaves_open(v: Values) -> str:
    """R_s is the mean of three lines, what one has more counted in."""
    winding = v["stator_resistance"] * (1.0 + min(in_phases(v["line_re"], v["line_im"])))
    return (
        f"R_s is the mean of the three lines with what is unlike in them: of like windings each has {winding:.4g} ohm."
    )


CAUSE = Cause(
    name="line_resistance",
    title="Resistance in one line",
    says="One line has {size} more than the two others between the voltage's tap and the winding",
    meaning="A contact, a terminal or a joint that heats with the square of the current; or unequal windings.",
    remedy="Check terminals, contactor and plugs of that line, measure the three windings' resistances.",
    physics="u -= R_s rho conj(i): rho turns twice with the phase that differs; the common part is R_s itself",
    signature="in proportion to current; -50, -250, 350 Hz",
    source="Bossio et al., detection of high-resistance connections (public recordings)",
    forms=(Form("", ("line_re", "line_im")),),
    sizes=_sizes,
    range=(-100.0, 1e4),
    confounders=(Confounder("voltage_gain_mismatch", "a start; or two loads", tied_without="a second load"),),
    negative_sequence="adds",
    leaves_open=_leaves_open,
    scenario=_scenario,
)
