"""A printed value: its number, its unit, the step of its last digit. What may be two things is refused with both."""

from __future__ import annotations

import re

from commissioner.errors import DataRefused
from commissioner.identify.catalogue.sheet import KEYS, Value
from commissioner.recordings.units import PER_MINUTE

NUMBER = r"[-+]?(?:\d{1,3}(?:[ \u00a0\u202f]\d{3})+(?!\d)|\d+)(?:[.,]\d+)?(?:[eE][-+]?\d+)?|[-+]?[.,]\d+"
PRINTED = re.compile(rf"\s*(?:ca\.?|~|≈)?\s*({NUMBER})\s*(.*)", re.DOTALL)
UNITS = {
    "w": 1.0, "kw": 1e3, "mw": 1e6, "hp": 745.7, "ps": 735.5, "cv": 735.5, "km": 735.5, "bg": 735.5, "bhp": 745.7, "v": 1.0, "kv": 1e3, "vac": 1.0, "a": 1.0, "ma": 1e-3, "ka": 1e3,
    "hz": 1.0, **dict.fromkeys(PER_MINUTE, 1.0), "nm": 1.0, "knm": 1e3, "kgm": 9.80665, "kpm": 9.80665, "kgfm": 9.80665, "danm": 10.0, "lbft": 1.35582, "lb-ft": 1.35582,
    "ftlb": 1.35582, "ohm": 1.0, "ω": 1.0, "mohm": 1e-3, "mω": 1e-3, "kgm2": 1.0, "kgm²": 1.0, "kgm^2": 1.0, "gm2": 1e-3, "gm²": 1e-3, "kgcm2": 1e-4, "kgcm²": 1e-4, "lbft2": 0.0421401, "lbft²": 0.0421401, "%": 0.01,
    "pu": 1.0, "p.u.": 1.0, "degc": 1.0, "°c": 1.0, "c": 1.0, "degf": 5.0 / 9.0, "°f": 5.0 / 9.0, "f": 5.0 / 9.0, "k": 1.0, "": 1.0, "-": 1.0, "x": 1.0, "xin": 1.0, "xmn": 1.0,
}  # fmt: skip
"""Factors to the unit of the key."""
OFFSETS = dict.fromkeys(("degf", "°f", "f"), -160.0 / 9.0) | {"k": -273.15}
"""Added behind the factor: of degrees Fahrenheit and kelvin."""
MEASURES = {
    "W": {"w", "kw", "mw", "hp", "ps", "cv", "km", "bg", "bhp"}, "V": {"v", "kv", "vac"}, "A": {"a", "ma", "ka"}, "Hz": {"hz"},
    "1/min": PER_MINUTE,
    "N m": {"nm", "knm", "kgm", "kpm", "kgfm", "danm", "lbft", "lb-ft", "ftlb"}, "ohm": {"ohm", "ω", "mohm", "mω"},
    "kg m2": {"kgm2", "kgm²", "kgm^2", "gm2", "gm²", "kgcm2", "kgcm²", "lbft2", "lbft²"}, "degC": {"degc", "°c", "c", "degf", "°f", "f", "k"}, "": {"%", "pu", "p.u.", "x", "xin", "xmn"},
}  # fmt: skip
RANGES = {
    "rated_power_w": (20.0, 20e6), "rated_voltage_v": (24.0, 15e3), "rated_frequency_hz": (5.0, 1000.0), "rated_speed_rpm": (50.0, 60e3),
    "rated_slip": (1e-4, 0.3), "rated_current_a": (0.05, 5e3), "power_factor": (0.2, 0.99), "efficiency": (0.2, 0.995),
    "starting_current_ratio": (0.2, 20.0), "starting_torque_ratio": (0.05, 10.0), "breakdown_torque_ratio": (0.05, 12.0),
    "pull_up_torque_ratio": (0.05, 10.0), "pole_pairs": (1.0, 24.0), "winding_temperature_c": (-40.0, 200.0),
}  # fmt: skip
"""What a cage motor's sheet can say; other values only have to be above zero."""
NOMINAL = frozenset({"rated_power_w", "rated_voltage_v", "rated_frequency_hz", "pole_pairs", "winding_temperature_c"})
"""Said without a rounding."""
PER_CENT_FROM = {"efficiency": 1.5, "power_factor": 1.5, "rated_slip": 0.3, "starting_current_ratio": 20.0, "starting_torque_ratio": 12.0,
                 "breakdown_torque_ratio": 15.0, "pull_up_torque_ratio": 12.0}  # fmt: skip
