"""What a constant-parameter circuit gets wrong in steady-state test points (locked rotor, no load), by name.

Per point the terminal impedance is R + jX with R = P / (3 I^2) and |Z| = V / (sqrt(3) I) (IEC 60034-28, IEEE 112). An
effect is named when it is significant in a nested F test *and* predicts points left out of the fit clearly better.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import f as fisher

from commissioner.motor.circuit import Quantity

Array = NDArray[np.float64]
NEEDED = ("frequency_hz", "voltage_line_v", "current_line_a", "power_w")
RESISTANCES = ("winding_resistance_uv_ohm", "winding_resistance_ohm", "resistance_ohm", "winding_resistance_line_ohm")
LEAST_POINTS = 5
SIGNIFICANCE = 1e-3
LEAST_HELD_OUT_GAIN = 0.25
LEAST_SCATTER = 0.002
"""No instrument of such a test is trusted beyond two parts in a thousand."""
NO_LOAD_RESISTANCE_RATIO = 1.6
"""R = P/(3 I^2) of a locked rotor varies less than this over a test; at no load it falls with voltage by more."""


@dataclass(frozen=True)
class Points:
    """Steady-state points of one test: `(n,)` each, line values rms, three-phase power; `resistance_ohm` per star phase."""

    name: str
    frequency_hz: Array
    voltage_line_v: Array
    current_line_a: Array
    power_w: Array
    resistance_ohm: Array | None
    is_locked: bool

    @property
    def count(self) -> int:
        return int(self.current_line_a.shape[0])

    @property
    def omega(self) -> Array:
        return np.asarray(2.0 * np.pi * self.frequency_hz)

    @property
    def phase_voltage_v(self) -> Array:
        return np.asarray(self.voltage_line_v / np.sqrt(3.0))

    def without(self, k: int) -> Points:
        keep = np.arange(self.count) != k
        return self._at(keep)

    def only(self, k: int) -> Points:
        return self._at(np.arange(self.count) == k)

    def _at(self, keep: NDArray[np.bool_]) -> Points:
        return replace(
            self, frequency_hz=self.frequency_hz[keep], voltage_line_v=self.voltage_line_v[keep],
            current_line_a=self.current_line_a[keep], power_w=self.power_w[keep],
            resistance_ohm=None if self.resistance_ohm is None else self.resistance_ohm[keep],
        )


@dataclass(frozen=True)
class PointCause:
    """A named cause with its size, the F test's p value, and the share of the held-out error it removes."""

    name: str
    sizes: Mapping[str, tuple[float, float, str]]
    p_value: float
    gain_share: float


@dataclass(frozen=True)
class PointsDiagnosis:
    """Verdict on one table. Errors are of the predicted current, rms over points left out one at a time, A."""

    test: str
    verdict: str
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


def is_points_table(columns: Sequence[str]) -> bool:
    return all(name in columns for name in NEEDED)


def read_points(columns: Mapping[str, Array], name: str) -> Points | str:
    """The points of a table, or the sentence that says why they cannot be used."""
    values = [np.asarray(columns[c], dtype=float) for c in NEEDED]
    if any(not np.all(np.isfinite(v)) or np.any(v <= 0) for v in values):
        return "frequency, voltage, current and power must be positive numbers in every row"
    if values[0].shape[0] < LEAST_POINTS:
        return f"{values[0].shape[0]} points cannot carry an answer; at least {LEAST_POINTS} are needed"
    f, v, i, p = values
    if np.any(p > np.sqrt(3.0) * v * i):
        row = int(np.argmax(p / (v * i)))
        return f"row {row + 1}: the power {p[row]:.6g} W exceeds the apparent power {np.sqrt(3.0) * v[row] * i[row]:.6g} VA"
    between = next((np.asarray(columns[c], dtype=float) for c in RESISTANCES if c in columns), None)
    return Points(name, f, v, i, p, None if between is None else 0.5 * between, _is_locked(f, i, p, name))


def _is_locked(f: Array, i: Array, p: Array, name: str) -> bool:
    lowered = name.lower().replace("-", "_").replace(" ", "_")
    if "no_load" in lowered or "noload" in lowered:
        return False
    if "locked" in lowered or "short_circuit" in lowered:
        return True
    resistance = p / (3.0 * i**2)
    ratios = [float(np.ptp(np.log(resistance[f == one]))) for one in np.unique(f)]
    return max(ratios) < np.log(NO_LOAD_RESISTANCE_RATIO)


