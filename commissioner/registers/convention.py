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

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from commissioner.errors import UsageError
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import Nameplate
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


@dataclass(frozen=True)
class Written:
    """Values for the drive by item name, in the items' units; `refused` says why an item gets none."""

    values: Mapping[str, float]
    refused: Mapping[str, str]


def drive_values(profile: DriveProfile, circuit: InverseGamma, nameplate: Nameplate | None = None) -> Written:
    """The circuit as the drive wants it. Items the file does not know are refused by its own sentence."""
    order = profile.parameters.order if profile.parameters else ()
    refused = {name: profile.unknown[name] for name in QUANTITIES if name in profile.unknown}
    values = {name: drive_value(profile.item(name), circuit, nameplate) for name in order}
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
    factor = 1.0 if quantity == "rotor_time_constant" else representation_factor(quantity, form, nameplate)
    return known[quantity] * factor


def is_our_own(item: Item) -> bool:
    """Whether the item holds the quantity as the service itself states it: R_s of any circuit, inverse-Gamma else."""
    model, form = CONVENTIONS.get(item.convention, ("", ""))
    return form == "per_phase" and (model == "inverse_gamma" or (item.quantity or item.name) == "stator_resistance")


def representation_factor(quantity: str, form: str, nameplate: Nameplate | None) -> float:
    """What a per-phase SI value is multiplied by: 2 line to line, omega_N, 100/Z_N or 100 omega_N/Z_N.

    omega_N = 2 pi f_N, Z_N = U_N/(sqrt(3) I_N). Raises UsageError where it needs a nameplate and there is none.
    """
    if form in ("per_phase", "line_to_line"):
        return 2.0 if form == "line_to_line" else 1.0
    if nameplate is None:
        raise UsageError(
            f"the drive wants {quantity} as {form.replace('_', ' ')}",
            step="convert to the drive's convention",
            value="no nameplate",
            limit="rated voltage, current and frequency",
            remedy="name the motor with --motor",
        )
    omega = 2 * math.pi * nameplate.rated_frequency_hz if quantity in INDUCTANCES else 1.0
    impedance_ohm = nameplate.rated_voltage_v / (math.sqrt(3) * nameplate.rated_current_a)
    return omega * (100 / impedance_ohm if form == "percent_of_base_impedance" else 1.0)


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


_CIRCUITS: Mapping[str, Callable[[InverseGamma], dict[str, float]]] = MappingProxyType(
    {"inverse_gamma": _inverse_gamma, "gamma": _gamma, "t": _t}
)


def staged_words_crc(values: Mapping[str, Value], profile: DriveProfile) -> int:
    """The check sum that a drive with staging is given over a whole set: `values` by the drive file's names, CRC-16 of
    the staged registers in the file's order."""
    assert profile.parameters is not None
    order = profile.parameters.order
    return crc16_modbus([word for name in order for word in encode_item(profile.item(f"staged_{name}"), values[name])])
