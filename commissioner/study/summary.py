"""What a study's rows say together: outcomes, errors against the truth by parameter, size of motor and effect; flux."""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from commissioner.motor.circuit import PARAMETERS, QUANTILE
from commissioner.study.rows import Row

COMMISSIONED = "commissioned"
ANSWERED = frozenset(
    {COMMISSIONED, "identified", "monitored", "partial", "explained", "nothing_significant", "not_distinguishable"}
)
"""Outcomes of a case that came to what its kind asks for."""
QUANTILES = (0.5, 0.95, 1.0)
MOST_SENTENCES = 20
_NUMBER = re.compile(r"(?<![\w.,])[-+]?\d+(?:[.,]\d+)*(?:e[-+]?\d+)?")
SIZES_KW = (1.0, 10.0)
"""Ends of the classes of rated power that errors are told for."""


@dataclass(frozen=True)
class Errors:
    """Of one parameter over the accepted cases: quantiles of the absolute relative error; share of truths inside the stated
    95 % interval."""

    field: str
    count: int
    quantiles: tuple[float, ...]
    coverage: float


@dataclass(frozen=True)
class Group:
    """The cases that have something in common: how they ended, and the errors of those that were accepted."""

    name: str
    outcomes: Mapping[str, int]
    errors: tuple[Errors, ...]

    @property
    def cases(self) -> int:
        return sum(self.outcomes.values())


@dataclass(frozen=True)
class Summary:
    """`reasons`: how many cases each reason ended without an answer; `remarks`: how many have each remark; `sizes`: by rated power;
    `effects`: a case with several counts for each of them."""

    cases: int
    outcomes: Mapping[str, int]
    reasons: Mapping[str, int]
    remarks: Mapping[str, int]
    errors: tuple[Errors, ...]
    sizes: tuple[Group, ...]
    effects: tuple[Group, ...]
    worst_flux_fraction: float | None
    cpu_s: float


def summarise(rows: Sequence[Row]) -> Summary:
    """Over all rows; parameters over those that were commissioned."""
    reasons = tallied([f"{row['outcome']}: {row['reason']}"] for row in rows if row["outcome"] not in ANSWERED)
    remarks = tallied((row.get("remarks") or "").splitlines() for row in rows)
    flux = [fraction for row in rows if (fraction := row.get("peak_flux_fraction")) is not None]
    whole = _group("all", rows)
    return Summary(
        whole.cases, whole.outcomes, reasons, remarks, whole.errors, tuple(_sizes(rows)), tuple(_effects(rows)),
        max(flux, default=None), math.fsum(row.get("cpu_s") or 0.0 for row in rows),
    )  # fmt: skip


def tallied(cases: Iterable[Iterable[str]]) -> dict[str, int]:
    """In how many cases each sentence stands, the most frequent first. Those that differ in numbers only are one: `…` for such a number."""
    holders: defaultdict[str, set[int]] = defaultdict(set)
    numbers: defaultdict[str, list[list[str]]] = defaultdict(list)
    for case, sentences in enumerate(cases):
        for sentence in sentences:
            frame = _NUMBER.sub("\0", sentence)
            holders[frame].add(case)
            numbers[frame].append(_NUMBER.findall(sentence))
    most = sorted(holders, key=lambda frame: -len(holders[frame]))[:MOST_SENTENCES]
    return {_filled(frame, numbers[frame]): len(holders[frame]) for frame in most}


def _filled(frame: str, numbers: Sequence[Sequence[str]]) -> str:
    first, *rest = frame.split("\0")
    same = (values[0] if len(set(values)) == 1 else "…" for values in zip(*numbers, strict=True))
    return first + "".join(number + part for number, part in zip(same, rest, strict=True))


def accepted(rows: Iterable[Row], name: str) -> list[Row]:
    """The rows that were commissioned and know of this parameter what is true and what was found."""
    return [
        r for r in rows if r["outcome"] == COMMISSIONED and r.get(f"{name}_true") and r.get(f"{name}_value") is not None
    ]


def relative_errors(known: Sequence[Row], name: str) -> NDArray[np.float64]:
    """Of what was found, from the truth, in rows that are `accepted`."""
    value, true = (np.array([row.get(f"{name}_{what}") for row in known], dtype=float) for what in ("value", "true"))
    errors: NDArray[np.float64] = (value - true) / true
    return errors


def _group(name: str, rows: Sequence[Row]) -> Group:
    outcomes = Counter(str(row["outcome"]) for row in rows)
    found = (_errors(field, accepted(rows, field)) for field in PARAMETERS)
    return Group(name, dict(outcomes.most_common()), tuple(errors for errors in found if errors is not None))


def _sizes(rows: Sequence[Row]) -> Iterable[Group]:
    ends_w = (0.0, *(1e3 * kw for kw in SIZES_KW), math.inf)
    for low, high in pairwise(ends_w):
        inside = [row for row in rows if low < (row.get("rated_power_w") or 0.0) <= high]
        if inside:
            yield _group(_between(low / 1e3, high / 1e3), inside)


def _between(low_kw: float, high_kw: float) -> str:
    if math.isinf(high_kw):
        return f"above {low_kw:g} kW"
    return f"{low_kw:g} to {high_kw:g} kW" if low_kw else f"up to {high_kw:g} kW"


def _effects(rows: Sequence[Row]) -> Iterable[Group]:
    named = [(row, str(row.get("effects") or "").split()) for row in rows]
    for name in sorted({name for _, names in named for name in names}):
        yield _group(name, [row for row, names in named if name in names])
    without = [row for row, names in named if not names and "effects" in row]
    if without:
        yield _group("none", without)


def _errors(name: str, known: Sequence[Row]) -> Errors | None:
    if not known:
        return None
    relative = np.abs(relative_errors(known, name))
    true, std = (np.array([row.get(f"{name}_{what}") for row in known], dtype=float) for what in ("true", "std"))
    inside = relative * true <= QUANTILE * std
    return Errors(name, len(known), tuple(float(np.quantile(relative, q)) for q in QUANTILES), float(np.mean(inside)))
