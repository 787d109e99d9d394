"""A running squirrel-cage motor on a grid or an inverter: T circuit, flux-linkage states, fourth-order Runge-Kutta.

Stator fluxes live in stator coordinates, rotor fluxes in rotor coordinates (where the bars are), joined through the
shaft angle. Rotor slots and a bent rotor modulate the stator's share of the main flux with the shaft angle.
States: psi_s alpha, psi_s beta, psi_r x, psi_r y, shaft speed, shaft angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.physics.compiled import cached
from sim.physics.loads import PeriodicLoad

SETTLE_S, START_SLIP = 3.0, 0.03


@dataclass(frozen=True)
class Machine:
    """Star-equivalent T circuit and mechanics, SI."""

    pole_pairs: int
    stator_resistance_ohm: float
    rotor_resistance_ohm: float
    stator_leakage_h: float
    rotor_leakage_h: float
    magnetizing_inductance_h: float
    inertia_kg_m2: float
    rotor_slots: int = 28
    slot_modulation: float = 0.0
    eccentricity: float = 0.0


@dataclass(frozen=True)
class Supply:
    """Phase amplitude and what is wrong with the mains. `drift_hz` is the whole excursion over the recording."""

    amplitude_v: float
    frequency_hz: float
    unbalance: float = 0.0
    unbalance_angle_rad: float = 0.0
    fifth: float = 0.0
    seventh: float = 0.0
    drift_ramp_hz_per_s: float = 0.0
    drift_wave_hz: float = 0.0
    drift_wave_rad_per_s: float = 0.1
    drift_wave_angle_rad: float = 0.0
    sag: float = 0.0
    sag_rad_per_s: float = 0.3


@dataclass(frozen=True)
class Played:
    """What truly happened, at the recording's sample times."""

    time_s: NDArray[np.float64]
    voltage_abc_v: NDArray[np.float64]
    current_abc_a: NDArray[np.float64]
    speed_rad_per_s: NDArray[np.float64]
    angle_rad: NDArray[np.float64]
    electromagnetic_torque_nm: NDArray[np.float64]
    load_torque_nm: NDArray[np.float64]


def play(
    machine: Machine,
    supply: Supply,
    loads: list[PeriodicLoad],
    steady_load: tuple[float, float, float],
    duration_s: float,
    sample_period_s: float,
) -> Played:
    """The motor's terminal quantities and shaft over `duration_s`, after `SETTLE_S` that are thrown away.

    `steady_load`: constant (N m), per speed (N m s), per speed squared (N m s2).
    """
    count = round(duration_s / sample_period_s)
    settle = round(SETTLE_S / sample_period_s)
    substeps = max(2, int(np.ceil(sample_period_s / 70e-6)))
    tables = np.array([load.torque_nm for load in loads]) if loads else np.zeros((0, 2))
    turning = np.array([[load.turns_per_shaft_turn, load.turns_per_s, load.start] for load in loads]).reshape(-1, 3)
    circuit = np.array(
        [
            machine.pole_pairs,
            machine.stator_resistance_ohm,
            machine.rotor_resistance_ohm,
            machine.stator_leakage_h + machine.magnetizing_inductance_h,
            machine.rotor_leakage_h + machine.magnetizing_inductance_h,
            machine.magnetizing_inductance_h,
            machine.inertia_kg_m2,
            machine.rotor_slots,
            machine.slot_modulation,
            machine.eccentricity,
        ],
        dtype=np.float64,
    )
    mains = np.array(
        [
            supply.amplitude_v,
            2 * np.pi * supply.frequency_hz,
            supply.unbalance,
            supply.unbalance_angle_rad,
            supply.fifth,
            supply.seventh,
            2 * np.pi * supply.drift_ramp_hz_per_s,
            2 * np.pi * supply.drift_wave_hz,
            supply.drift_wave_rad_per_s,
            supply.drift_wave_angle_rad,
            supply.sag,
            supply.sag_rad_per_s,
        ]
    )
    synchronous = 2 * np.pi * supply.frequency_hz / machine.pole_pairs
    start = np.array(
        [
            0.0,
            -supply.amplitude_v / (2 * np.pi * supply.frequency_hz),
            0.0,
            -supply.amplitude_v / (2 * np.pi * supply.frequency_hz),
            synchronous * (1 - START_SLIP),
            0.0,
        ]
    )
    raw = _march(
        circuit, mains, tables, turning, np.array(steady_load), start, -settle, count, sample_period_s, substeps
    )
    alpha_beta = raw[:, :4]
    return Played(
        time_s=np.arange(count) * sample_period_s,
        voltage_abc_v=_to_phases(alpha_beta[:, 0], alpha_beta[:, 1]),
        current_abc_a=_to_phases(alpha_beta[:, 2], alpha_beta[:, 3]),
        speed_rad_per_s=raw[:, 4].copy(),
        angle_rad=raw[:, 5].copy(),
        electromagnetic_torque_nm=raw[:, 6].copy(),
        load_torque_nm=raw[:, 7].copy(),
    )


