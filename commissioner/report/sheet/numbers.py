"""Numbers as a sheet shows them: one interval throughout (95 %), as many places as it carries."""

from __future__ import annotations

import math

from commissioner.motor.circuit import QUANTILE
from commissioner.motor.quantities import places


def half_width(std: float | None, factor: float = 1.0) -> float:
    """Half of the 95 % interval, in the unit that `factor` leads to; 0 where no error is known."""
    return QUANTILE * factor * (std or 0.0)


def interval(value: float, half: float) -> tuple[str, str]:
    """Value and half interval as texts: the interval has two digits, the value ends where it ends.

    Without an interval the value has three digits and the second text is empty.
    """
    if not (half > 0.0 and math.isfinite(half)):
        return digits(value, 3), ""
    return fixed(value, places(half)), fixed(half, places(half))


def with_interval(value: float, half: float) -> str:
    """`3.7160 ± 0.0098`."""
    shown, spread = interval(value, half)
    return f"{shown} ± {spread}" if spread else shown


def like(value: float, half: float) -> str:
    """Another value of the same quantity, to the same place as one with this interval."""
    return fixed(value, places(half)) if half > 0.0 else digits(value, 3)


def digits(value: float, count: int) -> str:
    """`count` significant digits without an exponent."""
    if not math.isfinite(value):
        return "not finite"
    if value == 0.0:
        return "0"
    return fixed(value, max(0, count - 1 - math.floor(math.log10(abs(value)))))


def fixed(value: float, decimals: int) -> str:
    """With a true minus sign, and no minus before nothing."""
    text = f"{round(value, decimals):.{max(0, decimals)}f}"
    if not float(text):
        text = text.removeprefix("-")
    return text.replace("-", "−")


def signed(value: float, count: int = 3) -> str:
    """With its sign, also where it is positive."""
    text = digits(value, count)
    return text if value < 0.0 else f"+{text}"


def percent(share: float) -> str:
    """A share of one as per cent."""
    return f"{digits(100.0 * share, 2)} %"


def spelled(number: int, noun: str) -> str:
    """`one test`, `four tests`."""
    words = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")
    return f"{words[number] if number < len(words) else number} {noun}{'' if number == 1 else 's'}"


def held(value: float) -> str:
    """A drive's own number, to the nine digits that tell two neighbouring 32-bit floats apart."""
    return f"{value:.9g}".replace("-", "−")
