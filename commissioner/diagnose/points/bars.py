"""Rotor resistance at running slip from locked-rotor points at several frequencies.

Bars carry their current near the slot's opening as the frequency rises: resistance goes up, leakage down. Two circuits of it,
each with two numbers beside R_R, L_sigma and L_M: two cages in parallel, Z = R + j w dL / (1 + j w tau), and a deep bar with a
part a of the resistance in the slot, Z = R (1 - a + a x coth x), x = (1 + j) sqrt(f / f_b) (P. L. Alger, "Induction Machines",
2nd ed., 1970, ch. 8). What the points do not fix is tied by priors, which are named; the answer is the mean over these and
constant bars by their evidence, its error holds what they differ by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import chdtrc

from commissioner.diagnose.intake.points import Array, Points
from commissioner.diagnose.points.circuits import forward_differences
from commissioner.diagnose.points.magnetizing import SPREAD, main_over_leakage

FAST_HZ = (40.0, 1.0)
"""Frequency at which the current is displaced by half, and the spread of its logarithm."""
DISPERSED = (0.3, 1.0)
"""The leakage that is lost when the current is displaced, over L_sigma, and the spread of its logarithm."""
SLOT_LOGIT = (1.0, 1.5)
"""Logit of a deep bar's part of the resistance that lies in the slot, and its spread."""
SATURATION_STD = 0.3
LEAST_SCATTER = 0.001
FAMILIES = ("constant", "cages", "bar")
Vector = NDArray[np.complex128]


@dataclass(frozen=True)
class SlowRotor:
    """R_R at running slip and its error, at the lowest and highest frequency measured; L_sigma there; p value of constant
    bars; `tied`: what the points do not fix; `left_out` and `fitted`: `(n, 2)` relative errors of current and power by the better of
    deep bar and two cages, which has `numbers` of its own."""

    resistance_ohm: float
    std_ohm: float
    measured_ohm: tuple[float, float]
    rise_over_range: tuple[float, float]
    p_value: float
    tied: tuple[str, ...]
    left_out: Array
    fitted: Array
    numbers: int


def slow_rotor(points: Points) -> SlowRotor | None:
    """None for points of one frequency, or without the stator's resistance."""
    frequencies = np.unique(points.frequency_hz)
    if frequencies.size < 2 or points.resistance_ohm is None or not points.is_locked:
        return None
    z = _impedance(points)
    fits = [_Fit(points, z, LEAST_SCATTER, family) for family in FAMILIES]
    best = min(float(np.sum(f.missed**2)) for f in fits)
    scatter = LEAST_SCATTER * max(float(np.sqrt(best / max(2 * points.count - 6, 1))), 1.0)
    constant, *others = all_three = [_Fit(points, z, scatter, family) for family in FAMILIES]
    evidence = np.array([f.log_evidence for f in all_three])
    gain = float(np.sum(constant.missed**2) - min(np.sum(f.missed**2) for f in others))
    p_value = float(chdtrc(2, max(gain, 0.0)))
    weight = np.exp(evidence - evidence.max())
    weight /= weight.sum()
    logs, stds = np.array([f.log_slow for f in all_three]), np.array([f.std_log_slow for f in all_three])
    mean = float(weight @ logs)
    std = float(np.sqrt(weight @ (stds**2 + (logs - mean) ** 2)))
    at = [float(np.median(z.real[points.frequency_hz == f])) for f in (frequencies[0], frequencies[-1])]
    rises = [f.rise for f in all_three]
    rise = float(weight @ rises)
    value = float(np.exp(mean))
    displaced = others[int(np.argmax(weight[1:]))]
    return SlowRotor(
        value, value * std, (at[0], at[1]), (rise, float(np.sqrt(weight @ (np.array(rises) - rise) ** 2)) + scatter),
        p_value, displaced.tied, displaced.left_out, displaced.fitted, displaced.x.size,
    )  # fmt: skip


