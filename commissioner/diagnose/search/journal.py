"""What the search does, as records: yielded one by one, shown, journalled, and decided again from their own numbers.

Every choice of the search is a function of records here, so that `replayed` makes the same ones without a fit; with other
rules it says what they would have changed.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf, isfinite
from typing import Any, NamedTuple, TypeVar, get_args, get_type_hints

from commissioner.diagnose.rules import RULES, Rules
from commissioner.diagnose.search.acceptance import guards
from commissioner.encoding import JsonObject, plain


@dataclass(frozen=True)
class Said:
    """What is no choice: the noise, where the nominal fit stands, lines looked at, samples put right."""

    sentence: str

    def __str__(self) -> str:
        return self.sentence


@dataclass(frozen=True)
class Nominal:
    """Where the four parameters alone stand, over the noise's rms."""

    sigma: float

    def __str__(self) -> str:
        return f"nominal fit: {self.sigma:.3g} times the noise"


@dataclass(frozen=True)
class Began:
    """Steps from these causes, on so many samples: a part of the recording, more of it, or other data."""

    accepted: tuple[str, ...]
    samples: int

    def __str__(self) -> str:
        return f"from {', '.join(self.accepted) or 'no cause'} on {self.samples} samples"


@dataclass(frozen=True)
class Beside:
    """What is known of the accepted causes when another is judged."""

    losses: Mapping[str, float]
    """Chi2 that goes without each of them."""
    rest_chi2: float
    """Surely not explained."""
    samples: float
    """Good samples of all phases."""
    material_chi2: float
    """What a contribution gains that just matters."""
    ripple_meets_tones: bool = False

    def is_large(self, rules: Rules) -> bool:
        return self.rest_chi2 > rules.large_rest_sigma**2 * self.samples

    def threshold(self, numbers: int, rules: Rules) -> float:
        return max(rules.required_chi2(numbers), self.material_chi2)

    def guard(self, name: str, rules: Rules) -> tuple[float, str]:
        """What a cause must gain beside others, and why: no more than nearly all of a large rest, for what the form of another cause
        leaves behind no simple cause takes entirely.
        """
        left, by = guards(self.losses, name, ripple_meets_tones=self.ripple_meets_tones, rules=rules)
        most = rules.entirely_share * self.rest_chi2
        return (most, "nearly all of the rest") if self.is_large(rules) and most < left else (left, by)

    def wanted(self, name: str, numbers: int, rules: Rules) -> tuple[float, str]:
        """What a cause of so many numbers must gain, and by which rule."""
        own = "the price of its numbers" if rules.required_chi2(numbers) >= self.material_chi2 else "materiality"
        guard, by = self.guard(name, rules)
        threshold = self.threshold(numbers, rules)
        return (guard, by) if guard > threshold else (threshold, own)


@dataclass(frozen=True)
class Screened:
    """One look at every absent cause: chi2 promised to first order, numbers that it needs; and what is asked of them."""

    promised: Mapping[str, tuple[float, int]]
    beside: Beside
    refused: tuple[str, ...] = ()
    """Not tried: dropped before, or implausible too often."""
    kept: Mapping[str, float] = field(default_factory=dict)
    """Causes that were ruled out before, with the share of their promise that a refit kept."""

    def __str__(self) -> str:
        return f"screened {len(self.promised)} causes, {self.beside.rest_chi2:.4g} surely not explained"


@dataclass(frozen=True)
class Tried:
    """One refit: what it promised, gained, and would have had to gain, and which rule asked for most."""

    name: str
    promised_chi2: float
    numbers: int
    gained_chi2: float
    wanted_chi2: float
    wanted_by: str
    is_sound: bool = True
    how: str = ""
    """`outright`: without a promise; or the form it was tried in."""
    kept: float | None = None
    """The share of the promise that it kept, where what was measured rules it out."""

    @property
    def is_enough(self) -> bool:
        return self.is_sound and self.gained_chi2 >= self.wanted_chi2

    def __str__(self) -> str:
        if self.how == "outright":
            return f"  try a large {self.name}: gained {self.gained_chi2:.4g}"
        if self.how:
            return f"  {self.name} {self.how}: gained {self.gained_chi2:.4g}"
        return f"  try {self.name}: promised {self.promised_chi2:.4g}, gained {self.gained_chi2:.4g}"


