"""From the nominal model to the accepted causes: forward steps, backward deletion, swaps, alternatives.

Each accepted effect enters with its full shape dictionary (splines, stop operators, rotor branches), so a later step
never has to mend the shape of an earlier one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from commissioner.diagnose import kinds
from commissioner.diagnose.channels import add_channels
from commissioner.diagnose.effects import CATALOGUE, Setting
from commissioner.diagnose.effects.effect import Sizes
from commissioner.diagnose.fit import Fit, fit
from commissioner.diagnose.lost import Loss, mend
from commissioner.diagnose.noise import Noise
from commissioner.diagnose.plant import Layout, Model, Term, even_vectors, odd_vectors, predict
from commissioner.diagnose.record import Record
from commissioner.diagnose.screen import STATISTICAL_FLOOR, STATISTICAL_PER_NUMBER, Screening, screen

MOST_CAUSES = 6
MATERIAL_SHARE = 1e-4
"""A cause must move the current by this share of its rms (-80 dB), else it is listed as below materiality."""
REFITTED = 4
RIVAL = 2.5
"""A candidate is refitted only if this multiple of its promise reaches the best gain so far."""
GUARD = 1e-3
"""A later cause must gain this share of what the strongest accepted nonlinearity gains, else it may be its shape."""
CLASS_GUARD = 1e-2
CLASS_MATES = {
    "resistance_anisotropy": "inductance_anisotropy", "inductance_anisotropy": "resistance_anisotropy",
    "iron_loss": "rotor_skin_effect", "rotor_skin_effect": "iron_loss",
}
"""Of two causes of one form (a tensor, a second rotor path) the weaker must gain this share of the stronger, else it may
refine the other's shape."""
SHAPED = frozenset({"dead_time", "device_drop", "magnetizing_saturation", "magnetic_hysteresis", "leakage_saturation"})
EXPLORED_SAMPLES = 45_000
CORNERS_HZ = (30.0, 70.0, 150.0, 330.0, 700.0)
MOST_LEAK_RATIO = 0.15
STOP_SHARES = (0.02, 0.06, 0.18, 0.5)

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


def layout_for(record: Record, model: Model) -> tuple[Layout, float]:
    """Dictionaries scaled to the currents and fluxes the model reaches on this record; and the largest iron flux."""
    flux = max(
        float(np.hypot(*predict(model, record, k, _bare_layout()).iron_flux_wb).max())
        for k in range(len(record.segments))
    )
    peak = record.facts.current_peak_a
    knee = 0.004 * peak
    layout = Layout(
        legs_top=float(np.arcsinh(0.6 * peak / knee)), legs_knee_a=knee, legs_vectors=odd_vectors(16),
        iron_top_wb=1.08 * flux, iron_vectors=even_vectors(10),
        leak_top_wb=1.2 * peak * model.nominal[2], leak_vectors=even_vectors(6),
        stop_radius_wb=np.array(STOP_SHARES) * flux,
        branch_time_s=1.0 / (2.0 * np.pi * np.array(CORNERS_HZ)),
        nonlinearity_scale_a=2.0 * record.facts.rated_current_peak_a,
        legs_slack_v=0.003 * peak * model.nominal[0], leak_ratio=min(model.nominal[2] / model.nominal[3], MOST_LEAK_RATIO),
    )
    return layout, flux


def _bare_layout() -> Layout:
    return Layout(
        1.0, 1.0, odd_vectors(4), 1.0, even_vectors(2), 1.0, even_vectors(2), np.array([1.0]), np.array([1.0]), 1.0
    )


def nominal_fit(record: Record, noise: Noise) -> Fit:
    """The four-parameter output-error fit, from the best of three starts."""
    fits = [fit(Model(start), record, _bare_layout(), noise, rounds=15, tolerance=1.0) for start in _starts(record)]
    return min(fits, key=lambda f: f.chi2)


