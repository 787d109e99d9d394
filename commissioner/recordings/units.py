"""Units as people write them behind a name, in a row of their own, or in a channel's properties."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

PREFIX = {"n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "": 1.0, "k": 1e3, "K": 1e3}
BASE = {
    "s": "time", "sec": "time", "secs": "time", "second": "time", "seconds": "time", "sekunde": "time", "sekunden": "time",
    "seconde": "time", "secondes": "time", "segundos": "time", "secondi": "time",
    "a": "current", "amp": "current", "amps": "current", "ampere": "current", "amperes": "current", "ampère": "current",
    "v": "voltage", "volt": "voltage", "volts": "voltage", "w": "power", "watt": "power", "watts": "power",
    "ohm": "resistance", "ohms": "resistance", "ω": "resistance", "hz": "frequency", "hertz": "frequency",
    "nm": "torque", "va": "apparent", "var": "apparent", "arms": "current", "aeff": "current", "vrms": "voltage", "veff": "voltage",
}  # fmt: skip
"""Unit without prefix, in lower case, and what it measures."""
PER_MINUTE = frozenset(
    [
        "rpm",
        "r.p.m.",
        "1/min",
        "/min",
        "min-1",
        "min⁻¹",
        "min^-1",
        "r/min",
        "rev/min",
        "u/min",
        "tr/min",
        "tr/mn",
        "giri/min",
        "obr/min",
        "obr./min",
        "ot/min",
        "d/dak",
        "dev/dak",
        "rot/min",
        "omw/min",
        "varv/min",
        "об/мин",
    ]
)
"""Turns a minute, as sheets write them."""
WHOLE = {
    "rad/s": ("speed", 1.0), "rads": ("speed", 1.0), "1/s": ("frequency", 1.0), "krpm": ("speed", 1e3 * math.pi / 30),
    **dict.fromkeys(PER_MINUTE, ("speed", math.pi / 30)),
    "min": ("time", 60.0), "minutes": ("time", 60.0), "h": ("time", 3600.0), "deg": ("angle", 1.0),
    "°": ("angle", 1.0), "rev": ("angle", 360.0), "turn": ("angle", 360.0), "turns": ("angle", 360.0), "degree": ("angle", 1.0), "degrees": ("angle", 1.0),
    "grad": ("angle", 1.0), "grados": ("angle", 1.0), "gradi": ("angle", 1.0), "degrés": ("angle", 1.0), "rad": ("angle", 180.0 / math.pi),
    "°c": ("temperature", 1.0), "degc": ("temperature", 1.0), "℃": ("temperature", 1.0), "celsius": ("temperature", 1.0), "n·m": ("torque", 1.0), "n m": ("torque", 1.0), "秒": ("time", 1.0), "毫秒": ("time", 1e-3),
    "微秒": ("time", 1e-6), "安": ("current", 1.0), "毫安": ("current", 1e-3), "伏": ("voltage", 1.0),
    "с": ("time", 1.0), "мс": ("time", 1e-3), "мкс": ("time", 1e-6), "а": ("current", 1.0), "ма": ("current", 1e-3),
    "в": ("voltage", 1.0), "кв": ("voltage", 1e3), "ka": ("current", 1e3), "kv": ("voltage", 1e3),
}  # fmt: skip
_OF_SAMPLES = re.compile(
    r"(?<=[av])[\s_(]*(?:pk|peak|inst)\)?$|(?<=[a-z°])\.?[\s_(]*el(?:ec(?:tr(?:ical)?)?)?\.?\)?$", re.IGNORECASE
)
"""What a unit says beside itself that is so of every sample: `A peak`, `deg el.`"""
FAHRENHEIT = frozenset({"°f", "degf", "℉", "fahrenheit", "deg f"})
KELVIN = frozenset({"k", "kelvin"})
PREFIX_WORD = {"milli": 1e-3, "mili": 1e-3, "micro": 1e-6, "mikro": 1e-6, "nano": 1e-9, "kilo": 1e3}
MEASURES = {"_s": "time", "_a": "current", "_v": "voltage", "_w": "power", "_hz": "frequency", "_ohm": "resistance",
            "_deg": "angle", "_nm": "torque"}  # fmt: skip
"""What a column of the contract measures, by the ending of its name."""
DAY_S = 86400
NO_UNIT = frozenset({"", "-", "none", "sequence", "unit", "units"})
"""What stands in a row of units where a column has none."""
FOREIGN = frozenset({"%", "pu", "p.u.", "counts", "count", "lsb", "digits", "raw", "bit", "bits", "db", "div", "dbv"})
"""Units that stand for something only with a factor which the file does not give."""
IN_NAME = re.compile(
    r"[\[(（【{<]\s*([^\])）】}>]*)\s*[\])）】}>]\s*$|(?:^|\s+)(?:in|en)\s+(\S{1,8})\s*$|\s*/\s*(\S{1,6})\s*$"
    r"|(?:(?<!_per)_|[,:]\s+)(ms|us|µs|ns|s|ma|mA|A|mv|mV|V|kv|kV|rpm|rad|с|мс|мкс|А|мА|В|кВ)$"
)
"""A unit at the end of a name: in brackets, after `in`, after a slash, an underscore, a comma or a colon."""

_BRACKETS = re.compile(r"[\[(（【][^\])）】]*[\])）】]\s*$")


@dataclass(frozen=True)
class Unit:
    """What a unit measures, and its factor to SI (of temperatures to degrees Celsius, behind which `offset` is added). `is_ambiguous`:
    mega or milli, which only the writer knows."""

    measures: str
    scale: float
    is_ambiguous: bool = False
    offset: float = 0.0


def unit_in(name: str) -> str:
    """The text of the unit at the end of a name, or nothing; `i(t)` is a function of time."""
    found = IN_NAME.search(name)
    text = next((g for g in found.groups() if g), "") if found else ""
    return "" if text.strip() == "t" else text


def without_brackets(name: str) -> str:
    """A name without what stands in brackets at its end."""
    return _BRACKETS.sub("", name).strip()


def unbracketed(text: str) -> str:
    """A unit's text out of its brackets."""
    return text.strip().strip("[]()（）【】{}<>").strip()


