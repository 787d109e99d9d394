"""The whole diagnosis of standstill recordings: one call, one result with the numbers that led to it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from commissioner.diagnose import calibration
from commissioner.diagnose.audit import Audit, prepare
from commissioner.diagnose.effects import CATALOGUE
from commissioner.diagnose.evidence import (
    TIE_CHI2,
    HeldOut,
    Rival,
    alternatives,
    claim_features,
    confidence,
    hold_out,
    setting_for,
    sizes_with_spread,
)
from commissioner.diagnose.experiment import next_experiment
from commissioner.diagnose.extended import model_document
from commissioner.diagnose.fit import Fit, inverse, on_part, whiten
from commissioner.diagnose.guards import SAME_ORDER, loss_without
from commissioner.diagnose.leftover import Leftover, leftover
from commissioner.diagnose.moved import PARAMETERS
from commissioner.diagnose.noise import Noise, measure_noise
from commissioner.diagnose.record import Record
from commissioner.diagnose.search import EXPLORED, Found, search
from commissioner.diagnose.split import Split, split_lines
from commissioner.motor.circuit import Quantity
from commissioner.records import StandstillRecording

MOSTLY_EXPLAINED_SIGMA, UNEXPLAINED_SIGMA, LEAST_SHARE = 0.1, 0.3, 0.95
COARSE_STEP_SHARE, COARSE_STEP_NOISE = 0.003, 0.1
"""Named as a cause: steps beyond a share of the rated peak current that make a hundredth of the noise power."""
TRUNCATION_SLACK = 0.15
ALWAYS_EQUIVALENT = {"dead_time": ("device_drop",)}
MOST_UNANSWERED, FAINT = 0.5, 0.1
"""Refused: currents, not below a tenth of the noise's power, of which the four-parameter model explains no more than half."""
SHOWN_BY_A_PART = 0.3
"""Of its gain per sample: a cause of which the first part of the segments shows less is late, or met seldom."""
LEAST_CONFIDENCE = 0.5
"""Below it a name is more likely wrong than right, and is not given."""
DELAY_OR_LAG_TIE = 1e-5
SAME_ORDER_TIE = 2e-3
NEARLY_ALL, LEFT_TIE = 0.001, 0.1
"""A rival that loses less than this share of a cause's gain, and less than this share of what no cause makes, is as good:
the unknown rest may favour either."""
NEVER_NAMEABLE = (
    "common gain of the current sensors | DC-link scale | all impedances",
    "slope resistance of the devices | cable resistance | R_s",
    "dead time | device threshold (one switching frequency and link voltage)",
    "networks of the same order: deep bar | eddy loss (named by their corner frequency)",
    "delay | first-order lag below an eighth of a sample period",
)


class Verdict(Enum):
    EXPLAINED = "explained"
    NOTHING_SIGNIFICANT = "nothing_significant"
    NOT_DISTINGUISHABLE = "not_distinguishable"
    UNEXPLAINED = "unexplained"
    REFUSED = "refused"


@dataclass(frozen=True)
class Cause:
    """One named cause. `sizes`: name -> (value, std, unit); `strength_sigma` rms contribution over the noise rms."""

    name: str
    title: str
    sizes: Mapping[str, tuple[float, float, str]]
    gain_share: float
    strength_sigma: float
    delta_chi2: float
    confidence: float
    equivalent: tuple[str, ...] = ()
    rivals: Mapping[str, float] = field(default_factory=dict)
    features: tuple[float, ...] = ()
    from_audit: bool = False


@dataclass(frozen=True)
class Diagnosis:
    """Everything the report shows. `found` is None where the data were refused."""

    verdict: Verdict
    reason: str
    causes: tuple[Cause, ...]
    below_materiality: tuple[str, ...]
    audit: Audit
    noise: Noise | None = None
    held_out: HeldOut | None = None
    left: Leftover | None = None
    parameters_before: Mapping[str, Quantity] = field(default_factory=dict)
    parameters_after: Mapping[str, Quantity] = field(default_factory=dict)
    detection_limits: Mapping[str, float] = field(default_factory=dict)
    next_experiment: Mapping[str, object] | None = None
    model: Mapping[str, object] = field(default_factory=dict)
    found: Found | None = None
    split: Split | None = None
    explained_share: float = 0.0
    remarks: tuple[str, ...] = ()
    unsure: tuple[Cause, ...] = ()
    """Fitted, and more likely wrong than right as names: what they explain counts as left."""


