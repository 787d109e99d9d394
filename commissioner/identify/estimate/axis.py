"""One test, one orientation: batch fit, observer with what the batch fit found taken off, and how far they agree."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from commissioner.compiled import writable
from commissioner.errors import DataRefused
from commissioner.identify.batch.extensions import select_model
from commissioner.identify.batch.fit import fit_segments
from commissioner.identify.batch.segments import BatchFit, Segment
from commissioner.identify.batch.slow_noise import widened
from commissioner.identify.batch.starts import from_impedance
from commissioner.identify.batch.whiteness import Whiteness, whiteness
from commissioner.identify.estimate.held_back import HeldBack, held_back
from commissioner.identify.estimate.sufficiency import require_conditioned
from commissioner.identify.estimate.turning import turning_doubt, turning_rad_per_s
from commissioner.identify.intake.alignment import more_periods
from commissioner.identify.intake.stretches import Stretch
from commissioner.identify.inverter.compensation import NOTHING, Compensation
from commissioner.identify.inverter.leg_law import LegLaw
from commissioner.identify.inverter.staircase import InverterError, Staircase, dc_levels, fit_staircase
from commissioner.identify.observer.offline import excited_part, observe
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import Nameplate, prior
from commissioner.motor.space_vector import is_aslant

Estimator = Literal["pao", "lyapunov", "nls"]
Matrix = NDArray[np.float64]
STILL = 1e-2
"""What a fit that begins at another axis' may still have to go, in standard errors."""
POORER = 1.1
"""Of the earlier axis' residual: what a fit that begins like it may leave before the axis is also fitted as if it were the first. The
model chosen for a small flux, bent as far as a larger one goes, left 1.36 of the noise."""
ASLANT_SHARE = 0.5
"""Of the current beside an aslant axis, relative to the one along it: the worst value of five motors was off by 1.5 times that."""
LARGEST_DISAGREEMENT = 3.0
"""Joint standard errors between observer and batch fit beyond which the observer is not believed."""


@dataclass(frozen=True)
class AxisResult:
    """One test: what the chosen estimator says, the batch fit beside it, and how far they are apart in standard
    errors.

    `law_error` (4,): relative, what an estimator that stands for itself misses of the least squares on the same samples,
    what an inverter may do on an axis that is `aslant`, and a shaft that turned. It is part of `covariance` (4, 4).
    """

    axis_deg: float
    parameters: InverseGamma
    covariance: Matrix
    law_error: Matrix
    batch: BatchFit
    disagreement_sigmas: float
    whiteness: Whiteness
    residual_rms_a: float
    peak_rotor_flux_wb: float
    peak_stator_flux_wb: float
    staircase: Staircase | None
    energised_s: float
    turning_rad_per_s: float = 0.0
    held_back: HeldBack | None = None


@dataclass(frozen=True)
class AxisFit:
    """One test after its batch fit; its staircase where that was needed."""

    stretches: tuple[Stretch, ...]
    staircase: Staircase | None
    batch: BatchFit
    follows_link: bool = False
    of: tuple[Stretch, ...] = ()
    """The stretches as they came, without the link's ripple."""

    def is_of(self, stretches: Sequence[Stretch]) -> bool:
        """Whether it was made from exactly these samples."""
        return len(self.of) == len(stretches) and all(map(_are_equal, self.of, stretches))

    @property
    def current_span_a(self) -> float:
        return 1.5 * max(float(np.max(np.abs(s.current_a))) for s in self.stretches)


def fit_axis(
    stretches: Sequence[Stretch],
    plate: Nameplate,
    period_s: float,
    guess: InverseGamma | None,
    leg: InverterError | None,
    like: AxisFit | None,
) -> AxisFit:
    """Batch fit of one test; `like` is an earlier axis' whose model and values it begins with, where its own staircase is
    only looked at if they do not do."""
    fit = _begun_like(like, stretches, period_s) if like is not None else None
    law, stairs = _free_law(like), None
    if fit is None or like is None or fit.batch.noise_a > POORER * like.batch.noise_a:
        stairs = _staircase(stretches)
        try:
            anew = _fitted(stretches, stairs, plate, period_s, guess, leg or (stairs.inverter if stairs else None), law)
        except DataRefused:
            if fit is None:
                raise
        else:
            fit = anew if fit is None else min(fit, anew, key=lambda f: f.batch.criterion())
    if more_periods(fit.batch.delay, period_s):
        return fit  # on the wrong rows nothing else of it counts
    try:
        require_conditioned(fit.batch)
    except DataRefused:
        if leg is not None or (stairs or _staircase(stretches)) is None:
            raise
        # what was taken for settled levels was none: begin as if there were none
        fit = _fitted(stretches, None, plate, period_s, guess, None, law)
        require_conditioned(fit.batch)
    return replace(fit, batch=widened(fit.batch, segments(fit.stretches)))


