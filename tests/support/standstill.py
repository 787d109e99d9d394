"""Motors and standstill currents for tests, from other code than the estimators': matrix exponentials and
Runge-Kutta."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numba import njit
from scipy.linalg import expm
from scipy.signal import lfilter

from commissioner.motor.nameplate import Nameplate

MOTORS = Path(__file__).parent.parent / "data" / "motors" / "motors.csv"


@dataclass(frozen=True)
class KnownMotor:
    """A published machine: its plate, and (R_s, R_R, L_sigma, L_M) as printed in the table."""

    name: str
    plate: Nameplate
    truth: tuple[float, float, float, float]

    @property
    def rotor_time_constant_s(self) -> float:
        return self.truth[3] / self.truth[1]


def usable_motors() -> Iterator[KnownMotor]:
    """The 35 machines of the table with a power rating; plate values not printed are the table's computed ones."""
    with MOTORS.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if row["use_for_mc"] != "1":
                continue
            frequency, pairs = float(row["f_Hz"]), int(row["poles"]) // 2
            speed = float(row["n_n_rpm"] or 0) or 60 * frequency / pairs * (1 - float(row["slip_calc"]))
            plate = Nameplate(
                1e3 * float(row["P_kW"]),
                float(row["V_LL"]),
                frequency,
                float(row["I_n_A"] or row["I_calc_A"]),
                speed,
                float(row["pf_n"] or row["pf_calc"]),
                pairs,
                "star",
            )
            truth = (
                float(row["Rs_ohm"]),
                float(row["R_R_ohm"]),
                1e-3 * float(row["L_sgm_mH"]),
                1e-3 * float(row["L_M_mH"]),
            )
            yield KnownMotor(row["id"], plate, truth)


def linear_current(truth: tuple[float, float, float, float], voltage_v: np.ndarray, period_s: float) -> np.ndarray:
    """Current of the linear machine from rest under held voltages: matrix exponential, then a difference equation."""
    return linear_response(truth, voltage_v, period_s)[0]


def linear_response(
    truth: tuple[float, float, float, float], voltage_v: np.ndarray, period_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """(current, rotor flux)."""
    r_s, r_r, l_sigma, l_m = truth
    alpha = r_r / l_m
    block = np.array([[-(r_s + r_r) / l_sigma, alpha / l_sigma, 1 / l_sigma], [r_r, -alpha, 0.0], [0.0, 0.0, 0.0]])
    e = expm(block * period_s)
    denominator = [1.0, -(e[0, 0] + e[1, 1]), e[0, 0] * e[1, 1] - e[0, 1] * e[1, 0]]
    current = lfilter([0.0, e[0, 2], e[0, 1] * e[1, 2] - e[1, 1] * e[0, 2]], denominator, voltage_v)
    flux = lfilter([0.0, e[1, 2], e[1, 0] * e[0, 2] - e[0, 0] * e[1, 2]], denominator, voltage_v)
    return current, flux


def multitone(tones: list[tuple[float, float, float]], seconds: float, period_s: float) -> np.ndarray:
    """Sum of (volts, hertz, radians) cosines on the grid."""
    time = np.arange(round(seconds / period_s)) * period_s
    return np.sum([a * np.cos(2 * np.pi * f * time + p) for a, f, p in tones], axis=0)


@njit(cache=True)
def saturating_block(
    u: np.ndarray,
    period: float,
    state: np.ndarray,
    machine: np.ndarray,
    plateau: float,
    knee: float,
    c: np.ndarray,
    current: np.ndarray,
    flux: np.ndarray,
) -> None:
    """Gamma machine, L_s = L_0 / (1 + (a psi)^S), behind legs that lose plateau x tanh(i / knee): midpoint rule."""
    r_s, r_r, l_l, l_0, a, order = machine
    steps = 8
    h = period / steps
    ps, pr = state[0], state[1]
    for k in range(u.size):
        current[k] = ps * (1.0 + (a * abs(ps)) ** order) / l_0 + (ps - pr) / l_l
        flux[k] = ps
        for _ in range(steps):
            x, y = ps, pr
            for stage in range(2):
                i = x * (1.0 + (a * abs(x)) ** order) / l_0 + (x - y) / l_l
                lost = 0.0
                if plateau > 0.0:
                    for leg in range(3):
                        lost += 2.0 / 3.0 * c[leg] * plateau * math.tanh(i * c[leg] / knee)
                ds, dr = u[k] - r_s * i - lost, r_r * (x - y) / l_l
                if stage == 0:
                    x, y = ps + 0.5 * h * ds, pr + 0.5 * h * dr
            ps += h * ds
            pr += h * dr
    state[0], state[1] = ps, pr