@dataclass(frozen=True)
class Accepted:
    """The best of those that were tried."""

    name: str
    left_sigma: float

    def __str__(self) -> str:
        return f"accepted {self.name}: {self.left_sigma:.4g} times the noise"


@dataclass(frozen=True)
class Dropped:
    """An accepted cause that was doubted: what goes without it, refitted, and what must; it stays where `is_taken` says no."""

    name: str
    lost_chi2: float
    wanted_chi2: float
    wanted_by: str
    is_sound: bool
    is_taken: bool

    def __str__(self) -> str:
        return f"  dropped {self.name}" if self.is_taken else f"  {self.name} stays: {self.lost_chi2:.4g} without it"


@dataclass(frozen=True)
class Exchanged:
    """Causes that give way to others (or to another form of themselves), where that gains what is wanted and is plausible."""

    says: str
    gone: tuple[str, ...]
    come: tuple[str, ...]
    gained_chi2: float
    wanted_chi2: float
    is_sound: bool
    is_taken: bool

    def __str__(self) -> str:
        return f"  {self.says}: gained {self.gained_chi2:.4g}"


@dataclass(frozen=True)
class Refined:
    """More, closer or other numbers for the causes that are accepted."""

    says: str
    gained_chi2: float
    wanted_chi2: float
    is_taken: bool

    def __str__(self) -> str:
        return f"  {self.says}: gained {self.gained_chi2:.4g}"


Step = Said | Nominal | Began | Screened | Tried | Accepted | Dropped | Exchanged | Refined
KINDS: Mapping[str, type] = {k.__name__.lower(): k for k in get_args(Step)}


Result = TypeVar("Result")


def followed(search: Generator[Step, None, Result], observe: Callable[[Step], None] = lambda _: None) -> Result:
    """What a search finds; `observe` is called with each of its records."""
    while True:
        try:
            observe(next(search))
        except StopIteration as end:
            found: Result = end.value
            return found


def written(steps: Iterable[Step]) -> list[JsonObject]:
    """The records as JSON types: `step` names the kind."""
    return [{"step": type(step).__name__.lower(), **plain(step)} for step in steps]


def read(rows: Iterable[Mapping[str, Any]]) -> tuple[Step, ...]:
    """The records back; a number that JSON has not was infinite. KeyError or TypeError where a row is none."""
    return tuple(_read(KINDS[row["step"]], {k: v for k, v in row.items() if k != "step"}) for row in rows)


def _read(kind: type, row: Mapping[str, Any]) -> Any:
    types = get_type_hints(kind)
    values: dict[str, Any] = {}
    for key, value in row.items():
        if types[key] is Beside:
            values[key] = _read(Beside, value)
        elif types[key] is float and value is None:
            values[key] = -inf if key == "gained_chi2" else inf
        else:
            values[key] = tuple(value) if isinstance(value, list) else value
    if kind is Screened:
        values["promised"] = {n: (float(chi2), int(numbers)) for n, (chi2, numbers) in row["promised"].items()}
    return kind(**values)


def candidates(screened: Screened, rules: Rules = RULES) -> list[str]:
    """Causes worth a refit by their promise, best first."""
    net = {n: chi2 - rules.price(numbers) for n, (chi2, numbers) in screened.promised.items()}
    out = []
    for name in sorted(net, key=lambda n: -net[n]):
        chi2, numbers = screened.promised[name]
        hopeless = rules.hopeless_share * screened.beside.guard(name, rules)[0]
        if name not in screened.refused and chi2 > max(rules.promised_share * rules.required_chi2(numbers), hopeless):
            out.append(name)
    return out[: rules.refitted]


def best_of(tried: Sequence[Tried], rules: Rules = RULES) -> Tried | None:
    """Of those that gained enough the one with most beyond the price of its numbers."""
    return max((t for t in tried if t.is_enough), key=lambda t: t.gained_chi2 - rules.price(t.numbers), default=None)


