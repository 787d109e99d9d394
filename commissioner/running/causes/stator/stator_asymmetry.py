"""Shorted turns in one winding: a loop beside the magnetizing branch takes a current of its own. A delta's windings lie between the lines."""

from __future__ import annotations

import math

from commissioner.estimation.numbers import Scales
from commissioner.estimation.record import Record
from commissioner.running.causes.cause import PHASES, Cause, Confounder, Form, Sizes, Values

WINDINGS = {"star": tuple(PHASES), "delta": ("uv", "vw", "wu")}
BEHIND = -0.25
"""Of a delta's winding, in thirds of a turn."""
EVERY = WINDINGS["star"] + WINDINGS["delta"]


def _sizes(v: Values, _: Scales) -> Sizes:
    loops = {p: math.hypot(v[f"loop_conductance_{p}"], v[f"loop_susceptance_{p}"]) for p in EVERY}
    worst = max(loops, key=lambda p: loops[p])
    sign = math.copysign(1.0, v[f"loop_conductance_{worst}"])
    return {f"current_in_{worst}_of_rated": (sign * loops[worst], "")}


def _scenario(v: Values, s: Scales) -> dict[str, float]:
    ((name, (size, _)),) = _sizes(v, s).items()
    winding = name.split("_")[2]
    if winding in PHASES:
        return {"size": size, "phase": PHASES.index(winding)}
    return {"size": size, "phase": WINDINGS["delta"].index(winding) + BEHIND}


MOST_LAG, OF_LEAKAGE = 1.7, 0.6
"""Of the loop's current behind its voltage, tangent: few turns are a resistance first, and none is less of one than the whole winding, which has so
much of the leakage (a bolted fault of a 30 kW motor has 2.5: it was a voltage gain of -5.169 +- 0.006 %). A voltage sensor's gain looks like a
pure reactance."""


def _is_loop(v: Values, s: Scales) -> bool:
    whole = OF_LEAKAGE * s.frequency_rad_per_s * v["leakage_inductance"] / v["stator_resistance"]
    loops = [(v[f"loop_conductance_{p}"], v[f"loop_susceptance_{p}"]) for p in EVERY]
    return all(g >= 0.0 and -0.3 * g <= b <= max(MOST_LAG, whole) * g for g, b in loops)


def _form(connection: str, winding: str) -> Form:
    def is_there(record: Record) -> bool:
        return record.plate.connection == connection

    return Form(f"phase {winding}", (f"loop_conductance_{winding}", f"loop_susceptance_{winding}"), needs=is_there)


CAUSE = Cause(
    name="stator_asymmetry",
    title="Asymmetry of the stator (turn fault)",
    says="One phase of the stator takes {size} of rated current beside its own, in proportion to the voltage: as shorted turns do",
    meaning="A fault of the motor: shorted turns heat where they are and grow.",
    remedy="Stop the motor soon and measure the winding; do not start it again before.",
    physics="i += i_f n_k, (b / g) di_f/dt / w + i_f = g (1 + b^2 / g^2) u_k: turns of winding k (of a delta: between two lines) shorted by a resistance and a leakage; "
    "the winding's own resistance and magnetomotive force see i less that",
    signature="a negative-sequence current in proportion to the voltage that the voltage's own unbalance does not explain",
    source="Tallam, Habetler, Harley, IEEE Trans. Ind. Appl. 38(4), 2002; Patel, Chandorkar (locus of the negative sequence against load); Radecki, "
    "DOI 10.5277/PED160111",
    forms=tuple(_form(connection, p) for connection, windings in WINDINGS.items() for p in windings),
    sizes=_sizes,
    range=(0.0, 2.0),
    allows=_is_loop,
    confounders=(
        Confounder(
            "voltage_gain_mismatch",
            "a start; or exchange two voltage probes and record again: what follows the probe is the probe's",
            tied_without="a start",
        ),
        Confounder("line_resistance", "a start, or two loads", tied_without="a second load"),
    ),
    negative_sequence="adds",
    scenario=_scenario,
)
