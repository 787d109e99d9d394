"""Circuit parameters from running data: theta = (R_s, R_r, L_m, L_l), leakages split as the start says, and the sensors' delay.

Schantz & Leeb, (19), (20): a true speed has no imaginary part, and its mean is the shaft speed that the spectrum gave.
Here each line's imaginary part is divided by its own standard deviation *at the parameters tried*: with fixed weights the
fit would shrink the leakage because that shrinks the noise. Air-gap effects make lines that no torque made; they enter as
a model error, a robust loss keeps them from steering, and a prior around the start keeps what the data leave open.

The currents' delay against the voltages (cheap sensors with filters: 100 to 300 us) is a fifth number with a prior of its own: at
light load it decides what the active power is. Mains harmonics show it, and so does the slip that this power would ask for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from commissioner.monitor.machine.inversion import Torus, complex_speed, speed_noise, torus
from commissioner.monitor.machine.sidebands import BandError, band_error
from commissioner.monitor.signals.averaging import Lines
from commissioner.monitor.signals.supply import Vector
from commissioner.motor.running import TCircuit

NAMES = ("stator_resistance_ohm", "rotor_resistance_ohm", "magnetizing_inductance_h", "leakage_inductance_h")
PRIOR_FROM_NAMEPLATE = (0.30, 0.25, 0.20, 0.35)
"""Standard deviations of the logarithms of (R_s, R_r, L_m, L_l) around a nameplate start. 35 published circuits scatter by
0.16, 0.02, 0.08, 0.29 around it; plates are rounded and toleranced (20 % of the slip), and motors are warm."""
PRIOR_FROM_COMMISSIONING = (0.12, 0.15, 0.08, 0.08)
"""A warm motor has up to 40 % more resistance than a cold one, and its own saturation."""
MEAN_MODEL_ERROR = 1e-4
"""Of synchronous speed: mains harmonics and unbalance put this much into the mean of (14) by their squares."""
MADE_BY_SENSORS = 0.25
"""Beyond it the negative sequence pulls the fit: 5 % of gain between phase voltages had made R_s twice as large."""
DECADE = np.log(10.0)
LARGEST_DELAY = 6.0
"""Standard deviations of the delay's prior."""


@dataclass(frozen=True)
class Start:
    """Where the fit begins, how far it may be wrong (log std), and where it came from."""

    circuit: TCircuit
    log_std: tuple[float, float, float, float]
    origin: str


@dataclass(frozen=True)
class Problem:
    """The fit's data. `mean_speed_std` is the spectrum's; infinite where no shaft line was found. Errors: see `sidebands`.

    `delay_std_s`: the delay's prior, around none; 0 holds it there.
    """

    lines: Lines
    on: Torus
    pole_pairs: int
    mean_speed_rad_per_s: float
    mean_speed_std: float
    band_error: BandError
    delay_std_s: float = 0.0


@dataclass(frozen=True)
class Fitted:
    """The circuit, the covariance of log(R_s, R_r, L_m, L_l), and what the data left to the prior.

    `delay_s` is by how much the currents lag behind the voltages; `log_per_s` how the logarithms go with it, the rest of their
    covariance being `held_covariance`.

    `open_direction` is the unit combination of the logarithms that the data fix worst; `open_share` says which part of its
    prior variance is left (1 = the data say nothing).
    """

    circuit: TCircuit
    log_covariance: NDArray[np.float64]
    open_direction: NDArray[np.float64]
    open_share: float
    held_covariance: NDArray[np.float64]
    log_per_s: NDArray[np.float64]
    delay_s: float = 0.0
    delay_std_s: float = 0.0


def pose(
    lines: Lines,
    start: TCircuit,
    pole_pairs: int,
    mean_speed_rad_per_s: float,
    mean_speed_std: float,
    delay_std_s: float = 0.0,
) -> Problem:
    """The problem, with the errors of its side bands at the start values."""
    on = torus(lines)
    error = band_error(start, pole_pairs, lines, on, mean_speed_rad_per_s)
    return Problem(lines, on, pole_pairs, mean_speed_rad_per_s, mean_speed_std, error, delay_std_s)


def informative(lines: Lines, mains: int) -> NDArray[np.bool_]:
    """The mean, every load line, and those mains pairs (even, as symmetric harmonics are here) that carry voltage; the fundamental's
    negative sequence only where unlike sensors make less than `MADE_BY_SENSORS` of it.
    """
    noise = np.sqrt(np.sum(np.abs(lines.voltage_influence) ** 2, axis=0))
    carries = np.abs(lines.voltage_v) > np.maximum(10 * noise, 1e-3 * np.abs(lines.voltage_v[0]))
    made = lines.asymmetry * np.abs(lines.voltage_v[0]) > MADE_BY_SENSORS * np.abs(lines.voltage_v)
    carries &= ~(made & (np.abs(lines.order) == 2))
    strong = {int(abs(k)) for k in lines.order[(lines.comb == mains) & carries] if k % 2 == 0}
    return np.array([p != mains or abs(int(k)) in strong for p, k in zip(lines.comb, lines.order, strict=True)])


