"""One generator per state: it yields commands, receives the drive's replies and returns the event that ends its state.

Nothing here knows a socket, a file or a clock; a scripted drive tests every path.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from commissioner.identify.analysis import Identification, identify
from commissioner.identify.excite.duration import LongerTest, longer_test
from commissioner.identify.excite.tones import DesignedExcitation
from commissioner.identify.inverter.first_current import FirstCurrent
from commissioner.identify.inverter.staircase import IDEAL_INVERTER, DcLevel, InverterError, Staircase
from commissioner.motor.circuit import PARAMETERS, InverseGamma
from commissioner.motor.nameplate import prior
from commissioner.motor.plate_match import PlateMatch
from commissioner.procedure.assembly import assemble, highest_stator_flux_wb
from commissioner.procedure.checks import CheckResult, check_failed, judge_drive
from commissioner.procedure.findings import (
    ChecksJudged,
    DriveIdentified,
    LeftUnfinished,
    LinkPlanned,
    RunEnded,
    StateEntered,
    VerdictReached,
)
from commissioner.procedure.link_plan import LinkPlan, plan_link
from commissioner.procedure.plan import BELOW_TRIP, Job
from commissioner.procedure.states import ENDED, ENERGISED, Event, State, follow
from commissioner.procedure.verdict import Decision, Objection, Verdict, decide, drive_name, evidence_of, match_of
from commissioner.records import DriveIdentity, DriveStatus, ParameterSnapshot, SampleBlock, WrittenParameter
from commissioner.safety.commands import (
    ArmWatchdog,
    Command,
    Identify,
    ReadNameplate,
    ReadStatus,
    TakeSnapshot,
    Tell,
    Wait,
    WriteParameters,
)

Step = Generator[Command, Any, Event]
"""What a state's generator is: yields commands, is sent replies, returns an event."""

PLATE_RESISTANCE_STD = 0.5
"""Of the R_s that a plate makes most likely, relative: 37 published machines scatter by 0.4 of it. A staircase whose currents stayed on the knee of what the
inverter loses said 0 +- 0.59 ohm of a motor of 0.28: held for certain, it kept the tests at a fifth of their flux."""
AT_WORST = 3.0
"""Standard errors of a look's L_M that a direct current reckons with, as the flux guard of the tones does: looks that knew L_M to 13 and
17 % let a staircase reach 1.18 and 1.04 of the limit, and a closing bias 1.08."""
DWELL_READINGS = 4
"""Status readings spread over the standstill dwell time."""