def diagnose(
    recordings: Sequence[StandstillRecording], *, excluded: Sequence[str] = (),
    report: Callable[[str], None] = lambda _: None, go_on: Callable[[], bool] = lambda: True,
) -> Diagnosis:
    """Names what a four-parameter simulation gets wrong about the recordings of one motor.

    `go_on` is asked between causes; once it says no, the answer is given with what was found so far, and says so.
    Never raises on poor data: what cannot carry an answer comes back as `refused` with the reason.
    """
    record, audit = prepare(recordings)
    if audit.refusal:
        return Diagnosis(Verdict.REFUSED, audit.refusal, (), (), audit)
    noise = measure_noise(record)
    if audit.step_a:
        noise = noise.with_converter_step(np.array(audit.step_a))
    report(f"noise {noise.floor_a * 1e3:.3g} mA rms, from {noise.source}")
    excluded = (*excluded, *_not_told_apart(len(audit.excited_hz)))
    try:
        found = search(record, noise, excluded=excluded, report=report, check=lambda f, r: _before_search(f, r, noise), go_on=go_on)
        _one_state(found.fit, found.record)
    except _Refused as refusal:
        return Diagnosis(Verdict.REFUSED, str(refusal), (), (), audit, noise)
    return _conclude(found, audit, noise, excluded)


def _conclude(found: Found, audit: Audit, noise: Noise, excluded: Sequence[str]) -> Diagnosis:
    record, layout = found.record, found.layout
    numbers = 4 + len(found.fit.model.terms)
    rest = leftover(found.fit.model, record, layout, noise, numbers, audit.excited_hz)
    held = hold_out(found.nominal, found.fit, record, layout, noise)
    rivals = _rivals(found, noise, excluded, [n for n in found.accepted if _may_be_named(found, n, rest)])
    doubt = _doubt(rest, _explained_share(found, rest, rest.sigma)) if found.accepted else 1.0
    causes = [_cause(found, name, rest, rivals.get(name, {}), noise, excluded, doubt) for name in found.accepted]
    causes = _with_open_ties(causes, rivals)
    causes = _without_truncation(causes, audit)
    causes += _audit_causes(audit, found, noise, {c.name for c in causes})
    unsure = tuple(c for c in causes if c.confidence < LEAST_CONFIDENCE or (not c.from_audit and _is_less_than_left(c.strength_sigma, rest)))
    causes = [c for c in causes if c not in unsure]
    total = replace(rest, sigma=float(np.hypot(rest.sigma, np.linalg.norm([c.strength_sigma for c in unsure]))))
    share, rest = _explained_share(found, rest, total.sigma), total
    verdict, reason = _verdict(causes, rest, share, leaves_a_trace=doubt < 1.0, is_complete=found.is_complete)
    experiment = next_experiment(verdict.value, causes, record)
    return Diagnosis(
        verdict, reason, tuple(sorted(causes, key=lambda c: -c.gain_share)), found.below_materiality, audit, noise, held,
        rest, _parameters(found.nominal), _parameters(found.fit), _limits(found), experiment,
        model_document(found, [*causes, *unsure]), found, split_lines(record), share,
        _remarks(noise, record, found.is_complete, unsure), unsure,
    )


def _explained_share(found: Found, rest: Leftover, left_sigma: float) -> float:
    """Share of the structured error power that is not among what is left (`left_sigma`, causes not named included)."""
    count = float(found.fit.normal.count.sum())
    structured = max(found.nominal.chi2 - found.fit.chi2, 0.0) + rest.sigma**2 * count
    return 1.0 - min(left_sigma**2 * count / max(structured, left_sigma**2 * count, 1.0), 1.0)


def _is_less_than_left(strength_sigma: float, rest: Leftover) -> bool:
    """A cause that makes less of the error than what no cause makes may be a part of that unknown."""
    return rest.sigma > max(strength_sigma, MOSTLY_EXPLAINED_SIGMA)


