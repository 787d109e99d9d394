"""What speaks for a machine: the sheet's values with rounding and tolerance, and what is assumed where the sheet is silent."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from commissioner.identify.catalogue.machine import Array, performance
from commissioner.identify.catalogue.sheet import Sheet, Value, synchronous_rpm
from commissioner.motor.nameplate import typical_efficiency

LINEAR = frozenset({f"{kind}{load}" for kind in ("power_factor", "efficiency") for load in ("", "_75", "_50")})
"""Compared as they are; all other values by their logarithms."""
IN_MODEL: Mapping[str, float] = {
    "power_factor_75": 0.006, "power_factor_50": 0.012, "efficiency_75": 0.002, "efficiency_50": 0.004,
    "no_load_current": 0.08, "starting_current_ratio": 0.01, "starting_torque_ratio": 0.01, "breakdown_torque_ratio": 0.01,
    "r_s": 0.04,
}  # fmt: skip
"""What a circuit of constant parameters leaves (iron that saturates less under load, a winding of unknown temperature), one
standard deviation."""
LIMITS_ARE = math.sqrt(3.0)
"""Standard deviations: the tolerances of IEC 60034-1 are limits, all between them taken as alike; a limit upwards or downwards alone
as one either way."""
SMALL_W, LARGE_W = 1000.0, 150e3
COPPER_C, COLD_C, WARM_C = 234.5, 20.0, 85.0


@dataclass(frozen=True)
class Scale:
    """The per-unit base: phase voltage and line current of the star equivalent; `shaft`: rated shaft power over base power."""

    voltage_v: float
    current_a: float
    frequency_hz: float
    shaft: float

    @property
    def impedance_ohm(self) -> float:
        return self.voltage_v / self.current_a

    @property
    def power_w(self) -> float:
        return 3.0 * self.voltage_v * self.current_a


@dataclass(frozen=True)
class Datum:
    """One value of the sheet as the fit compares it: `std` of rounding and model; `tolerance`: shift by one standard deviation of
    each tolerance's cause."""

    key: str
    value: float
    rounding: float
    model: float
    tolerance: Mapping[str, float]

    @property
    def std(self) -> float:
        return math.hypot(self.rounding, self.model)


@dataclass(frozen=True)
class Assumption:
    """A number of the circuit as machines of this kind have it: median, and one standard deviation of its logarithm."""

    name: str
    words: str
    median: float
    std: float
    source: str


@dataclass(frozen=True)
class Evidence:
    scale: Scale
    data: tuple[Datum, ...]
    assumptions: tuple[Assumption, ...]

    def predicted(self, numbers: Array) -> Array:
        """(n, data) of n machines."""
        found = {**performance(numbers, self.scale.shaft), "r_s": numbers[:, 0]}
        columns = [found[d.key] if d.key in LINEAR else np.log(found[d.key]) for d in self.data]
        return np.stack(columns, axis=1) if columns else np.empty((len(numbers), 0))

    def assumed(self, numbers: Array) -> Array:
        """(n, assumptions), logarithms, in the order of `assumptions_for`."""
        r_s, x_m, r_0, x_r, x_s, d, t, iron, friction, stray, saturation = numbers.T
        rotor = x_r + r_0 * d * t
        logs: Array = np.log(
            np.stack([r_s, x_m, r_0, x_s + rotor, x_s / rotor, d, t, iron, friction, stray, saturation], axis=1)
        )
        return logs


def evidence_of(sheet: Sheet) -> Evidence | None:
    """None where the sheet does not even fix the scale: voltage, frequency, and power or current."""
    scale = _scale(sheet)
    if scale is None:
        return None
    return Evidence(scale, tuple(_data(sheet, scale)), assumptions_for(sheet, scale))


