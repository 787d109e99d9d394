"""Is this the plate's motor, connected as the plate says, and are the currents of the right scale?

Every published machine with a plate that can be true draws, computed from its four parameters at rated slip, close to its
rated current. A motor wired otherwise, another motor, or currents of foreign scale do not: all impedances are then a common
factor off, and the predicted current by its inverse.

The ranges below are those of the 35 usable machines of 0.18 kW ... 1.7 MW in tests/data/motors, widened; `test_plate_match`
derives them again from the table.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import Nameplate, prior
from commissioner.motor.running import equal_leakages, from_nameplate, stator_impedance

CURRENT_RATIO = (0.66, 1.66)
"""Computed over rated current: 0.83 ... 1.59 in the table, widened: upwards by 5 % (a cold rotor adds a fifth to what most
have), downwards by a fifth for the iron that is less saturated in the test than at rated voltage."""
SURE, LEAST_SHARE = 2.0, 0.01
"""Standard errors by which R_s, or a first current's inductance, must contradict the plate: beside large sensors a small current tells little;
what of R_s is left at the least."""
MOST_INDUCTIVE = 1.95
"""Unsaturated static stator inductance over the plate's typical one: 0.63 ... 1.33 in the table at rated flux; iron that is
not saturated shows up to 1.4 times as much, and a value from few levels is a tenth off. There is no lower bound: behind an
inverter that loses much a small current shows too little inductance."""
OTHER_CONNECTION = 3.0
"""All impedances over the plate's (or the inverse) of a motor wired in star for delta. It may be that where this factor makes a plate's
motor of it: the table's then draw 0.28 ... 0.53 of the plate's current, or 2.5 ... 4.8 times it."""
MOST_DRAWN = 1.45
"""Current at standstill, under a first test's tones, over that of the plate's typical motor of the same resistance: at most 1.23 in the table,
wired in delta for star 1.37 ... 3.2 times. Only of a motor whose first current showed little inductance, and that is about to pass its current."""
SURELY_OTHERWISE = 2.45
"""From which factor on it is said to be that: below sqrt(6) a current scale of 2 is no less likely. The geometric mean of the impedances and
of the current's inverse is 2.67 ... 3.35 in the table but for five motors, whose plates are a factor of 1.26 ... 1.7 off."""

HALVES = 4.0
"""The same between the halves of a winding in series and in parallel, as of a motor for 230/460 V; nearer than the other connection from the
geometric mean of both on: 3.46."""
COUNT_AND_SCALE = "how many motors are connected (two have half the impedances), and the current sensors' scale"


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
    copper_w = 3.0 * machine.stator_resistance_ohm * plate.rated_current_a**2
    typical = prior(plate).typical
    ratios = [a / b for a, b in zip(machine.as_tuple(), typical.as_tuple(), strict=True)]
    return PlateMatch(
        current_a / plate.rated_current_a,
        copper_w / max(plate.rated_input_w - plate.rated_power_w, 1e-9),
        math.prod(ratios) ** 0.25,
    )


def mismatch(match: PlateMatch, plate: Nameplate) -> PlateMismatch | None:
    """The gravest contradiction, None where there is none."""
    if not CURRENT_RATIO[0] <= match.current_ratio <= CURRENT_RATIO[1]:
        return _of_scale(
            "the four parameters together give another rated current than the plate", match.current_ratio,
            f"{CURRENT_RATIO[0]:g} ... {CURRENT_RATIO[1]:g} of the rated current", match.impedance_ratio, plate,
            _connections_factor(match, plate),
        )  # fmt: skip
    if match.copper_loss_ratio > 1.0:
        return PlateMismatch(
            "the stator's copper loss at rated current exceeds all the losses the plate allows",
            match.copper_loss_ratio, "1",
            "check that --motor is the motor at the drive, the resistance of cable and contacts, which is in R_s, and the current sensors' scale",
        )  # fmt: skip
    return None


