"""Is the result good enough to be written into the drive? The verdict carries the numbers that led to it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from commissioner.identify.analysis import Identification, axis_at
from commissioner.identify.estimate.held_back import HeldBack
from commissioner.identify.estimate.turning import turning_doubt
from commissioner.identify.intake.dc_link import LinkCourse
from commissioner.motor.circuit import PARAMETERS, InverseGamma, Quantity
from commissioner.motor.nameplate import Nameplate, ParameterBox, believable
from commissioner.motor.plate_match import PlateMatch, plate_match, sure_mismatch
from commissioner.motor.quantities import in_shown_unit
from commissioner.procedure.plan import Acceptance
from commissioner.records import Signal


class Decision(Enum):
    """The value is what the technician reads."""

    WRITE_BACK = "write back"
    KEEP = "keep"
    REJECT = "reject"


@dataclass(frozen=True)
class Objection:
    """One reason why the result is not good enough."""

    what: str
    value: object
    limit: object
    remedy: str


@dataclass(frozen=True)
class Verdict:
    decision: Decision
    objections: tuple[Objection, ...]

    @property
    def reason(self) -> str:
        """One sentence."""
        if self.objections:
            return self.objections[0].what
        return "every parameter is within its acceptance" + (
            "" if self.decision is Decision.WRITE_BACK else "; writing was not asked for"
        )


_LIMIT = {
    "stator_resistance_ohm": "resistance_std_percent",
    "rotor_resistance_ohm": "rotor_resistance_std_percent",
    "leakage_inductance_h": "leakage_std_percent",
    "magnetizing_inductance_h": "magnetizing_std_percent",
}
FOLLOWS = 0.5
"""Of what the DC link moved by: what two tests must have seen of it, and what their values do not follow it by on a drive that
corrects its voltage. One that does not makes them follow by all of it."""

NO_MOTOR_BELOW, NO_MOTOR_ABOVE = InverseGamma(1e-4, 1e-4, 1e-6, 1e-4), InverseGamma(500.0, 500.0, 1.0, 10.0)
"""What motors from 50 W to some megawatts have: a drive that holds another motor's values holds values between these. Without the question
0.0215 was written as millihenry where a file had forgotten the scale of 1e-3, read back as written, and called good."""

Values = Mapping[str, Quantity]


@dataclass(frozen=True)
class Evidence:
    """What the verdict is reached from: combined values, each test's values, each test's batch fit beside them, and each
    test's values at the flux all of them reached. `unlike`: why the axes differ more than by chance, in words, and by how much, relative; `lost_samples` of all tests;
    `guard_acted`: the flux guard took the amplitude back; `beyond_time`: names that a longer test would not make surer; `turned`: tests
    in which the shaft turned, by what speed (electrical, rad/s), and what that makes doubtful of every value, relative; `link`: what the DC link did, None where nobody saw it."""

    combined: Values
    axes: tuple[tuple[float, Values], ...]
    batch: tuple[tuple[float, Values], ...] = ()
    at_one_flux: tuple[tuple[float, Values], ...] = ()
    unlike: tuple[tuple[str, float], ...] = ()
    lost_samples: int = 0
    guard_acted: bool = False
    beyond_time: frozenset[str] = frozenset()
    turned: tuple[tuple[float, float, float], ...] = ()
    link: LinkCourse | None = None
    held_back: tuple[tuple[float, HeldBack], ...] = ()
    """Axis and what the drive held back on it without saying so."""
    held: Mapping[str, float] = field(default_factory=dict)
    """What the drive held in use before, by parameter, as its file reads it; SI."""


def evidence_of(identification: Identification) -> Evidence:
    """The values of an identification that the verdict is reached from, each with its standard deviation."""
    axes = identification.axes
    std = [np.sqrt(np.diag(axis.covariance)) for axis in axes]
    batch = [axis.batch.inverse_gamma_at(axis.peak_stator_flux_wb)[0] for axis in axes]
    alike = [axis_at(axis, identification.holds_for_flux_wb) for axis in axes]
    return Evidence(
        combined=_values(identification.parameters, np.sqrt(np.diag(identification.covariance))),
        axes=tuple((axis.axis_deg, _values(axis.parameters, s)) for axis, s in zip(axes, std, strict=True)),
        batch=tuple((axis.axis_deg, _values(b, s)) for axis, b, s in zip(axes, batch, std, strict=True)),
        at_one_flux=tuple((e.axis_deg, _values(e.parameters, s)) for e, s in zip(alike, std, strict=True)),
        unlike=tuple((f.cause.value, f.relative_size) for f in identification.combined.findings),
        lost_samples=identification.lost_samples,
        turned=tuple(
            (a.axis_deg, a.turning_rad_per_s, turning_doubt(a.turning_rad_per_s, a.parameters))
            for a in axes
            if a.turning_rad_per_s
        ),
        link=identification.link,
        held_back=tuple((a.axis_deg, a.held_back) for a in axes if a.held_back is not None),
    )


def _values(parameters: InverseGamma, std: Signal) -> Values:
    return {name: Quantity(v, float(s)) for name, v, s in zip(PARAMETERS, parameters.as_tuple(), std, strict=True)}


def decide(evidence: Evidence, plate: Nameplate, acceptance: Acceptance, *, write_back: bool) -> Verdict:
    """WRITE_BACK or KEEP where nothing objects, else REJECT with every objection, gravest first."""
    objections = (
        *_held_back(evidence),
        *_another_motor(evidence.combined, plate),
        *_outside(evidence.combined, believable(plate)),
        *_turned(evidence, acceptance),
        *_link_moved(evidence, acceptance),
        *_disagreements(evidence, acceptance),
        *_uncertain(evidence, acceptance),
        *_spread(evidence, acceptance),
        *(_scaled(evidence) if write_back else ()),
        *(_unusual(evidence, acceptance) if acceptance.strict else ()),
    )
    if objections:
        return Verdict(Decision.REJECT, objections)
    return Verdict(Decision.WRITE_BACK if write_back else Decision.KEEP, ())


def drive_name(parameter: str) -> str:
    """Of a drive's item that is called as our parameter is: without its unit."""
    return parameter.removesuffix("_ohm").removesuffix("_h")


