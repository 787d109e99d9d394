"""Several axes, one motor: mean, spread, and what the spread says.

A current sensor's gain error scales every resistance and inductance seen along an axis alike, with a 2 theta pattern
(`standstill_identification` section 3.3); an anisotropic machine changes inductances only; heating changes R_s only, in
the order of the tests. All three are fitted together to the logarithms of the axes' parameters and named where their
coefficients are significant.
"""

from __future__ import annotations

import enum
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, chdtri

from commissioner.motor.circuit import PARAMETERS, InverseGamma
from commissioner.motor.quantities import field_name

Matrix = NDArray[np.float64]
SIGNIFICANCE = 0.01
FLOOR = 2e-4
"""No axis result is believed better than this, relatively, when axes are compared: what models leave out varies with
them."""

FEWEST_ORIENTATIONS = 3


@dataclass(frozen=True)
class AxisEstimate:
    """One orientation's result, in the order tested; `covariance` (4, 4) as `InverseGamma.as_tuple`."""

    axis_deg: float
    parameters: InverseGamma
    covariance: Matrix


class Cause(enum.Enum):
    SENSOR_GAIN = "current sensors differ in gain: resistances and inductances change together with the axis"
    ANISOTROPY = "the machine differs between axes: inductances change with the axis, resistances do not"
    HEATING = "the stator winding changed temperature: its resistance follows the order of the tests"
    UNEXPLAINED = "the axes differ by more than their errors, and not as sensors, anisotropy or heating would make them"


@dataclass(frozen=True)
class Finding:
    """`relative_size`: amplitude over axes (sensor gain, anisotropy) or change from first to last test (heating)."""

    cause: Cause
    relative_size: float
    relative_std: float
    probability_by_chance: float


@dataclass(frozen=True)
class Combined:
    """Information-weighted mean, its covariance widened by the dispersion where that is larger, relative dispersion
    `(4,)`."""

    parameters: InverseGamma
    covariance: Matrix
    relative_dispersion: tuple[float, float, float, float]
    findings: tuple[Finding, ...]
    remarks: tuple[str, ...]


def combine(axes: Sequence[AxisEstimate], common: Matrix | None = None) -> Combined:
    """The motor's parameters from one or more axes (ValueError for none).

    `common` (4, 4) is the part of the axes' covariances that all of them share, such as one inverter's: no number of
    axes averages it out.
    """
    logs = np.array([np.log(a.parameters.as_tuple()) for a in axes])
    covariances = [_log_covariance(a) for a in axes]
    weights = [np.linalg.inv(c) for c in covariances]
    bound = np.linalg.inv(np.sum(weights, axis=0))
    mean = bound @ np.sum([w @ x for w, x in zip(weights, logs, strict=True)], axis=0)
    spread = np.std(logs, axis=0, ddof=1) if len(axes) > 1 else np.zeros(4)
    of_mean = spread / math.sqrt(len(axes))
    std = np.maximum(np.sqrt(np.diag(bound)), of_mean)
    widen = std / np.sqrt(np.diag(bound))
    values = np.exp(mean)
    covariance = bound * np.outer(widen, widen) * np.outer(values, values)
    if common is not None:
        covariance = covariance + (1.0 - 1.0 / len(axes)) * common
    findings = _explain(axes, logs, covariances) if len(axes) >= 3 else ()
    a, b, c, d = map(float, values)
    s = [float(x) for x in spread]
    return Combined(InverseGamma(a, b, c, d), covariance, (s[0], s[1], s[2], s[3]), tuple(findings), _remarks(axes))


def _log_covariance(axis: AxisEstimate) -> Matrix:
    values = np.array(axis.parameters.as_tuple())
    return np.asarray(axis.covariance / np.outer(values, values) + FLOOR**2 * np.eye(4))


def _remarks(axes: Sequence[AxisEstimate]) -> tuple[str, ...]:
    orientations = _orientations(axes)
    remarks = []
    if not _pattern_is_visible(axes):
        remarks.append(
            f"orientations: {len(orientations)}; sensor gain and anisotropy need at least three: what the phases or their sensors "
            "differ by is in the values, and not all of it in the intervals"
        )
    if len(orientations) == len(axes) and len(axes) > 1:
        remarks.append("no orientation was repeated: heating cannot be told from differences between axes")
    return tuple(remarks)


