"""What the plate on the motor says, and what follows from it."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TypeAlias

from commissioner.motor.circuit import InverseGamma

Plate: TypeAlias = dict[str, float | int | str]
"""Of a nameplate what is known, by its fields' names."""


@dataclass(frozen=True)
class Nameplate:
    """Rated values. Voltage is line-to-line rms, current is line rms, whatever the connection."""

    rated_power_w: float
    rated_voltage_v: float
    rated_frequency_hz: float
    rated_current_a: float
    rated_speed_rpm: float
    power_factor: float
    pole_pairs: int
    connection: str  # "star" | "delta"; `connection_of` reads what plates and drives write
    inertia_kg_m2: float | None = None

    def known(self) -> Plate:
        """Its values without those that are not known."""
        return {name: value for name, value in vars(self).items() if value is not None}

    @property
    def rated_frequency_rad_per_s(self) -> float:
        return 2.0 * math.pi * self.rated_frequency_hz

    @property
    def rated_slip(self) -> float:
        """1 - n p / (60 f), the fraction of synchronous speed lost at rated load."""
        return 1.0 - self.rated_speed_rpm * self.pole_pairs / (60.0 * self.rated_frequency_hz)

    @property
    def rated_input_w(self) -> float:
        """Electrical, at rated load: sqrt(3) U I cos(phi)."""
        return math.sqrt(3.0) * self.rated_voltage_v * self.rated_current_a * self.power_factor

    @property
    def efficiency(self) -> float:
        """Shaft power over electrical power at rated load."""
        return self.rated_power_w / self.rated_input_w

    @property
    def run_up_s(self) -> float | None:
        """From standstill to rated speed at rated torque, J n^2 / P: what a moment of inertia in a wrong unit makes absurd."""
        speed_rad_per_s = 2.0 * math.pi * self.rated_speed_rpm / 60.0
        return self.inertia_kg_m2 and self.inertia_kg_m2 * speed_rad_per_s**2 / self.rated_power_w

    @property
    def rated_current_peak_a(self) -> float:
        return math.sqrt(2.0) * self.rated_current_a

    @property
    def impedance_base_ohm(self) -> float:
        """U_N / (sqrt(3) I_N): per phase of the star equivalent, for star and delta windings alike."""
        return self.rated_voltage_v / (math.sqrt(3.0) * self.rated_current_a)


RATED_VALUES = (
    "rated_power_w", "rated_voltage_v", "rated_frequency_hz", "rated_current_a", "rated_speed_rpm", "power_factor",
)  # fmt: skip
"""The numbers that every plate states, by their names here and in a recording; pole pairs follow from them."""


CONNECTIONS = {
    "star": ("star", "y", "wye", "stern", "estrella", "stella", "étoile", "etoile", "\N{GREEK CAPITAL LETTER LAMDA}"),
    "delta": ("delta", "d", "triangle", "mesh", "dreieck", "triángulo", "triangulo", "triangolo", "\N{GREEK CAPITAL LETTER DELTA}", "\N{WHITE UP-POINTING TRIANGLE}",
              "\N{BLACK UP-POINTING TRIANGLE}", "\N{INCREMENT}"),
}  # fmt: skip
"""How plates, drives and recordings write the two connections, in any case."""


def connection_of(written: object) -> object:
    """`star` or `delta` for one of their spellings; anything else as it is, for `check` to refuse."""
    word = str(written).strip().casefold()
    known = {spelling.casefold(): name for name, spellings in CONNECTIONS.items() for spelling in spellings}
    return known.get(word, written)


@dataclass(frozen=True)
class RatedFlux:
    """Rated stator-flux linkage per phase of the star equivalent; `peak` = sqrt(2) x `rms` is the space vector's
    length."""

    stator_rms_wb: float
    stator_peak_wb: float


@dataclass(frozen=True)
class ParameterBox:
    """Where the inverse-Gamma parameters of a motor with this plate can lie, and its most typical member."""

    lower: InverseGamma
    typical: InverseGamma
    upper: InverseGamma

    def contains(self, parameters: InverseGamma) -> bool:
        corners = zip(self.lower.as_tuple(), parameters.as_tuple(), self.upper.as_tuple(), strict=True)
        return all(low <= value <= high for low, value, high in corners)


@dataclass(frozen=True)
class PlateProblem:
    """A value no induction motor can carry on its plate: which, and what would be right."""

    key: str
    value: object
    expected: str