def match_of(combined: Values, plate: Nameplate) -> PlateMatch:
    """How the combined values fit the plate."""
    return plate_match(InverseGamma(*(combined[name].value for name in PARAMETERS)), plate)


def _held_back(evidence: Evidence) -> Iterator[Objection]:
    """Values of peaks that never came: how wrong they are no interval tells, for the fit took a part of what is missing for resistance."""
    for axis_deg, held in evidence.held_back:
        yield Objection(
            f"the drive limits its {held.what} at axis {axis_deg:g} deg and does not say so, or a current sensor ends there: {held.sentence}",
            f"{held.missing_v:.2g} V",
            "none missing beyond what noise explains",
            f"raise the drive's own {held.what} limit, or lower limits.current_fraction, so that the test stays below it; else look for a "
            "current sensor at the end of its range",
        )


def _another_motor(combined: Values, plate: Nameplate) -> Iterator[Objection]:
    """Values that no common error explains away: the plate is another motor's, or the currents are of foreign scale."""
    if any(combined[name].value <= 0.0 for name in PARAMETERS):
        return
    machine = InverseGamma(*(combined[name].value for name in PARAMETERS))
    found = sure_mismatch(machine, combined[PARAMETERS[0]].std, plate)
    if found is not None:
        yield Objection(found.what, found.value, found.limit, found.remedy)


def _outside(combined: Mapping[str, Quantity], box: ParameterBox) -> Iterator[Objection]:
    for name in PARAMETERS:
        low, high, value = getattr(box.lower, name), getattr(box.upper, name), combined[name].value
        if not low <= value <= high:
            yield Objection(
                f"{name} is not physical for this nameplate",
                in_shown_unit(name, value),
                in_shown_unit(name, low, high),
                "check the motor's connection and that --motor is the motor at the drive",
            )


def _turned(evidence: Evidence, acceptance: Acceptance) -> Iterator[Objection]:
    for axis_deg, speed, doubt in evidence.turned:
        if 100 * doubt > acceptance.resistance_std_percent:
            yield Objection(
                f"the shaft turned during the test of axis {axis_deg:g} deg",
                f"{speed:.2g} rad/s, electrical, which makes every value uncertain by {100 * doubt:.2g} %",
                f"{acceptance.resistance_std_percent:g} %",
                "hold the shaft still: close the brake or take the load off, and test again",
            )


def _link_moved(evidence: Evidence, acceptance: Acceptance) -> Iterator[Objection]:
    link = evidence.link
    if link is None or 100 * link.doubt <= acceptance.resistance_std_percent or _is_corrected(link, evidence):
        return
    yield Objection(
        "the DC link moved between the tests",
        f"{link.lowest_v:.4g} ... {link.highest_v:.4g} V, which makes every value uncertain by {100 * link.doubt:.2g} %",
        f"{acceptance.resistance_std_percent:g} %",
        "test again on a steady supply, with nothing heavy switched on it meanwhile, or have the drive correct its voltage for the link",
    )