Predict = Callable[[Array, Points], tuple[Array, Array]]


@dataclass(frozen=True)
class _Extension:
    """A candidate: how many numbers, and whether the points can show it."""

    name: str
    numbers: int


def diagnose_points(points: Points, resistance_ohm: float | None = None) -> PointsDiagnosis:
    """Forward selection from the constant-parameter circuit; every step must pass the F test and the hold-out."""
    if points.resistance_ohm is None and resistance_ohm is not None:
        points = replace(points, resistance_ohm=np.full(points.count, resistance_ohm))
    candidates = _candidates(points)
    accepted: list[_Extension] = []
    p_values: dict[str, float] = {}
    tested: dict[str, float] = {}
    while candidates:
        trials = [(c, *_compare(points, accepted, c)) for c in candidates]
        for candidate, p_value, _ in trials:
            tested[candidate.name] = p_value
        passing = [t for t in trials if t[1] < SIGNIFICANCE and t[2] > LEAST_HELD_OUT_GAIN]
        if not passing:
            break
        best = min(passing, key=lambda t: t[1])
        accepted.append(best[0])
        p_values[best[0].name] = best[1]
        candidates = [c for c in candidates if c.name != best[0].name]
    return _conclude(points, accepted, p_values, tested)


def _candidates(points: Points) -> list[_Extension]:
    if not points.is_locked:
        return [_Extension("magnetizing_saturation", 2), _Extension("iron_loss", 2)]
    several = np.unique(points.frequency_hz).size > 1
    spread = float(points.current_line_a.max() / points.current_line_a.min())
    out = [_Extension("leakage_saturation", 1)] if spread > 1.3 else []
    return out + ([_Extension("rotor_skin_effect", 1)] if several else [])


def _start(points: Points, extensions: Sequence[_Extension]) -> tuple[Array, Array, Array]:
    """Start, lower and upper bounds: (ln R, ln L) and zero for every extension's numbers."""
    resistance = points.power_w / (3.0 * points.current_line_a**2)
    size = points.phase_voltage_v / points.current_line_a
    reactance = np.sqrt(np.maximum(size**2 - resistance**2, 1e-6 * size**2))
    known = 0.0 if points.resistance_ohm is None else points.resistance_ohm
    first = np.median(np.maximum(resistance - known, 0.05 * resistance)) if points.is_locked else np.median(points.power_w)
    start = [float(np.log(first)), float(np.log(np.median(reactance / points.omega)))]
    low, high = [-np.inf, -np.inf], [np.inf, np.inf]
    for extension in extensions:
        if extension.name == "magnetizing_saturation":
            start += [0.3, 5.0]
            low += [0.0, 1.0]
            high += [50.0, 14.0]
        elif extension.name == "iron_loss":
            start += [0.6, 2.0]
            low += [0.0, 1.0]
            high += [1.0, 6.0]
        else:
            start += [0.1]
            low += [-0.5]
            high += [5.0]
    return np.array(start), np.array(low), np.array(high)


def _predicted(x: Array, points: Points, extensions: Sequence[_Extension], scale: Mapping[str, float]) -> tuple[Array, Array]:
    """Current (A rms) and power (W) at the points' voltage and frequency."""
    numbers: dict[str, Array] = {}
    at = 2
    for extension in extensions:
        numbers[extension.name] = x[at : at + extension.numbers]
        at += extension.numbers
    if points.is_locked:
        return _locked(x, points, numbers, scale)
    return _no_load(x, points, numbers, scale)


def _locked(x: Array, points: Points, numbers: Mapping[str, Array], scale: Mapping[str, float]) -> tuple[Array, Array]:
    """Z = R_s + R_R (1 + c ((f/f_0)^2 - 1)) + j w L_0 / (1 + s I / I_0): skin effect c, leakage saturation s.

    The iteration on I converges because L falls slowly (Lipo & Consoli, IEEE Trans. Ind. Appl. IA-20(1), 1984).
    """
    stator = np.zeros(points.count) if points.resistance_ohm is None else points.resistance_ohm
    skin = numbers.get("rotor_skin_effect", np.zeros(1))[0]
    saturation = numbers.get("leakage_saturation", np.zeros(1))[0]
    ratio = (points.frequency_hz / scale["frequency_hz"]) ** 2
    resistance = stator + np.exp(x[0]) * np.maximum(1.0 + skin * (ratio - 1.0), 1e-3)
    current = points.current_line_a.copy()
    for _ in range(60):
        reactance = points.omega * np.exp(x[1]) / np.maximum(1.0 + saturation * current / scale["current_a"], 0.1)
        current = 0.5 * (current + points.phase_voltage_v / np.hypot(resistance, reactance))
    return current, 3.0 * resistance * current**2