def _starts(record: Record) -> list[tuple[float, float, float, float]]:
    """From the command's spectrum: resistance at the lowest line, reactance at the highest; two spreads of L_M."""
    segment = max(record.segments, key=lambda s: float(np.std(s.voltage_axis_v)))
    n = segment.count
    window = np.hanning(n)
    volts = np.fft.rfft(segment.voltage_axis_v * window)
    amps = np.fft.rfft(np.where(segment.is_good, segment.axis_current_a, 0.0) * window)
    frequency = np.fft.rfftfreq(n, record.facts.sample_period_s)
    strong = np.flatnonzero(np.abs(volts) > 0.02 * np.abs(volts[1:]).max())
    strong = strong[strong > 0]
    impedance = volts[strong] / amps[strong]
    high, low = impedance[-1], impedance[0]
    w_high, w_low = 2 * np.pi * frequency[strong[-1]], 2 * np.pi * frequency[strong[0]]
    leakage = max(abs(high.imag) / w_high, 1e-5)
    total = max(abs(high.real), 1e-3)
    stator = float(np.clip(abs(low.real), 0.2 * total, 0.9 * total))
    rotor = max(total - stator, 0.2 * total)
    magnetizing = max(abs(low.imag) / w_low, 4.0 * leakage)
    return [
        (stator, rotor, leakage, magnetizing),
        (0.55 * total, 0.45 * total, leakage, 12.0 * leakage),
    ]


CARRY = Term("", "flux_carried_over", "1", kinds.CARRY, 0, 0.01, 0.0, 1.0)
"""Nuisance of the nominal model: how much of the rotor flux outlives the pause between two segments."""


def starts_of(record: Record) -> list[Term]:
    """Nuisances of the nominal model: stator and rotor flux at the start of every stretch that follows a hole."""
    return [
        Term("", f"start_{c}_{s.uid}", "Wb", kinds.INITIAL_FLUX, 2 + c, 0.01, segment=s.uid)
        for s in record.segments if not s.starts_at_rest for c in range(4)
    ]


def with_flux_before(record: Record, model: Model, layout: Layout) -> Record:
    """Every segment told the rotor flux at which the one before it ended (same file), by the model."""
    before: tuple[float, float] = (0.0, 0.0)
    out, file = [], -1
    for k, segment in enumerate(record.segments):
        started = segment.file == file
        out.append(replace(segment, flux_before_wb=before if started and segment.starts_at_rest else (0.0, 0.0)))
        before, file = predict(model, record, k, layout).last_rotor_flux_wb, segment.file
    return replace(record, segments=tuple(out))


def set_up(record: Record, noise: Noise, nominal: Fit) -> tuple[Record, Layout, Setting]:
    layout, flux = layout_for(record, nominal.model)
    record, lines = add_channels(record, nominal.model, layout)
    return record, layout, Setting(record, layout, flux, lines)