def sure_mismatch(machine: InverseGamma, resistance_std_ohm: float, plate: Nameplate) -> PlateMismatch | None:
    """As `mismatch`, where it stands with R_s smaller by SURE of its standard errors, too: a copper loss that is not sure contradicts no
    plate.
    """
    least_ohm = machine.stator_resistance_ohm - SURE * resistance_std_ohm
    least = replace(machine, stator_resistance_ohm=max(least_ohm, LEAST_SHARE * machine.stator_resistance_ohm))
    is_sure = mismatch(plate_match(least, plate), plate) is not None
    return mismatch(plate_match(machine, plate), plate) if is_sure else None


def inductance_mismatch(inductance_h: float, std_h: float, plate: Nameplate) -> PlateMismatch | None:
    """Of the static stator inductance alone, which a first small current tells.

    A star for delta is said where its range holds the value less SURE standard errors: a 22 kW motor's, 4.4 times the plate's, was seen
    as 6.3 +- 1.6 times, beyond the range's end at 5.9, and nothing was said of the wiring.
    """
    typical = prior(plate).typical
    typical_h = typical.leakage_inductance_h + typical.magnetizing_inductance_h
    if inductance_h - SURE * std_h <= MOST_INDUCTIVE * typical_h:
        return None
    ratio, least = inductance_h / typical_h, (inductance_h - SURE * std_h) / typical_h
    is_star = plate.connection == "delta" and least <= OTHER_CONNECTION * MOST_INDUCTIVE
    return _of_scale(
        "the inductance is not that of the plate's motor", ratio, f"at most {MOST_INDUCTIVE:g} of the plate's typical",
        ratio, plate, ratio if is_star else None,
    )  # fmt: skip


def current_mismatch(over_typical: float, plate: Nameplate) -> PlateMismatch | None:
    """Of what a motor draws at standstill under its first tones, over what the plate's typical one would: the only look at one that draws so
    much that its test has to end."""
    if over_typical <= MOST_DRAWN:
        return None
    return _of_scale(
        "the motor draws more than the plate's motor would", over_typical, f"at most {MOST_DRAWN:g} times the plate's typical",
        1.0 / over_typical, plate, over_typical if plate.connection == "star" else None,
    )  # fmt: skip


def _connections_factor(match: PlateMatch, plate: Nameplate) -> float | None:
    """By what the impedances are off, where the other connection would make the plate's motor of it; below 1: in the other way."""
    off = match.impedance_ratio / match.current_ratio
    factor, size = (OTHER_CONNECTION, off) if plate.connection == "delta" else (1.0 / OTHER_CONNECTION, 1.0 / off)
    return math.sqrt(size) if CURRENT_RATIO[0] <= factor * match.current_ratio <= CURRENT_RATIO[1] else None


def _of_scale(
    what: str, value: float, limit: str, impedances: float, plate: Nameplate, wired_otherwise: float | None
) -> PlateMismatch:
    """`wired_otherwise`: the factor that may be the other connection's, None where it cannot be one."""
    if wired_otherwise is None:
        return PlateMismatch(
            what, value, limit,
            f"all impedances are {impedances:.2g} times what the plate's motor has: check that --motor is the motor at the drive, its "
            f"connection (factor 3), of a motor for two voltages as 230/460 V how the halves of its winding are joined (factor 4), {COUNT_AND_SCALE}",
        )  # fmt: skip
    other, factor, halves, said = _OTHERWISE[plate.connection]
    if wired_otherwise >= math.sqrt(OTHER_CONNECTION * HALVES):
        what = (
            f"the motor is wired in {other} where the plate says {plate.connection}, or with the halves of its winding {halves} where "
            f"the plate's voltage is that of halves {said}: all its impedances are {impedances:.2g} times the plate's"
        )
    elif wired_otherwise >= SURELY_OTHERWISE:
        what = f"the motor is wired in {other} where the plate says {plate.connection}: all its impedances are {factor} the plate's"
    else:
        what = f"the motor may be wired in {other} where the plate says {plate.connection}, or its currents are off in scale: {what}"
    return PlateMismatch(
        what, value, limit,
        f"wire the motor in {plate.connection}, or give the plate's {other} values; of a motor for two voltages as 230/460 V see how the halves of "
        f"its winding are joined; if the wiring is right, check {COUNT_AND_SCALE}",
    )  # fmt: skip


