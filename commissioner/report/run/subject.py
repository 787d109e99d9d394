"""What a run's report is made from, under the names that its pages use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from commissioner.motor.space_vector import axis_current_a
from commissioner.procedure.steps import Findings
from commissioner.records import Signal
from commissioner.report.run.standing import Standing, standing

Record = Mapping[str, Any]
DAY_S = 86400.0
_ALLOWED = {
    "stator_resistance_ohm": "resistance_std_percent",
    "rotor_resistance_ohm": "rotor_resistance_std_percent",
    "leakage_inductance_h": "leakage_std_percent",
    "magnetizing_inductance_h": "magnetizing_std_percent",
}


@dataclass(frozen=True)
class Session:
    """One energised stretch: time from its start, current along the axis, and, where the fit used it, stator flux and
    what the model leaves; `(n,)` each."""

    time_s: Signal
    current_a: Signal
    stator_flux_wb: Signal | None
    residual_a: Signal | None

    @classmethod
    def fitted(cls, current: Signal, sample_period_s: float, flux: Signal, residual: Signal) -> Session:
        """Where the current was not measured nothing is left over: such a stretch has no residual to draw."""
        return cls(
            np.arange(current.size, dtype=np.float64) * np.float64(sample_period_s),
            current,
            flux if flux.size == current.size else None,
            residual if residual.size == current.size else None,
        )


@dataclass(frozen=True)
class Gaps:
    """What the recordings lack: how often, and how many samples."""

    count: int
    lost_samples: int


@dataclass(frozen=True)
class Test:
    """Every session of one orientation in a row."""

    number: int
    axis_deg: float
    sessions: tuple[Session, ...]
    noise_a: float

    def joined(self, what: str) -> tuple[Signal, Signal]:
        """Energised time and one quantity over all sessions that have it."""
        times, values, start = [], [], 0.0
        for session in self.sessions:
            value = getattr(session, what)
            if value is not None:
                times.append(start + session.time_s)
                values.append(value)
            start += float(session.time_s[-1]) if session.time_s.size else 0.0
        return (np.concatenate(times), np.concatenate(values)) if times else (np.empty(0), np.empty(0))


@dataclass(frozen=True)
class Subject:
    """A run: its result document, its journal's lines, what it learnt and what it was asked to do."""

    result: Record
    journal: Sequence[Record]
    findings: Findings
    request: Record

    @property
    def run(self) -> str:
        return str(self.result["run"])

    @property
    def outcome(self) -> str:
        return str(self.result["outcome"])

    @property
    def standing(self) -> Standing:
        return standing(self.result)

    @property
    def is_good(self) -> bool:
        return self.outcome == "commissioned"

    @property
    def parameters(self) -> Record:
        return self.result.get("parameters") or {}

    @property
    def written(self) -> dict[str, Record]:
        """Rows of what was written, by the contract's name of the parameter."""
        return {row["field"]: row for row in self.result.get("written") or () if row.get("field")}

    def in_si(self, row: Record, key: str) -> float:
        """A number of a written row in the contract's unit and convention."""
        return float(row[key]) / float(row.get("per_si") or 1.0)

    @property
    def before(self) -> Record:
        return self.result.get("before") or {}

    @property
    def guard(self) -> Record:
        return self.result.get("flux_guard") or {}

    @property
    def gaps(self) -> Gaps | None:
        found = self.result.get("gaps")
        return Gaps(**found) if found else None

    def first(self, kind: str) -> Record:
        """The first record of a kind; empty where there is none."""
        return next((line["record"] for line in self.journal if line["kind"] == kind), {})

    @cached_property
    def job(self) -> Record:
        return self.first("job")

    @property
    def plate(self) -> Record:
        return self.job.get("nameplate") or {}

    @property
    def plan(self) -> Record:
        return self.job.get("plan") or {}

    @property
    def planned_deg(self) -> tuple[float, ...]:
        """The axis of each test of the plan: one axis alone is not repeated."""
        axes = tuple(self.plan.get("axes_deg") or ())
        return (*axes, axes[0]) if self.plan.get("repeat_first") and len(axes) > 1 else axes

    @property
    def origin(self) -> Record:
        """Who made the run, where, by which version."""
        return self.first("run_started")

    def told(self, what: str) -> str:
        """What a person said about the motor and its place: with the order, or since; empty where nobody did."""
        said = [line["record"] for line in self.journal if line["kind"] == "motor_named"]
        for record in (*reversed(said), self.request.get("origin") or {}):
            if record.get(what):
                return str(record[what])
        return ""

    @property
    def begun(self) -> str:
        """UTC to the second; empty where the run left no record."""
        return str(self.journal[0]["utc"])[:19].replace("T", " ") if self.journal else ""

    @property
    def seconds(self) -> float | None:
        """By the clock, from the first to the last record that the run itself wrote."""
        ended = next((str(line["utc"]) for line in self.journal if line["kind"] == "run_ended"), None)
        return (_of_day(ended) - _of_day(str(self.journal[0]["utc"]))) % DAY_S if ended else None

    @property
    def is_simulated(self) -> bool:
        """The drive says of itself that it is a simulation."""
        return str((self.result.get("drive") or {}).get("drive_type", "")).startswith("SIM")

    def allowed_percent(self, name: str) -> float | None:
        """Standard error that the procedure allows of a parameter."""
        acceptance = self.plan.get("acceptance") or {}
        return acceptance.get(_ALLOWED.get(name, ""))

    @property
    def trip_current_a(self) -> float | None:
        """Peak phase current at which the drive ends a test."""
        drive, limits = self.result.get("drive") or {}, self.plan.get("limits") or {}
        if not (drive and limits and self.plate):
            return None
        own = float(limits["trip_fraction"]) * float(self.plate["rated_current_a"])
        return float(np.sqrt(2.0)) * min(own, float(drive["rated_drive_current_a"]))

    @property
    def peak_current_a(self) -> float | None:
        """The largest current along an axis, of all samples."""
        peaks = [float(np.max(np.abs(current))) for current in self._currents if current.size]
        return max(peaks) if peaks else None

    @property
    def peak_flux_wb(self) -> float | None:
        fraction, limit = self.guard.get("peak_fraction"), self.guard.get("limit_wb")
        return float(fraction) * float(limit) if fraction and limit else None

    @property
    def samples(self) -> int:
        return sum(block.count for _, block in self.findings.blocks)

    @property
    def lost_samples(self) -> int:
        """Of the stream, whether or not a result was made of it."""
        return sum(block.lost_before for _, block in self.findings.blocks)

    @property
    def tests_done(self) -> int:
        """Tests that came to their end, whether or not a result was made of them."""
        return sum(line["kind"] == "axis_finished" and not line["record"]["is_look"] for line in self.journal)

    @cached_property
    def tests(self) -> list[Test]:
        """The tests whose samples the result is fitted to, in order."""
        found = self.findings.identification
        if found is None:
            return []
        currents, tests = list(self._currents), []
        for number, axis in enumerate(found.axes, start=1):
            fit = axis.batch
            mine, currents = currents[: len(fit.residuals)], currents[len(fit.residuals) :]
            sessions = tuple(
                Session.fitted(current, fit.sample_period_s, flux, residual)
                for current, flux, residual in zip(mine, fit.stator_flux_wb, fit.residuals, strict=False)
            )
            tests.append(Test(number, axis.axis_deg, sessions, fit.noise_a))
        return tests

    @cached_property
    def estimates(self) -> list[list[Record]]:
        """The online estimates of each test; the look at an unknown motor is not among them."""
        tests: list[list[Record]] = []
        is_test = False
        for line in self.journal:
            if line["kind"] == "excitation_chosen":
                is_test = not line["record"]["is_look"]
                if is_test:
                    tests.append([])
            elif line["kind"] == "estimate_updated" and is_test:
                tests[-1].append(line["record"])
        return [test for test in tests if test]

    @property
    def applied_a(self) -> tuple[Signal, Signal]:
        """Energised time and the current along the axis, all sessions in a row."""
        period_s = np.repeat(
            [block.sample_period_s for _, block in self.findings.blocks],
            [block.count for _, block in self.findings.blocks],
        )
        return np.cumsum(period_s), np.concatenate(self._currents)

    @property
    def guarded(self) -> tuple[Signal, Signal]:
        """Time under tones, all tests in a row, and the flux that the guard judged, of its limit."""
        said = [line["record"] for line in self.journal if line["kind"] == "estimate_updated"]
        share = np.array([record["flux_fraction"] for record in said])
        times = np.array([record["time_s"] for record in said])
        begun = np.diff(times, prepend=0.0)
        return np.cumsum(np.where(begun > 0.0, begun, times)), share

    @cached_property
    def _currents(self) -> list[Signal]:
        """The current along the axis, one array for each energised session, in order."""
        sessions: dict[int, list[Signal]] = {}
        for segment, block in self.findings.blocks:
            current = axis_current_a(block.current_u_a, block.current_v_a, block.current_w_a, block.axis_deg)
            sessions.setdefault(segment, []).append(current)
        return [np.concatenate(parts) for parts in sessions.values()]


def _of_day(utc: str) -> float:
    """Seconds since midnight of an ISO time stamp."""
    hours, minutes, seconds = utc[11:].removesuffix("+00:00").split(":")
    return 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds)
