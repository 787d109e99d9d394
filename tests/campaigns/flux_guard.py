"""Random cases for the flux guard: `python -m tests.campaigns.flux_guard 1000 [first seed] [processes]`.

Each case: a published machine with its parameters moved (R +-30 %, leakage +-30 %, L_M -30 ... +20 %), iron that begins
to saturate between 0.7 and 1.3 of rated flux, an ideal inverter or one that loses 1 ... 20 V per leg (at 400 V), a lasting
DC voltage that nobody asked for, a drive that trips at 1.0 ... 1.4 of the motor's rated peak, a link of 5-100 ms, and the
amplitude following the guard's advice. What is known of the motor comes from the plate alone, is wrong, or was measured
before; of resistance and inverter, what a DC staircase says: their sum at its top current, and where the inverter loses
several times R_s I, up to a fifth of its loss taken for resistance. A motor that was measured also gets the DC bias the
product ends a test with, from levels that are 3 % off.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context

import numpy as np

from commissioner.identify.excite.bias import CUT_ABOVE, BiasGuard, plan_bias
from commissioner.identify.excite.flux_guard import FluxAdvice, FluxGuard
from commissioner.identify.excite.tones import Excitation, ExcitationLimits, design
from commissioner.identify.inverter.compensation import NOTHING, Compensation
from commissioner.identify.inverter.staircase import IDEAL_INVERTER, DcLevel, InverterError, StaircaseLimits, staircase
from commissioner.identify.observer.coordinates import PRIOR_LOG_STD
from commissioner.identify.observer.observer import ParallelObserver
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import Nameplate, prior, rated_flux
from commissioner.motor.space_vector import phase_cosines
from commissioner.procedure.energised.closing_bias import SECONDS as BIAS_S
from commissioner.procedure.energised.multitone import KNOWN_LOG_STD
from commissioner.procedure.energised.staircase import TOP
from commissioner.procedure.plan import BELOW_TRIP
from tests.support.standstill import saturating_block, usable_motors

PERIOD_S = 2e-4
FLUX_FRACTION, CURRENT_FRACTION, TRIP_FRACTION = 0.9, 1.0, 1.4  # as in config/procedure.toml
RAMP_PER_S = 5.0
BIAS_RAMP_V_PER_S = 4.0 * 100.0
FIRST_SCALE = 0.05
NOISE = 0.005
MOTORS = list(usable_motors())


@dataclass(frozen=True)
class Outcome:
    """`peak` is the true stator flux over the guard's limit, `current` the true current over the drive's trip level, which
    ends a test; `final_scale` what amplitude was reached, `begin` what was known of the machine."""

    seed: int
    motor: str
    peak: float
    current: float
    aborted: bool
    final_scale: float
    latency_s: float
    begin: str


@dataclass(frozen=True)
class Hidden:
    """What the guard does not know: `machine` as `saturating_block` takes it, one leg's loss, the voltage nobody asked for."""

    machine: np.ndarray
    plateau_v: float
    knee_a: float
    bias_v: float


def _truth(rng: np.random.Generator, plate: Nameplate, true: InverseGamma, has_inverter: bool) -> Hidden:
    ratio = (true.leakage_inductance_h + true.magnetizing_inductance_h) / true.magnetizing_inductance_h
    rated_wb = rated_flux(plate, true.stator_resistance_ohm).stator_peak_wb
    machine = [
        true.stator_resistance_ohm,
        ratio**2 * true.rotor_resistance_ohm,
        ratio * true.leakage_inductance_h,
        true.leakage_inductance_h + true.magnetizing_inductance_h,
        1.0 / (rated_wb * rng.uniform(0.7, 1.3)),
        7.0,
    ]
    plateau_v = np.exp(rng.uniform(0.0, np.log(20.0))) * plate.rated_voltage_v / 400.0
    knee_a = rng.uniform(0.005, 0.04) * plate.rated_current_peak_a
    # Up to 2 % of rated current flows for good, and its flux is in no measured integral.
    bias_v = rng.uniform(-0.02, 0.02) * true.stator_resistance_ohm * plate.rated_current_peak_a
    return Hidden(np.array(machine), float(plateau_v) if has_inverter else 0.0, knee_a, bias_v)


