"""Which channel is which: sequence, spacing, polarity, and which current belongs to which voltage.

Six phasors decide. A motor takes active and reactive power, so its current lags its voltage by 0 to 90 degrees; the
nameplate says by how much at this current. The simplest mistake that explains the phasors is taken, and reported.
At light load a second order, 60 degrees away, makes a motor as well, and a machine that generates looks in another order like a
motor: the slip decides (`pairing_by_slip`), or a start, in which every machine takes power (`pairing_by_start`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from commissioner.monitor.intake.findings import Audited, Finding, Findings, Generator, miswired
from commissioner.motor.channels.levels import LARGEST_CURRENT, LEAST_CURRENT
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import TCircuit, slip_at_current, slip_at_power, stator_impedance

Order = tuple[int, int, int]
Sign = tuple[int, int, int]
Option = tuple[Order, Sign, float]
Wiring = tuple[tuple[int, int], ...]
"""(current channel, polarity) of the phases of the voltage channels u, v, w."""

SPACING_TOLERANCE_DEG = 25.0
"""Besides what the voltage's own unbalance explains: its negative sequence meets the standstill impedance, so 3 % of it make
15 % of the rated current, and half of the current of an idling motor.
"""
LARGEST_SPACING_DEG = 45.0
"""Beyond it two readings of the same three phasors are equally good."""
LAG_TOLERANCE_DEG = 45.0
BELOW_RATED_DEG = 25.0
"""No motor's current lags by much less than at its rated load; the rest is for tolerances, saturation and sensors."""
RIVAL_MARGIN_DEG = 10.0
"""An idling motor's current may seem to lag by more than 90 degrees through sensors with a delay."""
REACTIVE = (0.7, 2.0)
"""Reactive power over that of the plate's machine at the same active power: 0.82 ... 1.75 in 99 % of the points of 35 published
machines at 0.9 ... 1.1 of their voltage, motor or generator up to 1.2 of their load."""
THIRD = 2 * np.pi / 3


@dataclass(frozen=True)
class Pairing:
    """`*_order[k]` is the channel that carries phase k, `*_sign[k]` its polarity.

    `others_deg`: the lags in the other orders that a motor has too, if not at this size of the currents. `generator`: the order in which
    it would generate, where that is no greater mistake than the motor's.
    """

    current_order: Order
    voltage_order: Order
    current_sign: Sign
    voltage_sign: Sign
    runs_backwards: bool
    lag_deg: float
    rivals_deg: tuple[float, ...]
    findings: tuple[Finding, ...]
    channel_map: Mapping[str, str]
    others_deg: tuple[float, ...] = ()
    generator: Generator | None = None
    wired: Wiring = ()

    @property
    def is_refused(self) -> bool:
        return any(finding.stops for finding in self.findings)


@dataclass(frozen=True)
class Triple:
    """Three phasors read as a symmetric system: polarities, sequence (+1, -1), and how far off 120 degrees it is."""

    sign: Sign
    sequence: int
    deviation_deg: float


def pair(
    currents: list[complex],
    voltages: list[complex],
    plate: Nameplate,
    start: TCircuit,
    frequency_hz: float,
    line_to_line: bool,
    lag_deg: float | None = None,
    wired: Wiring | None = None,
) -> Pairing:
    """The order and polarity of all channels, or findings that refuse; with `lag_deg` the order of that lag, with `wired` that one."""
    findings = Findings()
    v, i = read_triple(voltages), read_triple(currents)
    _spacing("voltage", v, SPACING_TOLERANCE_DEG, findings)
    voltage_order, turned = _voltage_order(v.sequence, line_to_line)
    ordered = _ordered(v.sign, voltage_order)
    voltage_sign: Sign = (turned * ordered[0], turned * ordered[1], turned * ordered[2])
    star = _star([voltage_sign[k] * voltages[voltage_order[k]] for k in range(3)], line_to_line)
    reference = positive_sequence(star)
    explained = _explained_deg(currents, star, start, frequency_hz)
    _spacing("current", i, min(SPACING_TOLERANCE_DEG + explained, LARGEST_SPACING_DEG), findings)
    named: Order = (0, 1, 2) if v.sequence > 0 else (0, 2, 1)
    options = _options(currents, i, reference)
    options = [option for option in options if wiring_of(option, named) == wired] or options
    rated_lag = float(np.degrees(np.arccos(plate.power_factor)))
    is_of_plate = LEAST_CURRENT < float(np.mean(np.abs(currents))) / plate.rated_current_peak_a < LARGEST_CURRENT
    expected = _expected_lag_deg(currents, star, start, frequency_hz) if is_of_plate else rated_lag
    tolerance = LAG_TOLERANCE_DEG if is_of_plate else 90.0
    of_plate = [o for o in options if is_of_plate and _is_of_plate(o, currents, star, start, frequency_hz)]
    chosen, generating = _choose(options, of_plate, expected, tolerance, named)
    if lag_deg is not None:
        chosen = min(options, key=lambda option: abs(option[2] - lag_deg))
    elif chosen is None:
        chosen = min(options, key=lambda option: abs(option[2] - expected))
        _refuse(chosen[2], expected, findings)
    current_order, current_sign, lag = chosen
    generator = Generator(generating[2], _mistakes(generating, named) == 0) if generating else None
    least = rated_lag - BELOW_RATED_DEG
    rivals = tuple(
        o[2]
        for o in options
        if least < o[2] < 90.0 + RIVAL_MARGIN_DEG and abs(o[2] - expected) < LAG_TOLERANCE_DEG and o[2] != lag
    )
    if v.sequence < 0:
        findings.add(
            "phase_order",
            "corrected",
            "the voltages follow each other as u-w-v: taken as a motor that turns backwards",
            "u-w-v",
            "u-v-w",
            "exchange two phases of all channels if the motor turns forwards",
        )
    _report_currents(current_order, current_sign, named, findings)
    _report_generator(chosen, generating, lag_deg is not None, findings)
    if v.sign != (1, 1, 1):
        flipped = [name for name, sign in zip("uvw", v.sign, strict=True) if sign < 0]
        findings.add(
            "polarity",
            "corrected",
            "voltage channel " + ", ".join(flipped) + " is inverted",
            "inverted",
            "same polarity",
            "turn the probe round",
        )
    mapping = {
        f"phase {name}": f"current {'-' if current_sign[k] < 0 else ''}{'uvw'[current_order[k]]}, "
        f"voltage {'-' if voltage_sign[k] < 0 else ''}{'uvw'[voltage_order[k]]}"
        for k, name in enumerate("uvw")
    }
    return Pairing(
        current_order, voltage_order, current_sign, voltage_sign, v.sequence < 0, lag, rivals, tuple(findings), mapping,
        tuple(o[2] for o in options if max(least, 0.0) < o[2] < 90.0 and o[2] != lag), generator,
        wiring_of(chosen, named),
    )  # fmt: skip


