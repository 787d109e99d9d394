"""What a drive's own tunings are worth: repeated, against the plate, against what was there before, against earlier runs.

Repeats are no independent draws: each heats the winding, so their trend is judged beside their spread. Values are judged in the
service's own terms (inverse-Gamma, per phase, SI) wherever the drive file has the convention, and only compared as the drive
counts them where no source tells the unit.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from commissioner.motor.nameplate import Nameplate, believable
from commissioner.motor.quantities import in_shown_unit
from commissioner.procedure.verdict import Objection
from commissioner.records import plain_name
from commissioner.registers.convention import our_values
from commissioner.registers.profile import DriveProfile, Item

SPREAD_PERCENT = 5.0
"""Largest minus smallest, of the median: a drive's own repeats differ by 1 ... 3 %; one that is wrong once by far more."""
TREND_PERCENT = 3.0
"""Of a resistance over all repeats: copper gains 0.39 % a kelvin, so 8 K of heating."""
FINE_COUNTS = 1000
"""Steps of its register: a value of so many moves from tuning to tuning, which differ by 1 % and more."""
FEWEST = 3
"""Repeats below which neither spread nor trend says anything."""


@dataclass(frozen=True)
class Earlier:
    """A value of the same motor from another run, in the service's terms."""

    run: str
    value: float


@dataclass(frozen=True)
class TunedRow:
    """One result over all repeats, as the drive counts it; and in the service's terms where that can be said.

    `spread_percent`: largest minus smallest, of the median. `trend_percent`: fitted line from the first to the last repeat.
    """

    name: str
    unit: str
    before: float
    values: tuple[float, ...]
    median: float
    spread_percent: float
    trend_percent: float
    change_percent: float | None
    field: str | None
    ours: float | None
    conversion: str
    plate_low: float | None
    plate_high: float | None
    earlier: tuple[Earlier, ...]


@dataclass(frozen=True)
class TuneVerdict:
    """`best`: the repeat nearest to the medians, as one set that the drive really found."""

    rows: tuple[TunedRow, ...]
    objections: tuple[Objection, ...]
    best: Mapping[str, float]
    not_judged: tuple[str, ...]

    @property
    def reason(self) -> str:
        if self.objections:
            return self.objections[0].what
        unjudged = (
            f"; not compared with the plate: {', '.join(map(plain_name, self.not_judged))}" if self.not_judged else ""
        )
        if all(len(row.values) >= FEWEST for row in self.rows):
            return "the drive's own tunings agree with each other" + (unjudged or " and with the plate")
        said = "the drive has tuned itself" if unjudged else "the drive's own tuning agrees with the plate"
        return f"{said}{unjudged}; fewer than {FEWEST} repeats say nothing of how far its tunings scatter"


def judge_tunings(
    profile: DriveProfile,
    repeats: Sequence[Mapping[str, float]],
    before: Mapping[str, float],
    plate: Nameplate,
    earlier: Mapping[str, Sequence[Earlier]],
) -> TuneVerdict:
    """Every result by itself, then the set. `earlier`: by the contract's field."""
    medians = {name: statistics.median(repeat[name] for repeat in repeats) for name in repeats[0]}
    rows = tuple(_row(profile, name, repeats, before, medians, plate, earlier) for name in medians)
    return TuneVerdict(
        rows=rows,
        objections=(
            *(o for row in rows for o in _objections(profile.item(row.name), row)),
            *_unchanged(profile, repeats, before),
        ),
        best=min(repeats, key=lambda repeat: _distance(repeat, medians)),
        not_judged=tuple(row.name for row in rows if row.plate_low is None),
    )


def _unsaid(item: Item) -> str:
    """Why a value is compared with itself alone."""
    if not item.convention:
        return "as the drive counts: no source tells its unit"
    return "as the drive means it: alone it is no value of the inverse-Gamma circuit"


def _row(
    profile: DriveProfile,
    name: str,
    repeats: Sequence[Mapping[str, float]],
    before: Mapping[str, float],
    medians: Mapping[str, float],
    plate: Nameplate,
    earlier: Mapping[str, Sequence[Earlier]],
) -> TunedRow:
    values = tuple(repeat[name] for repeat in repeats)
    median, old = medians[name], before[name]
    ours = our_values(profile, medians, plate).get(name)
    low, high = _box(ours.field, plate) if ours else (None, None)
    return TunedRow(
        name=name,
        unit=profile.item(name).unit,
        before=old,
        values=values,
        median=median,
        spread_percent=_percent(max(values) - min(values), median),
        trend_percent=_percent(_line(values), median),
        change_percent=100 * (median / old - 1) if old else None,
        field=ours.field if ours else None,
        ours=ours.value if ours else None,
        conversion=ours.conversion if ours else _unsaid(profile.item(name)),
        plate_low=low,
        plate_high=high,
        earlier=tuple(earlier.get(ours.field, ())) if ours else (),
    )


