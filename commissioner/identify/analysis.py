"""From a standstill recording to the motor's parameters: the same code offline and for the final judgement of a live
run.

Per axis: staircase -> R_s and inverter error; online observer over every stretch -> start values; batch fit with the
extensions the data ask for (delay, inverter error, saturating iron). All axes share one inverter. Observer once more
with what the batch fit found taken off; agreement and whiteness. Then the axes are combined.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from commissioner.errors import DataRefused, UsageError
from commissioner.identify.batch.fit import fit_segments
from commissioner.identify.batch.segments import BatchFit, extended
from commissioner.identify.batch.starts import periods_late
from commissioner.identify.batch.whiteness import holds_noise
from commissioner.identify.estimate.axes import AxisEstimate, Combined, combine
from commissioner.identify.estimate.axis import (
    LARGEST_DISAGREEMENT,
    AxisFit,
    AxisResult,
    Estimator,
    Matrix,
    carry_over,
    do_legs_drive_beside,
    fit_axis,
    judge_axis,
    segments,
)
from commissioner.identify.estimate.leg_family import one_inverter, pairs_of
from commissioner.identify.estimate.leg_refit import with_known_law
from commissioner.identify.estimate.sufficiency import (
    require_amperes,
    require_positive,
    require_tones,
    require_volts,
)
from commissioner.identify.intake.alignment import (
    FARTHEST,
    TimeShift,
    beyond_bound,
    more_periods,
    require_near,
    rows_off,
    shifted,
)
from commissioner.identify.intake.audit import Audit, audit
from commissioner.identify.intake.dc_link import LinkCourse, link_course
from commissioner.identify.intake.plate import nameplate_from
from commissioner.identify.intake.stretches import Stretch
from commissioner.identify.inverter.staircase import InverterError
from commissioner.motor.circuit import EQUAL_LEAKAGE, InverseGamma, TModel, to_t_model
from commissioner.motor.nameplate import Nameplate, RatedFlux, prior, rated_flux
from commissioner.motor.space_vector import LEGS_ALIKE_DEG
from commissioner.records import StandstillRecording

COPPER_ZERO_DEGC = -234.5
LEVEL, NEAR = 0.75, 0.08
"""Peak stator flux, of the rated one, that L_M is told for wherever the tests came as near to it as the second says: by how much
they miss it differs from run to run, and saturating iron would make that a difference of L_M."""
BEYOND_DOUBT = 0.25
"""Of what L_M changes by between the flux that a test reached and the one it is told for: its standard error there."""
MOST_SHIFTS = 8
LESS = 0.98
"""Of the residual, that other rows must leave where the delay does not say that they are the right ones."""
TRIAL_STEPS = 3
"""For the delay of a fit that needed none: from its end it is two steps away."""


@dataclass(frozen=True)
class Identification:
    """The whole answer. Parameters hold for the peak stator flux `holds_for_flux_wb` (secant values of saturating
    iron)."""

    estimator: Estimator
    parameters: InverseGamma
    covariance: Matrix
    holds_for_flux_wb: float
    t_model: TModel
    axes: tuple[AxisResult, ...]
    combined: Combined
    rated_flux: RatedFlux
    inverter: InverterError | None
    time_shift: TimeShift
    magnetizing_curve: tuple[tuple[float, float, float], ...]
    gaps: int
    lost_samples: int
    duration_s: float
    stator_resistance_20degc_ohm: tuple[float, float] | None
    remarks: tuple[str, ...]
    fits: tuple[AxisFit, ...] = ()
    """Of the tests, each by itself."""
    link: LinkCourse | None = None

    @property
    def delay_s(self) -> tuple[float, float]:
        """How far the currents lie behind the voltage, and the standard error."""
        return self.time_shift.value_s, self.time_shift.std_s

    @property
    def std(self) -> tuple[float, float, float, float]:
        a, b, c, d = np.sqrt(np.diag(self.covariance))
        return float(a), float(b), float(c), float(d)


def identify(
    recording: StandstillRecording,
    nameplate: Nameplate | None = None,
    estimator: Estimator = "pao",
    inverter: InverterError | None = None,
    start: InverseGamma | None = None,
    winding_temperature_degc: float | None = None,
    assumption: str = EQUAL_LEAKAGE,
    is_final: bool = True,
    earlier: Identification | None = None,
) -> Identification:
    """Everything a standstill recording says about the motor.

    `nameplate` defaults to the recording's metadata. `inverter` (from an earlier staircase) and `start` only give the
    search a start. `is_final` is False for a look that only designs the next test: the inverter's law is not fitted to the
    samples then. `earlier`: an identification of a part of these samples, begun without a start; its fits of tests that
    have the same samples are not made again. Raises DataRefused where the data cannot carry an answer, UsageError for an unknown estimator.
    """
    if estimator not in ("pao", "lyapunov", "nls"):
        raise UsageError(
            f"there is no estimator {estimator!r}",
            step="choose estimator",
            value=estimator,
            limit="pao, lyapunov or nls",
            remedy="give one of these names",
        )
    plate = nameplate or nameplate_from(recording.metadata)
    examined = audit(recording)
    require_amperes(examined, plate)
    require_volts(examined, plate)
    period_s = recording.sample_period_s
    require_tones(examined, period_s)
    tests = _by_test(examined)
    first, *others = tests
    link = link_course(recording, tests)

    def one(stretches: Sequence[Stretch]) -> AxisFit:
        done = next((f for f in earlier.fits if f.is_of(stretches)), None) if earlier else None
        return done or fit_axis(stretches, plate, period_s, start, inverter, None)

    fit, late = _aligned(first, lambda: rows_off(periods_late(first, period_s, prior(plate))), one)
    fits = [fit]
    for stretches in others:
        fits.append(fit_axis(shifted(stretches, late), plate, period_s, start, inverter, fit))
    as_fitted = tuple(fits)
    free = [f.batch for f in fits]
    pairs = pairs_of(free)
    legs = one_inverter(free, pairs)
    if is_final:
        legs = with_known_law(free, [segments(f.stretches) for f in fits], legs, pairs)
    fits = [replace(f, batch=batch) for f, batch in zip(fits, legs, strict=True)]
    results = [judge_axis(f, plate, period_s, estimator) for f in fits]
    shift = (
        _time_shift([results[0].batch, free[0]], as_fitted[0], late, period_s)
        if is_final
        else _as_fitted(results[0].batch, late, period_s)
    )
    require_near(shift)
    temperature = winding_temperature_degc or _temperature(recording)
    found = _summary(results, examined, plate, estimator, temperature, assumption, shift)
    of_link = (link.remark,) if link is not None and link.remark else ()
    return replace(found, fits=as_fitted, link=link, remarks=(*found.remarks, *of_link))


def _aligned(
    stretches: Sequence[Stretch], coarse: Callable[[], int], fit: Callable[[Sequence[Stretch]], AxisFit]
) -> tuple[AxisFit, int]:
    """The first test's fit with its currents on the rows of their voltages, and by how many rows they were late.

    A fit whose delay stays between its bounds needs no other rows. Else a coarse look says where to go on, if it looks the same
    way: alone it is not believed, an impedance that the inverter's loss has turned said 8 periods of sound tests. A delay that
    lies at its bound with a standard error as large may be any: other rows count where they leave less.
    """
    late, best, is_sure = 0, None, True
    for _ in range(MOST_SHIFTS):
        try:
            found = fit(shifted(stretches, late))
        except DataRefused:
            if best is not None and not is_sure:
                return best
            if late or not (late := coarse()):
                raise
            continue
        if best is not None and not is_sure and found.batch.noise_a > LESS * best[0].batch.noise_a:
            return best
        period_s = found.batch.sample_period_s
        more = more_periods(found.batch.delay, period_s)
        is_sure = more != 0
        if not (more := more or beyond_bound(found.batch.delay, period_s)):
            return found, late
        seen = coarse() if not late else 0
        best = found, late
        late += seen if seen * more > 0 and abs(seen) <= FARTHEST else more
        if abs(late) > FARTHEST:
            break
    require_near(TimeShift(late, late * period_s, 0.0, period_s))
    assert best is not None, "a refusal is raised, or a fit was made"
    return best


def _as_fitted(batch: BatchFit, late: int, period_s: float) -> TimeShift:
    return TimeShift(late, late * period_s + batch.delay.value, batch.delay.std, period_s)


def _time_shift(from_any: Sequence[BatchFit], of_test: AxisFit, late: int, period_s: float) -> TimeShift:
    """How far the currents lie behind the voltage; where no fit asked for a delay, what one with it says of none, begun at the first
    of `from_any` that can be simulated: values that a common loss has moved are no fit's, and may run away."""
    if from_any[0].model.with_delay:
        return _as_fitted(from_any[0], late, period_s)
    parts = segments(of_test.stretches)
    for batch in from_any:
        with_delay = replace(batch.model, with_delay=True)
        start, theta = batch.gamma.as_inverse_gamma(), extended(batch, with_delay)
        with suppress(DataRefused):
            trial = fit_segments(parts, period_s, start, with_delay, theta, TRIAL_STEPS, own_start=batch.own)
            return _as_fitted(trial, late, period_s)
    return _as_fitted(from_any[-1], late, period_s)