_GROUPS: dict[Cause, tuple[int, ...]] = {Cause.SENSOR_GAIN: (4, 5), Cause.ANISOTROPY: (6, 7), Cause.HEATING: (8,)}


def _explain(axes: Sequence[AxisEstimate], logs: Matrix, covariances: Sequence[Matrix]) -> list[Finding]:
    """Of all sets of causes the one that lowers chi-square most beyond chance. Causes added one at a time and never taken
    back name a sensor beside every large anisotropy."""
    possible = [c for c in _GROUPS if (_order_is_visible if c is Cause.HEATING else _pattern_is_visible)(axes)]
    sets = [list(s) for n in range(len(possible) + 1) for s in itertools.combinations(possible, n)]
    chosen = min(sets, key=lambda s: _fit(axes, logs, covariances, s)[0] + sum(_price(c) for c in s))
    chi_square, degrees, solution, covariance = _fit(axes, logs, covariances, chosen)
    findings = [_finding(c, axes, logs, covariances, chosen, solution, covariance) for c in chosen]
    chance = float(chdtrc(degrees, chi_square)) if degrees > 0 else 1.0
    if chance < SIGNIFICANCE / 10.0:
        rest = math.sqrt(chi_square / degrees)
        findings.append(Finding(Cause.UNEXPLAINED, rest * FLOOR, FLOOR, chance))
    return findings


def _price(cause: Cause) -> float:
    """What a cause must take off chi-square to be named."""
    return float(chdtri(len(_GROUPS[cause]), SIGNIFICANCE / len(_GROUPS)))


def _order_is_visible(axes: Sequence[AxisEstimate]) -> bool:
    """Heating shows in a repeated orientation, or where there are more tests than a 2 theta pattern can absorb."""
    return len(_orientations(axes)) < len(axes) or len(axes) > 3


def _pattern_is_visible(axes: Sequence[AxisEstimate]) -> bool:
    """Mean, cosine and sine of 2 theta are three unknowns: two orientations leave their sizes open."""
    return len(_orientations(axes)) >= FEWEST_ORIENTATIONS


def _orientations(axes: Sequence[AxisEstimate]) -> set[float]:
    return {round(a.axis_deg % 180.0, 3) for a in axes}


def _fit(
    axes: Sequence[AxisEstimate], logs: Matrix, covariances: Sequence[Matrix], causes: Sequence[Cause]
) -> tuple[float, int, Matrix, Matrix]:
    columns = [0, 1, 2, 3, *(k for cause in causes for k in _GROUPS[cause])]
    normal, right, total = np.zeros((9, 9)), np.zeros(9), 0.0
    for k, axis in enumerate(axes):
        design = _design(axis.axis_deg, k / max(len(axes) - 1, 1))
        weight = np.linalg.inv(covariances[k])
        normal += design.T @ weight @ design
        right += design.T @ weight @ logs[k]
        total += float(logs[k] @ weight @ logs[k])
    part = np.ix_(columns, columns)
    covariance: Matrix = np.asarray(np.linalg.pinv(normal[part]), dtype=np.float64)
    solution = covariance @ right[columns]
    return total - float(right[columns] @ solution), 4 * len(axes) - len(columns), solution, np.asarray(covariance)


def _design(axis_deg: float, order: float) -> Matrix:
    """(4, 9): log parameters over 4 means, sensor gain cos/sin, anisotropy cos/sin, heating."""
    angle = 2.0 * math.radians(axis_deg)
    design = np.zeros((4, 9))
    design[:, :4] = np.eye(4)
    design[:, 4], design[:, 5] = math.cos(angle), math.sin(angle)
    design[2:, 6], design[2:, 7] = math.cos(angle), math.sin(angle)
    design[0, 8] = order
    return design


