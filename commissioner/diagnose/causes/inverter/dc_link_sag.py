"""DC link that sags under load, uncompensated."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from commissioner.diagnose.causes.cause import NO_FAULT, Confounder, Entry, Words
from commissioner.diagnose.causes.inverter.link import COLUMN, OfTheLink
from commissioner.diagnose.causes.regressors import (
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
from commissioner.diagnose.causes.setting import Array, Numbers, Setting, Sizes, as_much_of, nearest_course
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.kernels.kinds import VOLTAGE_MOD
from commissioner.diagnose.plant.model import Model, Term

MOST_OF_A_LAG, MOST_OF_THE_LINK = 5.0, 2.0
MOST_SAG = 0.5
"""Of the link, at rated power: no source gives that power while it loses more. (A charging resistor that was left in loses it at small powers:
a recorded link shows that.)"""
LEFT_BY_THE_LOAD = 0.5
"""Of the power of a recorded link's course: what leaves more is no sag under the motor's load."""
SAG_SAMPLES = 4000
"""Of every segment, on which a sag of several lags is read as one of a single lag."""
SECOND_ORDER_LEAVES, LEAST_RINGING, MOST_RINGING = 0.25, 0.01, 2.0
"""Of the power that a lag of first order leaves; and the least and largest q of a lag 1 / (1 + s S + s^2 q S^2), two equal ones at a quarter."""

RINGING, RINGS = (0.03, 0.1, 0.3, 1.0), 0.8
"""Shapes q that are looked at before one is sought, and what of the course's size one of them must leave at most."""


class DcLinkSag(OfTheLink):
    """Relative loss of voltage at rated power through first-order lags of 0.3 to 100 ms (a dictionary). Their sum loses voltage; one
    alone may gain some: a choke before the capacitor makes a lag of second order, of which lags are a difference. What the motor gives
    back counts with its sign, or not at all, or is held behind diodes until it is drawn; or what is drawn and its root. Where the link
    was recorded, the part of its own swing that reaches the motor as well: 1 where the drive leaves it as it is.
    """

    name = "dc_link_sag"
    place = 2
    title = "DC link that sags under load, uncompensated"
    family = "odd"
    sign = 1
    signature = "voltage error proportional to command times power: odd lines that grow with the cube of the level"
    source = "v = v* (1 - k LP(p) / P_N); six-pulse rectifier regulation, e.g. N. Mohan, Power Electronics, ch. 5"
    confounders = (Confounder("dead_time"), Confounder("device_drop"))
    split_by = "record the DC-link voltage, or repeat at another amplitude"
    decides = "Record the DC-link voltage with the currents (column dc_link_v), or repeat one test at half the level."
    where_recorded = "Repeat one test at half the level: a sag falls to a quarter."
    either = tuple((*names, RECORDED_LINK) for names in (SWINGING, DRAWN, HELD, DRAWN + ROOT))
    words = Words(
        "The DC link sags by {size} at rated power, and nothing makes up for it",
        f"{NO_FAULT} Under load it gets less voltage than the drive believes.",
        "Switch DC-link (bus voltage) compensation on; if the sag is new, check the supply.",
        COLUMN,
    )
    of_the_recorded_swing = Words(
        "The DC link's voltage moves as it was recorded, whatever the motor does, and {size} of that reaches the motor",
        f"{NO_FAULT} Something else moves the link: the mains, or another drive on it.",
        "Switch DC-link (bus voltage) compensation on; look for what else draws on the link.",
        called="DC link's recorded swing",
    )

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        record = setting.record
        names = (*SWINGING, *DRAWN, *ROOT, *HELD)
        most = dict.fromkeys(names, (0.01, -MOST_OF_A_LAG, MOST_OF_A_LAG))
        if RECORDED_LINK in record.channel_names:
            most[RECORDED_LINK] = (0.1, 0.0, MOST_OF_THE_LINK)
        return tuple(
            Term(self.name, n, "1", VOLTAGE_MOD, record.channel(n), *bounds, channel=n) for n, bounds in most.items()
        )

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        """The sag at rated power; of a recorded link whose course the motor's own power hardly makes, the part that reaches the motor,
        where that is most of what is lost: in a link that is recorded coarsely the sag may be hidden.
        """
        if values.get(RECORDED_LINK):
            courses = _courses(setting.record)
            if _is_mostly_recorded(courses, values) and _as_lags(courses, values)[1] > LEFT_BY_THE_LOAD:
                return {"of_the_recorded_swing": (values[RECORDED_LINK], "1")}
        return {"sag_at_rated_power": (sagging(setting, values)[0] if any(values.values()) else 0.0, "1")}

    def promises_its_sign(self, setting: Setting, values: Numbers) -> bool:
        """As by `sizes`, which seeks the lag that comes nearest: it is among those around any that loses voltage with the numbers."""
        if not any(values.values()):
            return False
        course, weight, sources = _read(setting, values)
        if any(as_much_of(of(x), course, weight)[0] > 0.0 for of in sources for x in np.log(SAG_LAGS_S)):
            return True
        return _may_ring(course, weight, sources) and super().promises_its_sign(setting, values)

    def is_possible(self, sizes: Sizes, model: Model, setting: Setting) -> bool:
        most = sizes.get("sag_at_rated_power", (0.0, ""))[0]
        return most <= MOST_SAG or self.is_shown(model, setting.record)

    def without_recorded(self, model: Model, record: Record) -> Model:
        """The model in which a sag rides on lagged power alone, as it comes nearest: for currents beside which no link was recorded."""
        swing = model.of(self.name).get(RECORDED_LINK, 0.0)
        if not swing:
            return model
        lags, _ = _as_lags(_courses(record), model.of(self.name))
        values = tuple(
            0.0 if t.symbol == RECORDED_LINK else v + swing * lags[t.symbol] if t.effect == self.name else v
            for t, v in zip(model.terms, model.values, strict=True)
        )
        return replace(model, values=values)

    def words_for(self, sizes: Mapping[str, float]) -> Words:
        return self.of_the_recorded_swing if "of_the_recorded_swing" in sizes else self.words

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        """All of the sag through the one lag that comes nearest."""
        size, lag = sagging(setting, values)
        return {"size": size, "time_constant_s": lag}


