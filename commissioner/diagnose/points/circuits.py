"""The two circuits behind test points, locked rotor and no load, with what may extend them; fit and hold-out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.causes.in_points import InPoints
from commissioner.diagnose.intake.points import Array, Points
from commissioner.diagnose.points.magnetizing import ROTOR_SHARE, SPREAD, main_over_leakage

Factor = Callable[[str, Array], Array]
LEAST_SCATTER = 0.002
"""No instrument of such a test is trusted beyond two parts in a thousand."""

LEAST_VARIANCE = 1.0
"""Of errors over their scatter: points on a circuit to the last digit else name what no instrument shows, and sharpen the prior."""

ROUNDS = 9
"""Fixed-point rounds from the measured current; each takes off nine tenths of the error and more."""


HALF_OF_THE_DIGITS = float(np.sqrt(np.finfo(float).eps))
"""The step of a forward difference, over the larger of a number and 1."""
FARTHEST = 50.0
"""From its start, of the logarithm of a resistance (or loss) or inductance: a trial step beyond overflows."""


def own_numbers(points: Points) -> int:
    """Of the circuit without extensions: (ln R, ln L), and ln L_M / L_sigma of a locked rotor, which a prior ties."""
    return 3 if points.is_locked else 2


@dataclass(frozen=True)
class Extension:
    """A candidate: a cause by name, and what it does in a table of points."""

    name: str
    does: InPoints


def candidates_for(points: Points) -> list[Extension]:
    """Causes that act in such a table and that these points can show, in the order of their circuit."""
    some = [Extension(n, c.in_points) for n, c in CATALOGUE.items() if c.in_points]
    return [e for e in some if e.does.is_locked == points.is_locked and e.does.is_shown(points)]


def _start(points: Points, extensions: Sequence[Extension]) -> tuple[Array, Array, Array]:
    """Start, lower and upper bounds: the circuit's own numbers and zero for every extension's."""
    resistance = points.power_w / (3.0 * points.current_line_a**2)
    size = points.phase_voltage_v / points.current_line_a
    reactance = np.sqrt(np.maximum(size**2 - resistance**2, 1e-6 * size**2))
    known = 0.0 if points.resistance_ohm is None else points.resistance_ohm
    first = (
        np.median(np.maximum(resistance - known, 0.05 * resistance)) if points.is_locked else np.median(points.power_w)
    )
    start = [float(np.log(first)), float(np.log(np.median(reactance / points.omega)))]
    if points.is_locked:
        start.append(float(np.log(main_over_leakage(points))))
    low, high = [x - FARTHEST for x in start], [x + FARTHEST for x in start]
    for extension in extensions:
        start += extension.does.start
        low += extension.does.lower
        high += extension.does.upper
    return np.array(start), np.array(low), np.array(high)


def _predicted(
    x: Array, points: Points, extensions: Sequence[Extension], scale: Mapping[str, float]
) -> tuple[Array, Array]:
    """Current (A rms) and power (W) at the points' voltage and frequency, `(n,)`; `(k, n)` of k sets of numbers, x of `(numbers, k, 1)`."""
    acting: dict[str, tuple[Extension, Array]] = {}
    at = own_numbers(points)
    for extension in extensions:
        acting[extension.does.acts_on] = extension, x[at : at + extension.does.numbers]
        at += extension.does.numbers

    def factor(of: str, size: Array) -> Array:
        """What acts there makes of it, at this current or flux over the reference."""
        if of not in acting:
            return np.ones(points.count)
        extension, numbers = acting[of]
        return extension.does.factor(numbers, size, points.frequency_hz / scale["frequency_hz"])

    return (_locked if points.is_locked else _no_load)(x, points, factor, scale)


def _locked(x: Array, points: Points, factor: Factor, scale: Mapping[str, float]) -> tuple[Array, Array]:
    """Z = R_s + j w L_0 / (1 + s I / I_0) + (j w L_M parallel R_R (1 + c ((f/f_0)^2 - 1))): skin effect c, leakage saturation s.

    The iteration on I converges because L falls slowly (Lipo & Consoli, IEEE Trans. Ind. Appl. IA-20(1), 1984). Without the stator's
    resistance the first number is R_s + R_R.
    """
    current = points.current_line_a.copy()
    rotor = np.exp(x[0]) * factor("resistance", current)
    stator = points.resistance_ohm
    if stator is None:
        stator, rotor = (1.0 - ROTOR_SHARE) * rotor, ROTOR_SHARE * rotor
    over_main = rotor / (points.omega * np.exp(x[1] + x[2]))
    seen = rotor / (1.0 + over_main**2)
    resistance = stator + seen
    for _ in range(ROUNDS):
        reactance = points.omega * np.exp(x[1]) / factor("leakage", current / scale["current_a"])
        current = points.phase_voltage_v / np.hypot(resistance, reactance + seen * over_main)
    return current, 3.0 * resistance * current**2


