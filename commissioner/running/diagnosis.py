"""The whole diagnosis of running recordings: one call, one result with the numbers that led to it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from commissioner.errors import DataRefused
from commissioner.estimation.cancelling import TimeOver
from commissioner.estimation.fit import Fit, Problem, made_of, problem_of, scattered, simulate
from commissioner.estimation.hidden import at_small_slip, by_laws
from commissioner.estimation.numbers import AT, NAMES
from commissioner.estimation.record import Record, negative_sequence, prepare
from commissioner.motor.circuit import PARAMETERS, Quantity
from commissioner.motor.nameplate import Nameplate
from commissioner.records import DiagnosisVerdict, RunningRecording
from commissioner.running.at_flux import at_flux, is_saturated, stator_flux_wb
from commissioner.running.causes import CATALOGUE, goes_by, tied_in
from commissioner.running.causes.cause import Cause
from commissioner.running.experiment import Experiment, next_experiment
from commissioner.running.residual.lack import Lack, lack_of_fit, not_told, of_shaft, rms_errors
from commissioner.running.residual.swing_lines import of_swing, swing_of
from commissioner.running.rules import RULES
from commissioner.running.search import Found, Named, Step, search, so_far

UNEXPLAINED_SIGMA, FAR_OFF_SIGMA, LEAST_SHARE = 0.3, 1.0, 0.97
"""Of the noise, left where no cause is named; left however much was explained; share of the error that causes must explain else."""
BURST_SIGMA, BURST_SHARE = 1.0, 0.97
"""The same of the worst 20 ms: a law of another form leaves something in the first cycles of a start."""
MOST_SURE = 0.99
HELD_OUT = 0.3
"""Share of each window that is simulated on and not fitted. None where the load, and so the speed, must be fitted all along."""
MOSTLY_GUESSES = 0.8
"""Share of the error below which causes beside something unexplained are not named: whatever bends helps a fit a little."""
LEAST_ERROR = 0.1
"""Power of the held-out error over the noise's, below which there is nothing to gain there."""


Made = Callable[[Mapping[str, float]], Mapping[str, float]]
"""Of a machine's numbers."""


@dataclass(frozen=True)
class NamedCause:
    """`sizes`: value, standard deviation, unit; the first is spoken of. `rivals`: chi-square lost with another in its place."""

    name: str
    form: str
    sizes: Mapping[str, tuple[float, float, str]]
    gain_share: float
    delta_chi2: float
    strength_sigma: float
    confidence: float
    equivalent: tuple[str, ...]
    rivals: Mapping[str, float]


@dataclass(frozen=True)
class Gain:
    """Rms errors of the simulated current vector on what was held out, and the share of the error that is gone there."""

    held_out: float | None
    rmse_before_a: float
    rmse_after_a: float
    noise_floor_a: float
    explained_share: float


@dataclass(frozen=True)
class Diagnosis:
    """Everything the report shows. `found` is None where the data were refused, or the time was over before four numbers were fitted.
    `stator_flux_wb`: where the iron saturates, the peak flux at which `parameters_after` hold, all but R_s."""

    verdict: DiagnosisVerdict
    reason: str
    causes: tuple[NamedCause, ...] = ()
    gain: Gain | None = None
    left: Lack | None = None
    parameters_before: Mapping[str, Quantity] = field(default_factory=dict)
    parameters_after: Mapping[str, Quantity] = field(default_factory=dict)
    next_experiment: Experiment | None = None
    found: Found | None = None
    record: Record | None = None
    remarks: tuple[str, ...] = ()
    refusal: DataRefused | None = None
    stator_flux_wb: float | None = None

    def numbers(self) -> dict[str, float]:
        """Of the final machine, by name; empty where the data were refused."""
        return self.found.fit.machine.values() if self.found else {}

    @property
    def is_complete(self) -> bool:
        """Whether every cause was tried and weighed. What was refused is not tried again with more time."""
        return self.found.is_complete if self.found else self.refusal is not None


