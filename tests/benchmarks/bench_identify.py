"""Side by side: our observer, an EKF, series-parallel RLS; our least squares, a simplex search and SciPy's least squares.

`python -m tests.benchmarks.bench_identify` prints time per sample and errors after 5, 10, 20 and 60 s with 10 % noise.
The peers are written for this comparison only, in the form the literature gives them, compiled where ours is.
"""

from __future__ import annotations

import time

import numpy as np
from numba import njit
from scipy.linalg import expm
from scipy.optimize import fmin, least_squares
from scipy.signal import lfilter

from commissioner.identify.batch.fit import fit_segments
from commissioner.identify.batch.segments import Segment
from commissioner.identify.observer.observer import ParallelObserver
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import prior
from tests.benchmarks.pairs import Pair, timed
from tests.support.exact.cramer_rao import cramer_rao
from tests.support.standstill import linear_current, multitone, usable_motors

PERIOD_S = 3e-4
MOTOR = next(m for m in usable_motors() if m.name == "abb_2k2")
TONES = [(9.0, 0.5, 0.0), (6.0, 2.3, 1.0), (9.0, 9.7, 2.0), (12.0, 41.9, 3.0)]
SECONDS = (5.0, 10.0, 20.0, 60.0)
START = (5.5, 1.3, 0.029, 0.14)
REPEATS = 5
"""The shortest processor time counts: on a busy host all else measures the host. Nothing here runs in parallel."""


@njit(cache=True)
def ekf(u, y, period, start, relative, noise_variance):
    """State (i, psi_R, ln R_s, ln R_R, ln L_sigma, ln L_M): explicit midpoint rule, Jacobian by its own
    differentiation."""
    x = np.array([0.0, 0.0, np.log(start[0]), np.log(start[1]), np.log(start[2]), np.log(start[3])])
    p = np.zeros((6, 6))
    for j in range(2, 6):
        p[j, j] = relative**2
    f = np.eye(6)
    for k in range(u.size):
        s = p[0, 0] + noise_variance
        gain = p[:, 0] / s
        x = x + gain * (y[k] - x[0])
        p = p - np.outer(gain, p[0, :])
        r_s, r_r, l_s, l_m = np.exp(x[2]), np.exp(x[3]), np.exp(x[4]), np.exp(x[5])
        a = r_r / l_m
        i, psi = x[0], x[1]
        di, dpsi = (u[k] - (r_s + r_r) * i + a * psi) / l_s, r_r * i - a * psi
        im, pm = i + 0.5 * period * di, psi + 0.5 * period * dpsi
        di, dpsi = (u[k] - (r_s + r_r) * im + a * pm) / l_s, r_r * im - a * pm
        m = np.array([[-(r_s + r_r) / l_s, a / l_s], [r_r, -a]]) * period
        phi = np.eye(2) + m + 0.5 * m @ m
        f[:2, :2] = phi
        f[0, 2], f[1, 2] = -period * r_s * im / l_s, 0.0
        f[0, 3], f[1, 3] = period * (-r_r * im + a * pm) / l_s, period * dpsi
        f[0, 4], f[1, 4] = -period * di, 0.0
        f[0, 5], f[1, 5] = -period * a * pm / l_s, period * a * pm
        x[0], x[1] = i + period * di, psi + period * dpsi
        p = f @ p @ f.T
    return np.exp(x[2:])


@njit(cache=True)
def rls_series_parallel(u, y, f1, f2):
    """Equation error: the measured current in the regressor. Returns theta of the filtered form."""
    g1, g2 = 1 - f1, 1 - f2
    theta, p, w = np.zeros(4), np.eye(4) * 1e6, np.zeros(4)
    for k in range(u.size):
        pw = p @ w
        gain = pw / (1.0 + w @ pw)
        theta = theta + gain * (y[k] - theta @ w)
        p = p - np.outer(gain, pw)
        w[0], w[1] = f1 * w[0] + g1 * y[k], f2 * w[1] + g2 * y[k]
        w[2], w[3] = f1 * w[2] + g1 * u[k], f2 * w[3] + g2 * u[k]
    return theta


def rls(u, y):
    from commissioner.identify.observer.coordinates import filter_poles
    from commissioner.identify.observer.kernels import machine_from_theta

    f = filter_poles(prior(MOTOR.plate), PERIOD_S)
    out = np.full(4, np.nan)
    machine_from_theta(rls_series_parallel(u, y, f[0], f[1]), f, PERIOD_S, out)
    return out


def output_error(logs, u, y):
    """Measured minus simulated current, by a compiled difference equation; four logarithms, no offset."""
    r_s, r_r, l_s, l_m = np.exp(logs)
    a = r_r / l_m
    e = expm(np.array([[-(r_s + r_r) / l_s, a / l_s, 1 / l_s], [r_r, -a, 0.0], [0.0, 0.0, 0.0]]) * PERIOD_S)
    num = [0.0, e[0, 2], e[0, 1] * e[1, 2] - e[1, 1] * e[0, 2]]
    return y - lfilter(num, [1.0, -(e[0, 0] + e[1, 1]), e[0, 0] * e[1, 1] - e[0, 1] * e[1, 0]], u)


def trust_region(u, y):
    """SciPy's own least squares on the same output error, as somebody without this package would write it."""
    return np.exp(least_squares(output_error, np.log(START), method="lm", args=(u, y)).x)


def simplex(u, y):
    """The seed's batch reference, Matlab's fminsearch (Castaldi & Tilli 2005, section VI): Nelder-Mead with fminsearch's
    own start simplex and tolerances. Favoured here: the output error is simulated by a compiled difference equation, in
    logarithms, without a sensor offset."""

    def squares(logs):
        residual = output_error(logs, u, y)
        return float(residual @ residual)

    return np.exp(fmin(squares, np.log(START), xtol=1e-4, ftol=1e-4, maxiter=800, maxfun=800, disp=False))