def _known(
    rng: np.random.Generator, truth: Hidden, top_a: float, span_a: float, is_measured: bool
) -> tuple[float, InverterError]:
    """(stator resistance, inverter) as a batch fit or a DC staircase tells them."""
    resistance = float(truth.machine[0]) * (1.0 + 0.01 * rng.standard_normal())
    taken = rng.uniform(-0.03, 0.03)
    if not is_measured and truth.plateau_v:
        taken = rng.uniform(-0.05, 0.2) * min(1.0, 0.5 * truth.plateau_v / (resistance * top_a))
        resistance = max(resistance + 4.0 / 3.0 * taken * truth.plateau_v / top_a, 0.5 * resistance)
    if not truth.plateau_v:
        return resistance, IDEAL_INVERTER
    grid = np.linspace(0.0, span_a, 400)
    lost = (1.0 - taken) * truth.plateau_v * np.tanh(grid / truth.knee_a)
    return resistance, InverterError(tuple(grid.tolist()), tuple(lost.tolist()))


def run_case(seed: int, seconds: float = 6.0) -> Outcome:
    rng = np.random.default_rng(seed)
    motor = MOTORS[rng.integers(len(MOTORS))]
    plate, box = motor.plate, prior(motor.plate)
    spread = np.array([rng.uniform(0.7, 1.3), rng.uniform(0.7, 1.3), rng.uniform(0.7, 1.3), rng.uniform(0.7, 1.2)])
    true = InverseGamma(*(np.array(motor.truth) * spread))
    has_inverter, knowledge = rng.random() < 0.6, str(rng.choice(["plate", "wrong", "measured"]))
    truth = _truth(rng, plate, true, has_inverter)
    peak_a, axis_deg = plate.rated_current_peak_a, float(rng.choice([0.0, 60.0, 90.0]))
    trip_a = min(TRIP_FRACTION, rng.uniform(1.0, 1.5)) * peak_a
    test_a = min(CURRENT_FRACTION * peak_a, BELOW_TRIP * trip_a)
    rated_wb = rated_flux(plate, true.stator_resistance_ohm).stator_peak_wb
    volts = 0.3 * np.sqrt(2.0 / 3.0) * plate.rated_voltage_v
    top_a = staircase(plate, StaircaseLimits(test_a, FLUX_FRACTION * rated_wb, volts)).top_current_a
    resistance, known = _known(rng, truth, top_a, 2.0 * trip_a, knowledge == "measured")
    start = replace(box.typical, stator_resistance_ohm=resistance)
    if knowledge == "measured":
        start = InverseGamma(*(np.array(true.as_tuple()) * np.exp(0.03 * rng.standard_normal(4))))
    if knowledge == "wrong":
        start = InverseGamma(resistance, *(np.array(start.as_tuple())[1:] * np.exp(0.4 * rng.standard_normal(3))))
    limit_wb = FLUX_FRACTION * rated_flux(plate, resistance).stator_peak_wb
    chosen = design(start, ExcitationLimits(limit_wb, test_a, volts, NOISE * peak_a), PERIOD_S, known, seconds)
    compensation = NOTHING
    if has_inverter:
        compensation = Compensation(known.on_axis(np.linspace(0.0, 2.0 * trip_a, 1025), axis_deg), 2.0 * trip_a)
    log_std = KNOWN_LOG_STD if knowledge == "measured" else PRIOR_LOG_STD
    observer = ParallelObserver(
        box, PERIOD_S, peak_a, start=start, start_log_std=log_std, compensation=compensation
    )  # fmt: skip
    latency = rng.uniform(0.005, 0.1)
    held_v = _holds_v(truth, min(top_a, TOP * limit_wb / truth.machine[3]), axis_deg)
    guard = FluxGuard(
        limit_wb, latency, chosen.excitation, PERIOD_S, resistance, known, axis_deg,
        current_a=test_a, trip_a=trip_a, held_v=held_v,
    )  # fmt: skip
    first = min(FIRST_SCALE, guard.first_scale)
    if knowledge == "measured":
        first = guard.begin_known(start, log_std, RAMP_PER_S)
    played = _Played(truth, axis_deg, chosen.excitation, first)
    aborted, rotor_wb = _follow(played, guard, observer, rng, seconds)
    if knowledge == "measured" and not aborted and played.peak_a <= trip_a:
        limits = ExcitationLimits(limit_wb, test_a, volts)
        _bias(played, guard, start, limits, _levels(rng, truth, top_a, axis_deg), rotor_wb, seconds)
    begin = f"{knowledge}{', inverter' if has_inverter else ''}"
    return Outcome(
        seed, motor.name, played.peak_wb / limit_wb, played.peak_a / trip_a, aborted, played.scale, latency, begin
    )


