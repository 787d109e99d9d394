"""Known functions of time that effects ride on: heat doses, lagged power, ripple and mains lines, speed splines, phase patterns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.linalg import expm
from scipy.signal import lfilter, ss2tf

from commissioner.diagnose.causes.mains_lines import courses_of, found_lines, recorded_sag, without_lines
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import TO_PHASES, Named, Record, Segment
from commissioner.diagnose.kernels.link import behind_diodes
from commissioner.diagnose.plant.model import Layout, Model
from commissioner.diagnose.plant.prediction import predict

Array = NDArray[np.float64]
SAG_LAGS_S = (0.0003, 0.001, 0.003, 0.01, 0.03, 0.1)
SWINGING, DRAWN, ROOT, HELD = (
    tuple(f"sag_{of}{lag * 1e3:g}ms" for lag in SAG_LAGS_S) for of in ("", "drawn_", "root_", "held_")
)
"""Lagged powers: with their sign, from a source that takes back what it gave; without what is given back; the root of that, as of a
rectifier whose current flows in gaps; and of a capacitor behind diodes, which holds what is given back until it is drawn.
"""
RECORDED_LINK, LEAST_SWING = "link_recorded", 1e-5
"""The swing of a recorded link, without its ripple; and what counts as none, of the link."""
HEAT_LEAKS_S = {"": np.inf, "_20s": 20.0, "_6s": 6.0}
"""Time constants (s) with which heat leaks away, by how the names end: in sums of these every course with one of 5 s or more is
there to 1 % of its power, from 20 s on to 0.03 %."""
STATOR_HEAT = (*(f"{kind}{leak}" for kind in ("own", "mean") for leak in HEAT_LEAKS_S), "time", "settling")
CAGE_HEAT = tuple(f"rotor_heat{kind}" for kind in (*HEAT_LEAKS_S, "_time", "_settling"))
"""Warmth that is carried over from segment to segment: of the windings by their own loss or the mean of the three, and of the cage."""
FRESH_STATOR_HEAT, FRESH_CAGE_HEAT = "fresh", "rotor_heat_fresh"
"""Of a motor that cools in the pauses, whatever the time stamps say."""
SETTLED = 4.0
"""Thermal time constants in a recording, for a temperature that settles within it."""
SPEED_SPLINE, FINE_SPEED_SPLINE = "hat_", "hat_fine_"
SPEED_KNOTS_S = {SPEED_SPLINE: (0.4, 40), FINE_SPEED_SPLINE: (0.1, 80)}
"""Spacing of a speed's cubic splines, and the most intervals of a segment. A shaft held by its load swings below about 1 Hz, which the
wide ones follow to a per cent; the fine ones follow 2.5 Hz to a per cent."""


def add_channels(record: Record, model: Model, layout: Layout, noise: Noise) -> tuple[Record, dict[str, float]]:
    """The record with every known function of time, and the refined mains-bound frequencies (`ripple_300`: Hz)."""
    predictions = [predict(model, record, k, layout) for k in range(len(record.segments))]
    residuals = [s.currents_a - p.currents_a for s, p in zip(record.segments, predictions, strict=True)]
    lines = {name: frequency for name, (frequency, _) in found_lines(record, residuals, model, noise).items()}
    return with_known(record, [p.rotor_current_a for p in predictions], lines), lines


def with_known(record: Record, rotor_current_a: Sequence[Array], lines: Mapping[str, float]) -> Record:
    """The known functions of time in their fixed order, for given rotor currents and line frequencies."""
    return record.with_channels(
        _phase_patterns(record),
        _heat(record, rotor_current_a),
        _sag(record),
        _own(record),
        _speed_splines(record, SPEED_SPLINE),
        *courses_of(record, lines),
    )


def with_fine_speed_splines(record: Record, lines: Mapping[str, float]) -> Record:
    """The record with splines for a faster speed as well, before its lines."""
    return without_lines(record).with_channels(_speed_splines(record, FINE_SPEED_SPLINE), *courses_of(record, lines))


def _own(record: Record) -> Named:
    """What causes bring themselves, in the catalogue's order."""
    from commissioner.diagnose.causes import CATALOGUE

    named = {name: of for cause in CATALOGUE.values() for name, of in cause.regressors(record).items()}
    return tuple(named), [np.column_stack(columns) for columns in zip(*named.values(), strict=True)]