def _may_be_named(found: Found, name: str, rest: Leftover) -> bool:
    """Whether the name is likely enough: else its alternatives need not be sought."""
    count = float(found.fit.normal.count.sum())
    total = max(found.nominal.chi2 - found.fit.chi2, 1.0)
    sure = confidence(claim_features(found.fit, found.accepted, name, rest, total), calibration.WEIGHTS)
    return sure >= LEAST_CONFIDENCE and not _is_less_than_left(float(np.sqrt(found.gains[name] / count)), rest)


def _rivals(found: Found, noise: Noise, excluded: Sequence[str], asked: Sequence[str]) -> dict[str, dict[str, Rival]]:
    """Alternatives of the causes `asked` about, tried on the first part of every segment where that shows them as well."""
    if not asked:
        return {}
    record, layout = found.record, found.layout
    out: dict[str, dict[str, Rival]] = {}
    for samples in (*EXPLORED, record.samples):
        if len(out) == len(asked):
            break
        fitted, part = on_part(found.fit, record, layout, noise, samples)
        share = SHOWN_BY_A_PART * part.samples / record.samples
        shown = [n for n in asked if n not in out and (part is record or loss_without(fitted, n) > share * found.gains[n])]
        if shown:
            setting = setting_for(found.setting, part)
            out |= alternatives(fitted, found.accepted, part, layout, setting, noise, record.samples, excluded, shown)
    return out


def _cause(
    found: Found, name: str, rest: Leftover, rivals: Mapping[str, Rival], noise: Noise, excluded: Sequence[str],
    doubt: float,
) -> Cause:
    gain = found.gains[name]
    count = float(found.fit.normal.count.sum())
    total = max(found.nominal.chi2 - found.fit.chi2, 1.0)
    fixed = () if found.setting.link_varies else ALWAYS_EQUIVALENT.get(name, ())
    unsettled = min(NEARLY_ALL * gain, LEFT_TIE * rest.sigma**2 * count)
    close = tuple(n for n, r in rivals.items() if r.loss < max(TIE_CHI2, _share_open(name, n) * gain, unsettled))
    features = claim_features(found.fit, found.accepted, name, rest, total)
    sure = confidence(features, calibration.WEIGHTS) * doubt
    if not noise.is_known:
        sure *= calibration.UNKNOWN_NOISE_FACTOR
    return Cause(
        name, CATALOGUE[name].title, sizes_with_spread(found.fit, name, found.setting), min(gain / total, 1.0),
        float(np.sqrt(gain / count)), gain, sure, tuple(c for c in dict.fromkeys((*fixed, *close)) if c not in excluded),
        {n: r.loss for n, r in rivals.items()}, tuple(features),
    )


def _with_open_ties(causes: Sequence[Cause], rivals: Mapping[str, Mapping[str, Rival]]) -> list[Cause]:
    """Sizes whose spread holds half of what they move by if a tied cause beside them is the other one: either may be true."""
    out = []
    for cause in causes:
        tied = [rivals[c.name][n] for c in causes if c is not cause for n in c.equivalent if n in rivals.get(c.name, {})]
        sizes = {}
        for key, (value, spread, unit) in cause.sizes.items():
            moved = [0.5 * r.moved.get(cause.name, {}).get(key, 0.0) for r in tied]
            sizes[key] = (value, float(np.linalg.norm([spread, max(np.abs(moved), default=0.0)])), unit)
        out.append(replace(cause, sizes=sizes))
    return out


def _share_open(name: str, rival: str) -> float:
    """Share of a gain within which two causes are the same to the terminals, whatever fits better: networks of the same

    order; a delay and a lag, whose currents are taken as straight between the samples.
    """
    shares = {SAME_ORDER: SAME_ORDER_TIE, frozenset({"sampling_delay", "sensor_lag"}): DELAY_OR_LAG_TIE}
    return shares.get(frozenset({name, rival}), 0.0)


def _without_truncation(causes: Sequence[Cause], audit: Audit) -> list[Cause]:
    """A converter that cuts off instead of rounding shifts every channel by half a step: that is quantization, no offset."""
    out = []
    for cause in causes:
        offsets = [value for value, _, _ in cause.sizes.values()]
        halves = 0.5 * np.array(audit.step_a)
        if cause.name == "sensor_offset" and len(offsets) == halves.size and halves.min() > 0.0:
            ratio = np.array(offsets) / halves
            if np.all(np.abs(np.abs(ratio) - 1.0) < TRUNCATION_SLACK) and np.all(ratio * ratio[0] > 0.0):
                step = {"step_a": (float(halves.max()) * 2.0, 0.0, "A")}
                out.append(replace(cause, name="quantization", title=CATALOGUE["quantization"].title, sizes=step, equivalent=()))
                continue
        out.append(cause)
    return out