def _finding(
    cause: Cause,
    axes: Sequence[AxisEstimate],
    logs: Matrix,
    covariances: Sequence[Matrix],
    chosen: Sequence[Cause],
    solution: Matrix,
    covariance: Matrix,
) -> Finding:
    offset = 4 + sum(len(_GROUPS[c]) for c in chosen[: chosen.index(cause)])
    mine = slice(offset, offset + len(_GROUPS[cause]))
    size = float(np.linalg.norm(solution[mine]))
    std = float(np.sqrt(np.max(np.diag(covariance)[mine])))
    without = [c for c in chosen if c is not cause]
    gain = _fit(axes, logs, covariances, without)[0] - _fit(axes, logs, covariances, chosen)[0]
    signed = float(solution[mine][0]) if cause is Cause.HEATING else size
    return Finding(cause, signed, std, float(chdtrc(len(_GROUPS[cause]), max(gain, 0.0))))


# -- the same motor, weeks later ----------------------------------------------------------------------------------


class Identity(enum.Enum):
    SAME = "the same motor: no parameter has changed beyond error and temperature"
    CHANGED = "the same motor, changed"
    OTHER = "another motor"


@dataclass(frozen=True)
class Change:
    parameter: str
    relative_change: float
    sigmas: float


@dataclass(frozen=True)
class Comparison:
    """`changes` lists every parameter, the most significant first; `verdict` counts those beyond `limit_sigmas`."""

    verdict: Identity
    changes: tuple[Change, ...]
    limit_sigmas: float
    reason: str


REPEATABILITY = (0.004, 0.006, 0.006, 0.008)
"""What each repeated test of an unchanged motor scatters beyond its stated errors (sensor drift, rotor position), one standard
deviation as in ISO 5725: a difference of two tests has it twice."""
TEMPERATURE_K = 25.0
"""One standard deviation of the unknown difference in winding temperature between two tests; each has its half of the variance."""
ROTOR_BESIDE = 0.3
"""How far a rotor's unknown temperature differs from its winding's, as a share of that."""
RESISTANCE_PER_K = 0.0039


def scatter(test: Combined, temperature_is_known: bool) -> Matrix:
    """(4,), one standard deviation of the parameters' logarithms: what one test of an unchanged motor scatters in all. A
    difference of two tests scatters by the root of both squares."""
    claimed = np.diag(test.covariance) / np.square(test.parameters.as_tuple())
    heat = 0.0 if temperature_is_known else RESISTANCE_PER_K * TEMPERATURE_K / math.sqrt(2.0)
    warm = np.array([heat, math.hypot(heat, ROTOR_BESIDE * heat), 0.0, 0.0])
    return np.asarray(np.sqrt(claimed + np.square(REPEATABILITY) + warm**2))


def compare(
    before: Combined,
    after: Combined,
    temperature_is_known: tuple[bool, bool] = (False, False),
    limit_sigmas: float = 3.5,
) -> Comparison:
    """Whether two results belong to one motor. Resistances may move with an unknown temperature of either; a motor of
    which both inductances, or three parameters, have moved by more than a tenth is another one."""
    difference = np.log(after.parameters.as_tuple()) - np.log(before.parameters.as_tuple())
    std = [scatter(test, known) for test, known in zip((before, after), temperature_is_known, strict=True)]
    sigmas = np.abs(difference) / np.hypot(*std)
    changes = tuple(
        Change(PARAMETERS[k], float(math.expm1(difference[k])), float(sigmas[k])) for k in np.argsort(-sigmas)
    )
    far = (np.abs(difference) > 0.1) & (sigmas > limit_sigmas)
    if (far[2] and far[3]) or far.sum() >= 3:
        return Comparison(Identity.OTHER, changes, limit_sigmas, _sentence(changes, limit_sigmas))
    if np.any(sigmas > limit_sigmas):
        return Comparison(Identity.CHANGED, changes, limit_sigmas, _sentence(changes, limit_sigmas))
    return Comparison(
        Identity.SAME,
        changes,
        limit_sigmas,
        f"largest difference {_in_errors(changes[0])}, {field_name(changes[0].parameter)}",
    )


def _sentence(changes: Sequence[Change], limit: float) -> str:
    beyond = [c for c in changes if c.sigmas > limit]
    return ", ".join(f"{field_name(c.parameter)} {100 * c.relative_change:+.1f} % ({_in_errors(c)})" for c in beyond)


def _in_errors(change: Change) -> str:
    return f"{change.sigmas:.1f} standard errors"