def is_straight_motor(seen: Pairing | Audited) -> bool:
    """Whether the channels, as they are named, make a motor, and nothing else does."""
    is_alone = seen.generator is None and not seen.rivals_deg and not miswired(seen.findings)
    return is_alone and bool(seen.wired) and 0.0 < seen.lag_deg < 90.0


def _voltage_order(sequence: int, line_to_line: bool) -> tuple[Order, int]:
    """(order, polarity) that makes a positive sequence: phases v and w exchanged, which turns uv into -wu."""
    if sequence > 0:
        return (0, 1, 2), 1
    return ((2, 1, 0), -1) if line_to_line else ((0, 2, 1), 1)


def read_triple(phasors: list[complex]) -> Triple:
    """The polarities and sequence for which the three are closest to 120 degrees apart; as given wins a tie."""
    best = Triple((1, 1, 1), 1, 1e9)
    for flips in ((1, 1, 1), (1, -1, 1), (1, 1, -1), (-1, 1, 1)):
        for sequence in (1, -1):
            turned = [
                sign * phasor * np.exp(1j * sequence * k * THIRD)
                for k, (sign, phasor) in enumerate(zip(flips, phasors, strict=True))
            ]
            unit = [t / max(abs(t), 1e-12) for t in turned]
            middle = np.sum(unit)
            deviation = (
                max(abs(np.degrees(np.angle(u * np.conj(middle)))) for u in unit) if abs(middle) > 0.5 else 180.0
            )
            if deviation < best.deviation_deg - 1e-6:
                best = Triple(flips, sequence, float(deviation))
    return best


def positive_sequence(phasors: list[complex]) -> complex:
    """(1/3)(u + a v + a^2 w)."""
    return complex(sum(p * np.exp(1j * k * THIRD) for k, p in enumerate(phasors)) / 3)


def _ordered(sign: Sign, order: Order) -> Sign:
    return sign[order[0]], sign[order[1]], sign[order[2]]


def _star(voltages: list[complex], line_to_line: bool) -> list[complex]:
    if not line_to_line:
        return voltages
    uv, vw, wu = voltages
    return [(uv - wu) / 3, (vw - uv) / 3, (wu - vw) / 3]


def _explained_deg(currents: list[complex], star: list[complex], start: TCircuit, frequency_hz: float) -> float:
    """By how much the voltages' unbalance moves the currents from 120 degrees: arcsin(|V-| / (Z- |I|)), Z- at slip 2."""
    backward = sum(p * np.exp(-1j * k * THIRD) for k, p in enumerate(star)) / 3
    impedance = abs(stator_impedance(start, 2 * np.pi * frequency_hz, 2.0))
    share = abs(backward) / impedance / max(float(np.mean(np.abs(currents))), 1e-12)
    return float(np.degrees(np.arcsin(min(share, 1.0))))


def _spacing(name: str, triple: Triple, limit_deg: float, findings: Findings) -> None:
    if triple.deviation_deg > limit_deg:
        findings.add(
            "phase_spacing",
            "refused",
            f"the {name} channels are not 120 degrees apart (off by {triple.deviation_deg:.0f} degrees)",
            triple.deviation_deg,
            limit_deg,
            "check that three different phases are measured",
        )