def _temperature(recording: StandstillRecording) -> float | None:
    value = recording.metadata.get("winding_temperature_degc")
    return float(value) if isinstance(value, float | int) else None


def _by_test(examined: Audit) -> list[list[Stretch]]:
    """Stretches of one orientation in a row belong to one test; a return to it later is a test of its own."""
    tests: list[list[Stretch]] = []
    for stretch in examined.stretches:
        if not stretch.is_excited:
            continue
        if tests and math.isclose(tests[-1][-1].axis_deg, stretch.axis_deg):
            tests[-1].append(stretch)
        else:
            tests.append([stretch])
    return tests


def _summary(
    results: Sequence[AxisResult],
    examined: Audit,
    plate: Nameplate,
    estimator: Estimator,
    temperature: float | None,
    assumption: str,
    shift: TimeShift,
) -> Identification:
    rated = rated_flux(plate, float(np.mean([r.parameters.stator_resistance_ohm for r in results])))
    reached = min(rated.stator_peak_wb, *(r.peak_stator_flux_wb for r in results))
    flux = told_level_wb(reached, rated.stator_peak_wb)
    at_flux = [axis_at(r, flux) for r in results]
    combined = combine(at_flux, np.mean([r.batch.inverter_covariance_at(flux) for r in results], axis=0))
    first = min(results, key=lambda r: float(np.trace(r.covariance)))
    curve: Sequence[tuple[float, float, float]] = ()
    if first.batch.model.extra_powers:
        curve = [(float(a), float(b), float(c)) for a, b, c in zip(*first.batch.magnetizing_curve(), strict=True)]
    r_s = combined.parameters.stator_resistance_ohm
    at_20 = None
    if temperature is not None:
        factor = (20.0 - COPPER_ZERO_DEGC) / (temperature - COPPER_ZERO_DEGC)
        at_20 = (r_s * factor, math.sqrt(combined.covariance[0, 0]) * factor)
    return Identification(
        estimator=estimator,
        parameters=combined.parameters,
        covariance=combined.covariance,
        holds_for_flux_wb=flux,
        t_model=to_t_model(combined.parameters, combined.covariance, assumption),
        axes=tuple(results),
        combined=combined,
        rated_flux=rated,
        inverter=first.batch.inverter(),
        time_shift=shift,
        magnetizing_curve=tuple(curve),
        gaps=examined.gaps,
        lost_samples=examined.lost_samples,
        duration_s=examined.duration_s,
        stator_resistance_20degc_ohm=at_20,
        remarks=(
            *examined.remarks,
            *([shift.sentence] if shift.is_significant else []),
            *combined.remarks,
            *_remarks(results, rated, flux, reached),
        ),
    )