def _impedance(points: Points) -> Vector:
    """Per star phase beyond the stator's resistance."""
    resistance = points.power_w / (3.0 * points.current_line_a**2)
    size = points.phase_voltage_v / points.current_line_a
    stator = np.zeros(points.count) if points.resistance_ohm is None else points.resistance_ohm
    return np.asarray(resistance - stator + 1j * np.sqrt(np.maximum(size**2 - resistance**2, 0.0)))


class _Fit:
    """One circuit fitted to the impedances with its priors; numbers are logarithms but for the saturation and the logit."""

    def __init__(self, points: Points, z: Vector, scatter: float, family: str) -> None:
        self.points, self.z, self.family = points, z, family
        self.stator = points.resistance_ohm if points.resistance_ohm is not None else np.zeros(points.count)
        self.size = np.abs(z + self.stator) * scatter
        leak = float(np.median(z.imag / points.omega))
        self.main_over_leakage = main_over_leakage(points)
        start = [
            float(np.log(max(np.min(z.real), 1e-9))),
            float(np.log(leak)),
            float(np.log(self.main_over_leakage * leak)),
            0.0,
        ]
        if family == "cages":
            start += [float(np.log(DISPERSED[0] * leak)), float(np.log(FAST_HZ[0]))]
        elif family == "bar":
            start += [SLOT_LOGIT[0], float(np.log(FAST_HZ[0]))]

        def errors(x: Array) -> Array:
            """`(k, 2 n + prior)` of k sets of numbers, `(k, numbers)`."""
            left = (self.predicted(x.T[..., None]) - z) / self.size
            return np.concatenate([left.real, left.imag, self._prior(x.T).T], axis=1)

        found = least_squares(
            lambda x: errors(x[None])[0], start, lambda x: forward_differences(errors, x, np.inf), x_scale="jac", max_nfev=200,
        )  # fmt: skip
        self.x, self.missed = found.x, found.fun[: 2 * z.size]
        self.jacobian, self.covariance = found.jac, np.linalg.pinv(found.jac.T @ found.jac)
        sign, size = np.linalg.slogdet(found.jac.T @ found.jac)
        self.log_evidence = -0.5 * float(found.fun @ found.fun) - 0.5 * float(size if sign > 0 else 0.0)

    def _prior(self, x: Array) -> Array:
        out = [(x[2] - x[1] - np.log(self.main_over_leakage)) / SPREAD, x[3] / SATURATION_STD]
        if self.family == "cages":
            out.append((x[4] - x[1] - np.log(DISPERSED[0])) / DISPERSED[1])
        elif self.family == "bar":
            out.append((x[4] - SLOT_LOGIT[0]) / SLOT_LOGIT[1])
        if self.family != "constant":
            out.append((x[5] - np.log(FAST_HZ[0])) / FAST_HZ[1])
        return np.array(out)

    def rotor(self, x: Array, frequency_hz: Array) -> Vector:
        """Impedance of the rotor branch beyond what counts as the stator's leakage."""
        resistance = np.exp(np.clip(x[0], -50, 50))
        w = 2.0 * np.pi * frequency_hz
        if self.family == "cages":
            return np.asarray(resistance + 1j * w * np.exp(x[4]) / (1.0 + 1j * frequency_hz / np.exp(x[5])))
        if self.family == "bar":
            slot = 1.0 / (1.0 + np.exp(-x[4]))
            deep = (1.0 + 1.0j) * np.sqrt(frequency_hz / np.exp(np.clip(x[5], -20, 20)))
            return np.asarray(resistance * (1.0 - slot + slot * deep / np.tanh(deep)))
        return np.asarray(resistance + 0j * frequency_hz)

    def predicted(self, x: Array) -> Vector:
        """`(n,)`; `(k, n)` of k sets of numbers, x of `(numbers, k, 1)`."""
        p = self.points
        current = p.current_line_a / np.median(p.current_line_a)
        leak = 1j * p.omega * np.exp(x[1]) / np.maximum(1.0 + x[3] * (current - 1.0), 0.1)
        main, rotor = 1j * p.omega * np.exp(x[2]), self.rotor(x, p.frequency_hz)
        return np.asarray(leak + main * rotor / (main + rotor))

    def _log_slow(self, x: Array) -> float:
        """ln R_R of the inverse-Gamma circuit at slip frequency: what leakage the slow rotor has goes to the stator's side."""
        slow = 1e-3
        own = float(self.rotor(x, np.array([slow]))[0].imag / (2.0 * np.pi * slow))
        return float(x[0] - 2.0 * np.log1p(own / np.exp(x[2])))

    @property
    def log_slow(self) -> float:
        return self._log_slow(self.x)

    @property
    def std_log_slow(self) -> float:
        gradient = np.zeros(self.x.size)
        for k in range(self.x.size):
            step = np.zeros(self.x.size)
            step[k] = 1e-4
            gradient[k] = (self._log_slow(self.x + step) - self._log_slow(self.x - step)) / 2e-4
        return float(np.sqrt(max(float(gradient @ self.covariance @ gradient), 0.0)))

    @property
    def left_out(self) -> Array:
        """`(n, 2)` as `fitted`, of each point by the fit without it, to first order."""
        n = self.points.count
        reach = self.jacobian[: 2 * n] @ self.covariance @ self.jacobian[: 2 * n].T
        own = np.moveaxis(reach.reshape(2, n, 2, n).diagonal(axis1=1, axis2=3), -1, 0)
        errors = np.linalg.solve(np.eye(2) * (1.0 + 1e-9) - own, self.missed.reshape(2, n).T[..., None])[..., 0]
        return self.relative(self.z + self.size * (errors[:, 0] + 1j * errors[:, 1]))

    @property
    def fitted(self) -> Array:
        """`(n, 2)` relative errors of current and power at the measured voltage."""
        return self.relative(self.predicted(self.x))

    def relative(self, z: Vector) -> Array:
        """Errors of current and power where the impedance beyond the stator is `z`."""
        p, whole = self.points, z + self.stator
        current = p.phase_voltage_v / np.abs(whole)
        power = 3.0 * current**2 * whole.real
        return np.column_stack([current / p.current_line_a - 1.0, power / p.power_w - 1.0])

    @property
    def rise(self) -> float:
        ends = np.array([self.points.frequency_hz.min(), self.points.frequency_hz.max()])
        low, high = self.rotor(self.x, ends).real
        return float(high / low - 1.0)

    @property
    def tied(self) -> tuple[str, ...]:
        """Numbers that the points fix no better than what was taken for them."""
        names = ("R_R", "L_sigma", "L_M", "saturation", "displaced part", "frequency of displacement")
        priors = (np.inf, np.inf, SPREAD, SATURATION_STD, DISPERSED[1], FAST_HZ[1])
        spread = np.sqrt(np.diag(self.covariance))
        return tuple(n for n, s, p in zip(names, spread, priors, strict=False) if s > 0.5 * p and n != "saturation")


def remark_of(slow: SlowRotor | None, frequencies: Sequence[float]) -> str:
    """What the frequencies say of the rotor at running slip."""
    if slow is None and len(frequencies) > 1:
        return (
            f"Locked-rotor points at {frequencies[0]:g} ... {frequencies[-1]:g} Hz tell the rotor at slip frequency only with the stator's "
            "resistance, which is not known: give it, measured between two terminals, as winding_resistance_uv_ohm."
        )
    if slow is None:
        return (
            f"Locked-rotor points of one frequency ({frequencies[0]:g} Hz) cannot tell the rotor at slip frequency: bars may have "
            "less resistance there (a half in deep bars and double cages). R_R here is that of the test; add points at a quarter "
            "of the frequency or less."
        )
    tied = f" Not fixed by these points, taken from published machines: {', '.join(slow.tied)}." if slow.tied else ""
    return (
        f"R_R is that at running slip, extrapolated from {frequencies[0]:g} ... {frequencies[-1]:g} Hz, where the rotor's part is "
        f"{slow.measured_ohm[0]:.4g} ... {slow.measured_ohm[1]:.4g} ohm, by constant bars, a deep bar and two cages; its error holds what "
        f"these differ by. L_sigma is that of the test.{tied}"
    )