def _fitted(
    stretches: Sequence[Stretch],
    stairs: Staircase | None,
    plate: Nameplate,
    period_s: float,
    guess: InverseGamma | None,
    first_leg: InverterError | None,
    law: LegLaw | None,
) -> AxisFit:
    chosen = list(stretches)
    starts = _starts(chosen, plate, period_s, guess, first_leg)
    fit = select_model(segments(chosen), period_s, starts, first_leg, law)
    chosen, fit = _better_with_link(chosen, period_s, fit)
    return AxisFit(tuple(chosen), stairs, fit, chosen[0] is not stretches[0], tuple(stretches))


def _free_law(like: AxisFit | None) -> LegLaw | None:
    """The knots of the earlier axis' leg curve."""
    law = like.batch.model.leg if like is not None else None
    return law if isinstance(law, LegLaw) else None


def _begun_like(like: AxisFit, stretches: Sequence[Stretch], period_s: float) -> AxisFit | None:
    """The earlier axis' model fitted to this one; None where it runs away here (iron bent beyond what it was fitted for)."""
    chosen = with_link(stretches, like.batch.inverter()) if like.follows_link else list(stretches)
    batch = like.batch
    try:
        fit = fit_segments(
            segments(chosen), period_s, batch.gamma.as_inverse_gamma(), batch.model, batch.theta, tolerance=STILL
        )
    except DataRefused:
        return None
    return AxisFit(tuple(chosen), None, fit, chosen[0] is not stretches[0], tuple(stretches))


def _are_equal(a: Stretch, b: Stretch) -> bool:
    """The same samples, wherever they stand in their recordings."""
    pairs = zip(vars(a).values(), vars(b).values(), strict=True)
    return all(np.array_equal(x, y) if isinstance(x, np.ndarray) else x == y for x, y in pairs)


def with_link(stretches: Sequence[Stretch], leg: InverterError | None) -> list[Stretch]:
    """The stretches with the voltage that came out if the drive does not correct its duty cycles for the link's ripple:
    what it commands and what dead time takes of it are both in proportion to the link."""
    return [_with_link(s, leg) for s in stretches]


def _with_link(stretch: Stretch, leg: InverterError | None) -> Stretch:
    if stretch.link_ratio is None:
        return stretch
    lost = leg.on_axis(stretch.current_a, stretch.axis_deg) if leg is not None else 0.0
    ripple_v = (stretch.link_ratio - 1.0) * (stretch.voltage_v - lost)
    return replace(stretch, voltage_v=stretch.voltage_v + ripple_v)


def _better_with_link(stretches: list[Stretch], period_s: float, fit: BatchFit) -> tuple[list[Stretch], BatchFit]:
    """Whether the voltage follows the link's ripple is not on any plate: whichever leaves less unexplained."""
    if any(s.link_ratio is None for s in stretches):
        return stretches, fit
    follows = with_link(stretches, fit.inverter())
    try:
        other = fit_segments(segments(follows), period_s, fit.gamma.as_inverse_gamma(), fit.model, fit.theta)
    except DataRefused:
        return stretches, fit
    return (follows, other) if other.criterion() < fit.criterion() - 10.0 else (stretches, fit)


def segments(stretches: Sequence[Stretch]) -> list[Segment]:
    """Between segments the cage still carries what the current left behind, and iron may be remanent before the first:
    no segment is taken to start at rest."""
    return [
        Segment(
            writable(s.voltage_v), writable(s.current_a), s.axis_deg, starts_at_rest=False, kind=s.kind, weight=s.weight
        )
        for s in stretches
    ]


def judge_axis(fit: AxisFit, plate: Nameplate, period_s: float, estimator: Estimator) -> AxisResult:
    """The observer over the same stretches, what the batch fit found taken off, and what counts of the two."""
    batch, stretches = fit.batch, fit.stretches
    axis_deg = stretches[0].axis_deg
    compensation = batch.compensation(axis_deg, fit.current_span_a)
    law: Literal["fast", "lyapunov"] = "lyapunov" if estimator == "lyapunov" else "fast"
    centred = [replace(s, current_a=s.current_a - offset) for s, offset in zip(stretches, batch.offsets_a, strict=True)]
    start = batch.gamma.as_inverse_gamma()
    seen, observer = observe(_tones(centred, period_s), plate, prior(plate), period_s, compensation, law, start)
    flux = batch.peak_flux_wb
    at_flux, covariance = batch.inverse_gamma_at(flux)
    pao = carry_over(seen, start, at_flux)
    own = np.square(observer.std) * np.square(np.array(at_flux.as_tuple()) / seen.as_tuple())
    disagreement = _disagreement(pao, at_flux, own + np.diag(covariance))
    values, least_squares = np.array(pao.as_tuple()), np.array(at_flux.as_tuple())
    missed = values / least_squares - 1.0 if estimator == "lyapunov" else np.zeros(4)
    aslant = aslant_doubt(stretches, batch)
    turning = 0.0 if aslant else turning_rad_per_s(stretches, at_flux, period_s)  # a current has one reason
    law_error = np.hypot(missed, math.hypot(aslant, turning_doubt(turning, at_flux)))
    of_batch = estimator == "nls" or batch.model.with_split  # the observer has its iron at the stator
    return AxisResult(
        axis_deg=axis_deg,
        parameters=_judged(pao, batch, at_flux, own, covariance, disagreement, estimator),
        covariance=covariance + np.diag(np.square(law_error * least_squares)),
        law_error=law_error,
        batch=batch,
        disagreement_sigmas=disagreement,
        whiteness=batch.whiteness() if of_batch else whiteness(observer.residuals),
        residual_rms_a=batch.noise_a if of_batch else observer.residual_rms_a,
        peak_rotor_flux_wb=observer.peak_rotor_flux_wb,
        peak_stator_flux_wb=flux,
        staircase=fit.staircase,
        energised_s=sum(s.voltage_v.size for s in stretches) * period_s,
        turning_rad_per_s=turning,
        held_back=held_back(segments(stretches), batch, at_flux),
    )


