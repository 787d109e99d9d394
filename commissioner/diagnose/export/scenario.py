"""An extended model as a scenario of the simulated inverter: machine, plate and every cause in that catalogue's units.

Two models of one machine: shapes that the simulator parameterises otherwise (saturation, leakage, bars) are matched at
the operating point the diagnosis states.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from commissioner.diagnose.catalogue import Setting
from commissioner.diagnose.catalogue.effect import listed, spline_value
from commissioner.diagnose.catalogue.heating import warming
from commissioner.diagnose.catalogue.inverter import sagging
from commissioner.diagnose.plant.model import Model

PLATE = (
    "rated_power_w", "rated_voltage_v", "rated_frequency_hz", "rated_current_a", "rated_speed_rpm", "power_factor",
    "pole_pairs",
)  # fmt: skip
FULL_SCALE = 3.0
"""Sensor range of the scenario over the rated peak current; half again what the diagnosis calls full scale."""
ADIABATIC_S = 1e6
"""Time constant of heat that does not leak away."""
ROOT_AT_HALF, SIM_RANGE = 0.577, FULL_SCALE / 2.0

Numbers = Mapping[str, float]
Entry = dict[str, float | str]
Translate = Callable[[Numbers, Numbers, Setting, Model], Entry]


def scenario(model: Model, setting: Setting, causes: Sequence[Any]) -> dict[str, Any]:
    """The document `python -m sim --scenario` reads: an ideal drive but for the causes."""
    plate = {k: setting.facts.metadata[k] for k in PLATE if k in setting.facts.metadata}
    if "pole_pairs" in plate:
        plate["pole_pairs"] = int(plate["pole_pairs"])
    effects = {}
    for cause in causes:
        sizes = {key: value for key, (value, _, _) in cause.sizes.items()}
        translate = TRANSLATED.get(cause.name)
        if translate and (entry := translate(sizes, model.of(cause.name), setting, model)):
            effects[cause.name] = entry
    return {
        "nameplate": plate,
        "machine": {**gamma_machine(model.at_rest(setting.layout)[0]), "saturation_at_rated_flux": 0.0},
        "power_stage": {"dead_time_s": 0.0, "threshold_v": 0.0, "slope_ohm": 0.0, "link_ripple": 0.0},
        "sensors": {
            "noise_a": 0.0,
            "bits": 0,
            "offset_a": [0.0] * 3,
            "gain": [1.0] * 3,
            "delay_s": 0.0,
            "lag_s": 0.0,
            "full_scale_a": FULL_SCALE * setting.facts.rated_current_peak_a,
        },
        "heating": {"stator_per_min": 0.0, "rotor_per_min": 0.0},
        "effects": effects,
    }


def gamma_machine(nominal: Iterable[float]) -> dict[str, float]:
    """Gamma form (R_s, R_r, L_leak, L_s) of the inverse-Gamma set (Slemon 1989): ratio L_s / L_M."""
    r_s, r_r, l_sigma, l_m = nominal
    ratio = (l_m + l_sigma) / l_m
    keys = ("stator_resistance_ohm", "rotor_resistance_ohm", "leakage_inductance_h", "inductance_h")
    return dict(zip(keys, (r_s, r_r * ratio**2, l_sigma * ratio, l_m + l_sigma), strict=True))


def _branches(model: Model, setting: Setting) -> np.ndarray:
    return listed(model.of("rotor_skin_effect"), "branch", setting.layout.branch_time_s.size)


def _size(key: str, factor: float = 1.0) -> Translate:
    return lambda sizes, values, setting, model: {"size": factor * sizes[key]}


def _legs(half_over_knee: float) -> Translate:
    return lambda sizes, values, setting, model: {
        "size": sizes["voltage_v"],
        "knee_a": max(sizes["half_current_a"], 1e-6) / half_over_knee,
    }


def _sag(sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
    """All of the sag through the one lag that comes nearest."""
    size, lag = sagging(setting, values)
    return {"size": size, "time_constant_s": lag}


def _heat(sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
    """All of the heat with the one leak that bends its course as they do together."""
    rise, leak = warming(setting, values)
    return {"size": rise, "time_constant_s": 1.0 / max(leak, 1.0 / ADIABATIC_S)}


def _delay(sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
    """The simulator cannot read ahead: a current that is read late is read at its instant there."""
    return {"size": max(1e-6 * sizes["delay_us"], 0.0)}


def _lag(sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
    """One time constant, or from half of the shape of two equal ones on, those; none that sees a ripple, which the simulator has not."""
    if values.get("rippled"):
        return {}
    shape = "second_order" if values.get("shape", 0.0) > 0.125 else "first_order"
    return {"size": 1e-6 * sizes["time_constant_us"], "shape": shape}


def _hysteresis(sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
    return {"size": sizes["coercive_current_a"], "shape": "plays"}


def _line(prefix: str) -> Translate:
    """Amplitude and refined frequency of a mains-bound line."""

    def translate(sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        name, frequency = next((k, f) for k, f in setting.lines_hz.items() if k.startswith(prefix))
        base = name.rpartition("_")[2]
        return {
            "size": next(v for k, v in sizes.items() if k.startswith(f"amplitude_{base}")),
            "frequency_hz": frequency,
        }

    return translate


def _saturation(sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
    """Power law through the curve at the flux reached and at 0.8 of it."""
    layout, flux = setting.layout, sizes["at_flux_wb"]
    weights = listed(values, "curve", layout.iron_vectors.shape[0])
    high, low = (spline_value(layout.iron_vectors, weights, layout.iron_top_wb, a * flux) for a in (1.0, 0.8))
    order = float(np.clip(np.log(max(high, 1e-12) / max(low, 1e-12)) / np.log(1.25), 1.0, 20.0))
    rated = setting.facts.rated_flux_wb or flux
    inductance = model.nominal[2] + model.nominal[3]
    return {"size": high * inductance * (rated / flux) ** order, "order": order, "shape": "power"}


def _leakage(sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
    """The simulator states the drop at twice the rated current: first order in the square of the current."""
    reach = min(2.0 * setting.facts.rated_current_peak_a / sizes["at_current_a"], 3.0)
    gain = reach**2 * sizes["inductance_drop"] / max(1.0 - sizes["inductance_drop"], 0.1)
    return {"size": gain / (1.0 + gain), "shape": "root"}


def _skin(sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
    """The rise at rated frequency, and the corner that carries most of it."""
    rated = float(setting.facts.metadata.get("rated_frequency_hz", 50.0))
    branches, times = _branches(model, setting), setting.layout.branch_time_s
    corner = 1.0 / (2.0 * np.pi * float(branches @ times) / max(float(branches.sum()), 1e-12))
    return {"size": sizes["resistance_rise_at_rated_frequency"], "corner": corner / rated}


def _phases(symbol: str) -> Translate:
    """Largest of the three phases as the size, each phase's share as its weight."""

    def translate(sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        per_phase = np.array([values.get(p, 0.0) for p in "uvw"])
        per_phase = per_phase - (per_phase.mean() if symbol == "gain" else 0.0)
        largest = float(np.abs(per_phase).max()) or 1.0
        return {"size": largest, **{f"weight_{p}": float(x) / largest for p, x in zip("uvw", per_phase, strict=True)}}

    return translate


def _sensor(sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
    odd, even = sizes["odd_at_full_scale"] * SIM_RANGE**2, sizes["even_at_full_scale"] * SIM_RANGE
    return {"size": odd, "shape": "cubic", "even": even}


def _tilts(values: Numbers, first: str, second: str) -> tuple[complex, complex]:
    """Two second-harmonic tensors as complex numbers."""
    one, other = (complex(values.get(f"{p}_cos", 0.0), values.get(f"{p}_sin", 0.0)) for p in (first, second))
    return one, other


def _larger(one: complex, other: complex, shapes: tuple[str, str]) -> Entry:
    """The larger of two tensors as size and direction."""
    tilt, shape = (other, shapes[1]) if abs(other) > abs(one) else (one, shapes[0])
    return {"size": abs(tilt), "angle_deg": float(np.degrees(np.angle(tilt)) / 2.0) % 180.0, "shape": shape}


def _resistance(sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
    """Phase resistances that differ by 2 e over direction make a tensor of half that."""
    stator, rotor = _tilts(values, "stator", "rotor")
    return _larger(0.5 * stator, rotor, ("phases", "cage"))


def _inductance(sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
    """The Gamma circuit's tensors of 1/L_leak and 1/L_s that tilt 1/L_sigma and 1/L_M as found."""
    leakage, main = _tilts(values, "leakage", "magnetizing")
    ratio = model.nominal[2] / model.nominal[3]
    both = ratio / (1.0 + ratio) * (leakage - main)
    return _larger(leakage + both, main + both, ("leakage", "main"))


def _remanence(sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
    first = setting.record.segments[0].uid
    flux = complex(values.get(f"alpha_{first}", 0.0), values.get(f"beta_{first}", 0.0))
    return {"size": abs(flux), "angle_deg": float(np.degrees(np.angle(flux)))}


def _clock(sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
    wander = values.get("wander_sin", 0.0)
    if abs(wander) > abs(sizes["drift_ppm"]):
        return {"size": -wander, "shape": "wandering"}
    runs_on = abs(values.get("running", 0.0)) > abs(values.get("drift", 0.0))
    return {"size": -sizes["drift_ppm"], "runs_on": float(runs_on)}


TRANSLATED: dict[str, Translate] = {
    "dead_time": _legs(1.0), "device_drop": _legs(ROOT_AT_HALF), "dc_link_sag": _sag,
    "dc_link_ripple": _line("ripple"), "sampling_delay": _delay,
    "sensor_lag": _lag, "magnetizing_saturation": _saturation,
    "magnetic_hysteresis": _hysteresis, "remanence": _remanence, "leakage_saturation": _leakage,
    "rotor_skin_effect": _skin, "iron_loss": _size("conductance_ms", 1e-3),
    "stator_heating": _heat, "rotor_heating": _heat,
    "sensor_offset": _phases("offset"), "sensor_drift": _phases("drift"), "sensor_gain_mismatch": _phases("gain"),
    "sensor_nonlinearity": _sensor, "quantization": _size("step_a"),
    "clipping": lambda sizes, values, setting, model: {
        "size": 0.1, "limit_a": sizes["limit_a"], "shape": "soft" if "slope_lost" in sizes else "hard",
    },
    "lost_samples": _size("samples"), "mains_pickup": _line("mains"), "clock_drift": _clock,
    "shaft_motion": _size("speed_rad_per_s"),
    "inductance_anisotropy": _inductance,
    "resistance_anisotropy": _resistance,
    "cable_capacitance": _size("capacitance_nf", 1e-9),
}  # fmt: skip
