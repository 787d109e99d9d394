"""What a constant-parameter circuit gets wrong in steady-state test points, by name.

An effect is named when it is significant in a nested F test *and* predicts points left out of the fit clearly better.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.intake.points import Array, Points
from commissioner.diagnose.points.bars import SlowRotor, remark_of, slow_rotor
from commissioner.diagnose.points.circuits import (
    LEAST_VARIANCE,
    Extension,
    candidates_for,
    errors_of,
    fit_points,
    held_out,
    own_numbers,
    scales,
)
from commissioner.motor.circuit import Quantity
from commissioner.records import DiagnosisVerdict

SIGNIFICANCE = 1e-3
LEAST_HELD_OUT_GAIN = 0.25
LEAST_RISE = 0.02
"""Of the rotor's resistance over the frequencies measured: less is nothing to name."""
MOST_SCATTER = {"current": 0.05, "power": 0.1}
"""Rms error of the fitted points that coarse instruments may still make; beyond it no circuit here describes them."""


@dataclass(frozen=True)
class PointCause:
    """A named cause with its size, the F test's p value, and the share of the held-out error it removes."""

    name: str
    sizes: Mapping[str, tuple[float, float, str]]
    p_value: float
    gain_share: float


@dataclass(frozen=True)
class PointErrors:
    """Relative errors (n, 2) of predicted current and power at every point: left out of the fit, and in it."""

    left_out: Array
    fitted: Array


@dataclass(frozen=True)
class PointsDiagnosis:
    """Verdict on one table. Errors are of the predicted current, rms over points left out one at a time, A."""

    test: str
    verdict: DiagnosisVerdict
    reason: str
    causes: tuple[PointCause, ...]
    rmse_before_a: float
    rmse_after_a: float
    relative_before: float
    relative_after: float
    held_out_gain: float
    parameters_before: Mapping[str, Quantity]
    parameters_after: Mapping[str, Quantity]
    tested: Mapping[str, float]
    points: Points
    errors_before: PointErrors
    errors_after: PointErrors


def diagnose_points(points: Points, resistance_ohm: float | None = None) -> PointsDiagnosis:
    """Forward selection from the constant-parameter circuit; every step must pass the F test and the hold-out."""
    if points.resistance_ohm is None and resistance_ohm is not None:
        points = replace(points, resistance_ohm=np.full(points.count, resistance_ohm))
    candidates, scale = candidates_for(points), scales(points)
    accepted: list[Extension] = []
    p_values: dict[str, float] = {}
    tested: dict[str, float] = {}
    while candidates:
        trials = [(c, *_compare(points, accepted, c, scale)) for c in candidates]
        for candidate, p_value, _ in trials:
            tested[candidate.name] = p_value
        passing = [t for t in trials if t[1] < SIGNIFICANCE and t[2] > LEAST_HELD_OUT_GAIN]
        if not passing:
            break
        best = min(passing, key=lambda t: t[1])
        accepted.append(best[0])
        p_values[best[0].name] = best[1]
        candidates = [c for c in candidates if c.name != best[0].name]
    return _conclude(points, accepted, p_values, tested, scale)


def _compare(
    points: Points, accepted: Sequence[Extension], candidate: Extension, scale: Mapping[str, float]
) -> tuple[float, float]:
    """p value of the nested F test and, where that is small, the share of held-out error power the candidate removes."""
    before = float((fit_points(points, accepted, scale)[2] ** 2).sum())
    x, _, left = fit_points(points, [*accepted, candidate], scale)
    after = float((left**2).sum())
    freedom = left.size - x.size
    has_right_sign = x[-candidate.does.numbers] > 1e-6
    if freedom < 2 or not has_right_sign:
        return 1.0, 0.0
    ratio = (before - after) / candidate.does.numbers / max(after / freedom, LEAST_VARIANCE)
    p_value = float(fdtrc(candidate.does.numbers, freedom, max(ratio, 0.0)))
    if p_value > SIGNIFICANCE:
        return p_value, 0.0
    held_before = float((held_out(points, accepted, scale) ** 2).sum())
    held_after = float((held_out(points, [*accepted, candidate], scale) ** 2).sum())
    return p_value, 1.0 - held_after / max(held_before, 1e-300)