def explored(record: Record) -> Record:
    """The first part of every segment, so that the search stays short on long recordings."""
    share = max(EXPLORED_SAMPLES // max(len(record.segments), 1), 1500)
    return record.subset(tuple(range(len(record.segments))), share)


def search(
    record: Record, noise: Noise, *, excluded: Sequence[str] = (), report: Report = lambda _: None,
    check: Callable[[Fit, Record], None] | None = None,
) -> Found:
    """Accepted causes of the whole record: explored on a part, confirmed and completed on all of it.

    `check` sees the nominal fit first and may raise to spare the search.
    """
    part = explored(record)
    quick = nominal_fit(part, noise)
    nominal = fit(quick.model, record, _bare_layout(), noise, rounds=6, tolerance=1.0)
    unknown_starts = starts_of(record)
    if unknown_starts:
        nominal = fit(nominal.model.with_terms(unknown_starts), record, _bare_layout(), noise, rounds=8, tolerance=1.0)
    losses: tuple[Loss, ...] = ()
    if "lost_samples" not in excluded:
        record, losses = mend(record, nominal.model, _bare_layout(), noise)
    if losses:
        report(f"{sum(x.samples for x in losses)} unmarked lost samples put right")
        nominal = fit(nominal.model, record, _bare_layout(), noise, rounds=6, tolerance=1.0)
    if len(record.segments) > 1:
        record = with_flux_before(record, nominal.model, _bare_layout())
        nominal = fit(nominal.model.with_terms([CARRY]), record, _bare_layout(), noise, rounds=6, tolerance=1.0)
    if check is not None:
        check(nominal, record)
    report(f"nominal fit: {np.sqrt(nominal.chi2 / nominal.normal.count.sum()):.3g} times the noise")
    record, layout, setting = set_up(record, noise, nominal)
    names = [name for name in CATALOGUE if name not in excluded]
    model, accepted, current_setting = nominal.model, (), setting
    first: Screening | None = None
    if part.samples < 0.7 * record.samples:
        share = max(s.count for s in part.segments)
        small = record.subset(tuple(range(len(record.segments))), share)
        small_setting = replace(setting, record=small)
        start = fit(nominal.model, small, layout, noise, rounds=6)
        search_small = _Search(small, layout, small_setting, noise, names, report)
        fitted, accepted, _ = search_small.run(start, ())
        first = search_small.first
        model = _without_curves(_completed(fitted.model, accepted, setting))
    whole = _Search(record, layout, current_setting, noise, names, report)
    start = whole.relayout(fit(model, record, layout, noise))
    fitted, accepted, last = whole.run(start, accepted)
    first = whole.first if first is None else first
    return Found(
        nominal, fitted, accepted, record, whole.layout, whole.setting, last, first,
        tuple(whole.below), whole.gains(fitted, accepted), losses,
    )


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
    """One record, one dictionary; remembers what was tried."""

    def __init__(
        self, record: Record, layout: Layout, setting: Setting, noise: Noise, names: Sequence[str], report: Report
    ) -> None:
        self.record, self.layout, self.setting, self.noise = record, layout, setting, noise
        self.names, self.report = names, report
        self.below: list[str] = []
        self.first: Screening | None = None
        self.rms_a = float(np.sqrt(np.mean(np.concatenate([s.currents_a.ravel() for s in record.segments]) ** 2)))

    @property
    def material_chi2(self) -> float:
        """Delta chi2 of a contribution of MATERIAL_SHARE of the current's rms."""
        count = sum(s.count for s in self.record.segments) * self.record.facts.phases
        return float(count * (MATERIAL_SHARE * self.rms_a) ** 2 * np.mean(self.noise.sigma_a**-2.0))

    def threshold(self, numbers: int) -> float:
        return max(STATISTICAL_FLOOR + STATISTICAL_PER_NUMBER * numbers, self.material_chi2)

    def run(self, start: Fit, accepted: tuple[str, ...]) -> tuple[Fit, tuple[str, ...], Screening]:
        current = start
        refused: set[str] = set()
        while True:
            absent = [n for n in self.names if n not in accepted]
            screening = screen(current.model, self.record, self.layout, self.noise, self.setting, absent)
            self.first = self.first or screening
            if len(accepted) >= MOST_CAUSES:
                return current, accepted, screening
            step = self._forward(current, screening, refused)
            if step is None:
                return current, accepted, screening
            name, current = step
            accepted = (*accepted, name)
            self.report(f"accepted {name}: {np.sqrt(current.chi2 / current.normal.count.sum()):.4g} times the noise")
            current = self.relayout(current)
            current, accepted, dropped = self._backward(current, accepted)
            refused = set(dropped)

    def _forward(self, current: Fit, screening: Screening, refused: set[str]) -> tuple[str, Fit] | None:
        """The candidate whose refit gains most, if it passes the rule."""
        ranked = [s for s in screening.ranked() if s.name not in refused]
        promising = [s for s in ranked if s.delta_chi2 > 0.7 * s.threshold]
        best: tuple[float, str, Fit] | None = None
        present = {t.effect for t in current.model.terms} & SHAPED
        guard = GUARD * max((loss_without(current, name) for name in present), default=0.0)
        for score in promising[:REFITTED]:
            if best is not None and RIVAL * score.net < best[0]:
                break
            # every number of the effect: how a curve splits between stator and rotor shows only once it bends
            trial = fit(
                current.model.with_terms(CATALOGUE[score.name].terms(self.setting)), self.record, self.layout, self.noise
            )
            gain = current.chi2 - trial.chi2
            self.report(f"  try {score.name}: promised {score.delta_chi2:.4g}, gained {gain:.4g}")
            mate = CLASS_MATES.get(score.name, "")
            own_guard = CLASS_GUARD * loss_without(current, mate) if mate in {t.effect for t in current.model.terms} else 0.0
            if gain < max(guard, own_guard, self.threshold(score.numbers)) or not self._is_plausible(trial.model, score.name):
                if STATISTICAL_FLOOR + STATISTICAL_PER_NUMBER * score.numbers < gain:
                    self.below.append(score.name)
                continue
            net = gain - STATISTICAL_PER_NUMBER * score.numbers
            if best is None or net > best[0]:
                best = (net, score.name, trial)
        return None if best is None else (best[1], best[2])

    def _is_plausible(self, model: Model, name: str) -> bool:
        entry = CATALOGUE[name]
        return is_plausible(name, entry.sizes(self.setting, model.of(name)), self.record.facts.current_peak_a)

    def _backward(self, current: Fit, accepted: tuple[str, ...]) -> tuple[Fit, tuple[str, ...], list[str]]:
        """Drops accepted effects that the later ones have made idle (or turned to the wrong sign)."""
        dropped: list[str] = []
        for name in accepted[:-1]:
            loss = loss_without(current, name)
            numbers = sum(1 for t in current.model.terms if t.effect == name)
            if loss < 10.0 * self.threshold(numbers) or not self._is_plausible(current.model, name):
                trial = fit(current.model.without(name), self.record, self.layout, self.noise)
                if trial.chi2 - current.chi2 < self.threshold(numbers) or not self._is_plausible(current.model, name):
                    self.report(f"  dropped {name}")
                    current, accepted = trial, tuple(n for n in accepted if n != name)
                    dropped.append(name)
        return current, accepted, dropped

    def relayout(self, current: Fit) -> Fit:
        """New dictionary ranges where the improved model reaches other fluxes; curves start again from zero."""
        flux = max(
            float(np.hypot(*predict(current.model, self.record, k, self.layout).iron_flux_wb).max())
            for k in range(len(self.record.segments))
        )
        leak = 1.2 * self.record.facts.current_peak_a * current.model.nominal[2]
        if 0.85 < 1.08 * flux / self.layout.iron_top_wb < 1.06 and 0.8 < leak / self.layout.leak_top_wb < 1.15:
            return current
        self.layout = replace(
            self.layout, iron_top_wb=1.08 * flux, leak_top_wb=leak, stop_radius_wb=np.array(STOP_SHARES) * flux
        )
        self.setting = replace(self.setting, layout=self.layout, iron_flux_wb=flux)
        return fit(_without_curves(current.model), self.record, self.layout, self.noise)

    def gains(self, fitted: Fit, accepted: Sequence[str]) -> dict[str, float]:
        """Delta chi2 of each accepted effect, the others free (linear, at the fit)."""
        return {name: loss_without(fitted, name) for name in accepted}


def is_plausible(name: str, sizes: Sizes, current_peak_a: float) -> bool:
    """The sign physics demands; and a leg error that is at half its height before a fifth of the largest current."""
    sign = CATALOGUE[name].sign
    if sign and sizes and next(iter(sizes.values()))[0] * sign <= 0:
        return False
    return "half_current_a" not in sizes or sizes["half_current_a"][0] < 0.2 * current_peak_a


def loss_without(current: Fit, name: str) -> float:
    """How much chi2 rises to first order when the effect's numbers go to zero and the others re-adjust."""
    terms = current.model.terms
    mine = np.array([4 + k for k, t in enumerate(terms) if t.effect == name])
    others = np.array([k for k in range(4 + len(terms)) if k not in set(mine.tolist())])
    gram = current.normal.total_gram
    inner = gram[np.ix_(others, others)]
    cross = gram[np.ix_(others, mine)]
    schur = gram[np.ix_(mine, mine)] - cross.T @ np.linalg.pinv(inner, rcond=1e-12, hermitian=True) @ cross
    value = current.model.theta[mine]
    return float(value @ schur @ value)
