"""From the nominal model to the accepted causes: forward steps, backward deletion, swaps, alternatives.

Each accepted effect enters with its full shape dictionary (splines, stop operators, rotor branches), so a later step
never has to mend the shape of an earlier one.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from commissioner.diagnose import kinds
from commissioner.diagnose.audit import excited_lines
from commissioner.diagnose.effects import CATALOGUE, Setting
from commissioner.diagnose.effects.effect import Sizes
from commissioner.diagnose.fit import Fit, fit
from commissioner.diagnose.lost import Loss, mend
from commissioner.diagnose.model import Layout, Model
from commissioner.diagnose.noise import Noise
from commissioner.diagnose.nominal import (
    bare_layout,
    from_segment_to_segment,
    impedance_starts,
    largest_fluxes,
    nominal_fit,
    set_up,
    with_flux_before,
    with_ranges,
)
from commissioner.diagnose.record import Record, Segment
from commissioner.diagnose.screen import STATISTICAL_FLOOR, Screening, joint_net, price, required_chi2, screen
from commissioner.diagnose.settle import placed, without_idle_loops

MOST_CAUSES = 6
MATERIAL_SHARE = 1e-4
"""A cause must move the current by this share of its rms (-80 dB), else it is listed as below materiality."""
REFITTED = 4
IMPLAUSIBLE = 2
"""A candidate whose refit came out implausible so often is not refitted again."""
RIVAL = 2.5
"""A candidate is refitted only if this multiple of its promise reaches the best gain so far."""
GUARD = 2e-5
"""A later cause must gain this share of what the strongest accepted nonlinearity gains, else it may be its shape."""
CLASS_GUARD = 1e-2
"""Beside an accepted cause of rigid form that it is mistaken for, a later cause must gain this share of its gain."""
HOPELESS = 0.4
"""A candidate that promises less than this share of what its guard wants is not refitted."""
SAME_ORDER = frozenset({"rotor_skin_effect", "iron_loss"})
PAIR_GUARDS = {
    SAME_ORDER: 0.1, frozenset({"inductance_anisotropy", "resistance_anisotropy"}): 0.05,
    frozenset({"shaft_motion", "remanence"}): 0.05, frozenset({"sensor_offset", "sensor_drift"}): 3e-3,
}
"""Pairs of which the weaker is only named beside the other where it is no trifle: networks that terminals hardly tell apart;
a leakage's anisotropy, which tilts the cage's resistance by as much as of it lies on the rotor's side; flux left from the
segment before, which a shaft that turns in the pause carries elsewhere. (Offset and drift differ plainly.)"""
LINEAR = ("sampling_delay", "sensor_lag", "iron_loss", "rotor_skin_effect", "cable_capacitance")
"""Causes that only turn and scale the excited lines: any two of them can look like a third."""
REGROUPED, HOPEFUL = 4, 1.3
"""Groups refitted at most; and the factor by which a refit may gain more than promised."""
TONE_TO_TONE = 0.05
"""As CLASS_GUARD, for a ripple whose side lines fall from one tone to another, beside linear causes."""
LARGE_MISFIT, LARGE_DELAYS = 9.0, (0.7, 1.5, 2.5)
RIGID_GUARD = 1e-3
"""As GUARD, beside an accepted cause whose form has few numbers."""
STEPS_GUARD = 2e-2
"""As GUARD, of the power of coarse converter steps, which repeat with the signal and look a little like anything."""
EXACT = frozenset({
    "sensor_offset", "sensor_gain_mismatch", "sampling_delay", "mains_pickup", "dc_link_ripple", "remanence",
})
"""Causes whose form is not a matter of opinion: they leave nothing behind."""
LARGE_REST, CRUMB = 0.3, 0.08
"""A rest above this multiple of the noise of which the best candidate takes less than this share is left as it is."""
SHAPED = frozenset({"dead_time", "device_drop", "magnetizing_saturation", "leakage_saturation"})
"""Causes whose curve is free: what they leave is small. No two hysteresis models agree, so it is not among them."""
LEAST_SLOPE_LOST = 0.25
"""A channel that loses less of its slope than this at the largest current is not straight, yet not at its end."""
EXPLORED_SAMPLES = 45_000
MENDED = 3
"""Rounds of putting lost samples right and fitting again."""
MENDED_SHARE = 0.7
LEAST_BESIDE = 800.0
"""Beside accepted causes lost samples must gain so much, and as much as any cause beside one that it is mistaken for."""

Report = Callable[[str], None]


@dataclass(frozen=True)
class Found:
    """Accepted effects in order, the fit with them, and what was seen on the way."""

    nominal: Fit
    fit: Fit
    accepted: tuple[str, ...]
    record: Record
    layout: Layout
    setting: Setting
    screening: Screening
    first_screening: Screening
    below_materiality: tuple[str, ...] = ()
    gains: dict[str, float] = field(default_factory=dict)
    losses: tuple[Loss, ...] = ()
    is_complete: bool = True
    """False: the time allowed was over before nothing more passed the rules."""


def explored(record: Record) -> Record:
    """The first part of every segment, so that the search stays short on long recordings."""
    share = max(EXPLORED_SAMPLES // max(len(record.segments), 1), 1500)
    return record.subset(tuple(range(len(record.segments))), share)


def search(
    record: Record, noise: Noise, *, excluded: Sequence[str] = (), report: Report = lambda _: None,
    check: Callable[[Fit, Record], None] | None = None, go_on: Callable[[], bool] = lambda: True,
) -> Found:
    """Accepted causes of the whole record: explored on a part, confirmed and completed on all of it.

    `check` sees the nominal fit first and may raise to spare the search; where `go_on` says no, no further cause is tried.
    """
    part, bare = explored(record), bare_layout(record)
    record, nominal = from_segment_to_segment(record, nominal_fit(part, noise).model, bare, noise)
    losses: tuple[Loss, ...] = ()
    raw = record.segments
    if "lost_samples" not in excluded:
        record, nominal, losses = _mended(record, nominal, bare, noise, report)
    if check is not None:
        check(nominal, record)
    report(f"nominal fit: {np.sqrt(nominal.chi2 / nominal.normal.count.sum()):.3g} times the noise")
    record, layout, setting = set_up(record, noise, nominal)
    names = [name for name in CATALOGUE if name not in excluded]
    model = nominal.model
    accepted: tuple[str, ...] = ()
    first: Screening | None = None
    regrouped: set[frozenset[str]] = set()
    if part.samples < 0.7 * record.samples:
        small = explored(record)
        start = fit(nominal.model, small, layout, noise, rounds=6)
        search_small = _Search(small, layout, replace(setting, record=small), noise, names, report, record, go_on)
        fitted, accepted, _ = search_small.run(start, ())
        first, record, regrouped = search_small.first, search_small.full, search_small.regrouped
        model = _without_curves(_completed(fitted.model, accepted, setting))
    whole = _Search(record, layout, replace(setting, record=record), noise, names, report, record, go_on)
    whole.regrouped = regrouped
    completed = fit(model, record, layout, noise)
    if not np.isfinite(completed.chi2):
        # what fitted the part runs away beyond it
        completed, accepted = fit(nominal.model, record, layout, noise), ()
    start = whole.with_new_flux_before(whole.relayout(completed))
    fitted, accepted, last = whole.run(start, accepted)
    first = first or whole.first or last
    if accepted and losses:
        unmended = _with_the_losses(whole.record, raw, fitted, whole.layout, noise)
        if unmended is not None:
            report("what looked like lost samples were the causes named since")
            losses, (record, start) = (), unmended
            whole = whole.on(record)
            fitted, accepted, last = whole.run(start, accepted)
    if accepted and "lost_samples" not in excluded:
        least = max(LEAST_BESIDE, CLASS_GUARD * loss_of_strongest(fitted))
        mended, again, more = _mended(whole.record, fitted, whole.layout, noise, report, least)
        if more:
            losses += more
            whole = whole.on(mended)
            fitted, accepted, last = whole.run(again, accepted)
    if fitted.model.has_kind(kinds.STOP):
        fitted = without_idle_loops(fitted, whole.record, whole.layout, noise)
    iron_wb, leakage_wb = largest_fluxes(whole.record, fitted.model, whole.layout)
    reached = replace(
        whole.setting, iron_flux_wb=iron_wb, leakage_flux_wb=leakage_wb, leakage_h=fitted.model.nominal[2]
    )
    return Found(
        nominal, fitted, accepted, whole.record, whole.layout, reached, last, first,
        tuple(whole.below), losses_of(fitted, accepted), losses, go_on(),
    )


def _mended(
    record: Record, current: Fit, layout: Layout, noise: Noise, report: Report, least: float = 0.0
) -> tuple[Record, Fit, tuple[Loss, ...]]:
    """Unmarked losses put right until a better fit shows no more of them; none where most of the misfit stays, or where they

    gain less than `least`. A cause that is not in the model yet, like the kinks of a dead time, can look like many small losses.
    """
    losses: tuple[Loss, ...] = ()
    mended, better = record, current
    for _ in range(MENDED):
        # from the data as they came: the better model places what the worse one misplaced
        again, seen = mend(record, better.model, layout, noise, is_first=not losses)
        if not seen:
            break
        trial = fit(better.model, again, layout, noise, rounds=6, tolerance=1.0)
        if trial.chi2 >= better.chi2:
            break
        mended, better, losses = again, trial, seen
    excess, left = (f.chi2 - f.normal.count.sum() for f in (current, better))
    if not losses or left > (1.0 - MENDED_SHARE) * excess or excess - left < least:
        return record, current, ()
    report(f"{sum(x.samples for x in losses)} unmarked lost samples put right")
    return mended, better, losses


def _with_the_losses(
    mended: Record, raw: Sequence[Segment], fitted: Fit, layout: Layout, noise: Noise
) -> tuple[Record, Fit] | None:
    """The data as they came and the fit of all accepted causes to them, where that is hardly worse: then nothing was lost."""
    segments = tuple(
        replace(r, flux_before_wb=m.flux_before_wb) for r, m in zip(raw, mended.segments, strict=True)
    )
    record = replace(mended, segments=segments)
    trial = fit(fitted.model, record, layout, noise)
    masked = float(trial.normal.count.sum() - fitted.normal.count.sum())
    gain = trial.chi2 - fitted.chi2 - 3.0 * max(masked, 0.0)
    return (record, trial) if gain < max(LEAST_BESIDE, CLASS_GUARD * loss_of_strongest(fitted)) else None


def loss_of_strongest(fitted: Fit) -> float:
    """Delta chi2 of the strongest accepted effect."""
    return max(losses_of(fitted, _effects(fitted.model)).values(), default=0.0)


def _effects(model: Model) -> tuple[str, ...]:
    """The effects that the model has numbers of."""
    return tuple(dict.fromkeys(t.effect for t in model.terms if t.effect))


def _without_curves(model: Model) -> Model:
    """Curves set back to zero: spline coefficients beyond the flux reached so far mean nothing on other data."""
    curves = (kinds.IRON_CURVE, kinds.LEAKAGE_CURVE, kinds.STOP)
    values = tuple(0.0 if t.kind in curves else v for t, v in zip(model.terms, model.values, strict=True))
    return replace(model, values=values)


def _completed(model: Model, accepted: Sequence[str], setting: Setting) -> Model:
    """The model with every number of its effects: on a part of the data some were invisible."""
    nuisance = tuple(t for t in model.terms if not t.effect)
    terms = nuisance + tuple(t for name in accepted for t in CATALOGUE[name].terms(setting))
    known = {(t.effect, t.symbol): v for t, v in zip(model.terms, model.values, strict=True)}
    return Model(model.nominal, terms, tuple(known.get((t.effect, t.symbol), t.start) for t in terms))


class _Search:
    """One record (the first part of every segment of `full`, or all of it), one dictionary; remembers what was tried."""

    def __init__(
        self, record: Record, layout: Layout, setting: Setting, noise: Noise, names: Sequence[str], report: Report,
        full: Record, go_on: Callable[[], bool],
    ) -> None:
        self.record, self.layout, self.setting, self.noise = record, layout, setting, noise
        self.names, self.report, self.full, self.go_on = names, report, full, go_on
        self.below: list[str] = []
        self.implausible: list[str] = []
        self.regrouped: set[frozenset[str]] = set()
        self.ripple_meets_tones = _meets_tones(full, setting)
        self.first: Screening | None = None
        self.rms_a = float(np.sqrt(np.mean(np.concatenate([s.currents_a.ravel() for s in record.segments]) ** 2)))

    def on(self, record: Record) -> _Search:
        """A new search of the whole of another record, with what is known of the machine so far."""
        setting = replace(self.setting, record=record)
        return _Search(record, self.layout, setting, self.noise, self.names, self.report, record, self.go_on)

    @property
    def material_chi2(self) -> float:
        """Delta chi2 of a contribution of MATERIAL_SHARE of the current's rms, or of what coarse steps may imitate."""
        count = sum(s.count for s in self.record.segments) * self.record.facts.phases
        material = (MATERIAL_SHARE * self.rms_a) ** 2 * float(np.mean(self.noise.sigma_a**-2.0))
        return float(count * max(material, STEPS_GUARD * self.noise.rounding_share))

    def threshold(self, numbers: int) -> float:
        return max(required_chi2(numbers), self.material_chi2)

    def run(self, start: Fit, accepted: tuple[str, ...]) -> tuple[Fit, tuple[str, ...], Screening]:
        current = start
        refused: set[str] = set()
        while True:
            absent = [n for n in self.names if n not in accepted]
            screening = screen(current.model, self.record, self.layout, self.noise, self.setting, absent)
            self.first = self.first or screening
            is_over = len(accepted) >= MOST_CAUSES or not self.go_on()
            step = None if is_over else self._forward(current, screening, refused)
            if step is None:
                current, accepted, _ = self._backward(current, accepted, accepted)
                other = None if is_over else self._regrouped(current, accepted)
                if other is None:
                    return current, accepted, screening
                current, accepted = other
                continue
            name, current = step
            accepted = (*accepted, name)
            self.report(f"accepted {name}: {np.sqrt(current.chi2 / current.normal.count.sum()):.4g} times the noise")
            if any(t.effect == name and t.kind == kinds.NU for t in current.model.terms):
                current = placed(current, self.record, self.layout, self.noise)
            current = self.relayout(self.with_new_flux_before(current))
            current, accepted, dropped = self._backward(current, accepted, accepted[:-1])
            refused = set(dropped)

    def _forward(self, current: Fit, screening: Screening, refused: set[str]) -> tuple[str, Fit] | None:
        """The candidate whose refit gains most, if it passes the rule."""
        ranked = [
            s for s in screening.ranked() if s.name not in refused and self.implausible.count(s.name) < IMPLAUSIBLE
        ]
        losses = losses_of(current, _effects(current.model))
        promising = [
            s for s in ranked if s.delta_chi2 > max(0.7 * s.threshold, HOPELESS * self._guard(losses, s.name))
        ]
        best = self._large_delay(current, refused)
        for score in promising[:REFITTED]:
            if best is not None and RIVAL * score.net < best[0]:
                break
            # every number of the effect: how a curve splits between stator and rotor shows only once it bends
            wanted = max(self._guard(losses, score.name), self.threshold(score.numbers))
            to_beat = wanted if best is None else max(wanted, best[0] + price(score.numbers))
            trial = fit(
                current.model.with_terms(CATALOGUE[score.name].terms(self.setting)), self.record, self.layout, self.noise,
                wanted_chi2=current.chi2 - to_beat,
            )
            gain = current.chi2 - trial.chi2
            self.report(f"  try {score.name}: promised {score.delta_chi2:.4g}, gained {gain:.4g}")
            is_plausible = self._is_plausible(trial.model, score.name)
            if not is_plausible:
                self.implausible.append(score.name)
            if gain < wanted or not is_plausible:
                if required_chi2(score.numbers) < gain:
                    self.below.append(score.name)
                continue
            net = gain - price(score.numbers)
            if best is None or net > best[0]:
                best = (net, score.name, trial)
        return None if best is None or self._is_crumb(current, best[2]) else (best[1], best[2])

    def _is_crumb(self, current: Fit, trial: Fit) -> bool:
        """Whether the best candidate takes but a crumb of a large rest: then no cause makes it, and six crumbs name nothing."""
        rest = current.chi2 - float(current.normal.count.sum())
        is_large = rest > LARGE_REST**2 * float(current.normal.count.sum())
        return is_large and current.chi2 - trial.chi2 < CRUMB * rest

    def _regrouped(self, current: Fit, accepted: tuple[str, ...]) -> tuple[Fit, tuple[str, ...]] | None:
        """The accepted linear causes exchanged for another one or two of them, where that fits clearly better: one by one

        they are taken in the order of their gain, and the first may have stood for two others.
        """
        mine = tuple(n for n in accepted if n in LINEAR)
        if not 1 <= len(mine) <= 2 or frozenset(accepted) in self.regrouped:
            return None
        self.regrouped.add(frozenset(accepted))
        bare = current.model
        for name in mine:
            bare = bare.without(name)
        without = fit(bare, self.record, self.layout, self.noise, tolerance=1.0)
        pool = [n for n in LINEAR if n in self.names]
        screening = screen(without.model, self.record, self.layout, self.noise, self.setting, pool)
        # what merely joins the accepted ones has been tried, and guarded, on the way forward
        groups = [
            g for size in (1, 2) for g in itertools.combinations(screening.scores, size)
            if not set(mine) <= set(g) and set(g) != SAME_ORDER
        ]
        promised = sorted(((joint_net(screening, g), g) for g in groups), key=lambda x: -x[0])
        wanted = current.chi2 + sum(price(screening.scores[n].numbers) for n in mine if n in screening.scores) - STATISTICAL_FLOOR
        for net, group in promised[:REGROUPED]:
            if without.chi2 - HOPEFUL * net > wanted:
                break
            numbers = sum(price(screening.scores[n].numbers) for n in group)
            terms = [t for n in group for t in CATALOGUE[n].terms(self.setting)]
            trial = fit(
                without.model.with_terms(terms), self.record, self.layout, self.noise, wanted_chi2=wanted - numbers
            )
            is_sound = all(
                self._is_plausible(trial.model, n) and loss_without(trial, n) > self.threshold(screening.scores[n].numbers)
                for n in group
            )
            self.report(f"  instead of {'+'.join(mine)} {'+'.join(group)}: gained {current.chi2 - trial.chi2:.4g} more")
            if trial.chi2 + numbers < wanted and is_sound:
                return trial, (*(n for n in accepted if n not in mine), *group)
        return None

    def _guard(self, losses: Mapping[str, float], name: str) -> float:
        """What `_guard` says; and a ripple whose side lines fall from tone to tone changes impedances as linear causes do."""
        share = TONE_TO_TONE if name == "dc_link_ripple" and self.ripple_meets_tones else 0.0
        return max(_guard(losses, name), share * max((losses.get(n, 0.0) for n in LINEAR), default=0.0))

    def _large_delay(self, current: Fit, refused: set[str]) -> tuple[float, str, Fit] | None:
        """A delay of a sample and more turns the phases so far that no first-order promise shows it: tried outright."""
        terms = CATALOGUE["sampling_delay"].terms(self.setting) if "sampling_delay" in self.names else ()
        misfit = current.chi2 / float(current.normal.count.sum())
        if any(t.effect for t in current.model.terms) or not terms or misfit < LARGE_MISFIT or "sampling_delay" in refused:
            return None
        nuisance = [t for t in current.model.terms if not t.effect]
        trials = []
        for periods in LARGE_DELAYS:
            late = periods * self.record.facts.sample_period_s
            delay = replace(terms[0], start=late)
            for start in impedance_starts(self.record, late):
                model = Model(start).with_terms([*nuisance, delay, *terms[1:]])
                trials.append(fit(model, self.record, self.layout, self.noise, tolerance=1.0))
        best = min(trials, key=lambda f: f.chi2)
        gain = current.chi2 - best.chi2
        self.report(f"  try a large sampling_delay: gained {gain:.4g}")
        if gain < self.threshold(len(terms)) or not self._is_plausible(best.model, "sampling_delay"):
            return None
        return gain - price(len(terms)), "sampling_delay", best

    def _is_plausible(self, model: Model, name: str) -> bool:
        entry = CATALOGUE[name]
        return is_plausible(name, entry.sizes(self.setting, model.of(name)), self.record.facts.current_peak_a)

    def _backward(
        self, current: Fit, accepted: tuple[str, ...], doubted: Sequence[str]
    ) -> tuple[Fit, tuple[str, ...], list[str]]:
        """Drops accepted effects that the later ones have made idle, or a trifle beside them (or turned to the wrong sign)."""
        dropped: list[str] = []
        every = losses_of(current, accepted)
        for name in doubted:
            loss, losses = every[name], {n: x for n, x in every.items() if n != name}
            numbers = sum(1 for t in current.model.terms if t.effect == name)
            wanted = max(self._guard(losses, name), self.threshold(numbers))
            # starts that came before the carried flux was right hold its place: only a fit without them tells
            holds_place = name == "remanence" and current.model.has_kind(kinds.CARRY)
            if holds_place or loss < 10.0 * wanted or not self._is_plausible(current.model, name):
                trial = fit(current.model.without(name), self.record, self.layout, self.noise)
                if trial.chi2 - current.chi2 < wanted or not self._is_plausible(current.model, name):
                    self.report(f"  dropped {name}")
                    current, accepted = trial, tuple(n for n in accepted if n != name)
                    every = losses_of(current, accepted)
                    dropped.append(name)
        return current, accepted, dropped

    def with_new_flux_before(self, current: Fit) -> Fit:
        """The flux each segment inherits, by the improved model: a wrong one would pass for remanence."""
        if not current.model.has_kind(kinds.CARRY):
            return current
        full = with_flux_before(self.full, current.model, self.layout)
        record = full.subset(tuple(range(len(full.segments))), max(s.count for s in self.record.segments))
        old = np.array([s.flux_before_wb for s in self.record.segments])
        new = np.array([s.flux_before_wb for s in record.segments])
        if not np.isfinite(new).all() or np.abs(new - old).max() < 1e-3 * np.abs(new).max():
            return current
        self.full, self.record, self.setting = full, record, replace(self.setting, record=record)
        return fit(current.model, record, self.layout, self.noise)

    def relayout(self, current: Fit) -> Fit:
        """New dictionary ranges where the improved model reaches other fluxes; curves start again from zero."""
        flux, _ = largest_fluxes(self.record, current.model, self.layout)
        fresh = with_ranges(self.layout, flux, self.record.facts.current_peak_a * current.model.nominal[2])
        iron, leak = fresh.iron_top_wb / self.layout.iron_top_wb, fresh.leak_top_wb / self.layout.leak_top_wb
        if 0.85 < iron < 1.06 and 0.8 < leak < 1.15:
            return current
        again = fit(_without_curves(current.model), self.record, fresh, self.noise)
        if not np.isfinite(again.chi2):
            return current
        self.layout, self.setting = fresh, replace(self.setting, layout=fresh, iron_flux_wb=flux)
        return again


