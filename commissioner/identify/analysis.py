"""From a standstill recording to the motor's parameters: the same code offline and for the final judgement of a live
run.

Per axis: staircase -> R_s and inverter error; online observer over every stretch -> start values; batch fit with the
extensions the data ask for (delay, inverter error, saturating iron; Bayesian information criterion); observer once more
with what the batch fit found taken off; agreement and whiteness. Then the axes are combined.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from commissioner.errors import DataRefused, UsageError
from commissioner.identify.audit import Audit, Stretch, audit, nameplate_from, tones_in
from commissioner.identify.batch import (
    BatchFit,
    ModelChoice,
    Segment,
    extended,
    fit_segments,
    start_theta,
)
from commissioner.identify.combine import AxisEstimate, Combined, combine
from commissioner.identify.compensation import NOTHING, Compensation
from commissioner.identify.observer import PRIOR_LOG_STD, BlockEstimate, ParallelObserver, StoredBlock
from commissioner.identify.resistance import DcLevel, InverterError, Staircase, fit_staircase, knee_shape
from commissioner.identify.whiteness import Whiteness, whiteness
from commissioner.motor.circuit import EQUAL_LEAKAGE, InverseGamma, TModel, to_t_model
from commissioner.motor.nameplate import Nameplate, ParameterBox, RatedFlux, prior, rated_flux
from commissioner.motor.standstill import admittance_s, poles_per_s
from commissioner.records import Signal, StandstillRecording

Estimator = Literal["pao", "lyapunov", "nls"]
Matrix = NDArray[np.float64]
WORST_RELATIVE_STD = 0.25
EXTRA_POWERS = 4
FINAL_REVIEWS = 6
UNKNOWN_STATE_LOG_STD = 0.03
"""How well parameters must be known before an unknown initial state is estimated beside them."""
BLOCK = 500
EXCITED, EXCITED_WINDOW_S = 0.3, 0.2
BLIND_LOSSES = (0.1, 0.4)
COARSE = 0.03  # of a standard error, while models are compared
KNOT_FRACTIONS = (0.005, 0.01, 0.02, 0.035, 0.055, 0.08, 0.12)
"""Knots of the leg error, in fractions of the largest current; beyond the last it has a hyperbolic tail."""
COPPER_ZERO_DEGC = -234.5


@dataclass(frozen=True)
class AxisResult:
    """One test: what the chosen estimator says, the batch fit beside it, and how far they are apart in standard
    errors."""

    axis_deg: float
    parameters: InverseGamma
    covariance: Matrix
    batch: BatchFit
    observer_parameters: InverseGamma
    disagreement_sigmas: float
    whiteness: Whiteness
    residual_rms_a: float
    peak_rotor_flux_wb: float
    peak_stator_flux_wb: float
    staircase: Staircase | None
    energised_s: float


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
    delay_s: tuple[float, float]
    magnetizing_curve: tuple[tuple[float, float, float], ...]
    gaps: int
    lost_samples: int
    duration_s: float
    stator_resistance_20degc_ohm: tuple[float, float] | None
    remarks: tuple[str, ...]

    @property
    def std(self) -> tuple[float, float, float, float]:
        a, b, c, d = np.sqrt(np.diag(self.covariance))
        return float(a), float(b), float(c), float(d)

    def as_json(self) -> dict[str, object]:
        """The document of the contract (`run` / `identify`), ready for `json.dumps`."""
        from commissioner.identify.document import document

        return document(self)


def identify(
    recording: StandstillRecording,
    nameplate: Nameplate | None = None,
    estimator: Estimator = "pao",
    inverter: InverterError | None = None,
    start: InverseGamma | None = None,
    winding_temperature_degc: float | None = None,
    assumption: str = EQUAL_LEAKAGE,
) -> Identification:
    """Everything a standstill recording says about the motor.

    `nameplate` defaults to the recording's metadata. `inverter` (from an earlier staircase) and `start` only give the
    search a start. Raises DataRefused where the data cannot carry an answer, UsageError for an unknown estimator.
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
    _require_tones(examined, recording.sample_period_s)
    tests = _by_test(examined)
    results: list[AxisResult] = []
    for stretches in tests:
        like = results[0].batch if results else None
        results.append(_identify_axis(stretches, plate, recording.sample_period_s, estimator, start, inverter, like))
    return _summary(
        results, examined, plate, estimator, winding_temperature_degc or _temperature(recording), assumption
    )


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


