"""What a drive means by its motor parameters: circuit, phase or line, henry, ohm at rated frequency, per cent.

The service's own set is the inverse-Gamma circuit, per phase, star equivalent, SI. A drive's value is

    value = represent(quantity of the drive's circuit)

with, from R_s, R_R, L_sigma, L_M and L_s = L_sigma + L_M (G. R. Slemon, IEEE Trans. Ind. Appl. 25(6), 1989):

    inverse-Gamma   R_R, L_sigma, L_M
    Gamma           R_r = (L_s/L_M)^2 R_R     L_l = L_s L_sigma/L_M     main inductance L_s
    T               R_r = (L_s/L_M) R_R       L_ls = L_lr = L_s - L_m   L_m = sqrt(L_M L_s)

The T circuit has one number more than terminals can tell: equal leakages are assumed.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Protocol

from commissioner.errors import CheckFailed, UsageError
from commissioner.motor.circuit import Gamma as GammaCircuit
from commissioner.motor.circuit import InverseGamma, from_t_model
from commissioner.motor.nameplate import Nameplate, believable
from commissioner.registers.codec import Value, crc16_modbus, encode_item
from commissioner.registers.profile import DriveProfile, Item

RESISTANCES = ("stator_resistance", "rotor_resistance")
INDUCTANCES = (
    "leakage_inductance",
    "magnetizing_inductance",
    "stator_leakage_inductance",
    "rotor_leakage_inductance",
    "stator_inductance",
)
QUANTITIES = frozenset((*RESISTANCES, *INDUCTANCES, "rotor_time_constant"))
"""What a parameter item can stand for; its name, where the file gives no `quantity`."""

CIRCUITS = ("inverse_gamma", "gamma", "t")
REPRESENTATIONS = ("per_phase", "line_to_line", "reactance_at_rated_frequency", "percent_of_base_impedance")
CONVENTIONS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {f"{circuit}_{form}": (circuit, form) for circuit in CIRCUITS for form in REPRESENTATIONS}
    | {form: ("inverse_gamma", form) for form in REPRESENTATIONS}
    | {"time_constant": ("inverse_gamma", "per_phase")}
)
"""Name in a drive file -> (circuit, representation). Without a circuit in the name it is the inverse-Gamma one."""

UNITS = frozenset(
    ("V", "A", "W", "ohm", "H", "Wb", "s", "ms", "Hz", "rad/s", "1/min", "1/s", "V/s", "deg", "degC", "%", "Nm", "raw")
)
"""What an item's `unit` may say. `raw`: as the drive counts, where no source tells the unit; it can be compared and restored,
never converted."""


BASE_VALUES = ("rated_voltage_v", "rated_current_a", "rated_frequency_hz")
"""What per cent and reactances are of."""
COARSEST = 0.1
"""Largest part of a value that its register's steps may take from it or add: more, and it is rather the file's scale that is wrong."""


class Rated(Protocol):
    """A motor's rated values, as far as they are known: a nameplate's, or those of a document's example."""

    @property
    def rated_voltage_v(self) -> float | None: ...
    @property
    def rated_current_a(self) -> float | None: ...
    @property
    def rated_frequency_hz(self) -> float | None: ...


@dataclass(frozen=True)
class Ours:
    """A drive's value in the service's own terms: the contract's field, the SI value, how it was converted."""

    field: str
    value: float
    conversion: str
    is_of_a_set: bool = False


@dataclass(frozen=True)
class Written:
    """Values for the drive by item name, in the items' units; `refused` says why an item gets none."""

    values: Mapping[str, float]
    refused: Mapping[str, str]


def as_in_drive(plate: Nameplate, held: Mapping[str, float]) -> Nameplate:
    """The plate with the rated values that the drive itself holds (`held`, by their names): its per cent are of those, and its reactances
    at that frequency, also where they differ from the job's plate as much as a check allows."""
    volts, amperes, hertz = (
        held[name] if math.isfinite(held.get(name, math.nan)) and held[name] > 0.0 else getattr(plate, name)
        for name in BASE_VALUES
    )
    return replace(plate, rated_voltage_v=volts, rated_current_a=amperes, rated_frequency_hz=hertz)


