"""One cause, one file: everything that a cause's name decides anywhere in the product.

A file of a room ends with `CAUSE = ItsClass()`. Search, verdict, report, test points and the translation to the simulated
inverter ask the catalogue and compare no names; only causes name other causes, as confounders and in exchanges.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, ClassVar, Literal

from commissioner.diagnose.causes.setting import Array, Numbers, Setting, Sizes
from commissioner.diagnose.intake.audit import Audit
from commissioner.diagnose.intake.record import Facts, Record
from commissioner.diagnose.plant.model import Layout, Model, Term
from commissioner.diagnose.rules import Rules

if TYPE_CHECKING:
    from commissioner.diagnose.causes.in_points import InPoints
    from commissioner.diagnose.fit.gauss_newton import Fit
    from commissioner.diagnose.intake.noise import Noise

Family = Literal["linear", "odd", "even", "axis", "cross", "dc", "start", "drifting", "non-periodic", "noise"]
Entry = Mapping[str, float | str]
COMMAND = "commissioner diagnose first.csv second.csv --out compared"
SAME = "Leave everything else as it was: axis, level, and the sampling rate of the recording."
KEEPS = "No. R_s, R_R, L_sigma and L_M stay as they are; only the names become surer."
READ_BOTH = "Read both recordings together:"
FINE = "This is the measurement's error, not the motor's."
NO_FAULT = "This is no fault of the motor."


class Form(Enum):
    """What a cause's form may leave behind for a later one to take (`Rules` holds the share of each)."""

    EXACT = "its form is no matter of opinion: it leaves nothing"
    SHAPED = "its curve is free: what it leaves is small"
    RIGID = "few numbers, or a law that others state otherwise"


@dataclass(frozen=True)
class Words:
    """`says`: the headline's sentence, `{size}` is the first size. `drive`, `measurement`: what to do there."""

    says: str
    motor: str
    drive: str = ""
    measurement: str = ""
    is_normal: bool = False
    called: str = ""
    """What it is called in place of its name."""


@dataclass(frozen=True)
class Procedure:
    """How two causes are told apart: `steps` in order; the last command reads the old and the new file together."""

    steps: tuple[str, ...]
    command: str = COMMAND
    changes_values: str = KEEPS


@dataclass(frozen=True)
class AsOne:
    """Two causes that data cannot tell apart, spoken of as one: the words, and what the sizes that both share are called."""

    words: Words
    sizes: Mapping[str, str]


@dataclass(frozen=True)
class Confounder:
    """Another cause that this one is mistaken for. Stated in the file of the later one; the catalogue knows it both ways."""

    name: str
    least_share: float | None = None
    """Of the accepted one's gain, what the other must gain beside it; None: as the accepted one's form says."""
    tied_share: float = 0.0
    """Of a gain: two that differ by less are the same to the terminals, whatever fits better."""
    is_always_tied: bool = False
    """Where link and switching frequency never change: every inverter has both, and nothing is open that matters."""
    is_same_order: bool = False
    """Networks of the same order, which are never exchanged for one another as a group."""
    fewest_axes: int = 0
    """With fewer axes the two are open, whether they are named or not."""
    told_apart_by: Callable[[Facts], Procedure] | None = None
    as_one: AsOne | None = None


@dataclass(frozen=True)
class Standing:
    """Where a search stands, for a cause that may propose another explanation: the fitted model, the causes accepted and allowed."""

    model: Model
    accepted: tuple[str, ...]
    names: Collection[str]
    setting: Setting
    samples: float
    """Good samples of all phases: ln of it is what a number is worth."""
    rules: Rules

    def saved_chi2(self, model: Model) -> float:
        """What the numbers of causes that another model saves are worth, less what those that it adds cost."""
        here, there = (Counter(t.effect for t in m.terms if t.effect) for m in (self.model, model))
        return sum(self.rules.price(n) for n in here.values()) - sum(self.rules.price(n) for n in there.values())


