"""The circuit at the flux that a recording has: that of little flux follows from the law that was fitted, and nothing shows it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from commissioner.estimation.hidden import at_small_slip
from commissioner.estimation.record import Record
from commissioner.motor.channels.clock import turn_a_row

TAIL_S = 0.1
SIDES = ("stator", "gap", "rotor")
OF_IRON = ("rotor_resistance_ohm", "leakage_inductance_h", "magnetizing_inductance_h", "rotor_time_constant_s")
"""What holds at a flux: as that one linear machine has them, together."""


def _law(side: str, values: Mapping[str, float]) -> list[float]:
    return [values[f"{side}_saturation_{n}"] for n in (1, 2, 3)]


def is_saturated(values: Mapping[str, float]) -> bool:
    """Whether a law of the main flux was fitted: else L_M is one value for all flux."""
    return any(any(_law(side, values)) for side in SIDES)


def _ends_with(record: Record) -> tuple[complex, complex, float]:
    """Peak voltage and current of the last `TAIL_S` as they turn with the supply, and its frequency, rad/s."""
    w = record.windows[-1]
    many = min(max(round(TAIL_S / record.period_s), 10), w.count)
    u, i = (x[-many:, 0] + 1j * x[-many:, 1] for x in (w.voltage[::2], w.current))
    turn = turn_a_row(u)
    window = np.hanning(many) * np.exp(-1j * turn * np.arange(many))
    return (
        complex(u @ window / np.hanning(many).sum()),
        complex(i @ window / np.hanning(many).sum()),
        turn / record.period_s,
    )


def stator_flux_wb(record: Record, values: Mapping[str, float]) -> complex:
    """Peak, at the end of the recording: what R_s leaves of the voltage over the frequency."""
    u, i, w = _ends_with(record)
    return (u - values["stator_resistance"] * i) / (1j * w)


def at_flux(record: Record, values: Mapping[str, float]) -> dict[str, float]:
    """R_R, L_sigma, L_M and T_R of the machine that is linear with the currents of this flux: one set, of which any four tell the fifth.

    The saturated current is that of an inductance L_M / s across the flux psi_s - k L_sigma i (k: 0 stator, 1 rotor, between them the air gap).
    Seen from the stator that is an inverse-Gamma machine again, with g = 1 / (1 + (1 - k) s L_sigma / L_M): L_M g^2 / (1 + g s),
    R_R g^2, L_sigma (k + (1 - k) g). R_s is no part of the iron.
    """
    _, current, _ = _ends_with(record)
    stator = stator_flux_wb(record, values)
    four = at_small_slip(values)
    leakage, main = four.leakage_inductance_h, four.magnetizing_inductance_h
    split = values["leakage_split"] / (1.0 + values["leakage_split"])
    rated = record.scales.voltage_v / record.scales.frequency_rad_per_s
    share, added = 0.0, 0.0
    for side, k in zip(SIDES, (0.0, split, 1.0), strict=True):
        if any(law := _law(side, values)):
            z = float(abs(stator - k * leakage * current) / rated) ** 2
            share, added = k, z * (law[0] + z * (law[1] + z * law[2]))
    g = 1.0 / (1.0 + (1.0 - share) * added * leakage / main)
    return {
        "rotor_resistance_ohm": four.rotor_resistance_ohm * g * g,
        "leakage_inductance_h": leakage * (share + (1.0 - share) * g),
        "magnetizing_inductance_h": main * g * g / (1.0 + g * added),
        "rotor_time_constant_s": four.rotor_time_constant_s / (1.0 + g * added),
    }
