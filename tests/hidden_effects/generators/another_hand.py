"""Recordings by another hand: a T circuit in complex numbers with iron loss beside its magnetizing branch, stepped by its own
Runge-Kutta, behind its own sensors. Shares nothing with `sim`, whose physics the rest of the protocol comes from.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, field

import numpy as np
from numba import njit

from commissioner.records import StandstillRecording

PERIOD_S = 2e-4
FINE = 80
PLATE = {
    "rated_power_w": 3000.0, "rated_voltage_v": 400.0, "rated_frequency_hz": 50.0, "rated_current_a": 6.6,
    "switching_frequency_hz": 5000.0, "sample_period_s": PERIOD_S,
}  # fmt: skip
PEAK_A = math.sqrt(2.0) * 6.6
SEGMENTS = (
    (0.0, 1.0, 0.0), (60.0, 1.0, 0.0), (120.0, 1.0, 0.0), (0.0, 1.8, 0.0), (60.0, 1.0, 0.25), (120.0, 1.4, 0.35),
    (0.0, 1.0, 0.0), (60.0, 1.8, 0.0),
)  # fmt: skip
"""Axis in degrees, level of the tones, bias as a share of the rated peak current."""
FEW = 5
"""Of these show whatever a single cause does: each axis, a second level and a bias."""
TONES_HZ = (0.67, 3.0, 11.0, 42.0, 123.0, 327.0)
LAYERS = ((np.arange(8) + 0.5) * np.pi) ** 2
"""Poles of tanh(x) / x, over the time of diffusion: r_r times the bar's admittance is the sum of 2 / (pole + s bar_s); what lies
beyond the eighth is a conductance alone.
"""
SHARE = 0.07
PAUSE_S = 1.5
LINK_V = 560.0


@dataclass(frozen=True)
class Machine:
    """T circuit: ohm, H; what is wrong with the machine, its inverter and its sensors, none of it by default."""

    r_s: float = 2.1
    r_r: float = 1.7
    l_s: float = 0.009
    l_r: float = 0.011
    l_m: float = 0.24
    knee_wb: float = math.inf
    """Flux of the magnetizing branch at which its current has doubled, ninth order."""
    foot: float = 0.0
    """Part by which that current is larger at little flux, where the sheet is less permeable: exp(-(flux / foot_wb)^2) of it."""
    foot_wb: float = 0.2
    loop_a: float = 0.0
    """Half the width of the iron's loops at no flux, far from their ends: along an axis a Preisach model, whose relays are 2 h wide,
    h exponentially distributed about `loop_wb`, and fewer the further their middle is from no flux: 1 / cosh^2 of it over `meet_wb`,
    so that the branches of a loop meet in saturation; in the plane its plays are vectors, dragged along at a distance h.
    """
    remembers: bool = False
    """The iron goes into a segment with what it remembers of the one before; else every one begins demagnetized."""
    loop_wb: float = 0.1
    meet_wb: float = 0.6
    iron_ohm: float = math.inf
    leg_v: float = 0.0
    leg_a: float = 0.2
    """A leg loses (2 / pi) leg_v atan(i / leg_a)."""
    legs: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """So many times that, each of the three."""
    ripple: float = 0.0
    """Share of the link that swings at `ripple_hz`, at a rectifier's lines or as another drive on it makes it swing."""
    ripple_hz: float = 300.0
    lag_s: float = 0.0
    cut_off_hz: float = math.inf
    """Of a Butterworth filter of second order."""
    delay_s: float = 0.0
    read_late_s: float = 0.0
    """So long after its instant a current is read."""
    gains: tuple[float, float, float] = (1.0, 1.0, 1.0)
    offsets_a: tuple[float, float, float] = (0.0, 0.0, 0.0)
    hum_a: float = 0.0
    warming: float = 0.0
    """Relative rise of the stator resistance per minute."""
    end_a: float = math.inf
    """Largest current that the sensors report."""
    noise: float = 1e-3
    """Of the rated peak current."""
    bar_share: float = 0.0
    """Of the rotor's leakage that a second cage of three times the resistance shunts."""
    bar_s: float = 0.0
    """Time of diffusion through a solid bar of constant width, whose impedance is r_r x coth x, x^2 = s bar_s."""
    sag: float = 0.0
    """Share of the voltage that is missing at rated power, behind a lag of `sag_s`."""
    sag_s: float = 0.01
    again_s: float = 0.0
    """A second lag behind that one, as of a choke before the capacitor."""
    has_diodes: bool = False
    """No current goes back to the mains: what the machine gives back stays in the capacitor until it is needed."""
    records_link: bool = False
    swing: float = 0.0
    """Amplitude of the electrical speed, rad/s, of a shaft that swings at `swing_hz`."""
    swing_hz: float = 1.7
    left_wb: complex = 0.0
    """Flux of the open rotor's current, at the stator, when each segment begins."""
    tones_hz: tuple[float, ...] = field(default=TONES_HZ)
    rest_s: float = 0.0
    """Without a command before each segment's."""
    sweeps: bool = False
    """From the first of these to the last, in equal times for equal ratios, instead of all at once."""