def _audit_causes(audit: Audit, found: Found, noise: Noise, named: Collection[str]) -> list[Cause]:
    """Causes that leave no waveform: coarse converter steps, clipped and missing samples."""
    out = []
    step = max(audit.step_a, default=0.0)
    is_coarse = step > COARSE_STEP_SHARE * found.record.facts.rated_current_peak_a
    if "quantization" not in named and is_coarse and step / np.sqrt(12.0) > COARSE_STEP_NOISE * noise.floor_a:
        out.append(_plain("quantization", {"step_a": (step, 0.0, "A")}))
    if audit.clipped and "clipping" not in named:
        out.append(_plain("clipping", {"limit_a": (audit.clipped["limit_a"], 0.0, "A"),
                                       "samples": (audit.clipped["samples"], 0.0, "1")}))
    if audit.holes or found.losses:
        marked, unmarked = sum(h[2] for h in audit.holes), sum(x.samples for x in found.losses)
        out.append(_plain("lost_samples", {
            "samples": (float(marked + unmarked), 0.0, "1"), "without_gap_in_time": (float(unmarked), 0.0, "1"),
        }))
    return out


def _doubt(rest: Leftover, share: float) -> float:
    """Factor on every confidence where what is left is small, yet more than noise makes around the tones, and a larger

    part of all there was to explain than a right name leaves: 1 at the most that one may leave.
    """
    is_trace = rest.from_tones_sigma > 0.0 and rest.sigma <= MOSTLY_EXPLAINED_SIGMA
    return min((1.0 - LEAST_SHARE) / (1.0 - share), 1.0) if is_trace and share < 1.0 else 1.0


def _plain(name: str, sizes: Mapping[str, tuple[float, float, str]]) -> Cause:
    return Cause(name, CATALOGUE[name].title, sizes, 0.0, 0.0, 0.0, 0.99, from_audit=True)


def _verdict(
    causes: Sequence[Cause], rest: Leftover, share: float, *, leaves_a_trace: bool, is_complete: bool
) -> tuple[Verdict, str]:
    fitted = any(not c.from_audit for c in causes)
    if (
        rest.sigma > UNEXPLAINED_SIGMA or (causes and rest.sigma > MOSTLY_EXPLAINED_SIGMA and share < LEAST_SHARE)
        or (not fitted and rest.sigma > MOSTLY_EXPLAINED_SIGMA) or leaves_a_trace
    ):
        names = ", ".join(c.name for c in causes)
        if not is_complete:
            return Verdict.UNEXPLAINED, (
                f"Not finished: the time allowed was over before every cause was tried; a structured error of {rest.sigma:.2g} "
                f"times the noise is left so far{', beside ' + names if names else ''}."
            )
        seen = f" The data are consistent with {names}, but something else is in them too." if names else ""
        return Verdict.UNEXPLAINED, (
            f"A structured error of {rest.sigma:.2g} times the noise remains that no cause in the catalogue makes."
            f"{seen}"
        )
    if not causes:
        return Verdict.NOTHING_SIGNIFICANT, "The four-parameter model reproduces the recording to within its noise."
    tied = [c for c in causes if c.equivalent]
    if tied:
        classes = "; ".join(" or ".join((c.name, *c.equivalent)) for c in tied)
        return Verdict.NOT_DISTINGUISHABLE, f"These data cannot tell apart: {classes}."
    if rest.sigma > 0.0:
        return Verdict.EXPLAINED, (
            f"The named causes leave {rest.sigma:.2g} times the noise, {1.0 - share:.1%} of the error power that there was to explain."
        )
    return Verdict.EXPLAINED, "The named causes leave nothing above the noise."


def _parameters(one: Fit) -> dict[str, Quantity]:
    covariance = inverse(one.normal.total_gram)
    out = {
        n: Quantity(float(v), float(v * np.sqrt(max(covariance[k, k], 0.0))))
        for k, (n, v) in enumerate(zip(PARAMETERS, one.model.nominal, strict=True))
    }
    r_r, l_m = out[PARAMETERS[1]], out[PARAMETERS[3]]
    spread = covariance[1, 1] + covariance[3, 3] - 2.0 * covariance[1, 3]
    t = l_m.value / r_r.value
    out["rotor_time_constant_s"] = Quantity(t, float(t * np.sqrt(max(spread, 0.0))))
    return out


