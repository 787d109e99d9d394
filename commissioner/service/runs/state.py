"""What a run is doing, told from its journal alone: a fold over the records, the same live and years later."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from commissioner.procedure.states import State

MEASURING = (State.RESISTANCE.value, State.EXCITING.value)
HISTORY = 600
"""Estimates kept for the curves of one axis."""


@dataclass
class AxisTest:
    """One test of the plan. `parameters`, `std`: R_s, R_R, L_sigma, L_M in SI, as far as known."""

    axis_deg: float
    state: str = "waits"
    energised_s: float = 0.0
    parameters: list[float] | None = None
    std: list[float] | None = None


@dataclass
class OwnTuning:
    """A drive's own tuning: the results of each repeat that is done, and what the person at the drive is asked now."""

    done: list[dict[str, Any]] = field(default_factory=list)
    question: dict[str, Any] | None = None


@dataclass
class RunState:
    """`output`: on | off | unknown, by the drive's own word; `phase`: what the run is at."""

    run: str
    phase: str = "starting"
    output: str = "off"
    output_utc: str = ""
    output_word: str = ""
    is_confirmed: bool = True
    records: int = 0
    utc: str = ""
    tests: list[AxisTest] = field(default_factory=list)
    part: str = ""
    has_touched: bool = False
    planned_test_s: float = 0.0
    acceptance: dict[str, float] = field(default_factory=dict)
    current_limit_a: float | None = None
    flux_limit_wb: float | None = None
    current_high_a: float = 0.0
    flux_now_wb: float | None = None
    flux_high_wb: float = 0.0
    drive: dict[str, Any] = field(default_factory=dict)
    history: list[list[float]] = field(default_factory=list)
    stop: dict[str, Any] | None = None
    error: dict[str, Any] | None = None
    end: dict[str, Any] | None = None
    written: list[dict[str, Any]] = field(default_factory=list)
    link: dict[str, Any] | None = None
    diagnosis_s: float = 0.0
    tuning: OwnTuning | None = None

    @property
    def current(self) -> int | None:
        """Index of the test that is running or comes next; None once all are done or nothing is planned."""
        return next((k for k, test in enumerate(self.tests) if test.state != "done"), None)

    @property
    def is_over(self) -> bool:
        """The run has its end; it may still be diagnosing."""
        return self.end is not None

    @property
    def left_s(self) -> float:
        """Energised seconds that are still to come, about."""
        k = self.current
        if k is None or self.is_over:
            return 0.0
        planned = self.planned_test_s
        return (len(self.tests) - k - 1) * planned + max(0.0, planned - self.tests[k].energised_s)

    def heard(self, error: object) -> None:
        """What the process of a run said as it went, where its journal has no end, as on a disk that is full."""
        if isinstance(error, dict) and self.end is None:
            self.error = error

    def energised(self, seconds: float) -> None:
        """Motor time under voltage, as the blocks tell it."""
        k = self.current
        if k is not None:
            self.tests[k].energised_s += seconds
            self.tests[k].state = "running"

    def take(self, line: Mapping[str, Any]) -> None:
        """One record of the journal. One of another form than ours, as somebody or another version wrote it, tells nothing more."""
        record = line["record"] if isinstance(line.get("record"), dict) else {}
        self.utc = str(line.get("utc", ""))
        fold = _FOLDS.get(str(line["kind"]))
        with contextlib.suppress(LookupError, TypeError, ValueError, AttributeError):
            self.records = int(line.get("n", self.records)) + 1
            if fold is not None:
                fold(self, record)


def _warming(state: RunState, _record: dict[str, Any]) -> None:
    state.phase = "warming up"


def _job(state: RunState, record: dict[str, Any]) -> None:
    plan, plate = record["plan"], record["nameplate"]
    axes = list(plan["axes_deg"])
    if plan.get("repeat_first") and len(axes) > 1:
        axes.append(axes[0])
    state.tests = [AxisTest(float(axis)) for axis in axes]
    state.planned_test_s = plan["excitation"]["seconds"] + plan["excitation"]["staircase_seconds"]
    state.acceptance = dict(plan["acceptance"])
    state.current_limit_a = plan["limits"]["trip_fraction"] * 2**0.5 * plate["rated_current_a"]
    state.phase = "connecting"


def _entered(state: RunState, record: dict[str, Any]) -> None:
    name = str(record.get("state", ""))
    known = {State.CONNECTING.value: "connecting", State.CHECKING.value: "checking", State.JUDGING.value: "judging",
             State.WRITING.value: "writing"}  # fmt: skip
    state.phase = "measuring" if name in MEASURING else known.get(name, state.phase)
    if name == State.RESISTANCE.value:
        state.part, state.history = "levels", []