def drive_values(profile: DriveProfile, circuit: InverseGamma, nameplate: Nameplate | None = None) -> Written:
    """The circuit as the drive wants it. Items the file does not know are refused by its own sentence; what stands for no
    quantity of the circuit (the kind of a tuning) stays as it is."""
    order = profile.parameter_names
    refused = {name: profile.unknown[name] for name in QUANTITIES if name in profile.unknown}
    items = [profile.item(name) for name in order]
    meant = [item for item in items if item.convention or (item.quantity or item.name) in QUANTITIES]
    values = {item.name: drive_value(item, circuit, nameplate) for item in meant}
    for item in meant:
        _check_resolution(item, values[item.name])
    return Written(values, refused)


def drive_value(item: Item, circuit: InverseGamma, nameplate: Nameplate | None = None) -> float:
    """One item's value in its unit. Raises UsageError where the nameplate is needed and missing, or nothing fits."""
    quantity = item.quantity or item.name
    model, form = CONVENTIONS.get(item.convention, ("", ""))
    known = _CIRCUITS[model](circuit) if model else {}
    if quantity not in known:
        raise UsageError(
            f"{item.name}: '{item.convention}' says nothing about {quantity}",
            step="convert to the drive's convention",
            value=item.convention,
            limit=", ".join(sorted(known)) or ", ".join(CONVENTIONS),
            remedy="give the item a quantity and a convention that belong together",
        )
    return known[quantity] * representation_factor(quantity, form, nameplate)


def _check_resolution(item: Item, value: float) -> None:
    """CheckFailed where the register's steps are so coarse that another value would stand in the drive."""
    if item.type == "f32" or abs(round(value / item.scale) * item.scale - value) <= COARSEST * abs(value):
        return
    raise CheckFailed(
        f"{item.name} cannot stand in the drive as it is: its register counts in steps of {item.scale:g} {item.unit}",
        step="convert to the drive's convention", value=round(value / item.scale) * item.scale, limit=f"{value:.4g} {item.unit} within {COARSEST:.0%}",
        remedy="check the item's scale in the drive file; where it is right, see the manual for a finer register, or enter the value at the keypad",
    )  # fmt: skip


def per_phase_value(item: Item, value: float, rated: Rated | None) -> float:
    """The value of an item with a convention, per phase and in SI, in the circuit that the drive means. Raises UsageError as
    `representation_factor`."""
    form = CONVENTIONS[item.convention][1]
    return value / representation_factor(item.quantity or item.name, form, rated)


def parameter_limits(profile: DriveProfile, plate: Nameplate) -> dict[str, tuple[float, float]]:
    """Lowest and highest value of each of the drive's parameters over the corners of the plate's box, in the items' units.

    An item without a convention has none: what it stands for is not known.
    """
    box = believable(plate)
    sides = zip(box.lower.as_tuple(), box.upper.as_tuple(), strict=True)
    corners = [InverseGamma(*corner) for corner in itertools.product(*sides)]
    order = profile.parameter_names
    items = [profile.item(name) for name in order]
    values = {i.name: [drive_value(i, corner, plate) for corner in corners] for i in items if i.convention}
    return {name: (min(found), max(found)) for name, found in values.items()}


def unit_of(quantity: str, convention: str) -> str | None:
    """The unit in which an item of this quantity and convention must stand; None where it has no convention."""
    if convention not in CONVENTIONS or quantity not in QUANTITIES:
        return None
    form = CONVENTIONS[convention][1]
    if quantity == "rotor_time_constant":
        return "s"
    if form == "percent_of_base_impedance":
        return "%"
    return "H" if quantity in INDUCTANCES and form != "reactance_at_rated_frequency" else "ohm"