def _phase_patterns(record: Record) -> Named:
    """Phase resistances of a second-harmonic tensor, constant: cos and sin of twice the phase angle."""
    double = 2.0 * np.arctan2(TO_PHASES[:, 1], TO_PHASES[:, 0])
    row = np.concatenate([np.cos(double), np.sin(double)])
    names = tuple(f"phase_{n}_{p}" for n in ("cos", "sin") for p in "uvw")
    return names, [np.tile(row, (s.count, 1)) for s in record.segments]


def _three_phases(segment: Segment) -> Array:
    currents = np.where(segment.is_good, segment.currents_a, 0.0)
    if currents.shape[0] == 3:
        return currents
    return np.vstack([currents, -currents.sum(axis=0)])


def _heat(record: Record, rotor: Sequence[Array]) -> Named:
    """Doses in minutes at rated current, carried over segments: own phase, and mean of phases, each with every leak; plain time
    and time towards a settled temperature (to the same end as the mean); own phase since the segment's start; the same of the rotor.
    """
    rates = [_heat_rates(record, s, current) for s, current in zip(record.segments, rotor, strict=True)]
    doses = [_doses(record, rates, leak) for leak in HEAT_LEAKS_S.values()]
    ends = {s.file: dose[:, -1] for s, dose in zip(record.segments, doses[0], strict=True)}
    out = []
    for segment, rate, *here in zip(record.segments, rates, *doses, strict=True):
        since = _since_start(record, segment)
        settling = np.expm1(-SETTLED * since) / np.expm1(-SETTLED)
        fresh = np.cumsum(rate, axis=1) - rate
        end = ends[segment.file]
        windings = [
            *(dose[:3] for dose in here),
            *(np.repeat(dose[:3].mean(axis=0)[None], 3, axis=0) for dose in here),
            *(np.repeat(end[:3].mean() * x[None], 3, axis=0) for x in (since, settling)),
            fresh[:3],
        ]
        cage = [*(dose[3] for dose in here), end[3] * since, end[3] * settling, fresh[3]]
        out.append(np.vstack([*windings, *cage]).T)
    names = tuple(f"heat_{kind}_{p}" for kind in (*STATOR_HEAT, FRESH_STATOR_HEAT) for p in "uvw")
    return (*names, *CAGE_HEAT, FRESH_CAGE_HEAT), out


def _heat_rates(record: Record, segment: Segment, rotor_current: Array) -> Array:
    """(4, n) minutes at rated current that each sample adds: by the loss of every phase, and of the cage."""
    power = np.vstack([_three_phases(segment) ** 2, 0.5 * (rotor_current**2).sum(axis=0)])
    return np.asarray(2.0 * power / record.facts.rated_current_peak_a**2 * record.facts.sample_period_s / 60.0)


def _doses(record: Record, rates: Sequence[Array], leak_s: float) -> list[Array]:
    """Heat at every sample from those before it: d dose/dt = rate - dose / leak, over the segments of a file and their pauses."""
    stays = float(np.exp(-record.facts.sample_period_s / leak_s))
    out: list[Array] = []
    before: Segment | None = None
    held = np.zeros(0)
    for segment, rate in zip(record.segments, rates, strict=True):
        is_first = before is None or before.file != segment.file
        pause = 0.0 if before is None else max(float(segment.time_s[0] - before.time_s[-1]), 0.0)
        held = np.zeros(rate.shape[0]) if is_first else held * np.exp(-pause / leak_s)
        dose, _ = lfilter([1.0], [1.0, -stays], rate, axis=1, zi=held[:, None])
        out.append(dose - rate)
        before, held = segment, dose[:, -1]
    return out