_OTHERWISE = {
    "delta": ("star", "three times", "in series", "in parallel"),
    "star": ("delta", "a third of", "in parallel", "in series"),
}
"""By what the plate says: the other connection, its impedances over the plate's, how the halves of a winding are joined that looks like it, and
what the plate says then."""


SCALE = (0.70, 1.58)
"""Geometric mean of current, active and reactive power over the plate's, at one voltage, frequency and slip: 0.83 ... 1.56
in the table at rated slip (1.33 but for two whose stated speed or current is not their circuit's). sqrt 3, the smallest
factor that two readings differ by, is 1.73."""
USUAL = (0.80, 1.25)
"""Of the same mean: 99 % of 1500 honest points of tests/campaigns/intake/plate lie within, and of those off by sqrt 2 a tenth."""
ALIKE = 0.03
"""Relative: of the current's ratio and the mean one, up to which one number says both."""
FACTORS = (
    (math.sqrt(3.0), "star and delta, or line and phase values, mixed up"),
    (2.0, "a probe, a turns or a terminal factor"),
    (3.0, "star and delta mixed up: impedances differ by 3"),
    (10.0, "a probe's or a range's factor 10"),
    (100.0, "a factor 100"),
    (1000.0, "milli taken for whole units"),
)


@dataclass(frozen=True)
class OperatingPoint:
    """A motor at its terminals: phase voltage rms, supply frequency, slip, line current rms, active and reactive power."""

    voltage_v: float
    frequency_hz: float
    slip: float
    current_a: float
    power_w: float
    reactive_var: float


@dataclass(frozen=True)
class Contradiction:
    """Data and plate say different things: both values, by which factor, and what may be behind it.

    `factor`: the data's currents over the plate's. `likely`: the nearest of the usual factors, None where none is near.
    """

    what: str
    from_data: float
    from_plate: float
    unit: str
    factor: float
    likely: float | None
    limit: str
    remedy: str

    @property
    def value(self) -> str:
        return f"{self.from_data:.4g} {self.unit} from the data, {self.from_plate:.4g} {self.unit} from the plate"


def rated_point(machine: InverseGamma, plate: Nameplate) -> OperatingPoint:
    """What a machine would draw at rated voltage, frequency and slip."""
    impedance = stator_impedance(equal_leakages(machine), plate.rated_frequency_rad_per_s, plate.rated_slip)
    return _drawn(impedance, plate.rated_voltage_v / math.sqrt(3.0), plate.rated_frequency_hz, plate.rated_slip)


def plate_point(plate: Nameplate, at: OperatingPoint) -> OperatingPoint:
    """What the plate's motor draws at another point's voltage, frequency and slip: exact at the rated one, else by the
    circuit that the plate implies."""
    impedance = stator_impedance(from_nameplate(plate), 2.0 * math.pi * at.frequency_hz, at.slip)
    return _drawn(impedance, at.voltage_v, at.frequency_hz, at.slip)


def _drawn(impedance: complex, voltage_v: float, frequency_hz: float, slip: float) -> OperatingPoint:
    current = voltage_v / impedance
    apparent = 3.0 * voltage_v * current.conjugate()
    return OperatingPoint(voltage_v, frequency_hz, slip, abs(current), apparent.real, apparent.imag)