# -- one axis -----------------------------------------------------------------------------------------------------


def _identify_axis(
    stretches: Sequence[Stretch],
    plate: Nameplate,
    period_s: float,
    estimator: Estimator,
    guess: InverseGamma | None,
    leg: InverterError | None,
    like: BatchFit | None,
) -> AxisResult:
    box = prior(plate)
    stairs = _staircase(stretches)
    first_leg = leg or (stairs.inverter if stairs else None)
    axis_deg = stretches[0].axis_deg
    span = 1.5 * max(float(np.max(np.abs(s.current_a))) for s in stretches)
    segments = [Segment(s.voltage_v, s.current_a, s.axis_deg, s.starts_at_rest, s.kind) for s in stretches]
    if like is None:
        first = _first_estimate(stretches, plate, box, period_s, guess, first_leg, span)
        batch = _select(segments, period_s, first, first_leg)
    else:
        batch = fit_segments(segments, period_s, like.gamma.as_inverse_gamma(), like.model, like.theta)
    _require_conditioned(batch)
    compensation = batch.compensation(axis_deg, span)
    law: Literal["fast", "lyapunov"] = "lyapunov" if estimator == "lyapunov" else "fast"
    centred = [replace(s, current_a=s.current_a - offset) for s, offset in zip(stretches, batch.offsets_a, strict=True)]
    # DC levels do not excite persistently: the recursion is for tones, the batch fit takes the staircase along.
    tones = [_excited_part(s, period_s) for s in centred if s.kind != "staircase"] or centred
    seen, observer = _observe(tones, plate, box, period_s, compensation, law, batch.gamma.as_inverse_gamma())
    flux = batch.peak_flux_wb
    at_flux, covariance = batch.inverse_gamma_at(flux)
    linear = batch.inverse_gamma_at(0.0)[0]
    pao = _carry_over(seen, linear, at_flux)
    chosen = at_flux if estimator == "nls" else pao
    difference = np.array(pao.as_tuple()) - np.array(at_flux.as_tuple())
    return AxisResult(
        axis_deg=axis_deg,
        parameters=chosen,
        covariance=covariance,
        batch=batch,
        observer_parameters=pao,
        disagreement_sigmas=float(np.max(np.abs(difference) / np.sqrt(np.diag(covariance)))),
        whiteness=batch.whiteness() if estimator == "nls" else whiteness(observer.residuals),
        residual_rms_a=batch.noise_a if estimator == "nls" else observer.residual_rms_a,
        peak_rotor_flux_wb=observer.peak_rotor_flux_wb,
        peak_stator_flux_wb=flux,
        staircase=stairs,
        energised_s=sum(s.voltage_v.size for s in stretches) * period_s,
    )


def _excited_part(stretch: Stretch, period_s: float) -> Stretch:
    """The stretch from where its current first stays above `EXCITED` of its largest.

    While a test begins at small amplitude the inverter's dead band takes most of the command: what is left tells the
    recursion about the band's shape, not about the motor.
    """
    size = np.abs(stretch.current_a)
    window = max(1, round(EXCITED_WINDOW_S / period_s))
    peaks = [float(np.max(size[a : a + window])) for a in range(0, size.size, window)]
    first = window * next(k for k, peak in enumerate(peaks) if peak >= EXCITED * max(peaks))
    if first == 0:
        return stretch
    return replace(
        stretch,
        voltage_v=stretch.voltage_v[first:],
        current_a=stretch.current_a[first:],
        cross_a=stretch.cross_a[first:],
        starts_at_rest=False,
        start_s=stretch.start_s + first * period_s,
    )


