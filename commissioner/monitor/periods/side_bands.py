"""Side bands at twice the slip frequency beside the supply's line: of a rotor with unequal axes, or of a load that swings there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from commissioner.monitor.intake.findings import Finding
from commissioner.monitor.periods.combs import Found
from commissioner.monitor.periods.periods import SIGNIFICANT, PairSpectrum

LEAST_CELLS = 3.0
"""From the fundamental, whose skirt hides what is nearer."""


@dataclass(frozen=True)
class SideBands:
    """Rotor-asymmetry side bands at (1 +- 2 s) f: where, how high against the fundamental, and above the local floor."""

    offset_hz: float
    level_db: float
    above_floor_db: float


def rotor_side_bands(spectrum: PairSpectrum, supply_hz: float, slip: float, current_a: float) -> SideBands | None:
    """The pair at 2 s f in the supply's frame; None where it is closer to the fundamental than `LEAST_CELLS`."""
    offset = 2 * abs(slip) * supply_hz
    if offset < LEAST_CELLS * spectrum.cell_hz:
        return None
    k = round(offset / spectrum.frequency_hz[1])
    above = float(spectrum.at(offset)[0])
    level = np.sqrt(0.5 * above * spectrum.floor_a2[k]) / current_a
    return SideBands(offset, float(20 * np.log10(level + 1e-12)), float(10 * np.log10(above + 1e-12)))


def side_bands(found: Found, supply_hz: float, slip: float, current_a: float) -> SideBands | None:
    """Of what the combs leave; but a pair at 2 s f that was taken for a load's is as well the rotor's."""
    left = found.left_over
    near = any(abs(load.frequency_hz - 2 * abs(slip) * supply_hz) < left.cell_hz for load in found.loads)
    return rotor_side_bands(found.spectrum if near else left, supply_hz, slip, current_a)


def bar_or_load(bands: SideBands | None) -> tuple[Finding, ...]:
    """Where they stand out: from one recording at one load nobody can tell whose they are."""
    limit = float(10 * np.log10(SIGNIFICANT))
    if bands is None or bands.above_floor_db <= limit:
        return ()
    return (
        Finding(
            "side_bands", "note",
            f"the current has side bands at twice the slip frequency ({bands.offset_hz:.3g} Hz, {bands.level_db:.0f} dB of the fundamental): "
            "broken rotor bars make them, and so does a load that swings at that frequency",
            bands.above_floor_db, limit,
            "record at another load: a rotor's side bands follow the slip, a load's stay where they are",
        ),
    )  # fmt: skip