def _no_load(x: Array, points: Points, numbers: Mapping[str, Array], scale: Mapping[str, float]) -> tuple[Array, Array]:
    """i_m = psi/L (1 + b (psi/psi_0)^S) and P = P_0 (1 - g + g (V/V_0)^n) + 3 R_s I^2."""
    stator = np.zeros(points.count) if points.resistance_ohm is None else points.resistance_ohm
    b, power = numbers.get("magnetizing_saturation", np.array([0.0, 2.0]))
    loss = numbers.get("iron_loss", np.array([0.0, 2.0]))
    current = points.current_line_a.copy()
    for _ in range(30):
        active = np.minimum(_loss(x, points, loss, scale) / (3.0 * points.phase_voltage_v), 0.9 * current)
        induced = np.hypot(
            points.phase_voltage_v - stator * active, stator * np.sqrt(np.maximum(current**2 - active**2, 0.0))
        )
        flux = induced / points.omega
        reactive = flux / np.exp(x[1]) * (1.0 + b * (flux / scale["flux_wb"]) ** power)
        current = 0.5 * (current + np.hypot(reactive, active))
    return current, _loss(x, points, loss, scale) + 3.0 * stator * current**2


def _loss(x: Array, points: Points, loss: Array, scale: Mapping[str, float]) -> Array:
    grown = (points.phase_voltage_v / scale["voltage_v"]) ** loss[1]
    return np.asarray(np.exp(x[0]) * (1.0 - loss[0] + loss[0] * grown))


def _scale(points: Points) -> dict[str, float]:
    """Reference point of the extensions, and the scatter of current and power about the richest circuit.

    The two channels scatter differently (a wattmeter at low power factor), so each is weighed by its own.
    """
    scale = {
        "frequency_hz": float(points.frequency_hz.min()), "current_a": float(np.median(points.current_line_a)),
        "flux_wb": float(np.max(points.phase_voltage_v / points.omega)), "voltage_v": float(np.max(points.phase_voltage_v)),
        "current_scatter": 1.0, "power_scatter": 1.0,
    }
    left = _fit(points, _candidates(points), scale)[2]
    n = points.count
    scale["current_scatter"] = max(float(np.sqrt(np.mean(left[:n] ** 2))), LEAST_SCATTER)
    scale["power_scatter"] = max(float(np.sqrt(np.mean(left[n:] ** 2))), LEAST_SCATTER)
    return scale


def _fit(points: Points, extensions: Sequence[_Extension], scale: Mapping[str, float]) -> tuple[Array, Array, Array]:
    """Estimate, covariance and relative errors (current, power) over their scatter at the optimum."""
    start, low, high = _start(points, extensions)

    def errors(x: Array) -> Array:
        current, power = _predicted(x, points, extensions, scale)
        return np.concatenate([
            (current / points.current_line_a - 1.0) / scale["current_scatter"],
            (power / points.power_w - 1.0) / scale["power_scatter"],
        ])

    solution = least_squares(errors, start, bounds=(low, high), x_scale="jac", max_nfev=400)
    freedom = max(2 * points.count - start.shape[0], 1)
    variance = float(solution.fun @ solution.fun) / freedom
    covariance = variance * np.linalg.pinv(solution.jac.T @ solution.jac)
    return solution.x, covariance, solution.fun


def _compare(points: Points, accepted: Sequence[_Extension], candidate: _Extension) -> tuple[float, float]:
    """p value of the nested F test, and the share of held-out error power the candidate removes."""
    scale = _scale(points)
    before = float((_fit(points, accepted, scale)[2] ** 2).sum())
    x, _, left = _fit(points, [*accepted, candidate], scale)
    after = float((left**2).sum())
    numbers = 2 + sum(e.numbers for e in accepted) + candidate.numbers
    freedom = 2 * points.count - numbers
    if freedom < 2 or not _has_right_sign(x, candidate):
        return 1.0, 0.0
    ratio = (before - after) / candidate.numbers / max(after / freedom, 1e-300)
    held_before = float((_held_out(points, accepted, scale) ** 2).sum())
    held_after = float((_held_out(points, [*accepted, candidate], scale) ** 2).sum())
    return float(fisher.sf(ratio, candidate.numbers, freedom)), 1.0 - held_after / max(held_before, 1e-300)