def our_values(profile: DriveProfile, held: Mapping[str, float], nameplate: Nameplate | None) -> dict[str, Ours]:
    """Each held value that can be said in the service's own terms (inverse-Gamma, per phase, SI), by item name.

    Values of a T or Gamma circuit need the whole of it; R_s, the same in every circuit, and T_r stand alone. What has no convention,
    or needs a nameplate where there is none, is left out.
    """
    per_phase: dict[str, dict[str, tuple[str, float]]] = {}
    out: dict[str, Ours] = {}
    for name, value in held.items():
        item = profile.item(name)
        model, form = CONVENTIONS.get(item.convention, ("", ""))
        if not model:
            continue
        quantity = item.quantity or item.name
        try:
            factor = representation_factor(quantity, form, nameplate)
        except UsageError:
            continue
        per_phase.setdefault(model, {})[quantity] = (name, value / factor)
        if quantity in _ALONE or (model == "inverse_gamma" and quantity in _FIELDS):
            words = "as it stands" if factor == 1.0 else f"{form.replace('_', ' ')}: divided by {factor:.6g}"
            out[name] = Ours(_FIELDS[quantity], value / factor, words)
    found = [pair for circuit in per_phase.values() for pair in circuit.items()]
    stator = {quantity: pair for quantity, pair in found if quantity == "stator_resistance"}
    for model in ("t", "gamma"):
        out |= _whole_circuit(model, stator | per_phase.get(model, {}))
    return out


def _whole_circuit(model: str, found: Mapping[str, tuple[str, float]]) -> dict[str, Ours]:
    """The inverse-Gamma values of a complete T or Gamma set; empty where a part is missing."""
    needed = _SETS[model]
    if model == "gamma" and "magnetizing_inductance" in found:
        found = {"stator_inductance": found["magnetizing_inductance"], **found}
    if not all(quantity in found for quantity in needed):
        return {}
    values = [found[quantity][1] for quantity in needed]
    if not all(value > 0 for value in values):
        return {}
    circuit = from_t_model(*values) if model == "t" else GammaCircuit(*values).as_inverse_gamma()
    ours = {
        "rotor_resistance": circuit.rotor_resistance_ohm,
        "magnetizing_inductance": circuit.magnetizing_inductance_h,
    }
    ours |= {
        ("stator_leakage_inductance" if model == "t" else "leakage_inductance"): circuit.leakage_inductance_h,
        "stator_inductance": circuit.magnetizing_inductance_h,
    }
    words = f"{'T' if model == 't' else 'Gamma'} circuit to inverse-Gamma, whole set"
    return {
        found[quantity][0]: Ours(_FIELDS[_LIKE.get(quantity, quantity)], ours[quantity], words, is_of_a_set=True)
        for quantity in needed
        if quantity in ours
    }


def representation_factor(quantity: str, form: str, rated: Rated | None) -> float:
    """What a per-phase SI value is multiplied by: 2 line to line, omega_N, 100/Z_N or 100 omega_N/Z_N.

    omega_N = 2 pi f_N, Z_N = U_N/(sqrt(3) I_N). Raises UsageError naming what of them it needs and is not known.
    """
    if quantity == "rotor_time_constant" or form == "per_phase":
        return 1.0
    if form == "line_to_line":
        return 2.0
    factor = 1.0
    if form == "percent_of_base_impedance":
        voltage_v, current_a = _known(rated, quantity, form, "rated_voltage_v", "rated_current_a")
        factor = 100 / (voltage_v / (math.sqrt(3) * current_a))
    if quantity in INDUCTANCES:
        (frequency_hz,) = _known(rated, quantity, form, "rated_frequency_hz")
        factor *= 2 * math.pi * frequency_hz
    return factor


