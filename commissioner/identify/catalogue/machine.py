"""Steady state of a double-cage machine in per unit, many parameter sets at once.

T circuit with iron loss across the main branch. The two cages are one dispersive branch, R(s) + j s X(s) =
R_0 (1 + d j s t / (1 + j s t)) + j s X_r: the same four numbers as two parallel cages (J. Pedra, F. Corcoles, IEEE Trans. Energy
Convers. 19(2), 2004, doi:10.1109/TEC.2003.822314), always passive. Base: rated phase voltage and base current of the star equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

NUMBERS = ("r_s", "x_m", "r_0", "x_r", "x_s", "d", "t", "iron", "friction", "stray", "saturation")
"""`iron`: loss at rated main voltage; `friction`: at rated speed; `stray`: at base current, all over base power; `saturation`:
leakage at the locked rotor's current over that at the rated one."""
LOADS = (1.0, 0.75, 0.5)
HALVINGS, NEWTONS, GRID, ZOOMS = 10, 3, 25, 3


@dataclass(frozen=True)
class Point:
    """A steady state of n machines, `(n,)` each, per unit: slip, current, input, air-gap power."""

    slip: Array
    current: Array
    power: Array
    gap: Array

    @property
    def power_factor(self) -> Array:
        return np.asarray(self.power / self.current)


def at(numbers: Array, slip: Array, leakage: Array | float = 1.0) -> Point:
    """`numbers` (n, 11) in the order of `NUMBERS`; `slip` (n,) or (n, m); `leakage`: factor on all leakages."""
    r_s, x_m, _, _, x_s, _, _, iron, *_ = _columns(numbers, slip)
    rotor = rotor_branch(numbers, slip, leakage)
    main = 1.0 / (iron - 1j / x_m + 1.0 / rotor)
    current = 1.0 / (r_s + 1j * leakage * x_s + main)
    gap = np.abs(current * main / rotor) ** 2 * rotor.real
    return Point(slip, np.abs(current), current.real, gap)


def rotor_branch(numbers: Array, slip: Array, leakage: Array | float = 1.0) -> Complex:
    """R(s)/s + j X(s), per unit."""
    _, _, r_0, x_r, _, d, t, *_ = _columns(numbers, slip)
    return np.asarray(r_0 / slip + r_0 * d * 1j * t / (1.0 + 1j * slip * t) + 1j * leakage * x_r)


def _columns(numbers: Array, slip: Array) -> list[Array]:
    return [numbers[:, k].reshape(-1, *(1,) * (slip.ndim - 1)) for k in range(numbers.shape[1])]


def shaft_power(numbers: Array, point: Point) -> Array:
    """Air-gap power less rotor copper, friction and stray loss, per unit."""
    _, _, _, _, _, _, _, _, friction, stray, _ = _columns(numbers, point.slip)
    return np.asarray(point.gap * (1.0 - point.slip) - friction - stray * point.current**2)


def breakdown(numbers: Array) -> tuple[Array, Array]:
    """(slip, torque) of the largest torque at the shaft, per unit of base power over synchronous speed. Leakages lie half way, as
    logarithms, between those of rated and starting current."""
    leakage = np.sqrt(numbers[:, 10])[:, None]
    low, high = np.full(len(numbers), np.log(1e-3)), np.zeros(len(numbers))
    for _ in range(ZOOMS):
        grid = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, GRID)
        torque, step = at(numbers, np.exp(grid), leakage).gap, (high - low) / (GRID - 1)
        best = np.clip(torque.argmax(axis=1), 1, GRID - 2)[:, None] + np.arange(-1, 2)
        left, middle, right = np.take_along_axis(torque, best, axis=1).T
        bend = np.minimum(left - 2.0 * middle + right, -1e-300)
        centre = np.take_along_axis(grid, best, axis=1)[:, 1] + np.clip(0.5 * (left - right) / bend, -1.0, 1.0) * step
        low, high = centre - 2.0 * step, np.minimum(centre + 2.0 * step, 0.0)
    slip = np.exp(np.minimum(centre, 0.0))
    return slip, at(numbers, slip, leakage[:, 0]).gap - numbers[:, 8]


def loaded(numbers: Array, shaft: Array, peak: Array | None = None) -> Point:
    """The steady states (n, m) below pull-out, at slip `peak` (n,), that give the powers `shaft` (m,): bisection, then Newton."""
    peak = breakdown(numbers)[0] if peak is None else peak
    low = np.full((len(numbers), shaft.size), 1e-6)
    high = np.broadcast_to(peak[:, None], low.shape)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        is_less = shaft_power(numbers, at(numbers, middle)) < shaft
        low, high = np.where(is_less, middle, low), np.where(is_less, high, middle)
    slip, step = 0.5 * (low + high), 1e-4
    for _ in range(NEWTONS):
        less, more = (shaft_power(numbers, at(numbers, slip * (1.0 + d))) - shaft for d in (-step, step))
        slip = np.clip(slip - slip * step * (more + less) / np.where(more > less, more - less, np.inf), low, high)
    return at(numbers, slip)


def performance(numbers: Array, shaft: float) -> dict[str, Array]:
    """What a sheet prints, of n machines: slips, currents (per unit), ratios, by the keys of the sheet."""
    out: dict[str, Array] = {}
    peak, pull_out = breakdown(numbers)
    shafts = shaft * np.array(LOADS)
    point = loaded(numbers, shafts, peak)
    for k, ending in enumerate(("", "_75", "_50")):
        out[f"power_factor{ending}"] = point.power_factor[:, k]
        out[f"efficiency{ending}"] = shafts[k] / point.power[:, k]
    slip, current = point.slip[:, 0], point.current[:, 0]
    start, torque = at(numbers, np.ones(len(numbers)), numbers[:, 10]), shaft / (1.0 - slip)
    out |= {"rated_slip": slip, "rated_current": current}
    out["no_load_current"] = at(numbers, numbers[:, 2] * numbers[:, 8] + 1e-9).current
    out["starting_current_ratio"] = start.current / current
    out["starting_torque_ratio"] = start.gap / torque
    out["breakdown_torque_ratio"] = pull_out / torque
    return out


def inverse_gamma(numbers: Array, slip: Array) -> Array:
    """(n, 4): R_s, R_R, X_sigma, X_M per unit, of the rotor as it is at `slip` (n,)."""
    branch = rotor_branch(numbers, slip)
    r_r, x_r = branch.real * slip, branch.imag
    x_m, x_s = numbers[:, 1], numbers[:, 4]
    ratio = x_m / (x_m + x_r)
    return np.stack([numbers[:, 0], ratio**2 * r_r, x_s + x_m * (1.0 - ratio), ratio * x_m], axis=1)


def cages(numbers: Array) -> Array:
    """(n, 4): R_1, X_1 of the inner cage, R_2, X_2 of the outer, in parallel: the same branch by its two poles, per unit."""
    r_0, x_r, d, t = (numbers[:, k] for k in (2, 3, 5, 6))
    a, b, c = t * x_r, r_0 * (1.0 + d) * t + x_r, r_0
    root = np.sqrt(b * b - 4.0 * a * c)
    out = []
    for pole in (-2.0 * c / (b + root), -(b + root) / (2.0 * a)):
        x = (2.0 * a * pole + b) / (1.0 + t * pole)
        out += [-pole * x, x]
    return np.stack(out, axis=1)