@dataclass(frozen=True)
class Proposal:
    """Causes that may stand where others were accepted, as a model to begin a fit from."""

    model: Model
    gone: tuple[str, ...]
    come: tuple[str, ...]
    most_chi2: float
    """Above the present fit's: what the numbers that it saves are worth, less what those that it adds cost."""
    says: str
    is_sound: Callable[[Fit], bool] | None = None
    """Asked of the fit; None: every cause that comes must be plausible."""


class Cause:
    """One named cause. Zero is the nominal model; every number has a unit, and a sign where physics gives one."""

    name: ClassVar[str]
    place: ClassVar[int]
    """In the catalogue's order, which replays and last digits depend on."""
    title: ClassVar[str]
    family: ClassVar[Family]
    sign: ClassVar[Literal[-1, 0, 1]]
    form: ClassVar[Form] = Form.RIGID
    signature: ClassVar[str]
    source: ClassVar[str]
    confounders: ClassVar[tuple[Confounder, ...]] = ()
    imitates: ClassVar[tuple[str, ...]] = ()
    """Simpler causes that one of this one's many numbers has as its limit: beside them it can only imitate."""
    found_by: ClassVar[Literal["fit", "audit", "mending"]] = "fit"
    makes_late: ClassVar[bool] = False
    """Whether all it does is to turn phases: several such can look like one another."""
    moves_the_clock: ClassVar[bool] = False
    """Whether it is a delay that changes: nothing that a single tone shows."""
    meets_tones: ClassVar[bool] = False
    """Whether its side lines may fall from one tone to another, and change impedances as linear causes do."""
    line: ClassVar[str] = ""
    """How the names of the mains-bound lines that it rides on begin."""
    is_common: ClassVar[bool] = False
    """Named first where a screen lists what would have been seen."""
    bends_l_m: ClassVar[bool] = False
    """Whether beside it L_M is the unsaturated value."""
    spare: ClassVar[frozenset[int]] = frozenset()
    """Kinds of its numbers each of which may as well be zero."""
    where: ClassVar[frozenset[str]] = frozenset()
    """Sizes that say where it acts and not how much."""
    words: ClassVar[Words]
    advice: ClassVar[str] = ""
    """What a technician's page says beside its size, where it is normal or easily put right."""
    split_by: ClassVar[str]
    decides: ClassVar[str]
    """What settles whether the name is right, in one sentence."""
    course: ClassVar[str] = ""
    """What the names of numbers begin with that together are one free function of time: all one, it is one."""
    either: ClassVar[tuple[tuple[str, ...], ...]] = ()
    """Sets of its numbers' names of which but one is at work."""
    exchanged: ClassVar[tuple[Term, ...]] = ()
    """Numbers that are never sought alone: they come in exchange for others only."""
    in_points: ClassVar[InPoints | None] = None
    """What it does in a table of test points."""

    # what it is in the model
    def regressors(self, record: Record) -> Mapping[str, Sequence[Array]]:
        """Known functions of time of its own that its numbers multiply: by name, (n,) of every segment."""
        return {}

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        """Its numbers; empty: these data cannot show it."""
        raise NotImplementedError

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        """What a person reads: engineering values with units, the first one decides the sign."""
        raise NotImplementedError

    def measures(self, sizes: Sizes) -> list[tuple[str, tuple[float, str]]]:
        """The sizes that measure it, of which a detection limit is said: the first that does not say where it acts; of several sensors each one's."""
        some = [item for item in sizes.items() if item[0] not in self.where]
        return [item for item in some if item[0].split("_")[0] == some[0][0].split("_")[0]]

    def without_recorded(self, model: Model, record: Record) -> Model:
        """The model beside whose currents nothing but the command was recorded."""
        return model

    def unknown_form(self, model: Model, layout: Layout) -> Mapping[str, float]:
        """By size, the spread that comes from a form which is nobody's knowledge."""
        return {}

    # its numbers' sets
    def forms(self, terms: Sequence[Term]) -> tuple[tuple[Term, ...], ...]:
        """The sets of these numbers that may be at work together."""
        if not self.either:
            return (tuple(terms),)
        sets = (tuple(t for t in terms if t.symbol in names) for names in self.either)
        return tuple(s for s in sets if s)

    def form_of(self, symbols: Collection[str], terms: Sequence[Term]) -> tuple[Term, ...]:
        """Of the sets of these numbers the one that has most of these names, and what was exchanged."""
        best = max(self.forms(terms), key=lambda form: sum(t.symbol in symbols for t in form), default=())
        return (*best, *self.exchanged_in(symbols))

    def other_forms(self, symbols: Collection[str], terms: Sequence[Term]) -> tuple[tuple[Term, ...], ...]:
        """Of the sets of these numbers those that are not the one that has these names."""
        mine = {*self.form_of(symbols, terms)}
        return tuple(form for form in self.forms(terms) if {*form, *self.exchanged_in(symbols)} != mine)

    def exchanged_in(self, symbols: Collection[str]) -> tuple[Term, ...]:
        return tuple(t for t in self.exchanged if t.symbol in symbols)

    # what the search asks
    def is_plausible(self, model: Model, setting: Setting) -> bool:
        """The sign physics demands, and whatever else no such cause can be."""
        values = model.of(self.name)
        if self.is_ruled_out(model, setting.record):
            return False
        sizes = self.sizes(setting, values)
        has_own_sign = any(t.lower < 0.0 for t in self.exchanged_in(values))
        return (has_own_sign or self.has_its_sign(sizes)) and self.is_possible(sizes, model, setting)

    def promises_its_sign(self, setting: Setting, values: Numbers) -> bool:
        """Whether the sizes of these numbers, a step that no fit has made yet, have the sign that physics demands."""
        return not self.sign or self.has_its_sign(self.sizes(setting, values))

    def has_its_sign(self, sizes: Sizes) -> bool:
        """Whether the first size, if there is one, has the sign that physics demands, if it demands one."""
        return not self.sign or not sizes or next(iter(sizes.values()))[0] * self.sign > 0

    def is_possible(self, sizes: Sizes, model: Model, setting: Setting) -> bool:
        """Whether a cause of these sizes exists."""
        return True

    def is_ruled_out(self, model: Model, record: Record) -> bool:
        """Whether what was measured says surely that it is not this cause."""
        return False

    def outright(
        self, misfit: float, setting: Setting
    ) -> Iterable[tuple[tuple[float, float, float, float], Sequence[Term]]]:
        """Four parameters and numbers to begin from where the nominal model misses by `misfit` times the noise's power: no promise shows it."""
        return ()

    def occasion(self, accepted: Sequence[Cause], names: Collection[str]) -> frozenset[str] | None:
        """The accepted causes that decide whether it proposes others; each set is looked at once. None: nothing to propose."""
        return None

    def proposals(self, here: Standing) -> Iterable[tuple[Proposal, ...]]:
        """Groups of proposals where no single step leads; of each group the best that is worth it, the first group that has one."""
        return ()

    def in_place_of(self, fresh: str, here: Standing) -> Iterable[tuple[Proposal, ...]]:
        """The same, in place of a cause that was accepted just now."""
        return ()

    def rivals(self, model: Model, absent: Collection[str]) -> Iterable[tuple[str, Model]]:
        """Other causes that could make the same of the currents, which no screening finds."""
        return ()

    # what the verdict asks
    def seen_in(self, audit: Audit, record: Record, noise: Noise, unmarked: float) -> Sizes | None:
        """Sizes where the audit or the mending finds it without a fit; `unmarked`: samples lost without a gap in time."""
        return None

    def in_truth(self, values: Sequence[float], audit: Audit) -> tuple[str, Sizes] | None:
        """The cause of another name, with its sizes, that sizes of these values are."""
        return None

    # what is said, and written for the simulated inverter
    def words_for(self, sizes: Mapping[str, float]) -> Words:
        return self.words

    def what_decides(self, record: Record) -> str:
        """What settles the name in these data: nobody is asked to record what is recorded."""
        return self.decides

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        """Its entry in a scenario of the simulated inverter, in that catalogue's units; empty: that one has no such cause."""
        return {}