def sagging(setting: Setting, values: Mapping[str, float]) -> tuple[float, float]:
    """Sag at rated power and time constant (s) of the one lag whose loss of voltage comes nearest to the sum of these, but for a
    constant: that only scales the four numbers, so that several lags in place of one between them have any sum. The lag is of second
    order where that leaves at most SECOND_ORDER_LEAVES of what a first one does, and no capacitor holds what is given back.
    """
    course, weight, sources = _read(setting, values)
    read = [(lagged, *nearest_course(course, lagged, np.log(SAG_LAGS_S), weight)) for lagged in sources]
    lagged, size, log_lag = min(read, key=lambda r: float(np.linalg.norm(as_much_of(r[0](r[2]), course, weight)[1])))
    if any(values.get(n) for n in HELD):
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


def _read(setting: Setting, values: Mapping[str, float]) -> tuple[Array, Array, list[Callable[..., Array]]]:
    """The course that the numbers make together, the command, and the courses of a unit sag behind one lag that it may be: of power with
    its sign, or where it is drawn; of both beside a recorded link, whose course the powers only mend: what they are made of says
    nothing of the source there.
    """
    record = setting.record
    first = [s.first(SAG_SAMPLES) for s in record.segments]
    course = np.concatenate(
        [
            sum(v * record.channels[k][: s.count, record.channel(n)] for n, v in values.items())
            for k, s in enumerate(first)
        ]
    )
    both_ways = [power_of(record, s) for s in first]
    one_way = [np.maximum(p, 0.0) for p in both_ways]
    holds, draws = any(values.get(n) for n in HELD), any(values.get(n) for n in DRAWN)
    is_beside_a_link = values.get(RECORDED_LINK) and not holds
    powers = [both_ways, one_way] if is_beside_a_link else [one_way if draws else both_ways]
    lagged = [_lagged_of(record.facts.sample_period_s, holds, p) for p in powers]
    return course, np.concatenate([s.voltage_axis_v for s in first]), lagged


def _may_ring(course: Array, weight: Array, sources: Sequence[Callable[..., Array]]) -> bool:
    """Whether a lag of second order may leave little where none of first order loses voltage."""
    alone = float(np.linalg.norm(as_much_of(np.zeros_like(course), course, weight)[1]))
    return any(
        float(np.linalg.norm(as_much_of(of(x, shape), course, weight)[1])) < RINGS * alone
        for of in sources
        for x in np.log(SAG_LAGS_S)
        for shape in RINGING
    )


def _lagged_of(period_s: float, holds: bool, powers: Sequence[Array]) -> Callable[..., Array]:
    """The course of a unit sag behind one lag, over the logarithm of its time constant and its shape."""

    def lagged(log_lag: float, shape: float = 0.0) -> Array:
        lag = float(np.exp(log_lag))
        return -np.concatenate(
            behind_rectifier(powers, period_s, lag) if holds else behind_lag(powers, period_s, lag, shape)
        )

    return lagged


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


CAUSE = DcLinkSag()