def _since_start(record: Record, segment: Segment) -> Array:
    """Time since the file's first sample as a share of its whole length."""
    times = [s.time_s for s in record.segments if s.file == segment.file]
    share: Array = (segment.time_s - times[0][0]) / max(float(times[-1][-1] - times[0][0]), 1e-9)
    return share


def _sag(record: Record) -> Named:
    """Minus lagged electrical power over rated power; and the link's own course where it was recorded."""
    names, powers, period = (
        (*SWINGING, *DRAWN, *ROOT, *HELD),
        [power_of(record, s) for s in record.segments],
        record.facts.sample_period_s,
    )
    drawn = [np.maximum(p, 0.0) for p in powers]
    laws = [
        (behind_lag, powers),
        (behind_lag, drawn),
        (behind_lag, [np.sqrt(p) for p in drawn]),
        (behind_rectifier, powers),
    ]
    lagged = [law(of, period, lag) for law, of in laws for lag in SAG_LAGS_S]
    out = [-np.stack(courses, axis=1) for courses in zip(*lagged, strict=True)]
    recorded = recorded_sag(record)
    if not recorded or max(float(np.std(r)) for r in recorded) < LEAST_SWING:
        return names, out
    return (*names, RECORDED_LINK), [np.column_stack(pair) for pair in zip(out, recorded, strict=True)]


def power_of(record: Record, segment: Segment) -> Array:
    """Mean over each period, (n,), of the electrical power over rated power; the command of a sample acts on the current until the next."""
    current = segment.axis_current_a
    over_the_period = 0.5 * (current + np.append(current[1:], current[-1]))
    return np.asarray(1.5 * segment.voltage_axis_v * over_the_period / record.facts.rated_power_w)


def behind_lag(powers: Sequence[Array], period_s: float, lag_s: float, shape: float = 0.0) -> list[Array]:
    """Means over each period of powers (n,), held over each, behind the lag 1 / (1 + s S + s^2 q S^2), S = `lag_s`, q = `shape`."""
    top, bottom = _lag_filter(period_s, lag_s, shape)
    return [np.asarray(lfilter(top, bottom, power)) for power in powers]


@lru_cache(maxsize=256)
def _lag_filter(period_s: float, lag_s: float, shape: float) -> tuple[Array, Array]:
    """Numerator and denominator of `behind_lag` in z^-1."""
    # state (output, S times its slope if there is one), input, and the output's integral
    order = 2 if shape > 0.0 else 1
    rates = np.zeros((order + 2, order + 2))
    if shape > 0.0:
        rates[0, 1], rates[1, :3] = 1.0 / lag_s, np.array([-1.0, -1.0, 1.0]) / (shape * lag_s)
    else:
        rates[0, :2] = -1.0 / lag_s, 1.0 / lag_s
    rates[-1, 0] = 1.0 / period_s
    step = expm(rates * period_s)
    top, bottom = ss2tf(step[:order, :order], step[:order, [order]], step[[-1], :order], step[[-1], [order]])
    return top[0], bottom


def behind_rectifier(powers: Sequence[Array], period_s: float, lag_s: float) -> list[Array]:
    """As `behind_lag`, of a capacitor that diodes charge: what is given back stays in it until it is drawn."""
    return [behind_diodes(power, period_s / lag_s) for power in powers]


def _speed_splines(record: Record, name: str) -> Named:
    spacing_s, most_intervals = SPEED_KNOTS_S[name]
    out = []
    for segment in record.segments:
        seconds = segment.count * record.facts.sample_period_s
        intervals = int(np.clip(round(seconds / spacing_s), 2, most_intervals))
        knots = np.r_[np.zeros(3), np.linspace(0.0, 1.0, intervals + 1), np.ones(3)]
        out.append(BSpline.design_matrix(np.linspace(0.0, 1.0, segment.count), knots, 3).toarray())
    most = max(o.shape[1] for o in out)
    padded = [np.hstack([o, np.zeros((o.shape[0], most - o.shape[1]))]) for o in out]
    return tuple(f"{name}{k}" for k in range(most)), padded