def _intent(state: RunState, record: dict[str, Any]) -> None:
    state.has_touched = True
    action = record.get("action")
    if action in ("energise", "tune"):
        state.output, state.output_utc, state.is_confirmed = "on", state.utc, True
    if action == "tune":
        state.phase = "tuning"


def _disarmed(state: RunState, record: dict[str, Any]) -> None:
    verified = record.get("verified") or {}
    state.is_confirmed = bool(verified.get("is_confirmed"))
    state.output = "off" if state.is_confirmed or state.output == "off" else "unknown"
    state.output_utc, state.output_word = state.utc, str(verified.get("state", ""))
    state.flux_now_wb = None


def _chosen(state: RunState, record: dict[str, Any]) -> None:
    state.part = "look" if record.get("is_look") else "tones"
    state.history = []


def _bias(state: RunState, record: dict[str, Any]) -> None:
    if record.get("seconds"):
        state.part = "bias"


def _estimate(state: RunState, record: dict[str, Any]) -> None:
    observed, free = record["observer_flux_wb"] or 0.0, record["model_free_flux_wb"] or 0.0
    agreed = record["agreed_flux_fraction"] or 0.0
    if agreed > 0.0:
        state.flux_limit_wb = min(observed, free) / agreed
    state.flux_now_wb = observed
    state.flux_high_wb = max(state.flux_high_wb, observed)
    k = state.current
    if k is None or None in record["parameters"] or None in record["std"]:
        return
    state.tests[k].parameters, state.tests[k].std = list(record["parameters"]), list(record["std"])
    state.history.append([record["time_s"], *record["parameters"], *record["std"]])
    del state.history[:-HISTORY]


def _axis_done(state: RunState, record: dict[str, Any]) -> None:
    k = state.current
    if k is not None and not record.get("is_look"):
        state.tests[k].state = "done"


def _ended(state: RunState, record: dict[str, Any]) -> None:
    state.phase, state.end = "ended", record
    if isinstance(record.get("error"), dict):
        state.error = record["error"]


def _diagnosing(state: RunState, record: dict[str, Any]) -> None:
    state.phase, state.diagnosis_s = "diagnosing", float(record.get("seconds") or 0.0)


def _identified(state: RunState, record: dict[str, Any]) -> None:
    state.drive = record
    rated_a = record.get("rated_drive_current_a")
    if rated_a and state.current_limit_a is not None:
        state.current_limit_a = min(state.current_limit_a, 2**0.5 * rated_a)


def _error(state: RunState, record: dict[str, Any]) -> None:
    state.error = record


def _link(state: RunState, record: dict[str, Any]) -> None:
    state.link = record


def _written(state: RunState, record: dict[str, Any]) -> None:
    state.written = record.get("written", [])


def _diagnosed(state: RunState, _record: dict[str, Any]) -> None:
    state.phase = "ended"


def _tuning_began(state: RunState, _record: dict[str, Any]) -> None:
    state.tuning, state.phase = OwnTuning(), "tuning"


def _asked(state: RunState, record: dict[str, Any]) -> None:
    state.tuning = state.tuning or OwnTuning()
    state.tuning.question = record


def _answered(state: RunState, _record: dict[str, Any]) -> None:
    if state.tuning is not None:
        state.tuning.question = None


def _tuned_once(state: RunState, record: dict[str, Any]) -> None:
    state.tuning = state.tuning or OwnTuning()
    state.tuning.done.append(record)
    _at_rest(state, record)


def _tunings_judged(state: RunState, _record: dict[str, Any]) -> None:
    state.phase = "judging"


def _at_rest(state: RunState, _record: dict[str, Any]) -> None:
    """A tuning of its own is over: the drive was seen at rest."""
    state.output, state.output_utc, state.is_confirmed, state.output_word = "off", state.utc, True, "at rest"


def _stopped(state: RunState, record: dict[str, Any]) -> None:
    state.stop = record | {"utc": state.utc}


_FOLDS = {
    "warming_up": _warming, "job": _job, "state_entered": _entered, "about_to": _intent, "disarmed": _disarmed,
    "excitation_chosen": _chosen, "bias_chosen": _bias, "estimate_updated": _estimate, "axis_finished": _axis_done,
    "run_ended": _ended, "diagnosing": _diagnosing, "diagnosed": _diagnosed, "drive_identified": _identified,
    "error": _error, "link": _link, "parameters_written": _written, "stop_asked": _stopped, "tuned_once": _tuned_once,
    "tuning_began": _tuning_began, "tunings_judged": _tunings_judged, "tuning_ended": _at_rest, "asked_at_drive": _asked, "answered_at_drive": _answered,
}  # fmt: skip
