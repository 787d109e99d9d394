"""Random cases for the flux guard: `python -m tests.campaigns.flux_guard 1000` prints overshoots and aborts.

Each case: a published machine with its parameters moved (R +-30 %, leakage +-30 %, L_M -30 ... +20 %), iron that begins
to saturate between 0.7 and 1.3 of rated flux, a DC resistance known to 1 %, an inverter known to 5 % or ideal,
a lasting DC voltage that nobody asked for, an observer that starts from the plate alone, from a wrong machine, or from one measured before, a link
of 5-100 ms, and the amplitude following the guard's advice.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace

import numpy as np

from commissioner.identify.compensation import NOTHING, Compensation
from commissioner.identify.coordinates import PRIOR_LOG_STD
from commissioner.identify.excitation import ExcitationLimits, design
from commissioner.identify.flux import FluxAdvice, FluxGuard
from commissioner.identify.observer import ParallelObserver
from commissioner.identify.resistance import IDEAL_INVERTER, InverterError
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import prior, rated_flux
from commissioner.motor.space_vector import phase_cosines
from commissioner.procedure.under_test import KNOWN_LOG_STD
from tests.support.standstill import saturating_block, usable_motors

PERIOD_S = 2e-4
FLUX_FRACTION = 0.9
RAMP_PER_S = 5.0  # as in config/procedure.toml
FIRST_SCALE = 0.05


@dataclass(frozen=True)
class Outcome:
    """`peak` is the true stator flux over the guard's limit; `final_scale` what amplitude was reached."""

    seed: int
    motor: str
    peak: float
    aborted: bool
    final_scale: float
    latency_s: float
    begin: str
    """What was known of the machine."""


def run_case(seed: int, seconds: float = 6.0) -> Outcome:
    rng = np.random.default_rng(seed)
    motors = list(usable_motors())
    motor = motors[rng.integers(len(motors))]
    spread = np.array([rng.uniform(0.7, 1.3), rng.uniform(0.7, 1.3), rng.uniform(0.7, 1.3), rng.uniform(0.7, 1.2)])
    true = InverseGamma(*(np.array(motor.truth) * spread))
    ratio = (true.leakage_inductance_h + true.magnetizing_inductance_h) / true.magnetizing_inductance_h
    rated_wb = rated_flux(motor.plate, true.stator_resistance_ohm).stator_peak_wb
    machine = np.array(
        [
            true.stator_resistance_ohm,
            ratio**2 * true.rotor_resistance_ohm,
            ratio * true.leakage_inductance_h,
            true.leakage_inductance_h + true.magnetizing_inductance_h,
            1.0 / (rated_wb * rng.uniform(0.7, 1.3)),
            7.0,
        ]
    )
    plate, box = motor.plate, prior(motor.plate)
    current_a = 1.2 * plate.rated_current_peak_a
    axis_deg = float(rng.choice([0.0, 60.0, 90.0]))
    has_inverter = rng.random() < 0.5
    plateau = (
        0.2 * true.stator_resistance_ohm * plate.rated_current_peak_a * rng.uniform(0.2, 1.5) if has_inverter else 0.0
    )
    knee = 0.03 * plate.rated_current_peak_a
    known = IDEAL_INVERTER
    if has_inverter:
        grid = np.linspace(0.0, current_a, 200)
        known = InverterError(tuple(grid), tuple(plateau * rng.uniform(0.95, 1.05) * np.tanh(grid / knee)))
    resistance = true.stator_resistance_ohm * (1.0 + 0.01 * rng.standard_normal())
    start = replace(box.typical, stator_resistance_ohm=resistance)
    knowledge = rng.choice(["plate", "wrong", "measured"])
    if knowledge == "measured":
        start = InverseGamma(*(np.array(true.as_tuple()) * np.exp(0.03 * rng.standard_normal(4))))
    if knowledge == "wrong":
        start = InverseGamma(resistance, *(np.array(start.as_tuple())[1:] * np.exp(0.4 * rng.standard_normal(3))))
    limit_wb = FLUX_FRACTION * rated_flux(plate, resistance).stator_peak_wb
    limits = ExcitationLimits(
        limit_wb, 0.9 * current_a, 0.3 * plate.rated_voltage_v, 0.005 * plate.rated_current_peak_a
    )
    # A voltage nobody asked for: up to 2 % of rated current flows for good, and its flux is in no measured integral.
    bias_v = rng.uniform(-0.02, 0.02) * true.stator_resistance_ohm * plate.rated_current_peak_a
    chosen = design(plate, start, limits, PERIOD_S, known, seconds)
    compensation = NOTHING
    if has_inverter:
        span = 2.0 * current_a
        compensation = Compensation(known.on_axis(np.linspace(0.0, span, 1025), axis_deg), span)
    log_std = KNOWN_LOG_STD if knowledge == "measured" else PRIOR_LOG_STD
    observer = ParallelObserver(
        box, PERIOD_S, plate.rated_current_peak_a, start=start, start_log_std=log_std, compensation=compensation
    )
    latency = rng.uniform(0.005, 0.1)
    guard = FluxGuard(limit_wb, latency, chosen.excitation, PERIOD_S, resistance, known, axis_deg, reaction_s=0.02)
    first = min(FIRST_SCALE, guard.safe_scale)
    if knowledge == "measured":
        first = guard.begin_known(start, log_std, RAMP_PER_S)
    begin = f"{knowledge}{', inverter' if has_inverter else ''}"
    return _drive(
        seed, motor.name, machine, plateau, knee, axis_deg, chosen.excitation, observer, guard, latency, seconds, rng,
        first, bias_v, begin,
    )  # fmt: skip