def do_legs_drive_beside(axis_deg: float, batch: BatchFit) -> bool:
    """Whether what the inverter's legs lose drives a current beside the axis: legs that lose something, an axis along which they do not lose
    alike."""
    return is_aslant(axis_deg) and batch.model.leg is not None


def aslant_doubt(stretches: Sequence[Stretch], batch: BatchFit) -> float:
    """Relative, of every value, where they do: the fit knows the losses of a current along the axis only."""
    if not do_legs_drive_beside(stretches[0].axis_deg, batch):
        return 0.0
    along_a = np.concatenate([s.current_a for s in stretches])
    return ASLANT_SHARE * float(np.std(np.concatenate([s.cross_a for s in stretches])) / np.std(along_a))


def _tones(stretches: Sequence[Stretch], period_s: float) -> list[Stretch]:
    """DC levels do not excite persistently: the recursion is for tones, the batch fit takes the staircase along."""
    return [excited_part(s, period_s) for s in stretches if s.kind != "staircase"] or list(stretches)


def _starts(
    stretches: Sequence[Stretch],
    plate: Nameplate,
    period_s: float,
    guess: InverseGamma | None,
    leg: InverterError | None,
) -> list[InverseGamma]:
    """Machines to begin with: what the online observer finds, and what the impedance at the tones says."""
    box, compensation = prior(plate), NOTHING
    if leg is not None:
        span_a = 1.5 * max(float(np.max(np.abs(s.current_a))) for s in stretches)
        compensation = Compensation(leg.on_axis(np.linspace(0.0, span_a, 1025), stretches[0].axis_deg), span_a)
    tones = _tones(stretches, period_s)
    online = observe(tones, plate, box, period_s, compensation, "fast", guess)[0]
    offline = from_impedance(tones, period_s, box, leg)
    return [online] if offline is None else [online, offline]


def _staircase(stretches: Sequence[Stretch]) -> Staircase | None:
    """Fit the DC levels of this test's staircase stretches, or None where there are none to fit."""
    levels = [level for s in stretches if s.kind == "staircase" for level in dc_levels(s.voltage_v, s.current_a)]
    try:
        return fit_staircase(levels, stretches[0].axis_deg) if levels else None
    except DataRefused:
        return None


def _disagreement(pao: InverseGamma, batch: InverseGamma, variance: Matrix) -> float:
    """The largest difference of the two estimates in joint standard errors."""
    return float(np.max(np.abs(np.array(pao.as_tuple()) - np.array(batch.as_tuple())) / np.sqrt(variance)))


def _judged(
    pao: InverseGamma,
    batch: BatchFit,
    at_flux: InverseGamma,
    own: Matrix,
    covariance: Matrix,
    disagreement: float,
    estimator: Estimator,
) -> InverseGamma:
    """What counts. The gradient law stands for itself. The fast law sees the tones only, an inverter's loss at the ends of
    a period only, and has no sensitivity to saturation's feedback: behind a linear machine it and the batch fit count by
    their information, else it is the check and the batch fit counts."""
    if estimator == "lyapunov":
        return pao
    is_linear = batch.model.leg is None and not batch.model.extra_powers
    if estimator == "nls" or not is_linear or disagreement > LARGEST_DISAGREEMENT:
        return at_flux
    weight = 1.0 / own / (1.0 / own + 1.0 / np.diag(covariance))
    values = weight * np.array(pao.as_tuple()) + (1.0 - weight) * np.array(at_flux.as_tuple())
    return InverseGamma(*map(float, values))


def carry_over(seen: InverseGamma, linear: InverseGamma, at_flux: InverseGamma) -> InverseGamma:
    """The observer's unsaturated machine taken to the flux level along the batch fit's iron: parameter by parameter."""
    ratios = zip(seen.as_tuple(), linear.as_tuple(), at_flux.as_tuple(), strict=True)
    return InverseGamma(*(s * a / b for s, b, a in ratios))