@dataclass
class Findings:
    """What one run has learnt so far; the report is made from it however the run ends."""

    identity: DriveIdentity | None = None
    left_unfinished: LeftUnfinished | None = None
    """By an earlier run on this drive."""
    link: LinkPlan = field(default_factory=LinkPlan)
    snapshot: ParameterSnapshot | None = None
    checks: tuple[CheckResult, ...] = ()
    winding_degc: float | None = None
    """Before the first volt; None where the drive has no sensor."""
    tests_done: int = 0
    first_current: FirstCurrent | None = None
    knee: tuple[DcLevel, ...] = ()
    staircases: list[Staircase] = field(default_factory=list)
    held_v: float = 0.0
    """Of the last staircase: the largest voltage whose current, once settled, makes no more flux than was aimed at."""
    look: Identification | None = None
    """The newest batch fit of what had been recorded by then."""
    axis_s: float = 0.0
    """Energised on the present axis so far."""
    estimate: InverseGamma | None = None
    is_measured: bool = False
    """All four values of `estimate` were measured on this motor, none is the plate's."""
    excitations: list[DesignedExcitation] = field(default_factory=list)
    """Of the tests that are done, in order; the look at an unknown motor is not among them."""
    blocks: list[tuple[int, SampleBlock]] = field(default_factory=list)
    segment: int = -1
    peak_flux_fraction: float = 0.0
    guard_acted: bool = False
    flux_limit_wb: float | None = None
    identification: Identification | None = None
    verdict: Verdict | None = None
    plate_match: PlateMatch | None = None
    """Of the combined values."""
    written: tuple[WrittenParameter, ...] = ()

    @property
    def of_the_archive(self) -> tuple[str, ...]:
        """Remarks that no sample tells, so that no replay comes to them."""
        return () if self.left_unfinished is None else (self.left_unfinished.sentence,)

    @property
    def inverter(self) -> InverterError:
        """The newest inverter error: of the newest look, else of the last staircase, else none."""
        if self.look is not None and self.look.inverter is not None:
            return self.look.inverter
        return self.staircases[-1].inverter if self.staircases else IDEAL_INVERTER

    @property
    def longer_test(self) -> LongerTest | None:
        """What tests of twice the length would buy; None before there is a result."""
        found = self.identification
        if found is None or len(found.axes) != len(self.excitations):
            return None
        noise_a = [axis.batch.noise_a for axis in found.axes]
        return longer_test(found.parameters, found.std, self.excitations, noise_a)

    def trip_current_a(self, job: Job) -> float:
        """Peak phase current at which the drive will end a test: the motor's or the drive's own limit."""
        assert self.identity is not None
        return min(job.trip_current_a, self.identity.rated_drive_current_a * math.sqrt(2))

    def test_current_a(self, job: Job) -> float:
        """The largest current along the axis that a test on this drive aims at, peak."""
        return min(job.test_current_a, BELOW_TRIP * self.trip_current_a(job))

    def at_worst(self, machine: InverseGamma) -> InverseGamma:
        """A machine that was measured, with the largest L_M that the newest look allows."""
        doubt_h = AT_WORST * self.look.std[3] if self.look is not None else 0.0
        return replace(machine, magnetizing_inductance_h=machine.magnetizing_inductance_h + doubt_h)

    def resistance_ohm(self, job: Job) -> float:
        """The best stator resistance so far: the newest look's where that is sure, else what look, last staircase and plate say
        together, each by its standard error."""
        box, look = prior(job.nameplate), self.look
        if look is not None and look.std[0] < 0.05 * look.parameters.stator_resistance_ohm:
            return look.parameters.stator_resistance_ohm
        typical_ohm = box.typical.stator_resistance_ohm
        said = [(typical_ohm, PLATE_RESISTANCE_STD * typical_ohm)]
        said += [(s.stator_resistance.value, s.stator_resistance.std) for s in self.staircases[-1:]]
        if look is not None:
            said.append((look.parameters.stator_resistance_ohm, look.std[0]))
        weighed = [(value_ohm, 1.0 / std_ohm**2) for value_ohm, std_ohm in said if std_ohm > 0.0]
        mean_ohm = sum(value_ohm * weight for value_ohm, weight in weighed) / sum(weight for _, weight in weighed)
        return min(max(mean_ohm, box.lower.stator_resistance_ohm), box.upper.stator_resistance_ohm)


def through(
    steps: Mapping[State, Callable[[Job, Findings], Step]], job: Job, findings: Findings
) -> Generator[Command, Any, RunEnded]:
    """From state to state by the transition table, each carried out by its step, until one that has ended."""
    state, because = follow(State.IDLE, Event.START), Event.START
    while state not in ENDED:
        axis_deg = job.plan.tests_deg[findings.tests_done] if state in ENERGISED else None
        yield Tell(StateEntered(state.value, because.value, axis_deg))
        because = yield from steps[state](job, findings)
        state = follow(state, because)
    return RunEnded(state.value, findings.verdict.reason if findings.verdict else because.value, 0.0)


def connect(job: Job, findings: Findings) -> Step:
    """Who is at the other end."""
    identity: DriveIdentity = yield Identify()
    findings.identity = identity
    yield Tell(DriveIdentified(**asdict(identity)))
    return Event.IDENTIFIED