def _is_corrected(link: LinkCourse, evidence: Evidence) -> bool:
    """Whether the drive corrects its voltage for the link: two tests saw most of what it moved by, and their values did not follow."""
    tests = [values for _, values in evidence.at_one_flux or evidence.axes]
    seen = sorted((volts, k) for k, volts in enumerate(link.tests_v) if volts > 0.0)  # NaN is none
    if len(seen) < 2 or len(tests) != len(link.tests_v):
        return False
    (low_v, low), (high_v, high) = seen[0], seen[-1]
    moved = math.log(high_v / low_v)
    if moved < FOLLOWS * math.log(link.highest_v / link.lowest_v):
        return False
    follows = [math.log(tests[low][name].value / tests[high][name].value) for name in PARAMETERS]
    return float(np.median(follows)) < FOLLOWS * moved


def _disagreements(evidence: Evidence, acceptance: Acceptance) -> Iterator[Objection]:
    """Observer and batch fit apart by more than three standard errors and more than the parameter may be uncertain."""
    for (axis_deg, online), (_, batch) in zip(evidence.axes, evidence.batch, strict=False):
        for name in PARAMETERS:
            apart, limit = abs(online[name].value - batch[name].value), getattr(acceptance, _LIMIT[name])
            percent = 100 * apart / abs(batch[name].value)
            if apart > 3 * batch[name].std and percent > limit:
                yield Objection(
                    f"observer and batch fit disagree on {name} at axis {axis_deg:g} deg",
                    f"{percent:.2g} %",
                    f"{limit:g} %",
                    "the model misses something there: see the residual in the report, and `commissioner diagnose`",
                )


def _uncertain(evidence: Evidence, acceptance: Acceptance) -> Iterator[Objection]:
    for name in PARAMETERS:
        quantity, limit = evidence.combined[name], getattr(acceptance, _LIMIT[name])
        percent = 100 * quantity.std / abs(quantity.value) if quantity.value else float("inf")
        if not percent <= limit:
            yield Objection(
                f"{name} is too uncertain",
                f"{percent:.2g} % standard error",
                f"{limit:g} %",
                _surer(name, time_helps=name not in evidence.beyond_time),
            )


def _surer(name: str, *, time_helps: bool) -> str:
    """What would make it surer. No time tells R_s from an inverter whose loss is much larger than R_s I."""
    remedy = (
        "lengthen excitation.seconds, or look for noise on the current sensors"
        if time_helps
        else "a longer test would not narrow it: compare the current sensors' gains and the three phases' resistances"
    )
    if name != "stator_resistance_ohm":
        return remedy
    return f"{remedy}; behind a large dead time lower the switching frequency for the test, or raise limits.current_fraction"


def _spread(evidence: Evidence, acceptance: Acceptance) -> Iterator[Objection]:
    for name in PARAMETERS:
        values = [axis[name].value for _, axis in evidence.at_one_flux or evidence.axes]
        if len(values) < 2:
            continue
        spread = 100 * (max(values) - min(values)) / abs(evidence.combined[name].value)
        if spread > acceptance.axis_spread_percent:
            yield Objection(
                f"{name} differs between the axes",
                f"{spread:.2g} %",
                f"{acceptance.axis_spread_percent:g} %",
                "compare the current sensors' gains and the three phases' resistances",
            )


def _scaled(evidence: Evidence) -> Iterator[Objection]:
    """A value in the drive that no motor has: what is written by the same scale would be as wrong, and would read back as right."""
    for name in PARAMETERS:
        held, measured = evidence.held.get(name, 0.0), evidence.combined[name].value
        low, high = getattr(NO_MOTOR_BELOW, name), getattr(NO_MOTOR_ABOVE, name)
        if held <= 0.0 or measured <= 0.0 or low <= held <= high:
            continue
        item, power = drive_name(name), round(math.log10(held / measured))
        yield Objection(
            f"the drive holds a {item.replace('_', ' ')} that no motor has: its scale in the drive file is wrong",
            in_shown_unit(name, held),
            in_shown_unit(name, low, high),
            f"compare items.{item}, staged and stored ones too, with the drive's keypad: with {10.0**-power:g} times the scale it would be of the "
            "measured one's size",
        )


def _unusual(evidence: Evidence, acceptance: Acceptance) -> Iterator[Objection]:
    """What a good result may have beside it, unless it was asked to be strict; axes may differ by what R_s may be uncertain."""
    for cause, size in evidence.unlike:
        if 100 * abs(size) <= acceptance.resistance_std_percent:
            continue
        yield Objection(
            f"strict: {cause}",
            f"{100 * size:.2g} %",
            f"{acceptance.resistance_std_percent:g} %",
            "mend the cause, or run without --strict",
        )
    if evidence.lost_samples:
        yield Objection(
            "strict: samples were lost on the way", evidence.lost_samples, 0, "use a faster or a quieter link"
        )
    if evidence.guard_acted:
        yield Objection("strict: the flux guard took the amplitude back", "acted", "no cause to act", "check the plate")
