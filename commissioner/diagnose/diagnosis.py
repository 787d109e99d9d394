"""The whole diagnosis of standstill recordings: one call, one result with the numbers that led to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from commissioner.diagnose.contract import NextExperiment
from commissioner.diagnose.export.contract import ModelDocument
from commissioner.diagnose.export.model_file import model_document
from commissioner.diagnose.fit.answerable import check_before_search, check_one_state
from commissioner.diagnose.intake.audit import Audit, prepare
from commissioner.diagnose.intake.line_classes import Split, split_lines
from commissioner.diagnose.intake.noise import Noise, measure_noise, resting_share
from commissioner.diagnose.intake.refusal import refused
from commissioner.diagnose.rules import RULES
from commissioner.diagnose.search.journal import Said, Step, followed, replayed
from commissioner.diagnose.search.search import Found, not_told_apart, search
from commissioner.diagnose.verdict.causes import (
    Cause,
    causes_of,
    confidence_factor,
    explained_share,
)
from commissioner.diagnose.verdict.evidence import HeldOut, hold_out
from commissioner.diagnose.verdict.experiment import next_experiment
from commissioner.diagnose.verdict.lack_of_fit import LackOfFit, lack_of_fit
from commissioner.diagnose.verdict.parameters import parameters_of
from commissioner.errors import DataRefused
from commissioner.estimation.cancelling import TimeOver, given_up_by
from commissioner.identify.estimate.sufficiency import WORST_RELATIVE_STD
from commissioner.motor.circuit import PARAMETERS, SYMBOLS, Quantity
from commissioner.records import DiagnosisVerdict, StandstillRecording

NEVER_NAMEABLE = (
    "common gain of the current sensors | DC-link scale | all impedances",
    "slope resistance of the devices | cable resistance | R_s",
    "dead time | device threshold (one switching frequency and link voltage)",
    "networks of the same order: deep bar | eddy loss (named by their corner frequency)",
    "delay | first-order lag below an eighth of a sample period",
)


@dataclass(frozen=True)
class Diagnosis:
    """Everything the report shows. `found` is None where the data were refused."""

    verdict: DiagnosisVerdict
    reason: str
    causes: tuple[Cause, ...]
    below_materiality: tuple[str, ...]
    audit: Audit
    noise: Noise | None = None
    held_out: HeldOut | None = None
    left: LackOfFit | None = None
    parameters_before: Mapping[str, Quantity] = field(default_factory=dict)
    parameters_after: Mapping[str, Quantity] = field(default_factory=dict)
    next_experiment: NextExperiment | None = None
    model: ModelDocument | None = None
    found: Found | None = None
    split: Split | None = None
    explained_share: float = 0.0
    remarks: tuple[str, ...] = ()
    unsure: tuple[Cause, ...] = ()
    """Fitted, and more likely wrong than right as names: what they explain counts as left."""
    refusal: DataRefused | None = None
    is_complete: bool = True
    """False: given up before nothing more passed the rules, and nothing is named."""
    steps: tuple[Step, ...] = ()
    """What the search did, record by record: `search.journal.replayed` makes the same choices from them."""


def diagnose(
    recordings: Sequence[StandstillRecording],
    *,
    excluded: Sequence[str] = (),
    report: Callable[[Step], None] = lambda _: None,
    go_on: Callable[[], bool] = lambda: True,
) -> Diagnosis:
    """Names what a four-parameter simulation gets wrong about the recordings of one motor.

    Once `go_on` says no, the search is given up within a segment's prediction; the answer says so, and names nothing.
    Never raises on poor data: what cannot carry an answer comes back as `refused` with the reason.
    """
    averaged = [int(np.max(r.averaged)) for r in recordings if r.averaged is not None]
    if averaged:
        refusal = refused(
            "the samples are means over several control periods", max(averaged), "1 control period a sample",
            "diagnose a recording of every sample: a faster link, or a scope",
        )  # fmt: skip
        return _refused(refusal, Audit(()))
    record, audit = prepare(recordings)
    if audit.refusal:
        return _refused(audit.refusal, audit)
    noise = measure_noise(record)
    if audit.step_a:
        noise = noise.with_converter_step(np.array(audit.step_a), resting_share(record))
    rms_a = noise.rms_a(max(s.count for s in record.segments), record.facts.sample_period_s)
    steps: list[Step] = []

    def heard(step: Step) -> None:
        steps.append(step)
        report(step)

    heard(Said(f"noise {'' if noise.is_known else 'at most '}{rms_a * 1e3:.3g} mA rms, from {noise.source}"))
    excluded = (*excluded, *not_told_apart(len(audit.excited_hz)))
    try:
        check = partial(check_before_search, noise=noise)
        with given_up_by(go_on):
            found = followed(search(record, noise, excluded=excluded, check=check), heard)
            check_one_state(found.fit, found.record)
            return replace(_conclude(found, audit, noise, excluded), steps=tuple(steps))
    except DataRefused as refusal:
        return _refused(refusal, audit, noise)
    except TimeOver:
        return _unfinished(steps, audit, noise)


def _refused(refusal: DataRefused, audit: Audit, noise: Noise | None = None) -> Diagnosis:
    return Diagnosis("refused", f"{refusal.what}; {refusal.remedy}", (), (), audit, noise, refusal=refusal)


def _unfinished(steps: Sequence[Step], audit: Audit, noise: Noise) -> Diagnosis:
    """Given up: what the search had accepted was not weighed against what else makes the same error, so that it is no name yet."""
    so_far = ", ".join(replayed(steps).accepted)
    return Diagnosis(
        "unexplained",
        "Not finished: the time allowed was over before every cause was tried and weighed.",
        (),
        (),
        audit,
        noise,
        remarks=(
            "The time allowed was over before every cause was tried: diagnose the recording again without a limit.",
            *([f"Seen on the way, and not yet weighed against others: {so_far}."] if so_far else []),
        ),
        steps=tuple(steps),
        is_complete=False,
    )


def _conclude(found: Found, audit: Audit, noise: Noise, excluded: Sequence[str]) -> Diagnosis:
    record, layout = found.record, found.layout
    numbers = 4 + len(found.fit.model.terms)
    lack = lack_of_fit(found.fit.model, record, layout, noise, numbers, audit.excited_hz)
    lack = lack.with_ruled_out(float(np.sqrt(found.ruled_out.chi2 / found.fit.normal.count.sum())))
    held = hold_out(found.nominal, found.fit, record, layout, noise)
    trust = confidence_factor(lack, explained_share(found, lack, lack.sigma)) if found.accepted else 1.0
    gained = float(np.sqrt(max(found.nominal.chi2 - found.fit.chi2, 0.0) / found.fit.normal.count.sum()))
    if held.is_measured and held.share < RULES.worse_than_none and gained < RULES.weak_sigma:
        trust = 0.0
    causes, unsure = causes_of(found, lack, trust, audit, noise, excluded)
    if all(c.from_audit for c in causes):
        # nothing is gained by causes that are not named
        held = hold_out(found.nominal, found.nominal, record, layout, noise)
    # what an unsure cause takes is left as well, yet no more than there was
    before = float(np.sqrt(max(found.nominal.normal.unexplained, 0.0) / found.nominal.normal.count.sum()))
    left = float(np.hypot(lack.sigma, np.linalg.norm([c.strength_sigma for c in unsure])))
    total = replace(lack, sigma=max(min(left, before), lack.sigma))
    share, lack = explained_share(found, lack, total.sigma), total
    trifles = {name: gain for name, gain in found.below_materiality.items() if name not in found.accepted}
    trifle = max(trifles.values(), default=0.0) / float(found.fit.normal.count.sum())
    is_seen = max(lack.from_states_sigma, lack.from_bursts_sigma) ** 2 > max(RULES.unexplained_state_sigma**2, trifle)
    verdict, reason = _verdict(
        causes, lack, share, leaves_a_trace=0.0 < trust < 1.0 or (is_seen and not causes), found=found
    )
    experiment = next_experiment(verdict, causes, record)
    after = parameters_of(found.fit, layout)
    return Diagnosis(
        verdict,
        reason,
        tuple(sorted(causes, key=lambda c: -c.gain_share)),
        tuple(trifles),
        audit,
        noise,
        held,
        lack,
        parameters_of(found.nominal, layout),
        after,
        experiment,
        model_document(found, [*causes, *unsure]),
        found,
        split_lines(record),
        share,
        (*_remarks(noise, found, unsure), *_not_fixed(after)),
        unsure,
    )


def _verdict(
    causes: Sequence[Cause], lack: LackOfFit, share: float, *, leaves_a_trace: bool, found: Found
) -> tuple[DiagnosisVerdict, str]:
    fitted = any(not c.from_audit for c in causes)
    if (
        lack.sigma > RULES.unexplained_sigma
        or (causes and lack.sigma > RULES.mostly_explained_sigma and share < RULES.explained_share)
        or (not fitted and lack.sigma > RULES.mostly_explained_sigma)
        or leaves_a_trace
    ):
        names = ", ".join(c.name for c in causes)
        seen = f" The data are consistent with {names}, but something else is in them too." if names else ""
        comes_and_goes = (
            " It comes and goes: in some moments much more is left than in most." if lack.from_bursts_sigma else ""
        )
        ruled_out = (
            f" Part of it looks like {found.ruled_out.name}, which the recorded DC link rules out."
            if found.ruled_out.chi2
            else ""
        )
        return "unexplained", (
            f"A structured error of {lack.sigma:.2g} times the noise remains that no cause in the catalogue makes.{comes_and_goes}{ruled_out}{seen}"
        )
    if not causes:
        return (
            "nothing_significant",
            "The four-parameter model reproduces the recording to within its noise.",
        )
    tied = [c for c in causes if c.equivalent]
    if tied:
        classes = "; ".join(" or ".join((c.name, *c.equivalent)) for c in tied)
        return "not_distinguishable", f"These data cannot tell apart: {classes}."
    if lack.sigma > 0.0:
        return "explained", (
            f"The named causes leave {lack.sigma:.2g} times the noise, {1.0 - share:.1%} of the error power that there was to explain."
        )
    return "explained", "The named causes leave nothing above the noise."


def _not_fixed(parameters: Mapping[str, Quantity]) -> tuple[str, ...]:
    """The sentence on those of the four that `identify` would refuse to give; none where the excitation fixes all."""
    relative = {s: parameters[n].std / abs(parameters[n].value) for s, n in zip(SYMBOLS, PARAMETERS, strict=True)}
    loose = [f"{s} (relative standard error {r:.0%})" for s, r in relative.items() if not r <= WORST_RELATIVE_STD]
    if not loose:
        return ()
    return (
        f"The excitation does not fix {' and '.join(loose)}, limit {WORST_RELATIVE_STD:.0%}: record again with more current, "
        "and with more tones between the machine's poles.",
    )


def _remarks(noise: Noise, found: Found, unsure: Sequence[Cause]) -> tuple[str, ...]:
    out = []
    if unsure:
        names = ", ".join(f"{c.name} ({c.strength_sigma:.2g} times the noise)" for c in unsure)
        out.append(f"Helps the fit, but is more likely another cause in disguise, and is not named: {names}.")
    if found.spikes:
        out.append(
            "Single samples stand out by more than noise of this size makes (spikes, or noise with heavy tails): "
            f"{len(found.spikes)} are left out. None is lost: time goes on beside them."
        )
    if not noise.is_known:
        out.append(
            "No repeated segment, no repeated period, no zero-voltage stretch and no third sensor: the noise had to be "
            "taken from quiet frequencies of the same record. Broadband structure would be counted as noise, so "
            "`explained` means no line is left, and confidences are lowered. Repeat one segment to measure the noise."
        )
    if len({round(s.axis_deg % 180.0, 3) for s in found.record.segments}) < 2:
        out.append("One axis only: anisotropy cannot be told from the machine's own L_sigma and resistances.")
    return tuple(out)