UNFINISHED: tuple[DiagnosisVerdict, str] = (
    "unexplained", "Not finished: the time allowed was over before every cause was tried and weighed.",
)  # fmt: skip
NO_LIMIT = "The time allowed was over before every cause was tried: diagnose the recording again without a limit."


def diagnose(
    recordings: Sequence[RunningRecording],
    plate: Nameplate,
    *,
    excluded: Sequence[str] = (),
    observe: Callable[[Step], None] = lambda _: None,
    go_on: Callable[[], bool] = lambda: True,
) -> Diagnosis:
    """Names what a four-parameter simulation gets wrong about recordings of one running motor.

    Never raises on poor data: what cannot carry an answer comes back as `refused` with the reason. `go_on` is asked before
    every simulation of a window; once it says no, fit and search are given up: the answer says so, and names nothing.
    """
    try:
        record = prepare(recordings, plate)
        found = search(
            problem_of(record, HELD_OUT if record.has_speed else 0.0),
            excluded=excluded,
            observe=observe,
            go_on=go_on,
        )
    except DataRefused as refusal:
        return Diagnosis("refused", f"{refusal.what}; {refusal.remedy}", refusal=refusal)
    except TimeOver:
        return Diagnosis(*UNFINISHED, record=record, remarks=(*record.remarks, NO_LIMIT))
    return _conclude(found.problem.record, found)  # as it was read: means of an inverter's voltage, or held


def _conclude(record: Record, found: Found) -> Diagnosis:
    left = lack_of_fit(found.problem, found.nearest)
    causes = tuple(sorted((_cause(found, one) for one in found.accepted), key=lambda c: -c.gain_share))
    gain = _gain(found)
    verdict, reason = _verdict(causes, left, gain) if found.is_complete else UNFINISHED
    remarks = [
        *record.remarks,
        *not_told(found.fit),
        *of_shaft(left),
        *of_swing(swing_of(found.problem, found.fit.machine)),
    ]
    if verdict == "unexplained" and causes and gain.explained_share < MOSTLY_GUESSES:
        guesses = ", ".join(c.name.replace("_", " ") for c in causes)
        remarks.append(f"Helps the fit, but is more likely another cause in disguise, and is not named: {guesses}.")
        causes = ()
        verdict, reason = _verdict(causes, left, gain)
    remarks += _left_open(found) if causes else ()
    remarks += _of_trifles(found)
    if not found.is_complete:
        remarks.append(NO_LIMIT)
        if seen := ", ".join(so_far(found.steps)):
            remarks.append(f"Seen on the way, and not yet weighed against others: {seen.replace('_', ' ')}.")
    if not record.has_start:
        remarks.append(
            "No start in these data: saturation, deep bars, leakage and gains are hard to tell apart without one."
        )
    if not record.has_speed:
        remarks.append(
            "No speed column: the speed is that of a shaft with the fitted load, nothing is held out; iron loss and heating of the rotor are hard to see."
        )
    saturated: Mapping[str, Quantity] = {}
    if is_saturated(found.fit.machine.values()):
        saturated = _with_errors(found.problem, found.fit, lambda values: at_flux(record, values))
    return Diagnosis(
        verdict, reason, causes, gain, left, _parameters(found.problem, found.nominal), _with_trifles(found, {**_parameters(found.problem, found.fit), **saturated}),
        next_experiment(verdict, [(c.name, c.equivalent) for c in causes], record) if found.is_complete else None,
        found, record, tuple(remarks), stator_flux_wb=abs(stator_flux_wb(record, found.fit.machine.values())) if saturated else None,
    )  # fmt: skip


def _with_trifles(found: Found, told: Mapping[str, Quantity]) -> dict[str, Quantity]:
    """The parameters, what is too small to be named and moves them counted as an error of theirs."""
    values = {name: q.value for name, q in _parameters(found.problem, found.fit).items()}
    out = dict(told)
    for trifle in found.trifles:
        for name, moved in _parameters(found.problem, trifle.fit).items():
            if name in out:
                shift = moved.value - values[name]
                out[name] = Quantity(out[name].value, max(out[name].std, float(np.hypot(told[name].std, shift))))
    return out