def _limits(found: Found) -> dict[str, float]:
    """Smallest size of each effect (its step's multiple) that would have been found, in its first number's unit."""
    out = {}
    screening = found.first_screening
    scale = found.record.samples / max(sum(screening.normal.count) / found.record.facts.phases, 1.0)
    for name, score in screening.scores.items():
        k = list(screening.columns[name])
        power = screening.projected[np.ix_(k, k)]
        best = float(np.linalg.eigvalsh(power)[-1]) * max(scale, 1.0)
        if best > 0:
            out[name] = float(np.sqrt(score.threshold / best) * score.terms[0].step)
    return out


class _Refused(Exception):
    """The data cannot carry an answer: not of one motor in one state, or no answer to the command."""


def _before_search(nominal: Fit, record: Record, noise: Noise) -> None:
    """The currents answer the command at all; and a leakage that differs by half between files is no effect of level."""
    count = float(nominal.normal.count.sum())
    white = (whiten(s.currents_a, s.is_good, noise, record.facts.sample_period_s) for s in record.segments)
    flowing = sum(float(w @ w) for w in white) - count
    if nominal.chi2 - count > MOST_UNANSWERED * flowing > FAINT * count:
        raise _Refused(
            f"the command explains only {max(1.0 - (nominal.chi2 - count) / flowing, 0.0):.0%} of the current's power: "
            "voltage and current do not belong together, or something else drives the motor"
        )
    _compare_files(nominal, record, slice(2, 3), 0.4)


def _one_state(fitted: Fit, record: Record) -> None:
    _compare_files(fitted, record, slice(0, 3), 0.2)


def _compare_files(fitted: Fit, record: Record, which: slice, most: float) -> None:
    """Raises when the files' own four-parameter fits (one step from the common one) differ by more than `most`."""
    files = sorted({s.file for s in record.segments})
    if len(files) < 2:
        return
    estimates = []
    for file in files:
        rows = [k for k, s in enumerate(record.segments) if s.file == file]
        gram, slope = fitted.normal.gram[rows].sum(axis=0)[:4, :4], fitted.normal.slope[rows].sum(axis=0)[:4]
        estimates.append(np.linalg.solve(gram, slope))
    spread = np.ptp(np.array(estimates), axis=0)
    names = ("R_s", "R_R", "L_sigma", "L_M")
    worst = which.start + int(np.argmax(spread[which]))
    if spread[worst] > most:
        raise _Refused(
            f"the files are not of one motor in one state: {names[worst]} differs by {spread[worst]:.0%} between them "
            f"(fitted together: {fitted.model.nominal[worst]:.4g}); diagnose them one by one"
        )


def _not_told_apart(lines: int) -> tuple[str, ...]:
    """Two lines fit the four parameters exactly: what only shifts them, or jumps in delay, cannot be named then."""
    if lines > 2:
        return ()
    linear = tuple(name for name, entry in CATALOGUE.items() if entry.family == "linear")
    return linear if lines == 2 else (*linear, "clock_drift", "lost_samples")


def _remarks(noise: Noise, record: Record, is_complete: bool, unsure: Sequence[Cause]) -> tuple[str, ...]:
    out = [] if is_complete else ["The time allowed was over before every cause was tried: diagnose the recording again without a limit."]
    if unsure:
        names = ", ".join(f"{c.name} ({c.strength_sigma:.2g} times the noise)" for c in unsure)
        out.append(f"Helps the fit, but is more likely another cause in disguise, and is not named: {names}.")
    if not noise.is_known:
        out.append(
            "No repeated segment, no repeated period, no zero-voltage stretch and no third sensor: the noise had to be "
            "taken from quiet frequencies of the same record. Broadband structure would be counted as noise, so "
            "`explained` means no line is left, and confidences are lowered. Repeat one segment to measure the noise."
        )
    if len({round(s.axis_deg % 180.0, 3) for s in record.segments}) < 2:
        out.append("One axis only: anisotropy cannot be told from the machine's own L_sigma and resistances.")
    return tuple(out)