def _has_right_sign(x: Array, candidate: _Extension) -> bool:
    return bool(x[-candidate.numbers] > 1e-6)


def _held_out(points: Points, extensions: Sequence[_Extension], scale: Mapping[str, float]) -> Array:
    """Relative errors over their scatter (n, 2) of every point, predicted from the others."""
    out = []
    for k in range(points.count):
        x, _, _ = _fit(points.without(k), extensions, scale)
        one = points.only(k)
        current, power = _predicted(x, one, extensions, scale)
        out.append([float(current[0] / one.current_line_a[0] - 1.0), float(power[0] / one.power_w[0] - 1.0)])
    return np.array(out) / np.array([scale["current_scatter"], scale["power_scatter"]])


def _conclude(
    points: Points, accepted: Sequence[_Extension], p_values: Mapping[str, float], tested: Mapping[str, float]
) -> PointsDiagnosis:
    scale = _scale(points)
    held_before, held_after = _held_out(points, [], scale), _held_out(points, accepted, scale)
    total = float((held_before**2).sum())
    causes = []
    x, covariance, _ = _fit(points, accepted, scale)
    at = 2
    for extension in accepted:
        others = [e for e in accepted if e.name != extension.name]
        share = float((_held_out(points, others, scale) ** 2).sum() - (held_after**2).sum()) / max(total, 1e-300)
        spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))[at : at + extension.numbers]
        sizes = _sizes(extension.name, x[at : at + extension.numbers], spread, points, scale)
        causes.append(PointCause(extension.name, sizes, p_values[extension.name], float(np.clip(share, 0.0, 1.0))))
        at += extension.numbers
    verdict, reason = _verdict(points, causes, tested)
    unit = np.array([scale["current_scatter"], scale["power_scatter"]])
    rms = [float(np.sqrt(np.mean((h[:, 0] * points.current_line_a) ** 2))) for h in (held_before * unit, held_after * unit)]
    relative = [float(np.sqrt(np.mean((h * unit) ** 2))) for h in (held_before, held_after)]
    gain = 1.0 - (relative[1] / relative[0]) ** 2 if relative[0] > 0 else 0.0
    plain = _fit(points, [], scale)
    return PointsDiagnosis(
        "locked rotor" if points.is_locked else "no load", verdict, reason, tuple(causes), rms[0], rms[1], *relative, gain,
        _parameters(points, plain[0], plain[1]), _parameters(points, x, covariance), dict(tested),
    )


def _verdict(points: Points, causes: Sequence[PointCause], tested: Mapping[str, float]) -> tuple[str, str]:
    where = f"the {'locked-rotor' if points.is_locked else 'no-load'} points"
    if causes:
        return "explained", f"The named causes predict {where} left out of the fit clearly better than constant parameters."
    return "nothing_significant", f"Constant parameters describe {where} as well as their scatter allows ({len(tested)} causes tested)."


def _sizes(
    name: str, x: Array, spread: Array, points: Points, scale: Mapping[str, float]
) -> dict[str, tuple[float, float, str]]:
    if name == "leakage_saturation":
        low, high = float(points.current_line_a.min()), float(points.current_line_a.max())

        def drop(s: float) -> float:
            return 1.0 - (1.0 + s * low / scale["current_a"]) / (1.0 + s * high / scale["current_a"])

        return {"inductance_drop_over_range": (drop(float(x[0])), abs(drop(float(x[0] + spread[0])) - drop(float(x[0]))), "1")}
    if name == "rotor_skin_effect":
        rise = (float(points.frequency_hz.max()) / scale["frequency_hz"]) ** 2 - 1.0
        return {"resistance_rise_over_range": (float(x[0] * rise), float(spread[0] * rise), "1")}
    if name == "magnetizing_saturation":
        return {"extra_current_at_highest_flux": (float(x[0]), float(spread[0]), "1"), "exponent": (float(x[1]), float(spread[1]), "1")}
    return {
        "share_of_loss_growing_with_flux": (float(x[0]), float(spread[0]), "1"),
        "exponent": (float(x[1]), float(spread[1]), "1"),
    }


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