def rated_flux(nameplate: Nameplate, stator_resistance_ohm: float) -> RatedFlux:
    """|U - R_s I e^{-j phi}| / omega_N with phase values of the star equivalent (Castaldi & Tilli 2005, eq. (2)).

    `stator_resistance_ohm` is per phase of the star equivalent (half the resistance between two terminals), so the
    connection does not enter: a delta winding seen from its terminals is a star with U_N / sqrt(3) and I_N per phase.
    """
    voltage_v = nameplate.rated_voltage_v / math.sqrt(3.0)
    phase_rad = math.acos(min(1.0, nameplate.power_factor))
    back_emf_v = abs(voltage_v - stator_resistance_ohm * cmath.rect(nameplate.rated_current_a, -phase_rad))
    rms_wb = back_emf_v / nameplate.rated_frequency_rad_per_s
    return RatedFlux(rms_wb, math.sqrt(2.0) * rms_wb)


# Per-unit ranges (base U_N / (sqrt(3) I_N)); they cover with margin the 35 machines of 0.18 kW ... 1.7 MW in
# tests/data/motors: R_R / slip 0.57 ... 1.50, X_M sin(phi) 0.72 ... 1.49, X_sigma 0.068 ... 0.245, R_s / slip 0.29 ...
# 3.2.
_STATOR_OVER_SLIP = (0.15, 1.25, 5.0)
_ROTOR_OVER_SLIP = (0.35, 0.95, 2.2)
_LEAKAGE_PU = (0.03, 0.14, 0.45)
_MAGNETIZING_TIMES_SIN_PHI = (0.45, 1.12, 2.2)


def prior(nameplate: Nameplate) -> ParameterBox:
    """The box of inverse-Gamma parameters that the plate allows.

    Rotor resistance follows the rated slip, magnetizing reactance the reactive current I_N sin(phi), leakage the
    pull-out torque, stator resistance the losses. Ranges: 39 published machines.
    """
    base = nameplate.impedance_base_ohm
    slip = min(max(nameplate.rated_slip, 0.004), 0.15)
    sin_phi = math.sqrt(1.0 - min(nameplate.power_factor, 0.95) ** 2)
    omega = nameplate.rated_frequency_rad_per_s
    return ParameterBox(
        *(
            InverseGamma(
                stator_resistance_ohm=_STATOR_OVER_SLIP[k] * slip * base,
                rotor_resistance_ohm=_ROTOR_OVER_SLIP[k] * slip * base,
                leakage_inductance_h=_LEAKAGE_PU[k] * base / omega,
                magnetizing_inductance_h=_MAGNETIZING_TIMES_SIN_PHI[k] / sin_phi * base / omega,
            )
            for k in range(3)
        )
    )


UNSATURATED = 1.2
"""Of the largest magnetizing inductance of the box, which holds at rated flux: the most that iron shows in a test that keeps below it. The
largest of the table, 1.49, times 1.7 of iron that has not begun to saturate. Honest 7.5 and 18.5 kW motors of such iron, tested at 0.6 of the
flux limit behind a dead time, showed 1.01 and 1.05 of the box's largest and were told apart from their own plate."""


def believable(nameplate: Nameplate) -> ParameterBox:
    """What may be measured of a motor with this plate: `prior`, its iron less saturated than at rated flux."""
    box = prior(nameplate)
    most_h = UNSATURATED * box.upper.magnetizing_inductance_h
    return replace(box, upper=replace(box.upper, magnetizing_inductance_h=most_h))


def check(nameplate: Nameplate) -> tuple[PlateProblem, ...]:
    """What on this plate contradicts physics, most telling first; empty where nothing does."""
    return tuple(_problems(nameplate))


def _problems(plate: Nameplate) -> Iterator[PlateProblem]:
    positive = ("rated_power_w", "rated_voltage_v", "rated_frequency_hz", "rated_current_a", "rated_speed_rpm")
    broken = [key for key in positive if not (math.isfinite(getattr(plate, key)) and getattr(plate, key) > 0)]
    for key in broken:
        yield PlateProblem(key, getattr(plate, key), "a finite number above 0")
    if plate.connection not in ("star", "delta"):
        yield PlateProblem("connection", plate.connection, "star (Y, wye) or delta (D, triangle)")
    if plate.pole_pairs < 1:
        yield PlateProblem("pole_pairs", plate.pole_pairs, "1, 2, 3, ... (half the number of poles)")
        return
    if not 0.2 < plate.power_factor <= 1.0:
        yield PlateProblem("power_factor", plate.power_factor, "cos phi at rated load, 0.2 ... 1")
        return
    if not broken:
        yield from _contradictions(plate)