@dataclass(frozen=True)
class _Observed:
    residuals: tuple[Signal, ...]
    residual_rms_a: float
    peak_rotor_flux_wb: float


def _observe(
    stretches: Sequence[Stretch],
    plate: Nameplate,
    box: ParameterBox,
    period_s: float,
    compensation: Compensation,
    law: Literal["fast", "lyapunov"],
    start: InverseGamma | None,
) -> tuple[InverseGamma, _Observed]:
    """The online observer over all stretches in turn; segments are holes of unknown length to it."""
    observer = ParallelObserver(
        box,
        period_s,
        plate.rated_current_peak_a,
        law=law,
        start=start,
        compensation=compensation,
        starts_at_rest=stretches[0].starts_at_rest,
        start_log_std=PRIOR_LOG_STD if stretches[0].starts_at_rest or start is None else UNKNOWN_STATE_LOG_STD,
        expected_voltage_v=np.concatenate([s.voltage_v for s in stretches]) if law == "lyapunov" else None,
    )
    average = _Average(sum(s.voltage_v.size for s in stretches))
    for k, stretch in enumerate(stretches):
        lost = stretch.lost_before if stretch.lost_before or stretch.starts_at_rest or not k else 1
        at_rest = stretch.starts_at_rest
        for a in range(0, stretch.voltage_v.size, BLOCK if law == "lyapunov" else stretch.voltage_v.size):
            part = slice(a, a + BLOCK if law == "lyapunov" else None)
            block = observer.advance(stretch.voltage_v[part], stretch.current_a[part], lost, begins_at_rest=at_rest)
            average.add(block)
            lost, at_rest = 0, False
    if law == "fast":
        _review_until_still(observer)
    signals = observer.predicted(None if law == "fast" else average.parameters)
    shortest = min(s.voltage_v.size for s in stretches)
    settle = min(round(4.0 / -poles_per_s(observer.parameters)[0] / period_s), shortest // 3)
    residuals = tuple(_settled_residuals(observer.history, [current for current, _, _ in signals], settle))
    rotor = max(float(np.max(np.abs(flux))) for _, flux, _ in signals)
    rms = math.sqrt(sum(float(r @ r) for r in residuals) / sum(r.size for r in residuals))
    parameters = observer.parameters if law == "fast" else average.parameters
    return parameters, _Observed(residuals, rms, rotor)


def _settled_residuals(pieces: Sequence[StoredBlock], predicted: Sequence[Signal], settle: int) -> Iterator[Signal]:
    """What is left of each piece, without the first `settle` samples after a state that was not known."""
    unsettled = 0
    for piece, current in zip(pieces, predicted, strict=True):
        unsettled = settle if piece.restarts else unsettled
        residual = (piece.current_a - current)[unsettled:]
        unsettled = max(0, unsettled - current.size)
        if residual.size:
            yield residual


class _Average:
    """The seed's result of the gradient law: the mean of its estimates over the last sixth of the run (150-180 s of
    180)."""

    def __init__(self, total: int) -> None:
        self._from = total * 5 // 6
        self._sum, self._count = np.zeros(4), 0

    def add(self, block: BlockEstimate) -> None:
        if block.samples >= self._from:
            self._sum += block.parameters.as_tuple()
            self._count += 1

    @property
    def parameters(self) -> InverseGamma:
        a, b, c, d = map(float, self._sum / self._count)
        return InverseGamma(a, b, c, d)


def _review_until_still(observer: ParallelObserver) -> None:
    """Nothing more will come: go over the data until the estimate moves by less than a twentieth of its errors."""
    for _ in range(FINAL_REVIEWS):
        before = np.array(observer.parameters.as_tuple())
        observer.review()
        if np.all(np.abs(np.array(observer.parameters.as_tuple()) - before) < 0.05 * np.array(observer.std())):
            return


def _first_estimate(
    stretches: Sequence[Stretch],
    plate: Nameplate,
    box: ParameterBox,
    period_s: float,
    guess: InverseGamma | None,
    leg: InverterError | None,
    span_a: float,
) -> InverseGamma:
    compensation = NOTHING
    if leg is not None:
        grid = np.linspace(0.0, span_a, 1025)
        compensation = Compensation(leg.on_axis(grid, stretches[0].axis_deg), span_a)
    tones = [_excited_part(s, period_s) for s in stretches if s.kind != "staircase"] or stretches
    return _observe(tones, plate, box, period_s, compensation, "fast", guess)[0]


def _select(segments: Sequence[Segment], period_s: float, start: InverseGamma, leg: InverterError | None) -> BatchFit:
    """Greedy choice by the Bayesian criterion: whichever of delay, inverter error and saturation helps most is added,
    then the next, and what has become superfluous is dropped. A staircase's inverter error is in from the start."""
    largest = max(float(np.max(np.abs(s.current_a))) for s in segments)
    knots = tuple(f * largest for f in KNOT_FRACTIONS)
    best = min(
        (_begin(segments, period_s, start, leg, knots) if leg else _begin_blind(segments, period_s, start, knots)),
        key=lambda f: f.criterion(),
    )
    model = replace(best.model, flux_scale_wb=best.peak_flux_wb)
    best, tried = replace(best, model=model), {model}
    while True:
        m = best.model
        toggled = (
            replace(m, extra_powers=0 if m.extra_powers else EXTRA_POWERS),
            replace(m, with_delay=not m.with_delay),
            replace(m, knots_a=() if m.knots_a and not _loses_voltage(best) else knots),
        )
        trials = [
            fit_segments(segments, period_s, start, t, extended(best, t), tolerance=COARSE)
            for t in toggled
            if t not in tried
        ]
        tried.update(toggled)
        better = [t for t in trials if t.criterion() < best.criterion() - 10.0 and np.all(t.theta[:4] > 0.0)]
        if not better:
            return fit_segments(segments, period_s, start, best.model, best.theta)
        best = min(better, key=lambda t: t.criterion())


def _begin(
    segments: Sequence[Segment],
    period_s: float,
    start: InverseGamma,
    leg: InverterError | None,
    knots: tuple[float, ...],
) -> list[BatchFit]:
    model = ModelChoice(knots_a=knots if leg else ())
    return [fit_segments(segments, period_s, start, model, start_theta(start, model, leg), tolerance=COARSE)]


def _begin_blind(
    segments: Sequence[Segment], period_s: float, start: InverseGamma, knots: tuple[float, ...]
) -> list[BatchFit]:
    """Without a staircase the inverter is unknown: begin with none, a small and a large one."""
    rms_v = max(float(np.std(s.voltage_v)) for s in segments)
    legs = [None, *(knee_shape(share * rms_v, knots[3], 2.0) for share in BLIND_LOSSES)]
    return [fit for leg in legs for fit in _begin(segments, period_s, start, leg, knots)]


def _loses_voltage(fit: BatchFit) -> bool:
    """The leg error's plateau is beyond doubt, so that a fit without it need not be tried."""
    leg = fit.inverter()
    return leg is not None and abs(leg.plateau_v) > 10.0 * leg.std_v[-1]


def _carry_over(seen: InverseGamma, linear: InverseGamma, at_flux: InverseGamma) -> InverseGamma:
    """The observer's unsaturated machine taken to the flux level along the batch fit's iron: parameter by parameter."""
    ratios = zip(seen.as_tuple(), linear.as_tuple(), at_flux.as_tuple(), strict=True)
    return InverseGamma(*(s * a / b for s, b, a in ratios))


def _staircase(stretches: Sequence[Stretch]) -> Staircase | None:
    """Fit the DC levels of this test's staircase stretches, or None where there are none to fit."""
    levels = [level for s in stretches if s.kind == "staircase" for level in dc_levels(s.voltage_v, s.current_a)]
    try:
        return fit_staircase(levels, stretches[0].axis_deg) if levels else None
    except DataRefused:
        return None


def dc_levels(voltage_v: Signal, current_a: Signal, tail: float = 0.4) -> list[DcLevel]:
    """Means over the last `tail` of every stretch of constant voltage that is long enough to settle."""
    top = float(np.max(np.abs(voltage_v)))
    edges = np.flatnonzero(np.abs(np.diff(voltage_v)) > 1e-6 * top) + 1
    bounds = [0, *edges.tolist(), voltage_v.size]
    longest = max(b - a for a, b in itertools.pairwise(bounds))
    levels = []
    for a, b in itertools.pairwise(bounds):
        if b - a < max(0.3 * longest, 20) or abs(voltage_v[a]) < 1e-6 * top:
            continue
        part = current_a[b - int(tail * (b - a)) : b]
        levels.append(DcLevel(float(voltage_v[a]), float(np.mean(part)), float(np.std(part) / math.sqrt(part.size))))
    return levels


# -- can it be answered? ------------------------------------------------------------------------------------------


def _require_tones(examined: Audit, period_s: float) -> None:
    """One tone fixes two numbers, not four: say which."""
    if any(s.kind == "staircase" for s in examined.stretches if s.is_excited):
        return
    lines = [tones_in(s.voltage_v, period_s) for s in examined.stretches if s.is_excited]
    distinct = sorted({round(f, 2) for stretch in lines for f in stretch})
    groups = [f for k, f in enumerate(distinct) if k == 0 or f > 1.2 * distinct[k - 1]]
    if len(groups) > 1 or not groups:
        return
    stretch = max((s for s in examined.stretches if s.is_excited), key=lambda s: s.voltage_v.size)
    frequency = groups[0]
    time = np.arange(stretch.voltage_v.size) * period_s
    carrier = np.exp(-2j * np.pi * frequency * time) * np.hanning(time.size)
    impedance = complex(np.sum(stretch.voltage_v * carrier) / np.sum(stretch.current_a * carrier))
    raise DataRefused(
        "one tone cannot fix four parameters",
        step="check the excitation",
        value=f"one tone of {frequency:.4g} Hz",
        limit="two tones at least, four for a check of the model",
        remedy=(
            f"only this combination can be had: R_s + R_R w^2 L_M^2/(R_R^2 + w^2 L_M^2) = {impedance.real:.5g} ohm and "
            f"L_sigma + L_M R_R^2/(R_R^2 + w^2 L_M^2) = {impedance.imag / (2 * math.pi * frequency):.5g} H at "
            f"w = 2 pi {frequency:.4g} 1/s; excite several tones from below 1 Hz to above 20 Hz"
        ),
    )


def _require_conditioned(batch: BatchFit) -> None:
    machine, covariance = batch.inverse_gamma_at(0.0)
    relative = np.sqrt(np.diag(covariance)) / np.array(machine.as_tuple())
    if not np.all(np.isfinite(relative)) or np.max(relative) > WORST_RELATIVE_STD:
        names = ("R_s", "R_R", "L_sigma", "L_M")
        worst = int(np.argmax(np.where(np.isfinite(relative), relative, np.inf)))
        impedance = 1.0 / admittance_s(machine, np.array([1.0, 10.0]))
        raise DataRefused(
            f"the excitation does not fix {names[worst]}",
            step="identify",
            value=f"relative standard error {relative[worst]:.0%}",
            limit=f"{WORST_RELATIVE_STD:.0%}",
            remedy="excite more tones between the machine's poles, or record longer; the fit's impedance at 1 Hz is "
            f"{impedance[0]:.4g} ohm, at 10 Hz {impedance[1]:.4g} ohm",
        )


# -- all axes -----------------------------------------------------------------------------------------------------


def _summary(
    results: Sequence[AxisResult],
    examined: Audit,
    plate: Nameplate,
    estimator: Estimator,
    temperature: float | None,
    assumption: str,
) -> Identification:
    rated = rated_flux(plate, float(np.mean([r.parameters.stator_resistance_ohm for r in results])))
    flux = min(rated.stator_peak_wb, *(r.peak_stator_flux_wb for r in results))
    at_flux = [_axis_at(r, flux, estimator) for r in results]
    combined = combine(at_flux)
    first = min(results, key=lambda r: float(np.trace(r.covariance)))
    curve: Sequence[tuple[float, float, float]] = ()
    if first.batch.model.extra_powers:
        curve = [(float(a), float(b), float(c)) for a, b, c in zip(*first.batch.magnetizing_curve(), strict=True)]
    r_s = combined.parameters.stator_resistance_ohm
    at_20 = None
    if temperature is not None:
        factor = (20.0 - COPPER_ZERO_DEGC) / (temperature - COPPER_ZERO_DEGC)
        at_20 = (r_s * factor, math.sqrt(combined.covariance[0, 0]) * factor)
    delay = first.batch.delay
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
        delay_s=(delay.value, delay.std),
        magnetizing_curve=tuple(curve),
        gaps=examined.gaps,
        lost_samples=examined.lost_samples,
        duration_s=examined.duration_s,
        stator_resistance_20degc_ohm=at_20,
        remarks=(*examined.remarks, *combined.remarks, *_remarks(results, rated, flux)),
    )


