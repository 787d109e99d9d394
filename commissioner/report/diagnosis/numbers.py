"""Numbers of a diagnosis as a technician reads them: few digits, no exponents, ± for 19 of 20 cases."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from commissioner.motor.circuit import QUANTILE
from commissioner.motor.quantities import places

PLUS_MINUS = "± holds the true value in 19 of 20 cases."
PLAIN_NUMBERS = frozenset({"exponent", "samples", "without_gap_in_time"})
UNITS = {"us": "µs", "ohm": "Ω", "1/min": "per minute"}


def number(value: float, digits: int = 4) -> str:
    """So many significant digits, no exponent between 1e-4 and 1e6."""
    if value == 0.0 or not 1e-4 <= abs(value) < 1e6:
        return f"{value:.{digits}g}"
    last = digits - 1 - math.floor(math.log10(abs(value)))
    return f"{round(value, last):.{max(last, 0)}f}"


def sure(confidence: float) -> str:
    """Nothing is certain."""
    return "over 99 %" if confidence > 0.99 else f"{100.0 * confidence:.0f} %"


def percent(share: float) -> str:
    """Never 100 % where something is left, never 0 % where something is."""
    if 0.9995 <= share < 1.0:
        return "over 99.9 %"
    if share == 1.0:
        return "100 %"
    return "under 0.1 %" if 0.0 < share < 0.001 else f"{100.0 * share:.1f} %"


def part_word(share: float, largest: float) -> str:
    """`main` is the cause with the largest share; beside it `large` from a fifth, `small` from a hundredth, else `tiny`."""
    if share >= largest:
        return "main"
    return "large" if share >= 0.2 else "small" if share >= 0.01 else "tiny"


def part_of_error(share: float, largest: float) -> str:
    """`main (99.1 %)`: the word, which compares, and the number, on paper as on the screen."""
    return f"{part_word(share, largest)} ({percent(share)})"


def chance(p: float) -> str:
    """`1 in 5000`; a technician reads no exponents."""
    if p < 1e-6:
        return "under 1 in a million"
    return f"1 in {number(1.0 / p, 2)}" if p < 0.2 else f"{100.0 * p:.0f} %"


def with_spread(value: float, std: float | None, unit: str) -> str:
    """`1.694 ± 0.042 µs`: both to two digits of the interval; four digits of the value where that is unknown."""
    tail = f" {UNITS.get(unit, unit)}" if unit else ""
    if not std or not math.isfinite(std):
        return f"{number(value)}{tail}"
    spread = QUANTILE * std
    last = places(spread)
    if max(abs(value), spread) < 1e-4 or abs(value) >= 1e6 or last > 6:
        return f"{value:.3g} ± {spread:.2g}{tail}"
    return f"{round(value, last):.{max(last, 0)}f} ± {round(spread, last):.{max(last, 0)}f}{tail}"


def quantity(entry: Mapping[str, Any], key: str = "") -> str:
    """`1.694 ± 0.042 µs`; shares as `11.60 ± 0.78 %`."""
    value, std, unit = _readable(entry, key)
    return with_spread(value, std, unit)


def short(entry: Mapping[str, Any], key: str = "") -> str:
    """The size alone, two digits: `7.9 V`."""
    value, _, unit = _readable(entry, key)
    return f"{number(abs(value), 2)} {UNITS.get(unit, unit)}".strip()


def _readable(entry: Mapping[str, Any], key: str) -> tuple[float, float, str]:
    """Value, standard error and unit: shares in %, small values in m, µ or n of their unit."""
    value, std, unit = entry["value"], entry["std"] or 0.0, entry["unit"]
    if unit == "1":
        return (value, std, "") if key in PLAIN_NUMBERS else (100.0 * value, 100.0 * std, "%")
    if unit == "1/min":
        return 100.0 * value, 100.0 * std, "% per minute"
    prefix = 0
    while unit in ("A", "V", "Wb", "S", "s", "A/min") and 0.0 < abs(value) < 0.1 and prefix < 3:
        value, std, prefix = 1e3 * value, 1e3 * std, prefix + 1
    return value, std, ("", "m", "µ", "n")[prefix] + unit


def limit_words(document: Mapping[str, Any], name: str) -> str:
    """Smallest size these data would have shown, in the unit that the cause's size has; `-` where there is none."""
    for key, entry in document.get("detection_limits", {}).get(name, {}).items():
        return short({"std": None, **entry}, key)
    return "-"