LARGEST_SLIP, LARGEST_SLIP_OF_MORE_W = 0.25, (300.0, 0.16)
"""Rated slip of any cage motor, and from this power on: 60 Hz beside the speed at 50 Hz makes 0.20 of a four-pole motor."""


LOSS_BY_PAIRS = 0.55
"""Exponent by which losses rise with the pole pairs beyond two: of IE1 motors of 0.12 to 0.55 kW (IEC 60034-30-1) those of eight poles
lose 1.38 to 1.48 times, of six 1.14 to 1.27 times what those of four lose."""


def typical_efficiency(power_w: float, pole_pairs: int = 2) -> float:
    """Of a cage motor of this rated power and these pole pairs: of four poles 0.65 at 0.18 kW, 0.82 at 2.2 kW, 0.95 at 200 kW (IE1 to IE3
    lie within 0.1)."""
    slower = float(max(pole_pairs / 2.0, 1.0) ** LOSS_BY_PAIRS)
    return max(1.0 - 0.22 * slower * float((power_w / 1000.0) ** -0.27), 0.35)


LEAST_OF_TYPICAL = 0.7
"""Of the typical efficiency: sqrt 3, the smallest factor between two readings of one plate, leaves 0.58 of it."""
LEAST_LOSS_OF_TYPICAL, LAST_DIGITS = 0.3, 1.02
"""Of the typical losses: IE5 motors of 0.12 to 200 kW have 0.43 to 0.66 of them, published plates down to 0.27; and what rounded
volts, amperes and power factor may add to the efficiency of a plate."""


def efficiency_range(power_w: float, pole_pairs: int = 2) -> tuple[float, float]:
    """Least and most that the plate of a cage motor of this rated power can say: the most is that of four poles."""
    best = LAST_DIGITS * (1.0 - LEAST_LOSS_OF_TYPICAL * (1.0 - typical_efficiency(power_w)))
    return LEAST_OF_TYPICAL * typical_efficiency(power_w, pole_pairs), min(best, 1.0)


def _pairs(number: int) -> str:
    return f"{number} pole pair{'' if number == 1 else 's'}"


def _contradictions(plate: Nameplate) -> Iterator[PlateProblem]:
    synchronous_rpm = 60.0 * plate.rated_frequency_hz / plate.pole_pairs
    most = LARGEST_SLIP_OF_MORE_W[1] if plate.rated_power_w > LARGEST_SLIP_OF_MORE_W[0] else LARGEST_SLIP
    if not 0.0 < plate.rated_slip < most:
        # the pole pairs of a speed are the most whose synchronous speed still lies above it
        pairs = math.ceil(60.0 * plate.rated_frequency_hz / plate.rated_speed_rpm) - 1
        fits = pairs > 0 and 1.0 - plate.rated_speed_rpm * pairs / (60.0 * plate.rated_frequency_hz) < most
        yield PlateProblem(
            "rated_speed_rpm",
            plate.rated_speed_rpm,
            f"below the synchronous {synchronous_rpm:.0f} 1/min of {_pairs(plate.pole_pairs)} at "
            f"{plate.rated_frequency_hz:g} Hz by at most {most:.0%}: speed, frequency (50 or 60 Hz) and pole pairs of one line"
            + (
                f" ({plate.rated_speed_rpm:g} 1/min at {plate.rated_frequency_hz:g} Hz is of {_pairs(pairs)})"
                if fits
                else ""
            ),
        )
    input_w, efficiency = plate.rated_input_w, plate.efficiency
    least, best = efficiency_range(plate.rated_power_w, plate.pole_pairs)
    if not least < efficiency < best:
        yield PlateProblem(
            "rated_power_w",
            plate.rated_power_w,
            f"{least:.2g} ... {best:.3g} times the electrical input sqrt(3) U I cos(phi) = {input_w:.4g} W of this plate, as "
            f"motors of this power have (it is {efficiency:.3g}){_other_readings(plate)}; of a plate with two "
            "voltages, voltage and current of the same connection; of powers, the one at the shaft" + _as_peak(plate),
        )