def _scale(sheet: Sheet) -> Scale | None:
    voltage, frequency = sheet.get("rated_voltage_v"), sheet.get("rated_frequency_hz")
    power, current, factor = sheet.get("rated_power_w"), sheet.get("rated_current_a"), sheet.get("power_factor")
    efficiency = sheet.get("efficiency")
    if voltage is None or frequency is None or (power is None and (current is None or factor is None)):
        return None
    typical = typical_efficiency(power or 0.8 * math.sqrt(3.0) * voltage * (current or 0.0) * (factor or 0.0))
    used = (efficiency or typical, factor or 0.83)
    if current is None:
        current = (power or 0.0) / (math.sqrt(3.0) * voltage * used[0] * used[1])
    elif efficiency is None and factor is not None and power is not None:
        used = (power / (math.sqrt(3.0) * voltage * current * factor), factor)
    phase = voltage / math.sqrt(3.0)
    shaft = (power / (3.0 * phase * current)) if power is not None else used[0] * used[1]
    return Scale(phase, current, frequency, shaft)


def slip_of(sheet: Sheet) -> Value | None:
    """Rated slip from the speed or as printed, whichever has the finer digits. A speed that ends in 0 or 5 is printed to 5 1/min."""
    speed, synchronous, printed = (
        sheet.values.get("rated_speed_rpm"),
        synchronous_rpm(sheet),
        sheet.values.get("rated_slip"),
    )
    if speed is None or synchronous is None:
        return printed
    step = 2.5 if speed.half_step >= 0.5 and round(speed.value) % 5 == 0 else speed.half_step
    follows = Value(1.0 - speed.value / synchronous, step / synchronous)
    return printed if printed is not None and printed.half_step < follows.half_step else follows


def tolerances(sheet: Sheet, power_w: float) -> dict[str, float]:
    """IEC 60034-1, schedule of tolerances, as standard deviations: of slip, starting and breakdown values and loss relative, of the
    power factor as it is."""
    factor = sheet.get("power_factor") or 0.83
    return {
        "slip": (0.3 if power_w < SMALL_W else 0.2) / LIMITS_ARE,
        "loss": (0.15 if power_w <= LARGE_W else 0.1) / LIMITS_ARE,
        "power factor": min(max((1.0 - factor) / 6.0, 0.02), 0.07) / LIMITS_ARE,
        "starting current": 0.2 / LIMITS_ARE, "starting torque": 0.2 / LIMITS_ARE, "breakdown torque": 0.1 / LIMITS_ARE,
        "resistance": 0.03,
    }  # fmt: skip


def _data(sheet: Sheet, scale: Scale) -> list[Datum]:
    limits = tolerances(sheet, scale.shaft * scale.power_w)
    out = [d for key in ("power_factor", "efficiency") for d in _of_loads(sheet, key, limits)]
    if (slip := slip_of(sheet)) is not None:
        out.append(_relative("rated_slip", slip, {"slip": limits["slip"]}))
    efficiency, factor = sheet.get("efficiency") or typical_efficiency(scale.power_w), sheet.get("power_factor") or 0.83
    current = {
        "loss": limits["loss"] * (1.0 - efficiency) / efficiency,
        "power factor": -limits["power factor"] / factor,
    }
    for key, name, shift in (
        ("starting_current_ratio", "starting current", {k: -v for k, v in current.items()}), ("starting_torque_ratio", "starting torque", {}),
        ("breakdown_torque_ratio", "breakdown torque", {}),
    ):  # fmt: skip
        if key in sheet.values:
            out.append(_relative(key, sheet.values[key], {name: limits[name], **shift}))
    if (rated := sheet.values.get("rated_current_a")) is not None:
        out.append(_relative("rated_current", _over(rated, scale.current_a), current))
    if (idle := sheet.values.get("no_load_current_a")) is not None:
        out.append(_relative("no_load_current", _over(idle, scale.current_a), current))
    if (ohm := star_resistance(sheet)) is not None:
        out.append(_relative("r_s", _over(ohm, scale.impedance_ohm), {"resistance": limits["resistance"]}))
    return out


