"""Is this the plate's motor, connected as the plate says, and are the currents of the right scale?

Every published machine with a plate that can be true draws, computed from its four parameters at rated slip, close to its
rated current. A motor wired otherwise, another motor, or currents of foreign scale do not: all impedances are then a common
factor off, and the predicted current by its inverse.

The ranges below are those of the 35 usable machines of 0.18 kW ... 1.7 MW in tests/data/motors, widened; `test_plate_match`
derives them again from the table.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import Nameplate, prior
from commissioner.motor.running import equal_leakages, stator_impedance

CURRENT_RATIO = (0.66, 1.66)
"""Computed over rated current: 0.83 ... 1.59 in the table, widened: upwards by 5 % (a cold rotor adds a fifth to what most
have), downwards by a fifth for the iron that is less saturated in the test than at rated voltage."""
MOST_INDUCTIVE = 1.95
"""Unsaturated static stator inductance over the plate's typical one: 0.63 ... 1.33 in the table at rated flux; iron that is
not saturated shows up to 1.4 times as much, and a value from few levels is a tenth off. There is no lower bound: behind an
inverter that loses much a small current shows too little inductance."""
WIRED_OTHERWISE = (2.2, 4.2)
"""All impedances over the plate's (or the inverse): star for delta makes it 3."""


@dataclass(frozen=True)
class PlateMatch:
    """How four measured parameters fit the plate.

    `current_ratio`: current at rated voltage and slip, of the rated; `copper_loss_ratio`: stator copper loss at rated
    current, of all the losses the plate allows; `impedance_ratio`: geometric mean of R_s, R_R, L_sigma, L_M over the plate's
    typical ones.
    """

    current_ratio: float
    copper_loss_ratio: float
    impedance_ratio: float

    @property
    def unseen_gain(self) -> tuple[float, float]:
        """A gain common to all current sensors, shown over true, within these bounds would not have been noticed."""
        return self.current_ratio / CURRENT_RATIO[1], self.current_ratio / CURRENT_RATIO[0]


@dataclass(frozen=True)
class PlateMismatch:
    """What does not fit: value, range, and the remedy."""

    what: str
    value: float
    limit: str
    remedy: str


def plate_match(machine: InverseGamma, plate: Nameplate) -> PlateMatch:
    impedance = stator_impedance(equal_leakages(machine), plate.rated_frequency_rad_per_s, plate.rated_slip)
    current_a = plate.rated_voltage_v / math.sqrt(3.0) / abs(impedance)
    input_w = math.sqrt(3.0) * plate.rated_voltage_v * plate.rated_current_a * plate.power_factor
    copper_w = 3.0 * machine.stator_resistance_ohm * plate.rated_current_a**2
    typical = prior(plate).typical
    ratios = [a / b for a, b in zip(machine.as_tuple(), typical.as_tuple(), strict=True)]
    return PlateMatch(
        current_a / plate.rated_current_a,
        copper_w / max(input_w - plate.rated_power_w, 1e-9),
        math.prod(ratios) ** 0.25,
    )


def mismatch(match: PlateMatch, plate: Nameplate) -> PlateMismatch | None:
    """The gravest contradiction, None where there is none."""
    if not CURRENT_RATIO[0] <= match.current_ratio <= CURRENT_RATIO[1]:
        return _of_scale(
            "the four parameters together give another rated current than the plate", match.current_ratio,
            f"{CURRENT_RATIO[0]:g} ... {CURRENT_RATIO[1]:g} of the rated current", match.impedance_ratio, plate,
        )  # fmt: skip
    if match.copper_loss_ratio > 1.0:
        return PlateMismatch(
            "the stator's copper loss at rated current exceeds all the losses the plate allows",
            match.copper_loss_ratio, "1", "check that --motor is the motor at the drive, and the current sensors' scale",
        )  # fmt: skip
    return None


def inductance_mismatch(inductance_h: float, plate: Nameplate) -> PlateMismatch | None:
    """Of the static stator inductance alone, which a first small current tells."""
    typical = prior(plate).typical
    ratio = inductance_h / (typical.leakage_inductance_h + typical.magnetizing_inductance_h)
    if ratio <= MOST_INDUCTIVE:
        return None
    return _of_scale(
        "the inductance is not that of the plate's motor", ratio, f"at most {MOST_INDUCTIVE:g} of the plate's typical",
        ratio, plate,
    )  # fmt: skip


def _of_scale(what: str, value: float, limit: str, impedances: float, plate: Nameplate) -> PlateMismatch:
    other = {"star": "delta", "delta": "star"}.get(plate.connection, "another connection")
    factor = "three times" if impedances > 1.0 else "a third of"
    is_connection = WIRED_OTHERWISE[0] <= max(impedances, 1.0 / impedances) <= WIRED_OTHERWISE[1]
    if is_connection and (impedances > 1.0) == (plate.connection == "delta"):
        return PlateMismatch(
            f"the motor is wired in {other} where the plate says {plate.connection}: all its impedances are {factor} "
            "the plate's",
            value, limit,
            f"wire the motor in {plate.connection}, or give the plate's {other} values; if the wiring is right, check the "
            "current sensors' scale",
        )  # fmt: skip
    return PlateMismatch(
        f"{what}: all impedances are {impedances:.2g} times what the plate's motor has",
        value, limit, "check that --motor is the motor at the drive, its connection (factor 3), and the current sensors' scale",
    )  # fmt: skip