"""Without a unit a larger number is per cent."""


_FOOTNOTE = re.compile(r"(?<=[\w%])\s+\(?\d\)(?=\s*(?:;|$))")


def split_unit(printed: str) -> tuple[str, str] | None:
    """(number, unit) of a cell, without the mark of a footnote (`91,4 1)`); None where it begins with no number."""
    found = PRINTED.match(_FOOTNOTE.sub("", printed))
    return None if found is None else (found[1].strip(), found[2].strip(" ;,\t\"'"))


def unit_key(unit: str) -> str:
    """A unit without spaces, dots and brackets, in lower case; what counts turns a minute (`r.p.m.`) as it is."""
    if (plain := re.sub(r"[\s\[\]()]", "", unit).lower().rstrip(";,")) in PER_MINUTE:
        return plain
    return re.sub(r"[\s·*\[\]()]|(?<=[gfp])\.(?=m)|(?<=b)[.-](?=ft²|ft2)", "", unit).lower().rstrip(";,")


def value_of(key: str, number: str, unit: str, name: str, source: str) -> Value:
    """The value of `key`. DataRefused: a unit of something else, per cent for per unit, or a value that no motor has."""
    stem = re.sub(r"_(?:75|50)$", "", key)
    said, shown = unit_key(unit), KEYS[key][1]
    if said and said != "-" and said not in MEASURES.get(shown, set()):
        raise refused(
            f"the unit {unit} of {name} is none of {shown or 'a ratio or per cent'}",
            f"{number} {unit}",
            shown or "none or %",
            source,
        )
    text = re.sub(r"\s", "", number).replace(",", ".")
    decimals = len(re.split("[eE]", text)[0].partition(".")[2])
    factor, offset = UNITS[said], OFFSETS.get(said, 0.0)
    value = float(text)
    if not said and value > PER_CENT_FROM.get(stem, float("inf")):
        factor = 0.01
    step = 0.0 if stem in NOMINAL else 0.5 * factor * 10.0**-decimals
    low, high = RANGES.get(stem, (1e-9, 1e9))
    if not low <= factor * value + offset <= high:
        hint = " (per cent and per unit mixed?)" if said == "%" and value <= 1.0 else ""
        raise refused(
            f"{name} is {factor * value + offset:.6g} {shown}{hint}".rstrip(),
            f"{number} {unit}".strip(),
            f"{low:g} ... {high:g} {shown}",
            source,
        )
    return Value(factor * value + offset, step, f"{number} {unit}".strip())


FLYWHEEL = {"kgfm2": "kgm2", "kgfm²": "kgm2", "kpm2": "kgm2", "kpm²": "kgm2"}
"""Units of a flywheel effect by weight, and that by mass whose number is the same: a kilogram weighs one kilogram-force."""


def inertia_of_flywheel(number: str, unit: str, name: str, source: str) -> tuple[Value, str]:
    """(J = GD²/4, remark) of a flywheel effect: weight or mass times the square of twice the radius of gyration."""
    whole = value_of("inertia_kg_m2", number, FLYWHEEL.get(unit_key(unit), unit), name, source)
    found = Value(whole.value / 4.0, whole.half_step / 4.0, whole.printed)
    return (
        found,
        f"{name} {number} {unit}".strip()
        + f": the flywheel effect, four times the inertia, taken as J = {found.value:.6g} kg m2",
    )


def refused(what: str, value: object, limit: str, source: str) -> DataRefused:
    return DataRefused(
        f"{source}: {what}", step="read the sheet", value=value, limit=limit, remedy="correct the value or its unit"
    )