def star_resistance(sheet: Sheet) -> Value | None:
    """R_s of the star equivalent, warm (85 degC), from the printed resistance at its temperature (20 degC unless said)."""
    at = sheet.get("winding_temperature_c")
    warm = (COPPER_C + WARM_C) / (COPPER_C + (COLD_C if at is None else at))
    if (ends := sheet.values.get("winding_resistance_uv_ohm")) is not None:
        return _over(ends, 2.0 / warm)
    if (phase := sheet.values.get("winding_resistance_phase_ohm")) is not None:
        return _over(phase, (3.0 if sheet.connection == "delta" else 1.0) / warm)
    return None


def _over(value: Value, base: float) -> Value:
    return Value(value.value / base, value.half_step / base, value.printed)


def _of_loads(sheet: Sheet, key: str, limits: Mapping[str, float]) -> list[Datum]:
    out = []
    for ending in ("", "_75", "_50"):
        if (printed := sheet.values.get(key + ending)) is not None:
            full = sheet.get(key) or printed.value
            shift = -limits["loss"] * (1.0 - printed.value)
            if key == "power_factor":
                shift = (
                    limits["power factor"]
                    * printed.value
                    * (1.0 - printed.value**2)
                    / max(full * (1.0 - full**2), 0.05)
                )
            name = "loss" if key == "efficiency" else "power factor"
            out.append(
                Datum(
                    key + ending, printed.value, max(printed.std, 2e-4), IN_MODEL.get(key + ending, 0.0), {name: shift}
                )
            )
    return out


def _relative(key: str, value: Value, tolerance: Mapping[str, float]) -> Datum:
    return Datum(key, math.log(value.value), max(value.std / value.value, 5e-4), IN_MODEL.get(key, 0.0), tolerance)


def assumptions_for(sheet: Sheet, scale: Scale) -> tuple[Assumption, ...]:
    """Medians and spreads by the sheet's own size; 39 published machines (tests/data/motors) and the standards named."""
    slip, factor = slip_of(sheet), sheet.get("power_factor") or 0.83
    power_w = scale.shaft * scale.power_w
    efficiency = sheet.get("efficiency") or scale.shaft / factor
    loss = max(scale.shaft * (1.0 / min(efficiency, 0.995) - 1.0), 0.01)
    s = slip.value if slip is not None else 0.55 * loss / scale.shaft
    stray = 0.7 * (0.025 - 0.005 * math.log10(min(max(power_w / 1000.0, 1.0), 1e4))) * (scale.shaft + loss)
    share = 0.67 if sheet.design_class in ("B", "N") else 0.8
    machines = "published machines"
    return (
        Assumption("stator_resistance", "the stator's resistance", 0.38 * loss, 0.6, "its share of the losses"),
        Assumption("magnetizing_reactance", "the magnetizing reactance", 1.2 / math.sqrt(1.0 - min(factor, 0.95) ** 2), 0.5, machines),
        Assumption("rotor_resistance", "the rotor's resistance at running slip", s, 0.5, "its share of the losses"),
        Assumption("leakage", "the leakage reactance", 0.17, 0.4, machines),
        Assumption("leakage_split", "the stator's leakage over the rotor's", share, 0.35, "IEEE 112-2017, 5.9"),
        Assumption("displacement", "how much the rotor's resistance is larger at standstill", 0.8, 1.5, "cage rotors"),
        Assumption("displacement_frequency", "from which slip on it is larger (its inverse)", 3.0, 0.7, "cage rotors"),
        Assumption("iron", "the iron loss", 0.18 * loss, 0.6, "0.18 of all losses"),
        Assumption("friction", "friction and windage", 0.07 * loss, 0.7, "0.07 of all losses"),
        Assumption("stray", "the additional load loss", stray, 0.5, "0.7 of the allowance of IEC 60034-2-1"),
        Assumption("saturation", "the leakage at the starting current over that at the rated one", 0.9, 0.12, "built machines"),
    )  # fmt: skip
