"""True sizes of hidden effects in the diagnosis' own terms: functionals at the operating point it states."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from sim.physics import layout as at
from sim.physics.laws import leakage_excess, saturation_excess
from sim.physics.machine import Effect, Plant
from sim.physics.packing import pack
from sim.truth import leg_error_v

Sizes = Mapping[str, tuple[float, float, str]]


def size_error(effect: Effect, plant: Plant, sizes: Sizes, peak_a: float) -> float | None:
    """Relative error of the cause's leading size, None where the two sides define none in common.

    Compared are laws at a point: a leg's loss at 0.6 of the largest current, saturation at the flux reached, and so on.
    `peak_a`: largest phase current of the recording.
    """
    compare = COMPARED.get(effect.name)
    pair = compare(effect, plant, sizes, peak_a) if compare and sizes else None
    if pair is None or pair[1] == 0:
        return None
    return abs(pair[0] - pair[1]) / abs(pair[1])


Pair = tuple[float, float] | None
Compare = Callable[[Effect, Plant, Sizes, float], Pair]


def _first(sizes: Sizes) -> float:
    return next(iter(sizes.values()))[0]


def _scaled(factor: float) -> Compare:
    """The simulator's size times `factor` is the first size of the cause."""
    return lambda effect, plant, sizes, peak: (_first(sizes), factor * effect.size)


def _leg(effect: Effect, plant: Plant, sizes: Sizes, peak_a: float) -> Pair:
    slope = float(pack(plant)[0][at.P_SLOPE_OHM])
    return sizes["voltage_v"][0], leg_error_v(plant, 0.6 * peak_a) - slope * 0.6 * peak_a


def _saturation(effect: Effect, plant: Plant, sizes: Sizes, peak_a: float) -> Pair:
    flux, rated = sizes["at_flux_wb"][0], plant.nameplate.rated_flux_wb
    p = pack(plant)[0]
    reached = [max((k / 60.0 * flux / rated) ** 2, 1e-12) for k in range(61)]
    excess = [saturation_excess(y, p[at.P_SAT], p[at.P_SAT_ORDER], p[at.P_SAT_SHAPE]) for y in reached]
    return sizes["extra_current_a"][0], flux / plant.machine.inductance_h * (excess[-1] - min(excess))


def _leakage(effect: Effect, plant: Plant, sizes: Sizes, peak_a: float) -> Pair:
    """Drop at the recording's peak current: gain k E(psi / knee) with psi = L i / (1 + k E), by fixed point."""
    p = pack(plant)[0]
    leak, current = plant.machine.leakage_inductance_h, sizes["at_current_a"][0]
    gain = 0.0
    for _ in range(60):
        flux = leak * current / (1.0 + gain)
        gain = 0.5 * (gain + p[at.P_LEAKSAT] * leakage_excess(flux / p[at.P_LEAKSAT_WB], p[at.P_LEAKSAT_SHAPE]))
    return sizes["inductance_drop"][0], 1.0 - 1.0 / (1.0 + gain)


def _hysteresis(effect: Effect, plant: Plant, sizes: Sizes, peak_a: float) -> Pair:
    return sizes["coercive_current_a"][0], carried_by_memory(effect, plant, sizes["at_flux_wb"][0])


def carried_by_memory(effect: Effect, plant: Plant, flux_wb: float) -> float:
    """Current of the simulator's memory (A) where a wide loop turns at `flux_wb`.

    Where the loop widens, what it tends to, c = size (0.6 + 0.4 (psi / rated)^2), has grown on the way, and dy/dpsi = (c - y) / scale
    lags behind: y = c - scale c' + scale^2 c''.
    """
    if effect.shape != "widening":
        return effect.size
    rated = plant.nameplate.rated_flux_wb
    at, scale = flux_wb / rated, effect.details.get("scale_wb", 0.12 * rated) / rated
    return effect.size * (0.6 + 0.4 * (at**2 - 2.0 * scale * at + 2.0 * scale**2))


def _offset(effect: Effect, plant: Plant, sizes: Sizes, peak_a: float) -> Pair:
    return sizes["offset_u_a"][0], effect.size