def impedance(machine: Machine, hz: float) -> complex:
    s = 2j * math.pi * hz
    rotor = machine.r_r + s * machine.l_r
    return machine.r_s + s * machine.l_s + rotor * s * machine.l_m / (rotor + s * machine.l_m)


def command(machine: Machine, level: float, bias: float, seconds: float, seed: int) -> np.ndarray:
    """Voltage along the axis (n,), risen over a tenth of a second."""
    random = np.random.default_rng(seed)
    t = np.arange(round(seconds / PERIOD_S)) * PERIOD_S
    out = np.full(t.size, machine.r_s * bias * PEAK_A)
    for hz in () if machine.sweeps else machine.tones_hz:
        size = SHARE * level * PEAK_A * abs(impedance(machine, hz))
        out += size * np.cos(2.0 * math.pi * hz * t + random.uniform(-math.pi, math.pi))
    if machine.sweeps:
        rate = math.log(machine.tones_hz[-1] / machine.tones_hz[0]) / seconds
        hertz = machine.tones_hz[0] * np.exp(rate * t)
        sizes = SHARE * len(machine.tones_hz) * level * PEAK_A * np.array([abs(impedance(machine, hz)) for hz in hertz])
        out += sizes * np.cos(2.0 * math.pi * (hertz - machine.tones_hz[0]) / rate + random.uniform(-math.pi, math.pi))
    return np.concatenate([np.zeros(round(machine.rest_s / PERIOD_S)), out * np.clip(t / 0.1, 0.0, 1.0)])


def recorded(machine: Machine, seconds: float = 3.0, seed: int = 1, count: int = len(SEGMENTS)) -> StandstillRecording:
    """The first `count` segments one after the other, the machine at rest before each, and without flux but for what its iron keeps."""
    random = np.random.default_rng([seed, 7])
    times, numbers, axes, volts, currents, links = [], [], [], [], [], []
    begin, kept, plays = 0.0, 0j, np.zeros(60, dtype=np.complex128)
    for k, (axis, level, bias) in enumerate(SEGMENTS[:count]):
        volt = command(machine, level, bias, seconds, seed + (k if k < 6 else 0))
        along = cmath.exp(1j * math.radians(axis))
        left = complex(machine.left_wb) + kept
        seen, lost, last = _simulated(volt * along, PERIOD_S, FINE, begin, left, kept, plays, *_numbers(machine))
        if machine.remembers:
            kept = _at_rest(last, plays, PAUSE_S, *_iron(machine))
        else:
            plays[:] = 0.0
        t = begin + np.arange(volt.size) * PERIOD_S
        phases = np.stack([(seen * cmath.exp(-2j * math.pi * p / 3.0)).real for p in range(3)])
        hum = machine.hum_a * np.cos(2.0 * math.pi * 49.97 * t[None] + np.array([[0.3], [2.0], [4.1]]))
        noise = machine.noise * PEAK_A * random.normal(size=phases.shape)
        sensed = np.array(machine.gains)[:, None] * phases + np.array(machine.offsets_a)[:, None] + hum + noise
        currents.append(np.clip(sensed, -machine.end_a, machine.end_a))
        times.append(t)
        numbers.append(np.full(volt.size, k))
        axes.append(np.full(volt.size, axis))
        volts.append(volt)
        links.append(LINK_V * (1.0 - lost) if machine.records_link else np.full(volt.size, LINK_V))
        begin += machine.rest_s + seconds + PAUSE_S
    u, v, w = np.concatenate(currents, axis=1)
    return StandstillRecording(
        np.concatenate(times), np.concatenate(numbers), np.concatenate(axes), np.concatenate(volts), u, v, w,
        np.concatenate(links), PERIOD_S, PLATE,
    )  # fmt: skip


def _iron(m: Machine) -> tuple[float, ...]:
    return m.r_r, m.l_r, m.l_m, m.loop_a, m.loop_wb, m.meet_wb