def told_level_wb(reached_wb: float, rated_wb: float) -> float:
    """The peak stator flux that the parameters are told for, where all tests reached `reached_wb`."""
    level_wb = LEVEL * rated_wb
    return level_wb if abs(reached_wb - level_wb) <= NEAR * level_wb else reached_wb


def axis_at(result: AxisResult, flux_wb: float) -> AxisEstimate:
    """An axis' values at a flux all axes reached, or nearly: only there can saturating iron be compared (DataRefused where they
    make no machine there)."""
    machine, covariance = result.batch.inverse_gamma_at(flux_wb)
    own = result.batch.inverse_gamma_at(result.peak_stator_flux_wb)[0]
    machine = require_positive(carry_over(result.parameters, own, machine), flux_wb)
    law_std = result.law_error * np.array(machine.as_tuple())
    if flux_wb > result.peak_stator_flux_wb:
        beyond_h = machine.magnetizing_inductance_h - result.parameters.magnetizing_inductance_h
        law_std[3] = math.hypot(law_std[3], BEYOND_DOUBT * beyond_h)
    return AxisEstimate(result.axis_deg, machine, covariance + np.diag(np.square(law_std)))


def _remarks(results: Sequence[AxisResult], rated: RatedFlux, flux_wb: float, reached_wb: float) -> list[str]:
    remarks = [
        f"axis {r.axis_deg:g} deg is no multiple of {LEGS_ALIKE_DEG:g} deg: what the inverter's legs lose drives a current beside it; standard "
        "errors are widened for it, `commissioner diagnose` knows it"
        for r in results
        if do_legs_drive_beside(r.axis_deg, r.batch)
    ]
    for result in results:
        if result.held_back is not None:
            remarks.append(f"axis {result.axis_deg:g} deg: {result.held_back.sentence}")
        if result.turning_rad_per_s:
            remarks.append(
                f"axis {result.axis_deg:g} deg: the shaft turned, at {result.turning_rad_per_s:.2g} rad/s (electrical) or more; standard errors "
                "are widened for it"
            )
        if result.disagreement_sigmas > LARGEST_DISAGREEMENT:
            remarks.append(
                f"axis {result.axis_deg:g} deg: observer and batch fit differ by {result.disagreement_sigmas:.1f} "
                "standard errors: the batch fit counts"
            )
        if not result.whiteness.is_white:
            statistic, limit = result.whiteness.statistic, result.whiteness.limit
            shown = f"{statistic:.{0 if round(statistic) > limit else 2}f}"  # 20.13 is no 20 beside a limit of 20.1
            remarks.append(
                f"axis {result.axis_deg:g} deg: the residual is not white ({shown}, limit {limit}); standard errors are widened for it"
            )
    if any(not (r.whiteness.is_white or holds_noise(r.batch.residuals, r.residual_rms_a)) for r in results):
        remarks.append(
            "the currents hold no noise, as no sensor gives them: of such a played recording the residual is what its solver and its "
            "digits leave, and is never white; `commissioner simulate --noise-a` adds a sensor's noise"
        )
    remarks.append(
        f"L_M holds at a peak stator flux of {flux_wb:.3g} Wb, {flux_wb / rated.stator_peak_wb:.0%} of the rated"
        + (" one, and is not extrapolated" if flux_wb < 0.7 * rated.stator_peak_wb else " one")
    )
    if flux_wb > reached_wb:
        remarks.append(
            f"the tests reached {reached_wb:.3g} Wb; from there to {flux_wb:.3g} Wb, the level that L_M is told for, "
            "their own magnetizing curve leads; a quarter of the way is in L_M's standard error"
        )
    remarks.append("gain errors of current and DC-link sensors scale all values and are not in the standard errors")
    return remarks