def _gain(effect: Effect, plant: Plant, sizes: Sizes, peak_a: float) -> Pair:
    v = -0.5 if effect.shape == "one_phase" else -0.7
    return sizes["gain_v_over_u"][0], (1.0 + v * effect.size) / (1.0 + effect.size) - 1.0


def _sensor(effect: Effect, plant: Plant, sizes: Sizes, peak_a: float) -> Pair:
    """Even at the diagnosis' full scale (twice rated peak) from the simulator's; the odd shapes differ in kind."""
    if effect.shape != "even":
        return None
    return sizes["even_at_full_scale"][
        0
    ], effect.size * 2.0 * plant.nameplate.rated_peak_current_a / plant.sensors.full_scale_a


def _sag(effect: Effect, plant: Plant, sizes: Sizes, peak_a: float) -> Pair:
    """All that a recorded link shows reaches the motor. The soft source's size is its slope at no power, beyond which it bends."""
    if "of_the_recorded_swing" in sizes:
        return sizes["of_the_recorded_swing"][0], 1.0
    return (_first(sizes), effect.size) if effect.shape != "soft" else None


def _ripple(effect: Effect, plant: Plant, sizes: Sizes, peak_a: float) -> Pair:
    if effect.shape == "sawtooth":
        return None
    return float(np.hypot(*(sizes.get(f"amplitude_{f}_hz", (0.0,))[0] for f in (300, 360)))), effect.size


def _mains(effect: Effect, plant: Plant, sizes: Sizes, peak_a: float) -> Pair:
    rms_over_phases = float(np.sqrt(np.mean(np.square([1.0, 0.6, 0.8]))))
    return sizes["amplitude_50_hz_a"][0], effect.size * rms_over_phases


def _motion(effect: Effect, plant: Plant, sizes: Sizes, peak_a: float) -> Pair:
    return (_first(sizes), abs(effect.size)) if effect.shape in ("", "creep") else None


def _clock(effect: Effect, plant: Plant, sizes: Sizes, peak_a: float) -> Pair:
    return (abs(_first(sizes)), effect.size) if effect.shape in ("", "constant") else None


def _inductance(effect: Effect, plant: Plant, sizes: Sizes, peak_a: float) -> Pair:
    """The simulator tilts an inductance of its Gamma circuit; of the inverse-Gamma one, with k = L_s / (L_s + L_l),
    L_sigma = k L_l then tilts by k of it, and L_M = k L_s by 2 - k.
    """
    leakage, magnetizing = (sizes[f"{part}_anisotropy"][0] for part in ("leakage", "magnetizing"))
    k = plant.machine.inductance_h / (plant.machine.inductance_h + plant.machine.leakage_inductance_h)
    return (magnetizing, (2.0 - k) * effect.size) if effect.shape == "main" else (leakage, k * effect.size)


def _resistance(effect: Effect, plant: Plant, sizes: Sizes, peak_a: float) -> Pair:
    """Phase resistances that differ by 2 e over direction make a tensor of half that."""
    stator, rotor = (sizes[f"{part}_anisotropy"][0] for part in ("stator", "rotor"))
    return (rotor, effect.size) if effect.shape == "cage" else (0.5 * stator, effect.size)


def _conductance(effect: Effect, plant: Plant, sizes: Sizes, peak_a: float) -> Pair:
    return _first(sizes), 1e3 * effect.size


def _heating(effect: Effect, plant: Plant, sizes: Sizes, peak_a: float) -> Pair:
    return _first(sizes), effect.size


COMPARED: dict[str, Compare] = {
    "dead_time": _leg, "device_drop": _leg, "dc_link_sag": _sag, "dc_link_ripple": _ripple,
    "sampling_delay": _scaled(1e6), "sensor_lag": _scaled(1e6), "magnetizing_saturation": _saturation,
    "magnetic_hysteresis": _hysteresis, "leakage_saturation": _leakage, "iron_loss": _conductance, "rotor_skin_effect": _scaled(1.0),
    "stator_heating": _heating, "sensor_offset": _offset, "sensor_gain_mismatch": _gain, "sensor_nonlinearity": _sensor,
    "mains_pickup": _mains, "clock_drift": _clock, "shaft_motion": _motion, "inductance_anisotropy": _inductance,
    "resistance_anisotropy": _resistance, "cable_capacitance": _scaled(1e9), "quantization": _scaled(1.0),
}  # fmt: skip