def pao(u, y):
    observer = ParallelObserver(
        prior(MOTOR.plate), PERIOD_S, MOTOR.plate.rated_current_peak_a, start=InverseGamma(*START)
    )
    return np.array(observer.advance(u, y).parameters.as_tuple())


def lyapunov(u, y):
    observer = ParallelObserver(
        prior(MOTOR.plate),
        PERIOD_S,
        MOTOR.plate.rated_current_peak_a,
        law="lyapunov",
        start=InverseGamma(*START),
        expected_voltage_v=u[:30000],
    )
    return np.array(observer.advance(u, y).parameters.as_tuple())


def nls(u, y):
    fit = fit_segments([Segment(u, y, 0.0, True)], PERIOD_S, InverseGamma(*START))
    return np.array(fit.inverse_gamma_at(0.0)[0].as_tuple())


def kalman(u, y):
    return ekf(u, y, PERIOD_S, np.array(START), 0.5, 0.1**2 * float(np.var(y)) / 1.01)


METHODS = {
    "fast PAO (ours)": pao,
    "Lyapunov PAO (ours)": lyapunov,
    "EKF": kalman,
    "RLS, series-parallel": rls,
    "simplex NLS": simplex,
    "SciPy least_squares": trust_region,
    "NLS (ours)": nls,
}


def table(seeds: int = 5) -> list[tuple[str, float, float, list[float]]]:
    """(method, ns per sample, ms for the 60-s record, worst parameter's rms error in per cent at each duration)."""
    voltage = multitone(TONES, SECONDS[-1], PERIOD_S)
    current = linear_current(MOTOR.truth, voltage, PERIOD_S)
    noise = 0.1 * float(np.std(current))
    records = [current + noise * np.random.default_rng(s).standard_normal(current.size) for s in range(seeds)]
    rows = []
    for name, method in METHODS.items():
        method(voltage[:4000], records[0][:4000])
        errors = []
        for seconds in SECONDS:
            n = round(seconds / PERIOD_S)
            found = np.array(
                [method(voltage[:n], y[:n]) for y in records[: 2 if name.startswith("simplex") else seeds]]
            )
            errors.append(100 * float(np.max(np.sqrt(np.mean((found / MOTOR.truth - 1) ** 2, axis=0)))))
        spent = min(_seconds(method, voltage, records[0]) for _ in range(REPEATS))
        rows.append((name, 1e9 * spent / voltage.size, 1e3 * spent, errors))
    bounds = []
    for seconds in SECONDS:
        n = round(seconds / PERIOD_S)
        bound = cramer_rao(InverseGamma(*MOTOR.truth), voltage[:n], PERIOD_S, noise)
        bounds.append(100 * float(np.max(np.sqrt(np.diag(bound)) / MOTOR.truth)))
    rows.append(("Cramer-Rao bound", float("nan"), float("nan"), bounds))
    return rows


def pairs() -> list[Pair]:
    """The observer against recursive peers, the batch fit against batch peers: 60 s at 300 us with 10 % noise."""
    voltage = multitone(TONES, SECONDS[-1], PERIOD_S)
    current = linear_current(MOTOR.truth, voltage, PERIOD_S)
    current = current + 0.1 * float(np.std(current)) * np.random.default_rng(0).standard_normal(current.size)

    def one(method):
        return timed(lambda: method(voltage, current), voltage.size)

    recursive = [("extended Kalman filter, compiled", kalman), ("series-parallel RLS, compiled", rls)]
    batch = [("Nelder-Mead, compiled output error", simplex), ("SciPy least_squares (MINPACK)", trust_region)]
    return [
        Pair(task, peer, one(ours), one(theirs), "ns a sample", 1e9)
        for task, ours, peers in (("online observer", pao, recursive), ("batch fit, four parameters", nls, batch))
        for peer, theirs in peers
    ]


def _seconds(method, voltage, current) -> float:
    started = time.process_time()
    method(voltage, current)
    return time.process_time() - started


def kernel_rate() -> float:
    """Samples per second of the fast law's recursion alone, on one core, blocks of 500."""
    voltage = multitone(TONES, 60.0, PERIOD_S)
    current = linear_current(MOTOR.truth, voltage, PERIOD_S)
    current = current + 0.1 * np.std(current) * np.random.default_rng(0).standard_normal(current.size)
    observer = ParallelObserver(prior(MOTOR.plate), PERIOD_S, MOTOR.plate.rated_current_peak_a, memory_s=0.0)
    observer.advance(voltage[:5000], current[:5000])
    best = 0.0
    for _ in range(3):
        started = time.process_time()
        observer.advance(voltage, current)
        best = max(best, voltage.size / (time.process_time() - started))
    return best


def test_side_by_side(capsys):
    with capsys.disabled():
        main(seeds=1)


def main(seeds: int = 5) -> None:
    print(f"\nfast law, recursion alone: {kernel_rate() / 1e6:.1f} million samples/s on one core")
    print(
        f"{'10 % noise, 300 us, worst parameter':36s}{'ns/sample':>10s}{'60 s, ms':>10s}"
        + "".join(f"{s:7.0f} s" for s in SECONDS)
    )
    for name, per_sample, whole, errors in table(seeds):
        print(f"{name:36s}{per_sample:10.0f}{whole:10.1f}" + "".join(f"{e:8.2f}%" for e in errors))


if __name__ == "__main__":
    main()