BETWEEN_LINES = (math.sqrt(3.0), 2.0)
"""Between two readings of one plate: 230/400 V, star or delta, and 230/460 V, halves of a winding in parallel or in series."""
KW_PER_HP = 0.7457


def _over_typical(plate: Nameplate) -> float:
    """Its efficiency over that of a typical motor."""
    return plate.efficiency / typical_efficiency(plate.rated_power_w, plate.pole_pairs)


def _other_readings(plate: Nameplate) -> str:
    """The two readings that would fit where voltage and current are of different connections; or the power, where hp were taken for kW."""
    off = _over_typical(plate)
    if 1.0 < off < math.sqrt(BETWEEN_LINES[0] / KW_PER_HP):
        return f": {KW_PER_HP * plate.rated_power_w:.4g} W would fit, a number of hp taken for kW"
    up = min((k if off < 1.0 else 1.0 / k for k in BETWEEN_LINES), key=lambda k: abs(math.log(k * off)))
    if not LEAST_OF_TYPICAL < up * off < 1.25:
        return ""
    return (
        f": {plate.rated_voltage_v:.4g} V with {plate.rated_current_a / up:.3g} A would fit, or "
        f"{plate.rated_voltage_v / up:.4g} V with {plate.rated_current_a:.4g} A"
    )


def _as_peak(plate: Nameplate) -> str:
    """The rms value of a current that is its peak where that fits."""
    rms_a, off = plate.rated_current_a / math.sqrt(2.0), _over_typical(plate)
    fits = off < 1.0 and LEAST_OF_TYPICAL < math.sqrt(2.0) * off < 1.0 / LEAST_OF_TYPICAL
    return f"; {rms_a:.3g} A would fit, too, a peak value taken for an rms one" if fits else ""


MOST_LOSSES = 1.65
"""Of the typical losses, what a plate can say without a question: 1.59 at most in tests/data/motors, IE1 motors of 0.12 to 200 kW and two to
eight poles 1.41 (IEC 60034-30-1). A power in kW taken for one in hp makes 1.7 to 5 of IE1 to IE3 motors from 1.5 kW on."""
MOST_SLIP = 0.17
"""Of small motors: 0.17 at most of catalogues' 0.06 kW ones; 60 Hz beside a speed at 50 Hz makes 0.19 and more."""
LEAST_SLIP_OF_LOSSES = 0.06
"""Rated slip, the cage's share of the power that crosses the air gap, over the typical share of all losses: 0.121 at least in tests/data/motors.
A motor whose plate said 1799 of 1800 1/min was tested for 50 s as one of a cage that nothing could tell."""


def plate_doubt(plate: Nameplate) -> str:
    """Of a plate that `check` lets pass, what is unusual about it: value, limit and the readings that would fit; nothing of others."""
    return "; ".join(plate_doubts(plate))


def plate_doubts(plate: Nameplate) -> tuple[str, ...]:
    """The same, a sentence each."""
    return tuple(said for said in (_lossy(plate), _slow(plate), _synchronous(plate)) if said)


def _lossy(plate: Nameplate) -> str:
    typical = typical_efficiency(plate.rated_power_w, plate.pole_pairs)
    least = 1.0 - MOST_LOSSES * (1.0 - typical)
    if plate.efficiency >= least:
        return ""
    return (
        f"the plate means an efficiency of {plate.efficiency:.3g}, where motors of {plate.rated_power_w:.4g} W have {least:.2g} or more: read power, "
        f"voltage, current and power factor again ({plate.rated_power_w / KW_PER_HP:.4g} W would fit, a number of kW taken for hp, or "
        f"{plate.rated_current_a / math.sqrt(2.0):.3g} A, a peak value taken for an rms one)"
    )


def _slow(plate: Nameplate) -> str:
    if plate.rated_slip <= MOST_SLIP:
        return ""
    return (
        f"the plate means a slip of {plate.rated_slip:.2g}, where motors have {MOST_SLIP:g} at most: speed and frequency (50 or 60 Hz) must be of "
        "one line"
    )


def _synchronous(plate: Nameplate) -> str:
    least = LEAST_SLIP_OF_LOSSES * (1.0 - typical_efficiency(plate.rated_power_w, plate.pole_pairs))
    if plate.rated_slip >= least:
        return ""
    return (
        f"the plate means a slip of {plate.rated_slip:.2g}, where motors of {plate.rated_power_w:.4g} W have {least:.2g} or more: the rated speed is that "
        "under load, not the synchronous one or the one at no load"
    )