def _options(currents: list[complex], read: Triple, reference: complex) -> list[Option]:
    """(order, sign, lag in degrees) of every assignment that makes a positive sequence."""
    found = []
    for order, turned in product(((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)), (1, -1)):
        even = order in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
        if even != (read.sequence > 0):
            continue
        sign = tuple(turned * s for s in _ordered(read.sign, order))
        sequence = positive_sequence([sign[k] * currents[order[k]] for k in range(3)])
        lag = float(np.degrees(np.angle(reference * np.conj(sequence))))
        found.append((order, (int(sign[0]), int(sign[1]), int(sign[2])), lag))
    return found


def _expected_lag_deg(currents: list[complex], star: list[complex], start: TCircuit, frequency_hz: float) -> float:
    """The lag at which the nameplate's circuit draws a current of this size; 80 degrees below its no-load current."""
    voltage = float(np.mean(np.abs(star)))
    current = float(np.mean(np.abs(currents)))
    supply = 2 * np.pi * frequency_hz
    slip = slip_at_current(start, supply, voltage, current)
    return min(float(np.degrees(np.angle(stator_impedance(start, supply, slip)))), 80.0)


def wiring_of(option: Option, named: Order) -> Wiring:
    """The order as the channels are wired, whichever way the voltages follow each other."""
    return tuple((option[0][k], option[1][k]) for k in named)


def _mistakes(option: Option, named: Order) -> int:
    return sum(option[0][k] != named[k] for k in range(3)) + sum(s < 0 for s in option[1])


def _is_of_plate(
    option: Option, currents: list[complex], star: list[complex], start: TCircuit, frequency_hz: float
) -> bool:
    """Whether the plate's machine takes this reactive power at this active power: a generator takes it as well."""
    voltage, current = (float(np.mean(np.abs(x))) for x in (star, currents))
    power = 1.5 * voltage * current * np.exp(1j * np.radians(option[2]))
    supply = 2 * np.pi * frequency_hz
    slip = slip_at_power(start, supply, voltage, float(power.real))
    expected = 1.5 * voltage**2 * (1 / np.conj(stator_impedance(start, supply, slip))).imag
    return bool(REACTIVE[0] < power.imag / expected < REACTIVE[1])


def _choose(
    options: list[Option], of_plate: list[Option], expected_deg: float, tolerance_deg: float, named: Order
) -> tuple[Option | None, Option | None]:
    """(the simplest plausible assignment, that of a generator which is no greater mistake). A motor goes before a generator where the
    plate allows both, or both are miswired. Currents of foreign size say nothing of the lag, so any is plausible then: it is their scale that is refused.
    So it is where no motor, or only a miswired generator, is of this size and the channels as named make a motor: half of an overload's current is that of an
    idling machine."""
    motors = [o for o in options if 0.0 < o[2] < 90.0 and abs(o[2] - expected_deg) < tolerance_deg]
    motor = min(motors, key=lambda o: (_mistakes(o, named), abs(o[2] - expected_deg)), default=None)
    generator = min((o for o in of_plate if 90.0 <= o[2] < 180.0), key=lambda o: _mistakes(o, named), default=None)
    if motor is None and (generator is None or _mistakes(generator, named) > 0):
        motor = next((o for o in options if 0.0 < o[2] < 90.0 and _mistakes(o, named) == 0), None)
    if generator is None or (motor is not None and _mistakes(motor, named) < _mistakes(generator, named)):
        return motor, None
    is_motor = motor is not None and (any(o in of_plate for o in motors) or _mistakes(generator, named) > 0)
    return (motor if is_motor else generator), generator


def _refuse(lag_deg: float, expected_deg: float, findings: Findings) -> None:
    findings.add(
        "pairing",
        "refused",
        "no order of the current channels makes a motor: the current's lag is "
        f"{lag_deg:.0f} degrees where {expected_deg:.0f} are expected",
        lag_deg,
        "0 ... 90 degrees",
        "check which current belongs to which voltage, and the polarities",
    )


def _report_generator(chosen: Option, generating: Option | None, is_known: bool, findings: Findings) -> None:
    """That the machine generates, or that in another order it would."""
    if chosen == generating:
        what = "the machine generates: active power flows out of it"
    elif generating is not None and not is_known:
        what = f"a machine that generates, its current lagging by {generating[2]:.0f} degrees in another order of the channels, would draw the same"
    else:
        return
    findings.add("generating", "note", what, chosen[2], None, "")


def _report_currents(order: Order, sign: Sign, voltage_order: Order, findings: Findings) -> None:
    """One sentence per kind of mistake."""
    if order != voltage_order or any(s < 0 for s in sign):
        names = ", ".join(
            f"{'uvw'[k]} from {'inverted ' if sign[k] < 0 else ''}current_{'uvw'[order[k]]}_a" for k in range(3)
        )
        crossed = order != voltage_order
        findings.add(
            "crossed_channels" if crossed else "polarity",
            "corrected",
            (
                "the current channels are crossed against the voltages; "
                if crossed
                else "a current channel is inverted; "
            )
            + f"taken: phase {names} (exchanging the voltages instead would explain it as well)",
            names,
            "u, v, w in order",
            "correct the wiring or the column names",
        )