def _meets_tones(record: Record, setting: Setting) -> bool:
    """Whether two excited tones lie the ripple's frequency (or twice it) apart, within two lines of the longest segment."""
    tones = np.array(excited_lines(record))
    apart = np.abs(np.concatenate([(tones[:, None] - tones).ravel(), (tones[:, None] + tones).ravel()]))
    width = 2.0 / max(s.count * record.facts.sample_period_s for s in record.segments)
    ripples = [m * f for name, f in setting.lines_hz.items() if name.startswith("ripple") for m in (1.0, 2.0)]
    return any(bool((np.abs(apart - f) < width).any()) for f in ripples)


def _guard(losses: Mapping[str, float], name: str) -> float:
    """What the forms of the accepted causes (with what chi2 loses without them) may leave behind for a later one to take."""
    return max((_share_left(accepted, name) * loss for accepted, loss in losses.items()), default=0.0)


def _share_left(accepted: str, name: str) -> float:
    if accepted in SHAPED:
        return GUARD
    share = 0.0 if accepted in EXACT else RIGID_GUARD
    if accepted in CATALOGUE[name].confounders or name in CATALOGUE[accepted].confounders:
        share = max(share, PAIR_GUARDS.get(frozenset({accepted, name}), CLASS_GUARD))
    return share


def is_plausible(name: str, sizes: Sizes, current_peak_a: float) -> bool:
    """The sign physics demands; and a leg error that is at half its height before a fifth of the largest current."""
    sign = CATALOGUE[name].sign
    if sign and sizes and next(iter(sizes.values()))[0] * sign <= 0:
        return False
    if "slope_lost" in sizes and sizes["slope_lost"][0] < LEAST_SLOPE_LOST:
        return False
    return "half_current_a" not in sizes or sizes["half_current_a"][0] < 0.2 * current_peak_a


def losses_of(fitted: Fit, names: Sequence[str]) -> dict[str, float]:
    """Delta chi2 of each effect, the others free (linear, at the fit)."""
    return {name: loss_without(fitted, name) for name in names}


def loss_without(current: Fit, name: str) -> float:
    """How much chi2 rises to first order when the effect's numbers go to zero and the others re-adjust."""
    gram, mine, others, inner = current.set_apart(name)
    cross = gram[np.ix_(others, mine)]
    schur = gram[np.ix_(mine, mine)] - cross.T @ inner @ cross
    value = current.model.theta[mine]
    return float(value @ schur @ value)