def fit(problem: Problem, start: Start, first: TCircuit | None = None) -> Fitted:
    """Bounded trust-region least squares within a decade of the start (20); `first` is where it begins."""
    centre = logs_of(start.circuit)
    split = start.circuit.rotor_leakage_h / start.circuit.stator_leakage_h
    prior = np.array(start.log_std)
    unit = max(problem.delay_std_s, 1e-12)

    def residual(x: NDArray[np.float64]) -> NDArray[np.float64]:
        late = replace(problem, lines=advanced(problem.lines, x[4] * unit)) if problem.delay_std_s else problem
        return np.concatenate([_robust(_misfit(late, circuit_of(x[:4], split))), (x[:4] - centre) / prior, x[4:]])

    reach = np.append(np.full(4, DECADE), LARGEST_DELAY)
    middle = np.append(centre, 0.0)
    solved = least_squares(
        residual,
        middle if first is None else np.append(logs_of(first), 0.0),
        method="trf",
        bounds=(middle - reach, middle + reach),
        x_scale=np.append(prior, 1.0),
        jac="3-point",
        max_nfev=80,
    )
    circuit = circuit_of(solved.x[:4], split)
    delay = float(solved.x[4]) * unit if problem.delay_std_s else 0.0
    found = replace(problem, lines=advanced(problem.lines, delay))
    data = _misfit(found, circuit)
    inflation = max(1.0, float(np.median(np.abs(data[2:]) ** 2) / np.log(2))) if data.size > 3 else 1.0
    jacobian = solved.jac.copy()
    jacobian[:-5] /= np.sqrt(inflation)
    full = np.linalg.inv(jacobian.T @ jacobian)
    covariance, per_unit = full[:4, :4], full[:4, 4] / full[4, 4]
    direction, share = _open(covariance, prior)
    return Fitted(
        circuit,
        covariance,
        direction,
        share,
        covariance - np.outer(per_unit, per_unit) * full[4, 4],
        per_unit / unit,
        delay,
        float(np.sqrt(full[4, 4])) * problem.delay_std_s,
    )


def advanced(lines: Lines, delay_s: float) -> Lines:
    """The lines with the currents `delay_s` earlier."""
    turn = np.exp(1j * (lines.rate_rad_per_s + lines.supply_rad_per_s) * delay_s)
    return replace(lines, current_a=lines.current_a * turn, current_influence=lines.current_influence * turn)


def steps(fitted: Fitted) -> NDArray[np.float64]:
    """Four moves of the logarithms whose outer products sum to their covariance with the delay as it was found."""
    values, vectors = np.linalg.eigh(fitted.held_covariance)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))).T)


def logs_of(circuit: TCircuit) -> NDArray[np.float64]:
    """log(R_s, R_r, L_m, L_ls)."""
    return np.log(
        [
            circuit.stator_resistance_ohm,
            circuit.rotor_resistance_ohm,
            circuit.magnetizing_inductance_h,
            circuit.stator_leakage_h,
        ]
    )


def circuit_of(logs: NDArray[np.float64], split: float) -> TCircuit:
    """The circuit of log(R_s, R_r, L_m, L_ls) with L_lr = split L_ls."""
    r_s, r_r, l_m, l_l = (float(x) for x in np.exp(logs))
    return TCircuit(r_s, r_r, l_l, l_l * split, l_m)


def circuit_at(fitted: Fitted, step: NDArray[np.float64]) -> TCircuit:
    """The fitted circuit moved by `step` in the logarithms."""
    return circuit_of(logs_of(fitted.circuit) + step, fitted.circuit.rotor_leakage_h / fitted.circuit.stator_leakage_h)


def _misfit(problem: Problem, circuit: TCircuit) -> Vector:
    """Complex misfits over their standard deviations: the mean's imaginary and real part, then each line's imaginary."""
    mean, upper, lower = complex_speed(circuit, problem.pole_pairs, problem.lines, problem.on)
    noise_mean, noise_up, noise_low = speed_noise(circuit, problem.pole_pairs, problem.lines, problem.on)
    synchronous = problem.lines.supply_rad_per_s / problem.pole_pairs
    own = np.hypot(np.sqrt(0.5 * np.sum(np.abs(noise_mean) ** 2)), MEAN_MODEL_ERROR * synchronous)
    difference = 0.5 * (upper - lower)
    gap_up, gap_low = problem.band_error.gap_upper, problem.band_error.gap_lower
    variance = 0.25 * (
        np.sum(np.abs(noise_up - noise_low) ** 2, axis=0)
        + np.sum(np.abs(gap_up - gap_low) ** 2, axis=0)
        + problem.band_error.upper**2
        + problem.band_error.lower**2
    )
    known = np.hypot(own, problem.mean_speed_std)
    real = (mean.real - problem.mean_speed_rad_per_s) / known if np.isfinite(known) else 0.0
    return np.concatenate([[mean.imag / own, real], difference / np.sqrt(0.5 * variance)]).astype(np.complex128)


ROBUST_AT = 3.0


def _robust(misfit: Vector) -> NDArray[np.float64]:
    """Real and imaginary parts; beyond `ROBUST_AT` standard deviations a line's pull grows with the logarithm only."""
    size = np.abs(misfit)
    scale = ROBUST_AT * np.sqrt(np.log1p((size / ROBUST_AT) ** 2)) / np.maximum(size, 1e-12)
    scale[:2] = 1.0
    kept = misfit * np.where(size > 1e-9, scale, 1.0)
    return np.concatenate([kept.real, kept.imag[2:]])


def _open(covariance: NDArray[np.float64], prior: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """The combination with the largest share of its prior variance left."""
    values, vectors = np.linalg.eigh(covariance / np.outer(prior, prior))
    direction = vectors[:, -1] * prior
    direction = direction / np.linalg.norm(direction)
    return direction * np.sign(direction[int(np.argmax(np.abs(direction)))]), float(values[-1])