def base_values(item: Item) -> tuple[str, ...]:
    """The rated values without which an item's convention means nothing."""
    quantity, form = item.quantity or item.name, CONVENTIONS.get(item.convention, ("", ""))[1]
    is_percent, is_inductance = form == "percent_of_base_impedance", quantity in INDUCTANCES
    if quantity == "rotor_time_constant" or not (is_percent or form == "reactance_at_rated_frequency"):
        return ()
    return (*(BASE_VALUES[:2] if is_percent else ()), *(BASE_VALUES[2:] if is_inductance else ()))


def _known(rated: Rated | None, quantity: str, form: str, *names: str) -> list[float]:
    values = [getattr(rated, name, None) for name in names]
    if None in values:
        raise UsageError(
            f"the drive wants {quantity} as {form.replace('_', ' ')}",
            step="convert to the drive's convention",
            value="no nameplate",
            limit=" and ".join(names),
            remedy="name the motor with --motor",
        )
    return [float(value) for value in values if value is not None]


def _inverse_gamma(circuit: InverseGamma) -> dict[str, float]:
    r_s, r_r, l_sigma, l_m = circuit.as_tuple()
    return _named(r_s, r_r, l_m, l_sigma + l_m, circuit) | {"leakage_inductance": l_sigma}


def _gamma(circuit: InverseGamma) -> dict[str, float]:
    r_s, r_r, l_sigma, l_m = circuit.as_tuple()
    l_s = l_sigma + l_m
    ratio = l_s / l_m
    return _named(r_s, ratio**2 * r_r, l_s, l_s, circuit) | {"leakage_inductance": ratio * l_sigma}


def _t(circuit: InverseGamma) -> dict[str, float]:
    r_s, r_r, l_sigma, big_l_m = circuit.as_tuple()
    l_s = l_sigma + big_l_m
    l_m = math.sqrt(big_l_m * l_s)
    leakage = {"stator_leakage_inductance": l_s - l_m, "rotor_leakage_inductance": l_s - l_m}
    return _named(r_s, l_s / big_l_m * r_r, l_m, l_s, circuit) | leakage


def _named(r_s: float, r_r: float, l_m: float, l_s: float, circuit: InverseGamma) -> dict[str, float]:
    return {
        "stator_resistance": r_s,
        "rotor_resistance": r_r,
        "magnetizing_inductance": l_m,
        "stator_inductance": l_s,
        "rotor_time_constant": circuit.rotor_time_constant_s,
    }


_FIELDS: Mapping[str, str] = MappingProxyType(
    {
        "stator_resistance": "stator_resistance_ohm",
        "rotor_resistance": "rotor_resistance_ohm",
        "leakage_inductance": "leakage_inductance_h",
        "magnetizing_inductance": "magnetizing_inductance_h",
        "rotor_time_constant": "rotor_time_constant_s",
    }
)
_ALONE = ("stator_resistance", "rotor_time_constant")
_LIKE: Mapping[str, str] = MappingProxyType(
    {"stator_leakage_inductance": "leakage_inductance", "stator_inductance": "magnetizing_inductance"}
)
_SETS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "t": (
            "stator_resistance", "rotor_resistance", "stator_leakage_inductance", "rotor_leakage_inductance",
            "magnetizing_inductance",
        ),
        "gamma": ("stator_resistance", "rotor_resistance", "leakage_inductance", "stator_inductance"),
    }
)  # fmt: skip


_CIRCUITS: Mapping[str, Callable[[InverseGamma], dict[str, float]]] = MappingProxyType(
    {"inverse_gamma": _inverse_gamma, "gamma": _gamma, "t": _t}
)


def staged_words_crc(values: Mapping[str, Value], profile: DriveProfile) -> int:
    """The check sum that a drive with staging is given over a whole set: `values` by the drive file's names, CRC-16 of
    the staged registers in the file's order."""
    assert profile.parameters is not None
    order = profile.parameters.order
    return crc16_modbus([word for name in order for word in encode_item(profile.item(f"staged_{name}"), values[name])])