def next_candidate(screened: Screened, tried: Sequence[Tried], rules: Rules = RULES) -> str | None:
    """The next cause to refit: none once no promise can reach the best gain so far."""
    begun = {t.name for t in tried if not t.how}
    name = next((n for n in candidates(screened, rules) if n not in begun), None)
    best = best_of(tried, rules)
    if name is None or best is None:
        return name
    chi2, numbers = screened.promised[name]
    reached = rules.rival_promise * (chi2 - rules.price(numbers))
    return None if reached < best.gained_chi2 - rules.price(best.numbers) else name


class RuledOut(NamedTuple):
    """A cause that was ruled out by what was measured, and the chi2 it would take: so much is real, and it is not that cause's."""

    name: str = ""
    chi2: float = 0.0


def ruled_out(screened: Screened, tried: Sequence[Tried], rules: Rules = RULES) -> RuledOut:
    """Of the causes that were ruled out the one that would take most, more than it must gain; else none."""
    kept = {**screened.kept, **{t.name: t.kept for t in tried if t.kept is not None}}
    would = {n: share * screened.promised[n][0] for n, share in kept.items() if n in screened.promised}
    beyond = {n: x for n, x in would.items() if x > screened.beside.wanted(n, screened.promised[n][1], rules)[0]}
    name = max(beyond, key=lambda n: beyond[n], default="")
    return RuledOut(name, beyond.get(name, 0.0))


def chosen(screened: Screened, tried: Sequence[Tried], rules: Rules = RULES) -> str | None:
    """The cause that is accepted: the best, if it takes enough where much is left; else no cause makes it, and six small ones name nothing."""
    best, beside = best_of(tried, rules), screened.beside
    real = max(beside.rest_chi2 if beside.is_large(rules) else 0.0, ruled_out(screened, tried, rules).chi2)
    return None if best is None or best.gained_chi2 < rules.least_share_of_rest * real else best.name


@dataclass(frozen=True)
class Replayed:
    """`accepted`: what the journal ends with. `differs`: choices that these rules make otherwise, in order; empty with its own."""

    accepted: tuple[str, ...]
    differs: tuple[str, ...]


def replayed(steps: Iterable[Step], rules: Rules = RULES) -> Replayed:
    """Every choice made again from the records' numbers, without a fit."""
    accepted: list[str] = []
    differs: list[str] = []
    screened: Screened | None = None
    tried: list[Tried] = []

    def settle(taken: str | None) -> None:
        if screened is not None and (mine := chosen(screened, tried, rules)) != taken:
            differs.append(f"{mine or 'nothing'} accepted in place of {taken or 'nothing'}")

    for step in steps:
        match step:
            case Began():
                settle(None)
                screened, tried, accepted = None, [], list(step.accepted)
            case Screened():
                settle(None)
                screened, tried = step, []
            case Tried() if screened is not None:
                if not step.how and (mine := next_candidate(screened, tried, rules)) != step.name:
                    differs.append(f"{mine or 'nothing'} tried in place of {step.name}")
                tried.append(_judged_again(step, screened, rules))
            case Accepted():
                settle(step.name)
                screened, tried = None, []
                accepted.append(step.name)
            case Dropped() | Exchanged() | Refined():
                settle(None)
                screened, tried = None, []
                if is_taken(step) != step.is_taken:
                    differs.append(f"{step} {'not ' if step.is_taken else ''}taken".strip())
                if step.is_taken and not isinstance(step, Refined):
                    gone = (step.name,) if isinstance(step, Dropped) else step.gone
                    come = () if isinstance(step, Dropped) else step.come
                    accepted = [*(n for n in accepted if n not in gone), *come]
            case _:
                pass
    settle(None)
    return Replayed(tuple(accepted), tuple(differs))


def _judged_again(tried: Tried, screened: Screened, rules: Rules) -> Tried:
    beside = screened.beside
    if tried.how == "outright":
        return replace(tried, wanted_chi2=beside.threshold(tried.numbers, rules))
    return replace(tried, wanted_chi2=beside.wanted(tried.name, tried.numbers, rules)[0])


def is_taken(step: Dropped | Exchanged | Refined) -> bool:
    """Whether what was tried is kept."""
    if isinstance(step, Dropped):
        # what was left runs away alone: better an implausible cause than no model
        return isfinite(step.lost_chi2) and (step.lost_chi2 < step.wanted_chi2 or not step.is_sound)
    return step.gained_chi2 > step.wanted_chi2 and (isinstance(step, Refined) or step.is_sound)