def _of_trifles(found: Found) -> Iterator[str]:
    """What is too small to be named, and what it would move most."""
    if not found.trifles:
        return
    names = ", ".join(dict.fromkeys(t.cause.cause.replace("_", " ") for t in found.trifles))
    strength = max(np.sqrt(t.gain / t.fit.count) for t in found.trifles)
    values = {name: q.value for name, q in _parameters(found.problem, found.fit).items() if q.value}
    moved = [
        (q.value / values[k] - 1.0, k)
        for t in found.trifles
        for k, q in _parameters(found.problem, t.fit).items()
        if k in values
    ]
    share, most = max(moved, key=lambda one: abs(one[0]))
    yield (
        f"Too small to be named from these data, at most {strength:.2g} of the noise: {names}. If one of them is there, "
        f"{most.rpartition('_')[0].replace('_', ' ')} is up to {share:+.1%} from what is told; the standard deviations hold that."
    )


def _left_open(found: Found) -> Iterator[str]:
    """What a named cause leaves open of all parameters."""
    values = dict(zip(NAMES, found.fit.machine.physical(), strict=True))
    for one in found.accepted:
        if said := CATALOGUE[one.cause].leaves_open(values):
            yield said


def _gain(found: Found) -> Gain:
    fitted_before, before = rms_errors(found.problem, found.nominal.machine)
    fitted_after, after = rms_errors(found.problem, found.fit.machine)
    floor = found.problem.noise.total
    chi2 = (found.nominal.chi2 - found.nominal.count, found.fit.chi2 - found.fit.count)
    share = 1.0 - max(chi2[1], 0.0) / max(chi2[0], 1e-9) if chi2[0] > 0 and found.accepted else 0.0
    held = None
    if found.accepted and before**2 > (1.0 + LEAST_ERROR) * floor**2:
        held = 1.0 - max(after**2 - floor**2, 0.0) / (before**2 - floor**2)
    return Gain(held, before or fitted_before, after or fitted_after, floor, float(np.clip(share, 0.0, 1.0)))


def _cause(found: Found, one: Named) -> NamedCause:
    gain, rivals = found.gain[one.cause], found.rivals[one.cause]
    close = max(RULES.tie * found.fit.scale, RULES.tie_share * gain)
    tied = [name for name, lost in rivals.items() if lost < close]
    name, *same = goes_by(one.cause, found.problem.record, found.fit.machine.values())
    known = (*tied_in(name, found.problem.record), *_of_own_unbalance(found, one), *same)
    equivalent = tuple(dict.fromkeys((*known, *tied)))
    nearest = min((lost for name, lost in rivals.items() if name not in equivalent), default=gain)
    sure = MOST_SURE * (1.0 - np.exp(-0.5 * min(nearest, gain) / (found.fit.scale * 5.0)))
    total = max(found.nominal.chi2 - found.fit.chi2, 1e-9)
    return NamedCause(
        name, one.form.name, _sizes(found, one, CATALOGUE[name]), float(min(gain / total, 1.0)), gain, float(np.sqrt(gain / found.fit.count)),
        float(sure), equivalent, rivals,
    )  # fmt: skip


def _of_own_unbalance(found: Found, one: Named) -> tuple[str, ...]:
    """Whoever makes the impedance at negative sequence another than at slip, where a cause of that sequence is small beside the mains' own."""
    record, machine = found.problem.record, found.fit.machine
    if record.has_start or CATALOGUE[one.cause].negative_sequence != "adds":
        return ()
    without = machine.with_values(dict.fromkeys(one.form.numbers, 0.0))
    runs = zip(*(simulate(found.problem, m) for m in (machine, without)), strict=True)
    made = np.concatenate([(a[0] - b[0])[:, :2] for a, b in runs])
    volts = max(negative_sequence(w.voltage[::2]) for w in record.windows)
    driven = volts / (record.scales.frequency_rad_per_s * machine.value("leakage_inductance"))
    if np.sqrt(2.0 * np.mean(made**2)) >= RULES.own_unbalance * driven:
        return ()
    accepted = {c.cause for c in found.accepted}
    return tuple(c.name for c in CATALOGUE.values() if c.negative_sequence == "impedes" and c.name not in accepted)


