"""Sizes that this motor cannot have: another unit, line voltages under the names of phase voltages or the reverse."""

from __future__ import annotations

from dataclasses import dataclass

LEAST_CURRENT, LARGEST_CURRENT = 0.12, 3.0
"""Of the rated current: no motor idles on less, none runs in a steady state on more."""
LARGEST_VOLTS_PER_HERTZ = 1.45
LARGEST_FROM_HALF = 1.37
"""Of the rated volts per hertz; from half the rated frequency on, where no resistance asks for more, less: 50 Hz at the voltage of
60 with a tenth of overvoltage is 1.32, a peak value taken for an rms one 1.41."""
ROOT_THREE = 0.05
"""Of it, by which a voltage that is root three too small may miss it."""


@dataclass(frozen=True)
class Level:
    """What is the wrong size, over the plate's, and what was allowed."""

    code: str
    what: str
    value: float
    limit: float | str
    remedy: str


def current_level(share: float, least: float = LEAST_CURRENT, largest: float = LARGEST_CURRENT) -> Level | None:
    """`share`: the current over the rated one."""
    if least < share < largest:
        return None
    return Level(
        "current_level", f"the currents are {share:.3g} times the rated one", share, f"{least:g} ... {largest:g}",
        "give the currents in ampere (probe factor, mA?), or correct the plate",
    )  # fmt: skip


def voltage_level(share: float, frequency_share: float) -> Level | None:
    """`share`: volts per hertz over the rated ones; `frequency_share`: the frequency over the rated one."""
    if abs(share * 3.0**0.5 - 1.0) < ROOT_THREE:
        return Level(
            "voltage_level",
            "the voltages are root three too small for this motor: phase voltages under the names of line-to-line ones?",
            share, f"0.61 ... {LARGEST_FROM_HALF:g}", "name the columns voltage_u_v, voltage_v_v, voltage_w_v, or correct the plate",
        )  # fmt: skip
    largest = LARGEST_VOLTS_PER_HERTZ if frequency_share < 0.5 else LARGEST_FROM_HALF
    if share > largest:
        return Level(
            "voltage_level",
            "the voltages are too large for this motor: line-to-line under the names of phase voltages, or peak for rms?",
            share, largest, "name the columns voltage_uv_v, voltage_vw_v, voltage_wu_v, or correct the plate",
        )  # fmt: skip
    return None