def _numbers(m: Machine) -> tuple[float, ...]:
    turn = 0.0 if math.isinf(m.cut_off_hz) else 2.0 * math.pi * m.cut_off_hz
    knee = 0.0 if math.isinf(m.knee_wb) else 1.0 / m.knee_wb
    iron = 0.0 if math.isinf(m.iron_ohm) else m.iron_ohm
    return (
        m.loop_a,
        m.loop_wb,
        m.meet_wb,
        m.r_s,
        m.warming / 60.0,
        m.r_r,
        m.l_s,
        m.l_r,
        m.l_m,
        knee,
        m.foot,
        m.foot_wb,
        iron,
        m.leg_v,
        m.leg_a,
        m.legs,
        m.lag_s,
        turn,
        m.delay_s,
        m.read_late_s,
        m.sag / PLATE["rated_power_w"],
        m.sag_s,
        m.again_s,
        m.has_diodes,
        m.bar_share,
        m.bar_s,
        m.ripple,
        m.ripple_hz,
        m.swing,
        2.0 * math.pi * m.swing_hz,
    )


@njit(cache=True)
def _magnetizing(flux, l_m, knee, foot, foot_wb):
    return flux / l_m * (1.0 + (abs(flux) * knee) ** 8 + foot * math.exp(-((abs(flux) / foot_wb) ** 2)))


@njit(cache=True)
def _leg_loss(current, leg_v, leg_a, legs):
    """Space vector of what the three legs lose."""
    out = 0.0 + 0.0j
    for p in range(3):
        turned = complex(math.cos(2.0 * math.pi * p / 3.0), math.sin(2.0 * math.pi * p / 3.0))
        i = (current * turned.conjugate()).real
        out += 2.0 / 3.0 * turned * legs[p] * leg_v * 2.0 / math.pi * math.atan(i / leg_a)
    return out


@njit(cache=True)
def _relays(flux, plays, loop_a, loop_wb, meet_wb):
    """Extra magnetizing current of the loops at a flux; every play follows it."""
    most = 0.0
    total = 0.0j
    for k in range(plays.size):
        half = (k + 0.5) / plays.size * 5.0 * loop_wb
        weight = math.exp(-half / loop_wb)
        apart = abs(flux - plays[k])
        if apart > half:
            plays[k] = flux - half / apart * (flux - plays[k])
        most += weight
        total += weight * _bent(plays[k], meet_wb)
    return loop_a * (meet_wb / loop_wb) * (_bent(flux, meet_wb) - total / most)


@njit(cache=True)
def _bent(flux, meet_wb):
    size = abs(flux)
    return flux * (math.tanh(size / meet_wb) / size) if size > 0.0 else 0.0j


@njit(cache=True)
def _at_rest(rotor, plays, pause, r_r, l_r, l_m, loop_a, loop_wb, meet_wb):
    """Flux of the magnetizing branch that is left of the rotor's after a pause with open terminals; the plays follow it."""
    steps = 20_000
    loops = 0.0j
    for _ in range(steps):
        middle = (rotor / l_r - loops) / (1.0 / l_r + 1.0 / l_m)
        if loop_a > 0.0:
            loops = _relays(middle, plays, loop_a, loop_wb, meet_wb)
        rotor -= pause / steps * r_r * (rotor - middle) / l_r
    return middle


@njit(cache=True)
def _middle(x, own, l_s, l_m, knee, foot, foot_wb, loops):
    """Flux of the magnetizing branch."""
    middle = (x[0] / l_s + x[1] / own - loops) / (1.0 / l_s + 1.0 / own + 1.0 / l_m)
    for _ in range(12 if knee > 0.0 or foot > 0.0 else 0):
        wrong = (x[0] - middle) / l_s + (x[1] - middle) / own - _magnetizing(middle, l_m, knee, foot, foot_wb) - loops
        middle += wrong / (
            1.0 / l_s
            + 1.0 / own
            + (1.0 + 9.0 * (abs(middle) * knee) ** 8 + foot * math.exp(-((abs(middle) / foot_wb) ** 2))) / l_m
        )
    return middle