def contradiction(seen: OperatingPoint, plate: Nameplate) -> Contradiction | None:
    """Whether the data's currents and powers are the plate's at this point; None where they are."""
    said = plate_point(plate, seen)
    ratios = _ratios(seen, said)
    if ratios is not None:
        factor = _mean(ratios)
        if SCALE[0] <= factor <= SCALE[1]:
            return None
        likely, why = _usual(factor)
        given = f"give {_times(ratios)}{why}"
    elif seen.power_w * said.power_w < 0.0 and abs(seen.power_w - said.power_w) > plate.rated_power_w:
        factor, likely, given = seen.current_a / said.current_a, None, _opposite(seen, said)
    else:
        return None
    return Contradiction(
        f"the data do not belong to this plate: at {seen.voltage_v * math.sqrt(3.0):.4g} V, {seen.frequency_hz:.4g} Hz and a slip "
        f"of {seen.slip:.3g} they {given}",
        seen.current_a, said.current_a, "A", factor, likely, f"{SCALE[0]:g} ... {SCALE[1]:g} times the plate's",
        "check the current sensors' scale (and the voltages'), and that the plate is this motor's, in its connection, with its "
        "frequency and pole pairs; say which is right by --trust plate or --trust data",
    )  # fmt: skip


def _opposite(seen: OperatingPoint, said: OperatingPoint) -> str:
    """Power that flows the other way than this slip lets it: by more than the rated one, which no loss makes up for."""
    way = {True: "takes", False: "gives back"}
    return (
        f"show {seen.power_w:.4g} W, where the plate's machine {way[said.power_w > seen.power_w]} {abs(said.power_w):.4g} W "
        "(a wrong scale makes channels look crossed)"
    )


def doubt(seen: OperatingPoint, plate: Nameplate) -> str:
    """What is said of a factor that honest plates reach seldom and a peak value taken for an rms one always; nothing of others."""
    factor = _factor(seen, plate_point(plate, seen))
    if factor is None or USUAL[0] <= factor <= USUAL[1] or not SCALE[0] <= factor <= SCALE[1]:
        return ""
    return (
        f"the data give {factor:.3g} times the current and power of the plate's motor: few plates are off by so much, a peak value taken "
        "for an rms one is (1.41 or 0.707): check the scale of currents and voltages"
    )


def _factor(seen: OperatingPoint, said: OperatingPoint) -> float | None:
    """Geometric mean of current, active and reactive power over the plate's; None where one of them has another sign."""
    ratios = _ratios(seen, said)
    return None if ratios is None else _mean(ratios)


def _mean(ratios: tuple[float, float, float]) -> float:
    return math.prod(ratios) ** (1.0 / 3.0)


def _ratios(seen: OperatingPoint, said: OperatingPoint) -> tuple[float, float, float] | None:
    """Current, active and reactive power over the plate's."""
    pairs = ((seen.current_a, said.current_a), (seen.power_w, said.power_w), (seen.reactive_var, said.reactive_var))
    if any(not a * b > 0.0 for a, b in pairs):
        return None
    current, active, reactive = (a / b for a, b in pairs)
    return current, active, reactive


def disagreement(seen: OperatingPoint, plate: Nameplate) -> float:
    """Logarithm of the largest over the smallest of the three ratios: 0 where one factor explains them all."""
    ratios = _ratios(seen, plate_point(plate, seen))
    return math.inf if ratios is None else math.log(max(ratios) / min(ratios))


def _times(ratios: tuple[float, float, float]) -> str:
    """One number where current and powers have it in common, else each with its own."""
    factor, (current, active, reactive) = _mean(ratios), ratios
    if abs(math.log(current / factor)) < ALIKE:
        return f"{factor:.3g} times the plate's current and power"
    return (
        f"{current:.3g} times the plate's current, {active:.3g} times its active and {reactive:.3g} times its reactive power, "
        f"{factor:.3g} times in the geometric mean"
    )


def _usual(factor: float) -> tuple[float | None, str]:
    """The usual factor at most exp(0.27) away, and what makes it."""
    size = max(factor, 1.0 / factor)
    near = min(FACTORS, key=lambda f: abs(math.log(size / f[0])))
    if abs(math.log(size / near[0])) > 0.27:
        return None, ""
    return (near[0] if factor > 1.0 else 1.0 / near[0]), f" ({near[1]}?)"