def check(job: Job, findings: Findings) -> Step:
    """Everything that must hold before the first volt; arms the watchdog and sets the drive's own limits."""
    assert findings.identity is not None
    plate = yield ReadNameplate()
    statuses: list[DriveStatus] = [(yield ReadStatus())]
    for _ in range(DWELL_READINGS - 1):
        yield Wait(job.plan.supervision.standstill_dwell_s / (DWELL_READINGS - 1))
        statuses.append((yield ReadStatus()))
    results = judge_drive(
        findings.identity, statuses, plate, job.nameplate, job.drive_limits, job.test_current_a, job.pace
    )
    findings.checks = results
    winding_degc = statuses[-1].winding_degc
    findings.winding_degc = winding_degc if math.isfinite(winding_degc) else None
    yield Tell(ChecksJudged(results))
    failure = check_failed(results)
    if failure is not None:
        raise failure
    findings.link = plan_link(job.pace, findings.identity.control_period_s) or findings.link
    if findings.link.is_reduced:
        period_s = findings.identity.control_period_s
        yield Tell(LinkPlanned(findings.link.channels, findings.link.averaged, findings.link.sentence(period_s)))
    findings.snapshot = yield TakeSnapshot()
    yield ArmWatchdog(job.watchdog_s)
    return Event.CHECKS_PASSED


def reject(findings: Findings, objections: tuple[Objection, ...]) -> Generator[Command, Any, Event]:
    """End here, for these reasons; nothing more is energised or written."""
    findings.verdict = Verdict(Decision.REJECT, objections)
    yield Tell(told(findings.verdict))
    return Event.REJECT


def told(verdict: Verdict) -> VerdictReached:
    """The verdict as the journal has it: with its gravest objection."""
    value, limit, remedy = next(((o.value, o.limit, o.remedy) for o in verdict.objections), (None, None, ""))
    return VerdictReached(verdict.decision.value, verdict.reason, value, limit, remedy)


def judge(job: Job, findings: Findings) -> Step:
    """All segments together, by the same code as `identify` uses offline; then the verdict."""
    recording = assemble(findings.blocks, {}, "live run")
    assert recording is not None
    identification = identify(
        recording, job.nameplate, winding_temperature_degc=findings.winding_degc, earlier=findings.look
    )
    findings.identification = identification
    longer = findings.longer_test
    evidence = replace(
        evidence_of(identification),
        guard_acted=findings.guard_acted,
        beyond_time=longer.in_vain_for if longer else frozenset(),
        held=_held(findings.snapshot),
    )
    findings.plate_match = match_of(evidence.combined, job.nameplate)
    verdict = decide(evidence, job.nameplate, job.plan.acceptance, write_back=job.write_back)
    findings.verdict = verdict
    highest_wb = highest_stator_flux_wb(findings.blocks, identification.parameters)
    limit_wb = findings.flux_limit_wb or job.flux_limit_wb(findings.resistance_ohm(job))
    findings.peak_flux_fraction = max(findings.peak_flux_fraction, highest_wb / limit_wb)
    yield Tell(told(verdict))
    return {Decision.WRITE_BACK: Event.WRITE_BACK, Decision.KEEP: Event.KEEP, Decision.REJECT: Event.REJECT}[
        verdict.decision
    ]


def _held(snapshot: ParameterSnapshot | None) -> dict[str, float]:
    """What the drive held in use, by our names where its own name is ours without a unit."""
    in_use = snapshot.in_use if snapshot is not None else {}
    return {name: in_use[drive_name(name)] for name in PARAMETERS if drive_name(name) in in_use}


def write(job: Job, findings: Findings) -> Step:
    """The accepted values into the drive, verified; the runner restores the snapshot where that fails."""
    assert findings.identification is not None
    findings.written = yield WriteParameters(findings.identification.parameters, job.nameplate)
    return Event.VERIFIED