def _to_phases(alpha: NDArray[np.float64], beta: NDArray[np.float64]) -> NDArray[np.float64]:
    half = 0.5 * np.sqrt(3.0) * beta
    return np.stack([alpha, -0.5 * alpha + half, -0.5 * alpha - half])


@cached(fastmath=True)
def _voltage(mains, t):
    amplitude, w0, unbalance, tilt, fifth, seventh, ramp, wave, wave_rate, wave_start, sag, sag_rate = mains
    angle = w0 * t + 0.5 * ramp * t * t - wave / wave_rate * (np.cos(wave_rate * t + wave_start) - np.cos(wave_start))
    size = amplitude * (1 + sag * np.sin(sag_rate * t + 1.0))
    alpha = np.cos(angle) + unbalance * np.cos(angle - tilt)
    beta = np.sin(angle) - unbalance * np.sin(angle - tilt)
    alpha += fifth * np.cos(5 * angle + 0.4) + seventh * np.cos(7 * angle - 0.9)
    beta += -fifth * np.sin(5 * angle + 0.4) + seventh * np.sin(7 * angle - 0.9)
    return size * alpha, size * beta


@cached(fastmath=True)
def _load_torque(tables, turning, steady, t, speed, angle):
    total = steady[0] + steady[1] * speed + steady[2] * speed * speed
    for k in range(turning.shape[0]):
        phase = turning[k, 0] * angle / (2 * np.pi) + turning[k, 1] * t + turning[k, 2]
        place = (phase - np.floor(phase)) * tables.shape[1]
        low = int(place)
        part = place - low
        low %= tables.shape[1]
        high = (low + 1) % tables.shape[1]
        total += tables[k, low] * (1 - part) + tables[k, high] * part
    return total


@cached(fastmath=True)
def _slope(circuit, mains, tables, turning, steady, t, x, out):
    pairs, r_s, r_r, l_s, l_r, l_m, inertia, slots, slot_part, bend = circuit
    speed, angle = x[4], x[5]
    c, s = np.cos(pairs * angle), np.sin(pairs * angle)
    rotor_a = c * x[2] - s * x[3]  # rotor fluxes seen from the stator
    rotor_b = s * x[2] + c * x[3]
    det = l_s * l_r - l_m * l_m
    leak_s, leak_r = l_s - l_m, l_r - l_m
    main_a = l_m * (leak_r * x[0] + leak_s * rotor_a) / det
    main_b = l_m * (leak_r * x[1] + leak_s * rotor_b) / det
    gap = slot_part * np.cos(slots * angle) + bend * np.cos(angle)
    stator_a, stator_b = x[0] - gap * main_a, x[1] - gap * main_b
    is_a = (l_r * stator_a - l_m * rotor_a) / det
    is_b = (l_r * stator_b - l_m * rotor_b) / det
    ir_a = (l_s * rotor_a - l_m * stator_a) / det
    ir_b = (l_s * rotor_b - l_m * stator_b) / det
    va, vb = _voltage(mains, t)
    out[0] = va - r_s * is_a
    out[1] = vb - r_s * is_b
    out[2] = -r_r * (c * ir_a + s * ir_b)
    out[3] = -r_r * (-s * ir_a + c * ir_b)
    torque = 1.5 * pairs * l_m * (is_b * ir_a - is_a * ir_b)
    load = _load_torque(tables, turning, steady, t, speed, angle)
    out[4] = (torque - load) / inertia
    out[5] = speed
    return va, vb, is_a, is_b, torque, load


@cached(fastmath=True)
def _march(circuit, mains, tables, turning, steady, start, first, count, period, substeps):
    x = start.copy()
    y = np.empty(6)
    k1, k2, k3, k4 = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    h = period / substeps
    out = np.empty((count, 8))
    for n in range(first, count):
        if n >= 0:
            va, vb, ia, ib, torque, load = _slope(circuit, mains, tables, turning, steady, n * period, x, k1)
            out[n, 0], out[n, 1], out[n, 2], out[n, 3] = va, vb, ia, ib
            out[n, 4], out[n, 5], out[n, 6], out[n, 7] = x[4], x[5], torque, load
        for m in range(substeps):
            t = n * period + m * h
            _slope(circuit, mains, tables, turning, steady, t, x, k1)
            for j in range(6):
                y[j] = x[j] + 0.5 * h * k1[j]
            _slope(circuit, mains, tables, turning, steady, t + 0.5 * h, y, k2)
            for j in range(6):
                y[j] = x[j] + 0.5 * h * k2[j]
            _slope(circuit, mains, tables, turning, steady, t + 0.5 * h, y, k3)
            for j in range(6):
                y[j] = x[j] + h * k3[j]
            _slope(circuit, mains, tables, turning, steady, t + h, y, k4)
            for j in range(6):
                x[j] += h / 6.0 * (k1[j] + 2 * k2[j] + 2 * k3[j] + k4[j])
    return out
