"""What a cause is: its numbers in the machine, how they read, what it is mistaken for, what is said and done about it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from commissioner.estimation.numbers import Scales
from commissioner.estimation.record import Record

Values = Mapping[str, float]
Entry = Mapping[str, float | str]
"""A cause in the simulator's catalogue, in that one's units."""
Sizes = dict[str, tuple[float, str]]
"""Name to value and unit; the first one is the size that is spoken of."""
PHASES = "uvw"


@dataclass(frozen=True)
class Form:
    """One way in which a cause can be there. `numbers` are screened from zero; `spare` ones are freed once it is accepted;
    `needs`: of the recording; `is_signed`: whether the first number may be less than nothing beside spare ones."""

    name: str
    numbers: tuple[str, ...]
    spare: tuple[str, ...] = ()
    needs: Callable[[Record], bool] = field(default=lambda _: True, compare=False)
    is_signed: bool = False


@dataclass(frozen=True)
class Confounder:
    """Who looks alike, and what a plant can record to tell them apart. `tied_without`: what a recording must have before the fit may part them."""

    name: str
    told_apart_by: str = ""
    is_always_tied: bool = False
    tied_without: Literal["", "a start", "a second load"] = ""


@dataclass(frozen=True)
class Cause:
    """`says` has a `{size}`. `range`: of the first size, what physics allows; outside it is another cause in disguise.

    `allows`: what else physics demands of its numbers. `leaves_open`: a sentence on what no data tell of the parameters beside it, the channel
    or the line that differs from the mean being one alone. `is_sized_by_law`: whether a recording tells its sizes by the form of its law, which
    is not known, so that they have what `by_laws` says in their errors. `scenario`: entry of [effects] in the simulator; derivatives are those of
    the kernel's lines, exact by complex step. `swing`: of its load instead, (amplitude over rated torque, times a turn of the shaft). `goes_by`: whose its numbers may be in this recording, the likeliest first, where not its own alone;
    `negative_sequence`: whether it adds a current of it, or makes the impedance there another than at slip.
    """

    name: str
    title: str
    says: str
    meaning: str
    remedy: str
    physics: str
    signature: str
    source: str
    forms: tuple[Form, ...]
    sizes: Callable[[Values, Scales], Sizes]
    range: tuple[float, float]
    confounders: tuple[Confounder, ...] = ()
    scenario: Callable[[Values, Scales], Entry] | None = None
    swing: Callable[[Values], tuple[float, float]] | None = None
    needs: Callable[[Record], bool] = field(default=lambda _: True)
    is_of_measurement: bool = False
    allows: Callable[[Values, Scales], bool] = field(default=lambda _, __: True)
    goes_by: Callable[[Record, Values], tuple[str, ...]] = field(default=lambda _, __: ())
    leaves_open: Callable[[Values], str] = field(default=lambda _: "")
    is_sized_by_law: Callable[[Record], bool] = field(default=lambda _: False)
    negative_sequence: Literal["", "adds", "impedes"] = ""

    def size(self, values: Values, scales: Scales) -> float:
        """The one that is spoken of."""
        return next(iter(self.sizes(values, scales).values()))[0]

    def is_less_than_nothing(self, values: Values, scales: Scales) -> bool:
        """Whether physics gives the first size one sign, and it has the other."""
        return self.range[0] == 0.0 > self.size(values, scales)

    def is_plausible(self, values: Values, scales: Scales) -> bool:
        """Whether the first size lies in the range physics allows."""
        size = self.size(values, scales)
        return bool(np.isfinite(size) and self.range[0] <= size <= self.range[1] and self.allows(values, scales))


def of_one_gain(share: float) -> str:
    """What a gain of one channel leaves open."""
    return (
        "Which of the gains is right is not in the data: if one channel alone is wrong, resistances and inductances are off by "
        f"{share:.2%} of their values, beside their intervals."
    )


def in_phases(re: float, im: float) -> tuple[float, float, float]:
    """A vector that turns twice as unequal parts of three phases, sum zero: g = sum over k of g_k exp(2 j phi_k) / 3."""
    g = complex(re, im)
    return tuple(float(2.0 * (g * np.exp(-4j * np.pi * k / 3.0)).real) for k in range(3))  # type: ignore[return-value]


def one_of_three(parts: tuple[float, float, float]) -> tuple[int, float]:
    """The phase that differs most from the two others, and by how much from their mean."""
    apart = [1.5 * p for p in parts]  # sum zero: p - (-p / 2)
    k = int(np.argmax(np.abs(apart)))
    return k, apart[k]