def _no_load(x: Array, points: Points, factor: Factor, scale: Mapping[str, float]) -> tuple[Array, Array]:
    """i_m = psi/L (1 + b (psi/psi_0)^S) and P = P_loss + 3 R_s I^2; P_loss = P_0 (1 - g) (f/f_0)^2 of friction and
    P_0 g (f/f_0)^1.5 (V f_0 / V_0 f)^n of iron.
    """
    stator = np.zeros(points.count) if points.resistance_ohm is None else points.resistance_ohm
    applied = points.phase_voltage_v / points.omega / scale["flux_wb"]
    friction = (points.frequency_hz / scale["frequency_hz"]) ** 2
    loss = np.exp(x[0]) * factor("loss", applied) * friction
    current = points.current_line_a.copy()
    for _ in range(ROUNDS):
        active = np.minimum(loss / (3.0 * points.phase_voltage_v), 0.9 * current)
        induced = np.hypot(
            points.phase_voltage_v - stator * active, stator * np.sqrt(np.maximum(current**2 - active**2, 0.0))
        )
        flux = induced / points.omega
        reactive = flux / np.exp(x[1]) * factor("magnetizing", flux / scale["flux_wb"])
        current = np.hypot(reactive, active)
    return current, loss + 3.0 * stator * current**2


def scales(points: Points) -> dict[str, float]:
    """Reference point of the extensions, and the scatter of current and power about the richest circuit.

    The two channels scatter differently (a wattmeter at low power factor), so each is weighed by its own.
    """
    scale = {
        "frequency_hz": float(points.frequency_hz.min()),
        "current_a": float(np.median(points.current_line_a)),
        "flux_wb": float(np.max(points.phase_voltage_v / points.omega)),
        "current_scatter": LEAST_SCATTER,
        "power_scatter": LEAST_SCATTER,
    }
    left = LEAST_SCATTER * errors_of(points, fit_points(points, candidates_for(points), scale)[2])
    scale["current_scatter"], scale["power_scatter"] = (
        max(float(x), LEAST_SCATTER) for x in np.sqrt(np.mean(left**2, axis=0))
    )
    return scale


def errors_of(points: Points, left: Array) -> Array:
    """`(n, 2)` of what `fit_points` leaves, without the prior's part."""
    return np.asarray(left[: 2 * points.count].reshape(2, -1).T)


def fit_points(
    points: Points, extensions: Sequence[Extension], scale: Mapping[str, float], near: Array | None = None
) -> tuple[Array, Array, Array]:
    """Estimate, covariance and relative errors (current, power) over their scatter at the optimum, searched from `near`; of a locked
    rotor the prior's error stands last."""
    start, low, high = _start(points, extensions)
    usual = start[2:3] if points.is_locked else start[:0]
    start = start if near is None else near

    def errors(x: Array) -> Array:
        """`(k, 2 n + prior)` of k sets of numbers, `(k, numbers)`."""
        current, power = _predicted(x.T[..., None], points, extensions, scale)
        return np.concatenate(
            [
                (current / points.current_line_a - 1.0) / scale["current_scatter"],
                (power / points.power_w - 1.0) / scale["power_scatter"],
                (x[:, 2 : 2 + usual.size] - usual) / SPREAD,
            ],
            axis=1,
        )

    solution = least_squares(
        lambda x: errors(x[None])[0], start, lambda x: forward_differences(errors, x, high), bounds=(low, high), x_scale="jac", max_nfev=100,
    )  # fmt: skip
    freedom = max(solution.fun.size - start.shape[0], 1)
    variance = max(float(solution.fun @ solution.fun) / freedom, LEAST_VARIANCE)
    covariance = variance * np.linalg.pinv(solution.jac.T @ solution.jac)
    return solution.x, covariance, solution.fun


def forward_differences(errors: Callable[[Array], Array], x: Array, high: Array | float) -> Array:
    """Jacobian `(m, numbers)` of errors `(k, m)` that are asked for k sets of numbers at once; no step passes `high`."""
    steps = HALF_OF_THE_DIGITS * np.maximum(np.abs(x), 1.0)
    moved = x + np.diag(np.where(x + steps > high, -steps, steps))
    at, *others = errors(np.vstack([x, moved]))
    return np.asarray((np.array(others) - at).T / (np.diag(moved) - x))


def held_out(points: Points, extensions: Sequence[Extension], scale: Mapping[str, float]) -> Array:
    """Relative errors over their scatter (n, 2) of every point, predicted from the others."""
    out = []
    near = fit_points(points, extensions, scale)[0]
    for k in range(points.count):
        x, _, _ = fit_points(points.without(k), extensions, scale, near)
        one = points.only(k)
        current, power = _predicted(x, one, extensions, scale)
        out.append([float(current[0] / one.current_line_a[0] - 1.0), float(power[0] / one.power_w[0] - 1.0)])
    errors: Array = np.array(out) / np.array([scale["current_scatter"], scale["power_scatter"]])
    return errors
