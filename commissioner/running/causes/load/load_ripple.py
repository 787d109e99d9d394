"""A load that pulsates at a frequency of its own: behind a belt or a gear, no whole number of times a turn of the motor's shaft."""

from __future__ import annotations

import math

from commissioner.estimation.numbers import Scales
from commissioner.running.causes.cause import Cause, Confounder, Form, Sizes, Values


def _swing(v: Values) -> tuple[float, float]:
    return math.hypot(v["load_swing_cos"], v["load_swing_sin"]), v["load_swing_turns"]


def _sizes(v: Values, s: Scales) -> Sizes:
    """Amplitude of the torque, and how often it comes."""
    part, turns = _swing(v)
    return {"torque_nm": (part * s.torque_nm, "Nm"), "of_rated_torque": (part, ""), "times_a_turn": (turns, "a turn")}


CAUSE = Cause(
    name="load_ripple",
    title="Load that pulsates at a frequency of its own",
    says="The load's torque pulsates by {size} about its mean, at a frequency that is no whole multiple of the shaft's turns: as behind a belt or a gear",
    meaning="The driven machine, not the motor: a piston, an eccentric pulley, a worn belt or gear that turns at another speed.",
    remedy="Find what turns so many times a turn of the motor (pulley and gear ratios, belt length over pulley). A simulation needs it in its load.",
    physics="J dw/dt = T_e - T_l - T_n (a cos k theta + b sin k theta), theta the shaft's angle, k any number, found from the strongest line",
    signature="f +- k f_r, both side bands, where k is no whole number; a broken bar's are at f +- 2 s f, its sweep in a start goes with the slip",
    source="W. T. Thomson, I. Culbert, Current Signature Analysis, Wiley-IEEE 2017, ch. 8 and 9",
    forms=(Form("", ("load_swing_cos", "load_swing_sin"), ("load_swing_turns",), is_signed=True),),
    sizes=_sizes,
    range=(0.0, 50.0 * 1e3),
    swing=_swing,
    needs=lambda record: not record.has_speed,
    leaves_open=lambda _: (
        "The load's pulsation has one amplitude for all of the recording; where it grows with the load, what it has more may be in the load's own "
        "course: the torque is the least that pulsates there."
    ),
    confounders=(
        Confounder("rotor_asymmetry", "a second load: a bar's side bands go with the slip, a load's with the speed"),
    ),
)