def read_unit(text: str) -> Unit | None:
    """The unit that a text means, in or out of brackets; None where it is none."""
    bare = _OF_SAMPLES.sub("", unbracketed(text))
    whole = WHOLE.get(bare.lower())
    if whole:
        return Unit(*whole)
    if bare.lower() in FAHRENHEIT:
        return Unit("temperature", 5.0 / 9.0, offset=-160.0 / 9.0)
    if bare.lower() in KELVIN:
        return Unit("temperature", 1.0, offset=-273.15)
    if bare.lower() in BASE:
        return Unit(BASE[bare.lower()], 1.0)
    for word, scale in PREFIX_WORD.items():
        if bare.lower().startswith(word) and (measures := BASE.get(bare.lower()[len(word) :].strip())):
            return Unit(measures, scale)
    prefix, base = bare[:1], bare[1:].lower()
    if base not in BASE:
        return None
    if prefix == "M":
        return Unit(BASE[base], 1e-3, is_ambiguous=BASE[base] in {"time", "current", "voltage"})
    return Unit(BASE[base], PREFIX[prefix]) if prefix in PREFIX else _upper(prefix, base)


def _upper(prefix: str, base: str) -> Unit | None:
    """`US`, `NS`: capitals of micro and nano have no other meaning."""
    lower = prefix.lower()
    return Unit(BASE[base], PREFIX[lower]) if lower in {"u", "n"} and len(base) == 1 else None


def measured_by(column: str) -> str | None:
    """What a column of the contract measures; None of one without a unit."""
    if column == "speed_rad_per_s":
        return "speed"
    return next((measures for ending, measures in MEASURES.items() if column.endswith(ending)), None)


def is_temperature(text: str) -> bool:
    """Whether a unit is one of temperature: `T [°C]` is no time."""
    return (unit := read_unit(text)) is not None and unit.measures == "temperature"


def is_peak(text: str) -> bool:
    """Whether a unit says that its values are the peaks of an alternation: `Vpk`, `A peak`."""
    return re.search(r"(?<=[av])[\s_(]*(?:pk|peak)\)?$", unbracketed(text), re.IGNORECASE) is not None


def is_rms(text: str) -> bool:
    """Whether a unit, as people write it, says that its values are root mean squares: `Arms`, `A rms`, `Veff`."""
    return re.search(r"(?<=[av])[\s_(]*(?:rms|eff)\)?$", unbracketed(text), re.IGNORECASE) is not None


def is_unit(text: str) -> bool:
    """Whether a cell of a row of units is one: nothing, a unit, or a unit that says nothing by itself."""
    bare = unbracketed(text).lower()
    return bare in NO_UNIT or read_unit(text) is not None or bare in FOREIGN