class _Played:
    """The drive and the motor: plays the excitation at an amplitude that ramps to the one last asked for."""

    def __init__(self, truth: Hidden, axis_deg: float, excitation: Excitation, first_scale: float) -> None:
        self._truth, self._excitation, self._state = truth, excitation, np.zeros(2)
        self._cosines = np.array(phase_cosines(axis_deg))
        self.wanted, self.scale, self.peak_wb, self.peak_a = first_scale, 0.0, 0.0, 0.0
        self.wanted_bias_v, self.bias_v = 0.0, 0.0

    def play(self, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
        """(voltage, current) of the samples from `first` on."""
        step = RAMP_PER_S * PERIOD_S
        change = np.clip(self.wanted - self.scale, -step * count, step * count)
        ramp = self.scale + np.sign(change) * np.minimum(np.arange(1, count + 1) * step, abs(change))
        self.scale = float(ramp[-1])
        step = BIAS_RAMP_V_PER_S * PERIOD_S
        change = np.clip(self.wanted_bias_v - self.bias_v, -step * count, step * count)
        bias = self.bias_v + np.sign(change) * np.minimum(np.arange(1, count + 1) * step, abs(change))
        self.bias_v = float(bias[-1])
        time_s = (first + np.arange(count, dtype=np.float64)) * PERIOD_S
        voltage = self._excitation.voltage_v(time_s, ramp) + bias
        current, flux, t = np.empty(count), np.empty(count), self._truth
        saturating_block(
            voltage + t.bias_v, PERIOD_S, self._state, t.machine, t.plateau_v, t.knee_a, self._cosines, current, flux
        )
        self.peak_wb = max(self.peak_wb, float(np.max(np.abs(flux))))
        self.peak_a = max(self.peak_a, float(np.max(np.abs(current))))
        return voltage, current


def _follow(
    played: _Played, guard: FluxGuard, observer: ParallelObserver, rng: np.random.Generator, seconds: float
) -> tuple[bool, float]:
    """Let the amplitude follow the guard's advice, one latency late: whether it said to de-energise, and the rotor flux seen
    last. Ends where the drive would."""
    block = max(50, round(0.5 * guard.latency_s / PERIOD_S))
    pending: list[tuple[int, float]] = []
    aborted, rotor_wb = False, 0.0
    for first in range(0, round(seconds / PERIOD_S), block):
        while pending and pending[0][0] <= first:
            played.wanted = pending.pop(0)[1]
        voltage, current = played.play(first, block)
        if played.peak_a > guard.trip_a:
            break
        if aborted:
            continue
        measured = current + NOISE * observer.current_scale_a * rng.standard_normal(block)
        estimate = observer.advance(voltage, measured)
        rotor_wb = float(estimate.rotor_flux_wb[-1])
        reading = guard.advance(voltage, measured, estimate, played.scale)
        due = first + block + round(guard.latency_s / PERIOD_S)
        is_steady = abs(played.scale - played.wanted) < 1e-6
        if reading.advice is FluxAdvice.ABORT:
            aborted = True
            pending.append((due, 0.0))
        elif reading.advice is FluxAdvice.BACK_OFF or (reading.advice is FluxAdvice.RAISE and is_steady):
            pending.append((due, min(1.0, reading.permitted_scale)))
    return aborted, rotor_wb


def _levels(rng: np.random.Generator, truth: Hidden, top_a: float, axis_deg: float) -> list[DcLevel]:
    """A staircase's settled levels."""
    currents = top_a * np.array([1.0, 0.6, 0.3])
    held = currents * rng.uniform(0.97, 1.03)
    return [DcLevel(_holds_v(truth, i, axis_deg), float(h), 0.0) for i, h in zip(currents, held, strict=True)]


def _holds_v(truth: Hidden, current_a: float, axis_deg: float) -> float:
    """The direct voltage that drives this current in the end."""
    cosines = np.array(phase_cosines(axis_deg))
    lost_v = 2.0 / 3.0 * np.sum(cosines * truth.plateau_v * np.tanh(current_a * cosines / truth.knee_a))
    return float(truth.machine[0] * current_a + lost_v)


def _bias(
    played: _Played,
    guard: FluxGuard,
    machine: InverseGamma,
    limits: ExcitationLimits,
    levels: Sequence[DcLevel],
    rotor_wb: float,
    began_s: float,
) -> None:
    """The stretch on a DC bias, as `procedure.under_bias` plays it, commands one latency late."""
    plan = plan_bias(machine, guard.excitation, limits, levels, PERIOD_S)
    if plan is None:
        return
    block = max(50, round(0.5 * guard.latency_s / PERIOD_S))
    watch = BiasGuard(
        machine, limits.flux_wb, guard.latency_s, guard.excitation, plan.scale, plan.voltage_v, PERIOD_S, guard.inverter,
        guard.axis_deg, rotor_wb,
    )  # fmt: skip
    played.wanted = plan.scale
    first, cut_at = round(began_s / PERIOD_S), math.inf
    last = first + round(BIAS_S * max(1.0, 2.0 * machine.rotor_time_constant_s) / PERIOD_S)
    while first < last:
        if first >= cut_at:
            played.wanted, played.wanted_bias_v = 0.0, 0.0
        elif abs(played.scale - plan.scale) < 1e-6:
            played.wanted_bias_v = plan.voltage_v
        _, current = played.play(first, block)
        first += block
        if watch.advance(current, first * PERIOD_S)[1] > CUT_ABOVE * limits.flux_wb:
            cut_at = min(cut_at, first + round(guard.latency_s / PERIOD_S))


def _outcomes(seeds: Sequence[int], processes: int) -> Iterator[Outcome]:
    if processes < 2:
        yield from map(run_case, seeds)
        return
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        yield from pool.map(run_case, seeds, chunksize=10)


def summary(outcomes: Sequence[Outcome]) -> str:
    peaks = [o.peak for o in outcomes]
    aborts = [o for o in outcomes if o.aborted]
    return (
        f"{len(outcomes)} cases: largest true flux {max(peaks):.4f} of the limit, {sum(p > 1.02 for p in peaks)} above 1.02; "
        f"{len(aborts)} aborts, {sum(o.peak < 1.0 for o in aborts)} of them below the limit; "
        f"{sum(o.current > 1.0 for o in outcomes)} tripped the drive; flux reached: median {np.median(peaks):.2f}, "
        f"10th percentile {np.percentile(peaks, 10):.2f}"
    )


def main(count: int = 1000, first: int = 0, processes: int = 1) -> int:
    outcomes: list[Outcome] = []
    for outcome in _outcomes(range(first, first + count), processes):
        outcomes.append(outcome)
        if len(outcomes) % 100 == 0 or len(outcomes) == count:
            print(summary(outcomes), flush=True)
        if outcome.peak > 1.02 or outcome.aborted or outcome.current > 1.0:
            print(outcome, flush=True)
    return int(any(o.peak > 1.02 for o in outcomes))


if __name__ == "__main__":
    raise SystemExit(main(*map(int, sys.argv[1:4])))
