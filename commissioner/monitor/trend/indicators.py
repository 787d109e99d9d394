"""Numbers that a person trends: torque pulses compared, ripples, unbalance.

Pulses after Schantz & Leeb, IV-D and Table I: each part of the shaft turn belongs to one cylinder (vane, tooth); the pulses
are normalised and laid over each other; the area between the curves says how unlike they are. The plain difference of their
areas is given too, but lobes of opposite sign cancel in it: on the simulated compressor a 0.8 mm2 hole moves it by 2 of its
standard deviations, the area between the curves by more than 10.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from commissioner.monitor.chain import Observation
from commissioner.monitor.intake.findings import Fundamental
from commissioner.monitor.machine.inversion import SpeedLines, basis_of, torque_of
from commissioner.monitor.signals.supply import Vector
from commissioner.motor.circuit import Quantity
from commissioner.motor.running import TCircuit, stator_impedance
from commissioner.records import Signal

POINTS = 720
SENSOR_NOISE = 0.15
"""Scatter of the negative-sequence excess from recording to recording, in per cent: 0.12 over healthy 8-s recordings at 1 % noise."""
CUT_PERCENT = 0.1
"""Pulses are cut at whole points of the turn: that alone moves their areas so much."""
MOST_PULSES = 8
DOMINANT = 1.5
"""A pulse train is there where its line is so many times the once-per-turn line."""


@dataclass(frozen=True)
class Pulses:
    """`curves[k]` is the k-th part of the turn, normalised to the mean pulse's height; in per cent of it:
    `dissimilarity` = area between the two most unlike curves, `area_difference` = largest minus smallest area.

    `std` is everything, `*_noise` the part that changes from recording to recording (the air gap's share does not).
    """

    per_turn: int
    curves: tuple[Signal, ...]
    dissimilarity: Quantity
    dissimilarity_noise: float
    area_difference: Quantity
    area_difference_noise: float


@dataclass(frozen=True)
class Indicator:
    """One number to trend; `noise_std` is the part of `quantity.std` that is drawn anew in each recording."""

    name: str
    quantity: Quantity
    noise_std: float
    unit: str


def pulses(observation: Observation) -> Pulses | None:
    """The turn's torque pulses, or None where the torque has no pulse train (no order 2 to 8 stands out)."""
    curves = _turns(observation)
    value = curves[0]
    spectrum = np.abs(np.fft.rfft(value))[: MOST_PULSES + 1]
    count = int(np.argmax(spectrum[2:])) + 2
    if spectrum[count] < DOMINANT * spectrum[1]:
        return None
    start = _trough(value, count)
    made = [_compare(curve, count, start) for curve in curves]
    noise = int(observation.lines.current_influence.shape[0])
    chance = _chance(observation, value)
    area = np.array([area for _, area, _ in made])
    shape = np.array([shape for _, _, shape in made])
    return Pulses(
        count,
        made[0][0],
        Quantity(float(shape[0]), _spread(shape)),
        float(np.hypot(_spread(shape[: noise + 1]), chance)),
        Quantity(float(area[0]), _spread(area)),
        float(np.hypot(_spread(area[: noise + 1]), chance / np.sqrt(count))),
    )


def _chance(observation: Observation, torque: Signal) -> float:
    """Per cent of the pulses' height: what the orders between the pulses may hold beyond what is drawn. Few recordings make them look quieter than
    they are, until by chance one of them is drawn.
    """
    inertia = observation.inertia_kg_m2 or 0.0
    left_out = inertia * np.sqrt(observation.solved.kept.between_pulses)
    return float(np.hypot(CUT_PERCENT, 100 * left_out / max(float(np.ptp(torque)), 1e-12)))


def _spread(values: Signal) -> float:
    return float(np.sqrt(np.sum((values[1:] - values[0]) ** 2)))


def _turns(observation: Observation) -> list[Signal]:
    """Load torque over one shaft turn from the shaft's own comb; the value first, then its one-sigma changes."""
    problem, solved = observation.problem, observation.solved
    lines, on = problem.lines, problem.on
    turns = observation.segment_speed_rad_per_s / (2 * np.pi * observation.combs[0].frequency_hz)
    phase = 2 * np.pi * np.arange(POINTS) / POINTS / turns
    others = {p: np.zeros(POINTS) for p in range(1, len(observation.combs))}
    basis = basis_of(lines, {0: phase} | others, POINTS)
    basis[:, lines.comb > 0] = 0.0
    inertia = observation.inertia_kg_m2
    rate = 1j * lines.rate_rad_per_s[on.positive]

    def torque(circuit: TCircuit, speed: SpeedLines, flux: Vector, current: Vector) -> Signal:
        electric = torque_of(circuit, problem.pole_pairs, basis @ flux, basis @ current)
        if inertia is None:
            return electric
        return electric - inertia * 2 * np.real(basis[:, on.positive] @ (rate * speed.amplitude_rad_per_s))

    first = torque(solved.circuit, solved.speed, solved.state.flux_wb, lines.current_a)
    return [first, *(torque(*change) for change in solved.changes)]


def _trough(torque: Signal, count: int) -> int:
    """Where the pulse train of order `count` has its first trough: pulses are cut there."""
    angle = float(np.angle(np.fft.rfft(torque)[count]))
    return round(((np.pi - angle) % (2 * np.pi)) / (2 * np.pi) * POINTS / count) % POINTS


def _compare(torque: Signal, count: int, start: int) -> tuple[tuple[Signal, ...], float, float]:
    """(normalised curves, area difference, shape difference), both in per cent."""
    length = POINTS // count
    turned = np.roll(torque, -start)
    parts = np.array([np.roll(turned, -round(k * POINTS / count))[:length] for k in range(count)])
    middle = parts.mean(axis=0)
    scaled = (parts - middle.min()) / max(float(np.ptp(middle)), 1e-12)
    areas = scaled.mean(axis=1)
    apart = max(float(np.mean(np.abs(a - b))) for a in scaled for b in scaled)
    return tuple(scaled), 100 * float(areas.max() - areas.min()), 100 * apart


def negative_sequence_excess(fundamental: Fundamental, circuit: TCircuit, slip: float) -> float:
    """|I- - V- / Z-| / |I+|: the negative-sequence current that the mains' own unbalance does not explain."""
    impedance = stator_impedance(circuit, 2 * np.pi * fundamental.frequency_hz, 2 - slip)
    expected = fundamental.voltage_negative_v / impedance
    return float(abs(fundamental.current_negative_a - expected) / max(abs(fundamental.current_a), 1e-12))


def trendable(observation: Observation, made: Pulses | None) -> list[Indicator]:
    """Everything that a baseline watches."""
    period, moving = observation.period, observation.period.moving_std
    fundamental = observation.audited.fundamental
    assert fundamental is not None
    out = [
        Indicator(
            "speed_ripple_rad_per_s", *_ripple(period.speed_rad_per_s, moving.speed, period.noise_rms.speed), "rad/s"
        ),
        Indicator("torque_ripple_nm", *_ripple(period.torque_nm, moving.torque, period.noise_rms.torque), "N m"),
    ]
    if period.load_torque_nm is not None:
        ripple = _ripple(period.load_torque_nm, moving.load_torque, period.noise_rms.load_torque)
        out.append(Indicator("load_torque_ripple_nm", *ripple, "N m"))
    if made is not None:
        out.append(Indicator("pulse_dissimilarity_percent", made.dissimilarity, made.dissimilarity_noise, "%"))
        out.append(Indicator("pulse_area_difference_percent", made.area_difference, made.area_difference_noise, "%"))
    excess = negative_sequence_excess(fundamental, observation.fitted.circuit, observation.slip)
    out.append(Indicator("negative_sequence_excess_percent", Quantity(100 * excess, 0.3), SENSOR_NOISE, "%"))
    return out


def _ripple(values: Signal, std: float, noise: float) -> tuple[Quantity, float]:
    """Amplitude of the sine with the same rms, with the rms standard deviation of its points around their mean; a peak would
    jump with each order that one recording shows and another does not."""
    return Quantity(float(np.sqrt(2.0) * np.std(values)), std), noise