def _axis_at(result: AxisResult, flux_wb: float, estimator: Estimator) -> AxisEstimate:
    machine, covariance = result.batch.inverse_gamma_at(flux_wb)
    if estimator != "nls":
        own = result.batch.inverse_gamma_at(result.peak_stator_flux_wb)[0]
        machine = _carry_over(result.observer_parameters, own, machine)
    return AxisEstimate(result.axis_deg, machine, covariance)


def _remarks(results: Sequence[AxisResult], rated: RatedFlux, flux_wb: float) -> list[str]:
    remarks = []
    for result in results:
        if result.disagreement_sigmas > 3.0:
            remarks.append(
                f"axis {result.axis_deg:g} deg: observer and batch fit differ by {result.disagreement_sigmas:.1f} "
                "standard errors: the model misses something"
            )
        if not result.whiteness.is_white:
            remarks.append(
                f"axis {result.axis_deg:g} deg: the residual is not white ({result.whiteness.statistic:.0f}, limit "
                f"{result.whiteness.limit}); standard errors are widened for it"
            )
    if flux_wb < 0.7 * rated.stator_peak_wb:
        remarks.append(
            f"the flux reached {flux_wb:.3g} Wb of rated {rated.stator_peak_wb:.3g} Wb: L_M holds there and is not "
            "extrapolated"
        )
    remarks.append("gain errors of current and DC-link sensors scale all values and are not in the standard errors")
    return remarks


def inverter_json(inverter: InverterError | None, staircase: Staircase | None) -> Mapping[str, object]:
    """The inverter's part of the document."""
    if inverter is None:
        return {"identified": False}
    out: dict[str, object] = {
        "identified": True,
        "leg_error_v": {"value": inverter.plateau_v, "std": inverter.std_v[-1] if inverter.std_v else None},
        "knee_a": inverter.knee_a,
        "leg_current_a": list(inverter.current_a),
        "leg_voltage_v": list(inverter.voltage_v),
    }
    if staircase is not None:
        r = staircase.stator_resistance
        out["staircase_resistance_ohm"] = {"value": r.value, "std": r.std}
    return out
