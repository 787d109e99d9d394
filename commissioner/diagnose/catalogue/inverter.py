"""Causes in the power stage: legs, link and cable."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from commissioner.diagnose.catalogue.effect import (
    Effect,
    Setting,
    Sizes,
    as_much_of,
    effect,
    listed,
    nearest_course,
    spline_value,
)
from commissioner.diagnose.catalogue.regressors import (
    DRAWN,
    HELD,
    RECORDED_LINK,
    ROOT,
    SAG_LAGS_S,
    SWINGING,
    behind_lag,
    behind_rectifier,
    power_of,
)
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.kernels.kinds import CABLE
from commissioner.diagnose.plant.model import Layout, Model, Term

Array = NDArray[np.float64]
MOST_UNEQUAL = 4.0
"""Of the mean of the three legs, by which one may differ: what a compensation leaves may have another sign in one of them."""
MOST_OF_A_LAG, MOST_OF_THE_LINK = 5.0, 2.0
LEFT_BY_THE_LOAD = 0.5
"""Of the power of a recorded link's course: what leaves more is no sag under the motor's load."""
SAG_SAMPLES = 4000
"""Of every segment, on which a sag of several lags is read as one of a single lag."""
SECOND_ORDER_LEAVES, LEAST_RINGING, MOST_RINGING = 0.25, 0.01, 2.0
"""Of the power that a lag of first order leaves; and the least and largest q of a lag 1 / (1 + s S + s^2 q S^2), two equal ones at a quarter."""


def _leg_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    layout = setting.layout
    weights = listed(values, "leg", layout.legs_vectors.shape[0])
    top = spline_value(layout.legs_vectors, weights, layout.legs_top, layout.legs_top)
    grid = np.linspace(0.0, layout.legs_top, 200)
    curve = np.array([spline_value(layout.legs_vectors, weights, layout.legs_top, y) for y in grid])
    reached = np.flatnonzero(curve >= 0.5 * top) if top > 0 else np.array([0])
    half = float(layout.legs_knee_a * np.sinh(grid[reached[0]])) if reached.size else 0.0
    unequal = {k: (values[k], "1") for k in ("unequal_v", "unequal_w") if values.get(k)}
    return {"voltage_v": (top, "V"), "half_current_a": (half, "A"), **unequal}


def lost_by_a_leg(model: Model, layout: Layout, share: float) -> float:
    """V, at a share of the range of currents on which its loss may bend."""
    count = layout.legs_vectors.shape[0]
    weights = model.sum_kind(kinds.LEGS, count) + model.sum_kind(kinds.LEGS_LINK, count)
    at = float(np.arcsinh(share * np.sinh(layout.legs_top)))
    return spline_value(layout.legs_vectors, weights, layout.legs_top, at)


def tail_of_legs(model: Model, layout: Layout) -> tuple[float, float]:
    """Half of what a leg's loss rises by over the upper half of the currents at which it may bend, V, and the resistance, ohm, that this

    looks like: a law that goes on rising beyond cannot be told from R_s, and its form is nobody's knowledge.
    """
    rise = 0.5 * max(lost_by_a_leg(model, layout, 1.0) - lost_by_a_leg(model, layout, 0.5), 0.0)
    return rise, rise / (0.5 * float(np.sinh(layout.legs_top)) * layout.legs_knee_a)


def _dead_time_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    sizes = dict(_leg_sizes(setting, values))
    facts = setting.facts
    if facts.switching_frequency_hz and facts.dc_link_v:
        seconds = sizes["voltage_v"][0] / (facts.switching_frequency_hz * facts.dc_link_v)
        sizes["time_us"] = (seconds * 1e6, "us")
    return sizes


def _legs(name: str, kind: int, setting: Setting) -> tuple[Term, ...]:
    count = setting.layout.legs_vectors.shape[0]
    shares = tuple(
        Term(name, f"unequal_{leg}", "1", kinds.LEG_SHARE, k, 0.01, -MOST_UNEQUAL, MOST_UNEQUAL)
        for k, leg in ((1, "v"), (2, "w"))
    )
    return (*(Term(name, f"leg_{k}", "V", kind, k, 0.1, 0.0, np.inf) for k in range(count)), *shares)


@effect(
    "dead_time",
    "Dead time of the inverter legs",
    sign=1,
    family="odd",
    sizes=_dead_time_sizes,
    signature="each leg loses a voltage with the sign of its own current, largest relative to the command at small "
    "current; odd lines around every tone; leaks into the cross axis off the multiples of 30 degrees",
    confounders=("device_drop", "dc_link_sag", "sensor_nonlinearity"),
    source="J. Holtz, J. Quan, IEEE Trans. Ind. Appl. 38(4), 2002; V_dt = T_d f_sw V_dc per leg",
    split_by="repeat one segment at half the switching frequency or another link voltage",
)
def dead_time(setting: Setting) -> tuple[Term, ...]:
    """v_x = v_x* - (1 + u_x) F(|i_x|) sign(i_x), F a spline over asinh(i) that rises from 0 to V_dt [V >= 0] and stays there, u_x what

    sets the leg apart from the mean of the three. Scales with link voltage times switching frequency where these differ between segments.
    """
    return _legs("dead_time", kinds.LEGS_LINK, setting)


@effect(
    "device_drop",
    "Threshold voltage of the switches and diodes",
    sign=1,
    family="odd",
    sizes=_leg_sizes,
    signature="as dead time, but independent of switching frequency and link voltage",
    confounders=("dead_time", "dc_link_sag"),
    source="A. R. Munoz, T. A. Lipo, IEEE Trans. Power Electron. 14(2), 1999; slope resistance is part of R_s",
    split_by="repeat one segment at half the switching frequency or another link voltage",
)
def device_drop(setting: Setting) -> tuple[Term, ...]:
    """v_x = v_x* - V_th(|i_x|) sign(i_x), V_th >= 0 [V]. Its own terms exist only where dead time can be told from it."""
    return _legs("device_drop", kinds.LEGS, setting) if setting.link_varies else ()


def sagging(setting: Setting, values: Mapping[str, float]) -> tuple[float, float]:
    """Sag at rated power and time constant (s) of the one lag whose loss of voltage comes nearest to the sum of these, but for a

    constant: that only scales the four numbers, so that several lags in place of one between them have any sum. The lag is of second
    order where that leaves at most SECOND_ORDER_LEAVES of what a first one does, and no capacitor holds what is given back.
    """
    record = setting.record
    first = [s.first(SAG_SAMPLES) for s in record.segments]
    weight = np.concatenate([s.voltage_axis_v for s in first])
    course = np.concatenate(
        [
            sum(v * record.channels[k][: s.count, record.channel(n)] for n, v in values.items())
            for k, s in enumerate(first)
        ]
    )

    both_ways, period = [power_of(record, s) for s in first], record.facts.sample_period_s
    one_way = [np.maximum(p, 0.0) for p in both_ways]
    holds, draws = any(values.get(n) for n in HELD), any(values.get(n) for n in DRAWN)

    def lagged_of(powers: Sequence[Array]) -> Callable[..., Array]:
        def lagged(log_lag: float, shape: float = 0.0) -> Array:
            lag = float(np.exp(log_lag))
            return -np.concatenate(
                behind_rectifier(powers, period, lag) if holds else behind_lag(powers, period, lag, shape)
            )

        return lagged

    # beside a recorded link the powers only mend its course: what they are made of says nothing of the source
    is_beside_a_link = values.get(RECORDED_LINK) and not holds
    sources = [both_ways, one_way] if is_beside_a_link else [one_way if draws else both_ways]
    read = [(lagged, *nearest_course(course, lagged, np.log(SAG_LAGS_S), weight)) for lagged in map(lagged_of, sources)]
    lagged, size, log_lag = min(read, key=lambda r: float(np.linalg.norm(as_much_of(r[0](r[2]), course, weight)[1])))
    if holds:
        return size, float(np.exp(log_lag))
    left = as_much_of(lagged(log_lag), course, weight)[1]
    second = least_squares(
        lambda x: as_much_of(lagged(*x), course, weight)[1],
        (log_lag, 0.1),
        x_scale=(0.1, 0.1),
        bounds=((np.log(SAG_LAGS_S[0] / 2.0), LEAST_RINGING), (np.log(2.0 * SAG_LAGS_S[-1]), MOST_RINGING)),
    )
    if 2.0 * second.cost < SECOND_ORDER_LEAVES * float(left @ left):
        log_lag, shape = second.x
        size = as_much_of(lagged(log_lag, shape), course, weight)[0]
    return size, float(np.exp(log_lag))


def _sag_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    """The sag at rated power; of a recorded link whose course the motor's own power hardly makes, the part that reaches the motor,

    where that is most of what is lost: in a link that is recorded coarsely the sag may be hidden.
    """
    if values.get(RECORDED_LINK):
        courses = _courses(setting.record)
        if _is_mostly_recorded(courses, values) and _as_lags(courses, values)[1] > LEFT_BY_THE_LOAD:
            return {"of_the_recorded_swing": (values[RECORDED_LINK], "1")}
    return {"sag_at_rated_power": (sagging(setting, values)[0] if any(values.values()) else 0.0, "1")}


def _as_lags(courses: Mapping[str, Array], names: Iterable[str]) -> tuple[dict[str, float], float]:
    """The sum of the lagged powers among these names that comes nearest to the recorded link's course, and the share of its power

    that this leaves.
    """
    course, lags = courses[RECORDED_LINK], [n for n in names if n != RECORDED_LINK]
    table = np.column_stack([courses[n] for n in lags])
    found = np.linalg.lstsq(table, course, rcond=None)[0]
    left = course - table @ found
    return dict(zip(lags, map(float, found), strict=True)), float(left @ left) / max(float(course @ course), 1e-300)


def _is_mostly_recorded(courses: Mapping[str, Array], values: Mapping[str, float]) -> bool:
    """Whether more of the voltage moves with the recorded link than with the motor's own power."""
    recorded = values[RECORDED_LINK] * courses[RECORDED_LINK]
    drawn = np.sum([values.get(n, 0.0) * c for n, c in courses.items() if n != RECORDED_LINK], axis=0)
    return float(np.linalg.norm(recorded)) > float(np.linalg.norm(drawn))