def _conclude(
    points: Points,
    accepted: Sequence[Extension],
    p_values: Mapping[str, float],
    tested: Mapping[str, float],
    scale: Mapping[str, float],
) -> PointsDiagnosis:
    held_before, held_after = held_out(points, [], scale), held_out(points, accepted, scale)
    total = float((held_before**2).sum())
    causes = []
    x, covariance, left = fit_points(points, accepted, scale)
    unit = np.array([scale["current_scatter"], scale["power_scatter"]])
    after = PointErrors(held_after * unit, errors_of(points, left) * unit)
    missed = _missed(after, x.size)
    at = own_numbers(points)
    for extension in accepted:
        others = [e for e in accepted if e.name != extension.name]
        share = float((held_out(points, others, scale) ** 2).sum() - (held_after**2).sum()) / max(total, 1e-300)
        mine = slice(at, at + extension.does.numbers)
        sizes = _sizes(extension, x[mine], covariance[mine, mine], points, scale)
        causes.append(PointCause(extension.name, sizes, p_values[extension.name], float(np.clip(share, 0.0, 1.0))))
        at += extension.does.numbers
    slow = slow_rotor(points)
    if slow is not None and slow.p_value < SIGNIFICANCE and slow.rise_over_range[0] > LEAST_RISE:
        causes, bars = _with_bars(causes, slow), PointErrors(slow.left_out, slow.fitted)
        if _beyond_instruments(of_bars := _missed(bars, slow.numbers)) < _beyond_instruments(missed):
            after, missed = bars, of_bars
    if points.is_locked:
        remark = remark_of(slow, np.unique(points.frequency_hz).tolist())
        points = replace(points, remarks=(*points.remarks, remark))
    verdict, reason = _verdict(points, causes, tested, missed)
    plain = fit_points(points, [], scale)
    before = PointErrors(held_before * unit, errors_of(points, plain[2]) * unit)
    rms = [float(np.sqrt(np.mean((e.left_out[:, 0] * points.current_line_a) ** 2))) for e in (before, after)]
    relative = [float(np.sqrt(np.mean(e.left_out**2))) for e in (before, after)]
    gain = 1.0 - (relative[1] / relative[0]) ** 2 if relative[0] > 0 else 0.0
    return PointsDiagnosis(
        "locked rotor" if points.is_locked else "no load",
        verdict,
        reason,
        () if verdict == "unexplained" else tuple(causes),
        rms[0],
        rms[1],
        relative[0],
        relative[1],
        gain,
        _parameters(points, plain[0], plain[1]),
        _parameters(points, x, covariance) | _slow(slow),
        dict(tested),
        points,
        before,
        after,
    )


def _slow(slow: SlowRotor | None) -> dict[str, Quantity]:
    return {} if slow is None else {"rotor_resistance_ohm": Quantity(slow.resistance_ohm, slow.std_ohm)}


def _with_bars(causes: Sequence[PointCause], slow: SlowRotor) -> list[PointCause]:
    """With the displacement of current that the frequencies show, where the plain rise with f squared did not."""
    bars = next(n for n, c in CATALOGUE.items() if c.in_points and c.in_points.acts_on == "resistance")
    if any(c.name == bars for c in causes):
        return list(causes)
    sizes = {"resistance_rise_over_range": (*slow.rise_over_range, "1")}
    return [*causes, PointCause(bars, sizes, slow.p_value, 0.0)]


def _missed(errors: PointErrors, numbers: int) -> dict[str, float]:
    """Rms of the fitted points' errors, by what they are of, for the numbers that were fitted."""
    freedom = max(1.0 - numbers / (2.0 * errors.fitted.shape[0]), 0.25)
    return dict(zip(MOST_SCATTER, np.sqrt(np.mean(errors.fitted**2, axis=0) / freedom).tolist(), strict=True))


def _beyond_instruments(missed: Mapping[str, float]) -> float:
    """The larger of both errors over what instruments may make."""
    return max(missed[what] / most for what, most in MOST_SCATTER.items())


def _verdict(
    points: Points, causes: Sequence[PointCause], tested: Mapping[str, float], missed: Mapping[str, float]
) -> tuple[DiagnosisVerdict, str]:
    where = f"the {'locked-rotor' if points.is_locked else 'no-load'} points"
    if _beyond_instruments(missed) > 1.0:
        errors = " and ".join(
            f"{missed[what]:.1%} in {what} (instruments: up to {most:.0%})" for what, most in MOST_SCATTER.items()
        )
        return "unexplained", (
            f"Read as {where.removeprefix('the ')}, the best circuit misses them by {errors}: points of more than one motor or "
            "test, of a motor under load, in other units than the column says, or with a cause that no circuit here has."
        )
    if causes:
        return (
            "explained",
            f"The named causes predict {where} left out of the fit clearly better than constant parameters.",
        )
    return (
        "nothing_significant",
        f"Constant parameters describe {where} as well as their scatter allows ({len(tested)} causes tested).",
    )


def _sizes(
    extension: Extension, x: Array, covariance: Array, points: Points, scale: Mapping[str, float]
) -> dict[str, tuple[float, float, str]]:
    """What an extension does over the table's own range, which the points fix better than its numbers."""
    value = extension.does.sizes(x, points, scale)
    spread = np.sqrt(np.diag(covariance))
    slopes = {key: np.zeros(x.size) for key in value}
    for k in np.flatnonzero(spread > 0.0):
        step = np.zeros(x.size)
        step[k] = 1e-3 * min(float(spread[k]), abs(float(x[k])) + 1e-6)
        above, below = (extension.does.sizes(x + sign * step, points, scale) for sign in (1.0, -1.0))
        for key, slope in slopes.items():
            slope[k] = (above[key] - below[key]) / (2.0 * step[k])
    return {key: (value[key], max(float(slope @ covariance @ slope), 0.0) ** 0.5, "1") for key, slope in slopes.items()}


def _parameters(points: Points, x: Array, covariance: Array) -> dict[str, Quantity]:
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    first, second = float(np.exp(x[0])), float(np.exp(x[1]))
    if not points.is_locked:
        return {
            "loss_at_highest_voltage_w": Quantity(first, first * float(spread[0])),
            "stator_inductance_h": Quantity(second, second * float(spread[1])),
        }
    name = "rotor_resistance_ohm" if points.resistance_ohm is not None else "total_resistance_ohm"
    return {
        name: Quantity(first, first * float(spread[0])),
        "leakage_inductance_h": Quantity(second, second * float(spread[1])),
    }