def _drive(
    seed,
    name,
    machine,
    plateau,
    knee,
    axis_deg,
    excitation,
    observer,
    guard,
    latency,
    seconds,
    rng,
    first_scale,
    bias_v,
    begin,
) -> Outcome:
    block = max(50, round(0.5 * latency / PERIOD_S))
    cosines = np.array(phase_cosines(axis_deg))
    scale, wanted = 0.0, first_scale
    pending: list[tuple[int, float]] = []
    state, peak, aborted = np.zeros(2), 0.0, False
    noise = 0.005 * observer.current_scale_a
    for first in range(0, round(seconds / PERIOD_S), block):
        time = (first + np.arange(block)) * PERIOD_S
        while pending and pending[0][0] <= first:
            wanted = pending.pop(0)[1]
        limit = RAMP_PER_S * PERIOD_S
        steps = np.clip(wanted - scale, -limit * block, limit * block)
        ramp = scale + np.sign(steps) * np.minimum(np.arange(1, block + 1) * limit, abs(steps))
        scale = float(ramp[-1])
        voltage = excitation.voltage_v(time, ramp)
        current, flux = np.empty(block), np.empty(block)
        saturating_block(voltage + bias_v, PERIOD_S, state, machine, plateau, knee, cosines, current, flux)
        peak = max(peak, float(np.max(np.abs(flux))))
        if aborted:
            continue
        measured = current + noise * rng.standard_normal(block)
        reading = guard.advance(voltage, measured, observer.advance(voltage, measured), scale)
        due = first + block + round(latency / PERIOD_S)
        if reading.advice is FluxAdvice.ABORT:
            aborted = True
            pending.append((due, 0.0))
        elif reading.advice is FluxAdvice.BACK_OFF or (
            reading.advice is FluxAdvice.RAISE and abs(scale - wanted) < 1e-6
        ):
            pending.append((due, min(1.0, reading.permitted_scale)))
    return Outcome(seed, name, peak / guard.limit_wb, aborted, scale, latency, begin)


def main(count: int, first: int = 0) -> None:
    outcomes = [run_case(seed) for seed in range(first, first + count)]
    worst = sorted(outcomes, key=lambda o: -o.peak)[:8]
    unnecessary = [o for o in outcomes if o.aborted and o.peak < 1.0]
    print(
        f"{count} cases: largest true peak {worst[0].peak:.4f} of the limit; "
        f"{sum(o.peak > 1.02 for o in outcomes)} above 1.02; {sum(o.aborted for o in outcomes)} aborts, "
        f"{len(unnecessary)} of them below the limit; "
        f"peak reached: median {np.median([o.peak for o in outcomes]):.2f}, 10th percentile "
        f"{np.percentile([o.peak for o in outcomes], 10):.2f}"
    )
    for o in worst:
        print(o)
    for o in unnecessary:
        print("unnecessary", o)
    low = sorted(outcomes, key=lambda o: o.peak)[:8]
    for o in low:
        print("low", o)
    if not math.isfinite(worst[0].peak):
        raise SystemExit(1)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000, int(sys.argv[2]) if len(sys.argv) > 2 else 0)