def _courses(record: Record) -> dict[str, Array]:
    """By name, what a lagged power or the recorded link moves of the command, per unit and but for a constant part of it, at some

    instants of all segments.
    """
    some = [slice(None, None, max(s.count // SAG_SAMPLES, 1)) for s in record.segments]
    command = np.concatenate([s.voltage_axis_v[at] for s, at in zip(record.segments, some, strict=True)])
    out = {}
    for name in [n for n in record.channel_names if n in (*SWINGING, *DRAWN, *ROOT, *HELD, RECORDED_LINK)]:
        moved = command * np.concatenate(
            [c[at, record.channel(name)] for c, at in zip(record.channels, some, strict=True)]
        )
        out[name] = moved - command * float(command @ moved) / max(float(command @ command), 1e-300)
    return out


def without_the_recorded_link(model: Model, record: Record) -> Model:
    """The model in which a sag rides on lagged power alone, as it comes nearest: for currents beside which no link was recorded."""
    swing = model.of("dc_link_sag").get(RECORDED_LINK, 0.0)
    if not swing:
        return model
    lags, _ = _as_lags(_courses(record), model.of("dc_link_sag"))
    values = tuple(
        0.0 if t.symbol == RECORDED_LINK else v + swing * lags[t.symbol] if t.effect == "dc_link_sag" else v
        for t, v in zip(model.terms, model.values, strict=True)
    )
    return replace(model, values=values)


@effect(
    "dc_link_sag",
    "DC link that sags under load, uncompensated",
    sign=1,
    family="odd",
    sizes=_sag_sizes,
    signature="voltage error proportional to command times power: odd lines that grow with the cube of the level",
    confounders=("dead_time", "sensor_nonlinearity", "leakage_saturation"),
    source="v = v* (1 - k LP(p) / P_N); six-pulse rectifier regulation, e.g. N. Mohan, Power Electronics, ch. 5",
    split_by="record the DC-link voltage, or repeat at another amplitude",
    either=tuple((*names, RECORDED_LINK) for names in (SWINGING, DRAWN, HELD, DRAWN + ROOT)),
)
def dc_link_sag(setting: Setting) -> tuple[Term, ...]:
    """Relative loss of voltage at rated power through first-order lags of 0.3 to 100 ms (a dictionary). Their sum loses voltage; one

    alone may gain some: a choke before the capacitor makes a lag of second order, of which lags are a difference. What the motor gives
    back counts with its sign, or not at all, or is held behind diodes until it is drawn; or what is drawn and its root. Where the link
    was recorded, the part of its own swing that reaches the motor as well: 1 where the drive leaves it as it is.
    """
    record = setting.record
    lags = tuple(
        Term(
            "dc_link_sag", n, "1", kinds.VOLTAGE_MOD, record.channel(n), 0.01, -MOST_OF_A_LAG, MOST_OF_A_LAG, channel=n
        )
        for n in (*SWINGING, *DRAWN, *ROOT, *HELD)
    )
    if RECORDED_LINK not in record.channel_names:
        return lags
    seen = Term(
        "dc_link_sag",
        RECORDED_LINK,
        "1",
        kinds.VOLTAGE_MOD,
        record.channel(RECORDED_LINK),
        0.1,
        0.0,
        MOST_OF_THE_LINK,
        channel=RECORDED_LINK,
    )
    return (*lags, seen)


def _ripple_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    sizes: dict[str, tuple[float, str]] = {}
    for base in (100, 120, 300, 360):
        parts = [v for k, v in values.items() if k.startswith(f"ripple_{base}_")]
        if parts:
            sizes[f"amplitude_{base}_hz"] = (float(np.sqrt(2.0 * np.mean(np.square(parts)))), "1")
    return sizes


@effect(
    "dc_link_ripple",
    "Ripple of the DC link",
    sign=0,
    family="non-periodic",
    sizes=_ripple_sizes,
    signature="side lines at every tone plus and minus 100, 120, 300 or 360 Hz, proportional to the tone",
    confounders=("mains_pickup",),
    source="v = v* (1 + a cos wt + b sin wt); rectifier ripple, N. Mohan, Power Electronics, ch. 5",
    split_by="record the DC-link voltage",
)
def dc_link_ripple(setting: Setting) -> tuple[Term, ...]:
    """Relative amplitudes a, b of the rectifier's ripple line (frequency refined on the data)."""
    names = [n for n in setting.record.channel_names if n.startswith("ripple_")]
    return tuple(
        Term(
            "dc_link_ripple",
            f"{n}_{s.uid}",
            "1",
            kinds.VOLTAGE_MOD,
            setting.record.channel(n),
            0.01,
            segment=s.uid,
            channel=n,
        )
        for s in setting.record.segments
        for n in names
    )


def _cable_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    return {"capacitance_nf": (sum(values.values()) * 1e9, "nF")}


@effect(
    "cable_capacitance",
    "Capacitance of the motor cable",
    sign=1,
    family="linear",
    sizes=_cable_sizes,
    signature="a current that leads the voltage by 90 degrees, growing with frequency; no distortion",
    confounders=("sampling_delay", "iron_loss", "rotor_skin_effect"),
    source="i_sensor = i + C dv/dt at the inverter-side sensor",
    split_by="excite lines up to 0.4 of the sampling rate",
)
def cable_capacitance(setting: Setting) -> tuple[Term, ...]:
    """C >= 0 [F] per phase to the star point, charged by the step of the command at, before or after the sample."""
    return tuple(
        Term("cable_capacitance", when, "F", CABLE, k, 1e-9, 0.0, 1e-4)
        for k, when in enumerate(("at", "before", "after"))
    )


ENTRIES: tuple[Effect, ...] = (dead_time, device_drop, dc_link_sag, dc_link_ripple, cable_capacitance)