def _box(field: str, plate: Nameplate) -> tuple[float | None, float | None]:
    """What the plate allows of a contract's field."""
    box = believable(plate)
    if field == "rotor_time_constant_s":
        low, high = box.lower, box.upper
        return (
            low.magnetizing_inductance_h / high.rotor_resistance_ohm,
            high.magnetizing_inductance_h / low.rotor_resistance_ohm,
        )
    return getattr(box.lower, field), getattr(box.upper, field)


def _line(values: Sequence[float]) -> float:
    """By how much the fitted line rises from the first repeat to the last."""
    if len(values) < 2:
        return 0.0
    steps = np.arange(len(values)) - 0.5 * (len(values) - 1)
    return float(steps @ (np.array(values) - values[0]) / (steps @ steps)) * (len(values) - 1)


def _percent(part: float, whole: float) -> float:
    if part == 0.0:
        return 0.0
    return 100 * part / abs(whole) if whole else float("inf")


def _distance(repeat: Mapping[str, float], medians: Mapping[str, float]) -> float:
    return sum(abs(_percent(repeat[name] - median, median)) for name, median in medians.items())


def _unchanged(
    profile: DriveProfile, repeats: Sequence[Mapping[str, float]], before: Mapping[str, float]
) -> Iterator[Objection]:
    """Where every result is to the last digit what stood there before, in every repeat, the drive keeps elsewhere what it found, or
    did not tune: as long as one of them is counted so finely that no second tuning meets it."""
    seen = [(name, value, before[name]) for repeat in repeats for name, value in repeat.items()]
    is_fine = any(_counts(profile.item(name), value) >= FINE_COUNTS for name, value, _ in seen)
    if is_fine and all(value == old for _, value, old in seen):
        yield Objection(
            "the drive's tuning changed nothing: every result is what stood there before", f"{len(repeats)} x the same to the last digit",
            "a tuning never finds every digit again",
            "see on the drive's display whether it tuned, where it keeps what it found, and whether that must first be taken over",
        )  # fmt: skip


def _counts(item: Item, value: float) -> float:
    """How many steps of its register a value is."""
    return math.inf if item.type == "f32" else abs(value) / item.scale


def _is_no_value(item: Item, value: float) -> bool:
    """The ends of a register's range, signed or not: what drives show for 'not available' and what a value beyond it is clipped to."""
    if item.type == "f32":
        return False
    bits = 16 * item.words
    return round(value / item.scale) in (2**bits - 1, 2 ** (bits - 1) - 1, 2 ** (bits - 1), -(2 ** (bits - 1)), -1)


def _objections(item: Item, row: TunedRow) -> Iterator[Objection]:
    if any(_is_no_value(item, value) for value in row.values):
        yield Objection(
            f"{plain_name(row.name)} stands at an end of its register", row.median, "a value inside its range",
            "drives show so that they have no value, or more than the register holds: look at the drive's display",
        )  # fmt: skip
        return
    low, high = item.minimum, item.maximum
    if not (-math.inf if low is None else low) <= row.median <= (math.inf if high is None else high):
        yield Objection(
            f"{plain_name(row.name)} is none that the drive file allows", row.median, item.bounds,
            "check the item's address, width and scale in the drive file",
        )  # fmt: skip
        return
    if row.median <= 0.0:
        yield Objection(
            f"{plain_name(row.name)} is not a motor's", row.median, "above 0",
            "the drive found nothing: check the motor's connection, and the item's address and width in the drive file",
        )  # fmt: skip
        return
    low, high = row.plate_low, row.plate_high
    if row.field and row.ours is not None and low is not None and high is not None and not low <= row.ours <= high:
        yield Objection(
            f"{plain_name(row.name)} is not physical for this nameplate", in_shown_unit(row.field, row.ours), in_shown_unit(row.field, low, high),
            "check the plate in the drive, the motor's connection, and the drive file's scale and convention",
        )  # fmt: skip
    if len(row.values) < FEWEST:
        return
    if row.spread_percent > SPREAD_PERCENT:
        far = max(row.values, key=lambda value: abs(value - row.median))
        yield Objection(
            f"{plain_name(row.name)} differs between the repeats, most in number {row.values.index(far) + 1}",
            f"{row.spread_percent:.2g} %", f"{SPREAD_PERCENT:g} %",
            "keep the shaft at rest and tune again; a repeat that is wrong once makes all of them doubtful",
        )  # fmt: skip
    elif (
        row.field in ("stator_resistance_ohm", None)
        and "resistance" in row.name
        and abs(row.trend_percent) > TREND_PERCENT
    ):
        yield Objection(
            f"{plain_name(row.name)} runs away over the repeats: each of them heats the winding",
            f"{row.trend_percent:+.2g} %", f"{TREND_PERCENT:g} %", "let the motor cool down and give a longer --pause",
        )  # fmt: skip