def _sizes(found: Found, one: Named, cause: Cause) -> dict[str, tuple[float, float, str]]:
    """With standard deviations from the covariance of all that was free."""
    scales = found.problem.record.scales
    units = {name: unit for name, (_, unit) in cause.sizes(found.fit.machine.values(), scales).items()}
    told = _with_errors(
        found.problem, found.fit, lambda values: {name: size for name, (size, _) in cause.sizes(values, scales).items()},
        is_by_law=cause.is_sized_by_law(found.problem.record),
    )  # fmt: skip
    return {name: (q.value, q.std, units[name]) for name, q in told.items()}


def _with_errors(problem: Problem, fit: Fit, made: Made, *, is_by_law: bool = True) -> dict[str, Quantity]:
    """What is made of the machine's numbers, with standard deviations from the covariance of all that was free; `is_by_law`: with what
    nobody knows of where iron loses and what form bars have."""
    covariance, told = scattered(problem, fit), made_of(fit, made)
    moves = np.array([moved for _, moved in told.values()])
    variance = np.maximum(np.einsum("ij,jk,ik->i", moves, covariance, moves), 0.0)
    if is_by_law:
        variance = variance + np.sum(by_laws(fit, moves) ** 2, axis=0)
    return {name: Quantity(told[name][0], float(std)) for name, std in zip(told, np.sqrt(variance), strict=True)}


def _verdict(causes: Sequence[NamedCause], left: Lack, gain: Gain) -> tuple[DiagnosisVerdict, str]:
    is_off = left.sigma > UNEXPLAINED_SIGMA and (not causes or gain.explained_share < LEAST_SHARE)
    in_bursts = left.burst_sigma > BURST_SIGMA and (not causes or gain.explained_share < BURST_SHARE)
    if is_off or in_bursts or left.sigma > FAR_OFF_SIGMA:
        names = (
            f" The data are consistent with {', '.join(c.name for c in causes)}, but something else is in them too."
            if causes
            else ""
        )
        where = f" Most of it lies at {left.burst_at_s:.2f} s." if left.burst_sigma > 2.0 * max(left.sigma, 0.1) else ""
        size = max(left.sigma, left.burst_sigma if in_bursts else 0.0)
        return (
            "unexplained",
            f"A structured error of {size:.2g} times the noise remains that no cause in the catalogue makes.{where}{names}",
        )
    if not causes:
        return (
            "nothing_significant",
            "The four-parameter model reproduces the recording to within its noise.",
        )
    tied = [c for c in causes if c.equivalent]
    if tied:
        return (
            "not_distinguishable",
            f"These data cannot tell apart: {'; '.join(' or '.join((c.name, *c.equivalent)) for c in tied)}.",
        )
    if left.sigma > 0.0:
        return (
            "explained",
            f"The named causes leave {left.sigma:.2g} times the noise, {1.0 - gain.explained_share:.1%} of the error power that there was to explain.",
        )
    return "explained", "The named causes leave nothing above the noise."


def _parameters(problem: Problem, fit: Fit) -> dict[str, Quantity]:
    out = _with_errors(problem, fit, _four)
    if fit.machine.has_shaft and any(c.kind == "p" and c.index == AT["inertia"] for c in fit.columns):
        out["inertia_kg_m2"] = Quantity(fit.machine.value("inertia"), fit.std("inertia"))
    return out


def _four(values: Mapping[str, float]) -> dict[str, float]:
    four = at_small_slip(values)
    return {**dict(zip(PARAMETERS, four.as_tuple(), strict=True)), "rotor_time_constant_s": four.rotor_time_constant_s}