@njit(cache=True)
def _rates(
    x,
    v,
    loops,
    r_s,
    omega,
    r_r,
    l_s,
    l_r,
    l_m,
    knee,
    foot,
    foot_wb,
    iron,
    leg_v,
    leg_a,
    legs,
    lag,
    turn,
    bar,
    diffusion,
):
    """x: stator, rotor, magnetizing flux, flux of the shunted leakage, behind the lag, the two states of the filter, and the
    currents of the bar's layers.
    """
    own = (1.0 - bar) * l_r
    middle = x[2] if iron > 0.0 else _middle(x, own, l_s, l_m, knee, foot, foot_wb, loops)
    i_s, i_r = (x[0] - middle) / l_s, (x[1] - middle) / own
    d = np.zeros(7 + LAYERS.size, dtype=np.complex128)
    d[0] = v - r_s * i_s - (_leg_loss(i_s, leg_v, leg_a, legs) if leg_v > 0.0 else 0.0)
    if bar > 0.0:
        # the cage is two in parallel: a resistance alone, and one in series with the deeper part of the leakage
        deep = x[3] / (bar * l_r)
        d[1] = -3.0 * r_r * (i_r - deep)
        d[3] = -d[1] - 1.5 * r_r * deep
    elif diffusion > 0.0:
        d[1] = -r_r * (i_r - x[7:].sum()) / (1.0 - (2.0 / LAYERS).sum())
        d[7:] = (-2.0 * d[1] / r_r - LAYERS * x[7:]) / diffusion
    else:
        d[1] = -r_r * i_r
    d[1] += 1j * omega * x[1]
    if iron > 0.0:
        d[2] = iron * (i_s + i_r - _magnetizing(middle, l_m, knee, foot, foot_wb) - loops)
    if lag > 0.0:
        d[4] = (i_s - x[4]) / lag
    if turn > 0.0:
        d[5] = x[6]
        d[6] = turn * turn * (i_s - x[5]) - math.sqrt(2.0) * turn * x[6]
    seen = x[4] if lag > 0.0 else (x[5] if turn > 0.0 else i_s)
    return d, seen, i_s


@njit(cache=True)
def _simulated(
    volts,
    period,
    fine,
    begin,
    left,
    kept,
    plays,
    loop_a,
    loop_wb,
    meet_wb,
    cold,
    warming,
    r_r,
    l_s,
    l_r,
    l_m,
    knee,
    foot,
    foot_wb,
    iron,
    leg_v,
    leg_a,
    legs,
    lag,
    turn,
    delay,
    read_late,
    sag,
    sag_s,
    again_s,
    diodes,
    bar,
    diffusion,
    ripple,
    ripple_hz,
    swing,
    swings,
):
    """Current (n,) that the sensors see, `delay` old, before noise; what the link has lost then, of it; and the last rotor flux."""
    n, h = volts.size, period / fine
    x = np.zeros(7 + LAYERS.size, dtype=np.complex128)
    x[0], x[1], x[2] = left, kept + (left - kept) * (l_m + l_r) / l_m, left
    late, after = round(delay / h), round(read_late / h)
    memory = np.zeros(late + 1, dtype=np.complex128)
    out = np.zeros(n, dtype=np.complex128)
    lost = np.zeros(n)
    constant = (
        r_r, l_s, l_r, l_m, knee, foot, foot_wb, iron, leg_v, leg_a, legs, lag, turn, bar, diffusion,
    )  # fmt: skip
    at = 0
    v = 0.0j
    load = drops = 0.0
    loops = _relays(kept, plays, loop_a, loop_wb, meet_wb) if loop_a > 0.0 else 0.0j
    for k in range(n):
        omega = swing * math.cos(swings * (begin + k * period))
        r_s = cold * (1.0 + warming * (begin + k * period))
        lost[k] = sag * drops - ripple * math.cos(2.0 * math.pi * ripple_hz * (k + 0.5) * period)
        for step in range(fine):
            # the sample shows what was before the voltage stepped
            k1, seen, drawn = _rates(x, v, loops, r_s, omega, *constant)
            memory[at % (late + 1)] = seen
            if step == after:
                out[k] = memory[(at - late) % (late + 1)] if at >= late else 0.0j
            if step == 0:
                v = volts[k] * (1.0 - sag * drops + ripple * math.cos(2.0 * math.pi * ripple_hz * k * period))
                k1, seen, drawn = _rates(x, v, loops, r_s, omega, *constant)
            at += 1
            k2, seen, drawn = _rates(x + 0.5 * h * k1, v, loops, r_s, omega, *constant)
            k3, seen, drawn = _rates(x + 0.5 * h * k2, v, loops, r_s, omega, *constant)
            k4, seen, drawn = _rates(x + h * k3, v, loops, r_s, omega, *constant)
            x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            if loop_a > 0.0:
                flux = x[2] if iron > 0.0 else _middle(x, (1.0 - bar) * l_r, l_s, l_m, knee, foot, foot_wb, loops)
                loops = _relays(flux, plays, loop_a, loop_wb, meet_wb)
            if sag > 0.0:
                load += (
                    h / sag_s * (1.5 * (volts[k] * drawn.conjugate()).real - (0.0 if diodes and load < 0.0 else load))
                )
                drops = drops + h / again_s * (load - drops) if again_s > 0.0 else load
            v = volts[k] * (
                1.0 - sag * drops + ripple * math.cos(2.0 * math.pi * ripple_hz * (k + (step + 1.5) / fine) * period)
            )
    return out, lost, x[1]
