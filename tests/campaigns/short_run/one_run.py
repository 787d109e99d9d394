"""One random short run carried out against the simulated drive, and judged by the simulator's log and memory alone.

The product's own runner goes over a real wire; what its archive says afterwards is only compared with the truth.
"""

from __future__ import annotations

import contextlib
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from unittest import mock

from commissioner.errors import CommissionerError
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.modbus import ModbusPort, open_port
from commissioner.link.wire.url import parse_url
from commissioner.motor.nameplate import rated_flux
from commissioner.procedure.findings import RunEnded
from commissioner.procedure.plan import Job
from commissioner.procedure.steps import Findings
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.summary import RunSummary, summarise
from commissioner.run.job import bounds, drive_limits, names_of, watch_limits
from commissioner.run.runner import Runner
from sim.scenario import Scenario, build, read_document
from sim.wire.line import Handler
from sim.wire.server import Running, run_in_thread
from sim.wire.station import Options
from tests.campaigns.short_run import truth
from tests.campaigns.short_run.sequences import Sequence
from tests.campaigns.short_run.short_course import (
    NEW_ON_THE_WIRE,
    OLD_ON_THE_WIRE,
    PLAN,
    REPLY_TIMEOUT_S,
    plate,
    short_course,
)

LINK_LATENCY_S = 0.02
TRUE_STATOR_RESISTANCE_OHM = 3.7
WATCHDOG_TRIP = 6
REPEATS, STALL_S = 8, 0.02
"""A sequence that this machine disturbed by letting a thread or an answer wait so long is run again, so often at most."""
PAUSE_S = 0.1
RING_SAMPLES = 1000
AFTER_STALL_S = 1.0
"""So long after a stall that was asked for, a slow answer says nothing about the machine."""


@dataclass
class Outcome:
    """How the run ended and which invariants broke.

    `dead_after_s`: longest time energised after a loss; `harmed`: requests that the simulator denied an answer;
    `lost`: answers that the link missed or did not believe; `stall_s`: how long this machine let a thread wait;
    `answer_s`: the longest request whose answer was sent sound and at once.
    """

    sequence: Sequence
    ended: RunEnded | None
    broken: list[str] = field(default_factory=list)
    dead_after_s: float = 0.0
    sessions: int = 0
    harmed: int = 0
    lost: int = 0
    watchdog_bites: int = 0
    seconds: float = 0.0
    stall_s: float = 0.0
    answer_s: float = 0.0
    repeats: int = 0

    @property
    def was_disturbed(self) -> bool:
        """Whether the machine, not the sequence, may have decided the run: reply time-out and watchdog are short."""
        has_stalled = max(self.stall_s, self.answer_s) >= STALL_S
        return has_stalled and bool(self.broken or self.lost > self.harmed or self.watchdog_bites)


class StallWatch:
    """How long this machine at most let a thread wait: the simulated watchdog lives on it, a real one does not."""

    def __enter__(self) -> StallWatch:
        self.longest_s, self._is_over = 0.0, threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        self._thread.join()

    def _watch(self) -> None:
        last = time.monotonic()
        while not self._is_over.wait(0.005):
            now = time.monotonic()
            self.longest_s, last = max(self.longest_s, now - last - 0.005), now


class AnswerWatch:
    """The longest request whose answer the simulator sent sound and at once: a few milliseconds, unless this machine
    is too busy to run the simulator's thread or to carry bytes through a pseudo terminal or its loopback."""

    def __init__(self) -> None:
        self.longest_s, self._is_sound = 0.0, False

    def __enter__(self) -> AnswerWatch:
        self._patches = contextlib.ExitStack()
        self._patches.enter_context(mock.patch.object(Handler, "_put", self._noting(Handler._put)))
        self._patches.enter_context(mock.patch.object(ModbusPort, "_transact", self._timing(ModbusPort._transact)))
        return self

    def __exit__(self, *_: object) -> None:
        self._patches.close()

    def _noting(self, put: Callable[..., None]) -> Callable[..., None]:
        def noted(handler: Handler, data: bytes, begin: float) -> None:
            was_stalled = time.monotonic() - handler.line.drive.stalled_until < AFTER_STALL_S
            self._is_sound = not (handler.hits or was_stalled)
            put(handler, data, begin)

        return noted

    def _timing(self, transact: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*arguments: Any) -> Any:
            self._is_sound, begun = False, time.monotonic()
            try:
                return transact(*arguments)
            finally:
                if self._is_sound:
                    self.longest_s = max(self.longest_s, time.monotonic() - begun)

        return timed


def short_scenario() -> Scenario:
    """The default drive with a ring that a short session can overrun."""
    default = build(read_document("default"), "default")
    return replace(default, setup=replace(default.setup, ring_capacity=RING_SAMPLES))


def run_one(sequence: Sequence, scenario: Scenario, root: Path) -> Outcome:
    """The sequence carried out in a fresh folder below `root`, and judged."""
    began = time.perf_counter()
    folder = Path(tempfile.mkdtemp(dir=root))
    options = Options(
        seed=sequence.seed, state_log=folder / "state.jsonl", nvm=folder / "nvm.json", faults=sequence.faults,
        **({"tcp_port": 0} if sequence.wire == "tcp" else {"rtu": "pty"}),
    )  # fmt: skip
    with run_in_thread(scenario, options) as running:
        requests = _watch_requests(running, sequence.wire)
        ended, summary, lost = _run(sequence, _url(running, sequence.wire), folder)
        ended_wall = time.time()
        time.sleep(0.002)
        outcome = Outcome(sequence, ended)
        outcome.broken += _judge(sequence, requests, folder, ended, summary, ended_wall)
        outcome.harmed = sum(harmed for _, harmed in requests.seen)
    log = truth.read_log(folder / "state.jsonl")
    outcome.lost, outcome.sessions = lost, len(truth.of(log, "energised"))
    outcome.watchdog_bites = sum(trip["cause"] == WATCHDOG_TRIP for trip in truth.of(log, "trip"))
    for _, end in truth.sessions(truth.before_runaway(log)):
        if end is not None:
            outcome.dead_after_s = max(outcome.dead_after_s, requests.loss_before(end["wall"]) or 0.0)
            if end["why"] == f"trip {WATCHDOG_TRIP}":
                outcome.dead_after_s = max(outcome.dead_after_s, end["since_heartbeat_s"])
    outcome.seconds = time.perf_counter() - began
    return outcome


def run_until_undisturbed(sequence: Sequence, scenario: Scenario, root: Path) -> Outcome:
    """As `run_one`; again where the machine itself stalled and the run shows it.

    What must happen without a fault is judged only where the machine did not disturb; what must never happen, always.
    """
    for repeats in range(REPEATS + 1):
        time.sleep(PAUSE_S * (2**repeats - 1))  # a busy spell of the machine passes
        with StallWatch() as watch, AnswerWatch() as answers:
            outcome = run_one(sequence, scenario, root)
        outcome.stall_s, outcome.answer_s, outcome.repeats = watch.longest_s, answers.longest_s, repeats
        if not outcome.was_disturbed:
            outcome.broken += _broken_promise(sequence, outcome.ended)
            break
    return outcome


def _url(running: Running, wire: str) -> str:
    address = running.addresses[wire]
    return f"tcp://{address}" if wire == "tcp" else f"rtu://{address}?parity=N&stop=1&baud=921600"


def _watch_requests(running: Running, wire: str) -> truth.Requests:
    """Note every request as the simulator's station counts it."""
    plan, requests = running.drive.plan, truth.Requests()
    count = plan.next_request

    def next_request(drive: Any, function: int) -> list[Any]:
        hits = count(drive, function)
        requests.seen.append((time.time(), truth.deny_the_answer(hits, wire, function, REPLY_TIMEOUT_S)))
        return hits

    plan.next_request = next_request  # type: ignore[method-assign]
    return requests


def make_job(*, write_back: bool, tests: int) -> Job:
    profile = load_profile("simulated")
    return Job(PLAN, plate(), drive_limits(profile), names_of(profile)[0], write_back, LINK_LATENCY_S)


def _run(sequence: Sequence, url: str, root: Path) -> tuple[RunEnded | None, RunSummary, int]:
    profile, script = load_profile("simulated"), sequence.script
    job = make_job(write_back=script.decision == "write back", tests=script.tests)
    folder = RunFolder.create(root, "campaign")
    ended: RunEnded | None = None
    with contextlib.closing(folder):
        try:
            port = open_port(parse_url(url), profile, reply_timeout_s=REPLY_TIMEOUT_S)
        except CommissionerError as error:
            folder.journal("run_ended", RunEnded(error.outcome, error.what, 0.0, error.as_dict()))
            return None, summarise(folder.path), 0
        with contextlib.closing(port):
            inverter = Inverter(port, profile, lambda intent: folder.journal("about_to", intent))
            runner = Runner(inverter, folder, bounds(job), watch_limits(job), lambda record: None)
            ended = runner.perform(_stopping(runner, sequence, short_course(script, job, Findings())))
    return ended, summarise(folder.path), port.stats.timeouts + port.stats.mismatches


def _stopping(runner: Runner, sequence: Sequence, course: Any) -> Iterator[Any]:
    """The operator's Ctrl-C at a random command, as the signal handler would note it."""
    reply, number = None, 0
    while True:
        try:
            command = course.send(reply)
        except StopIteration as stop:
            return stop.value
        if number == sequence.stop_after:
            runner._stop.ask("", "Ctrl-C")
        number += 1
        reply = yield command


# --- judgement -------------------------------------------------------------------------------------------------------


def allowed_for(job: Job, *, writing: bool) -> truth.Allowed:
    flux = rated_flux(job.nameplate, TRUE_STATOR_RESISTANCE_OHM).stator_peak_wb
    return truth.Allowed(
        1000 * job.plan.supervision.max_watchdog_s, job.trip_current_a, job.test_voltage_v,
        job.plan.limits.flux_fraction * flux, writing,
    )  # fmt: skip


def _judge(
    sequence: Sequence, requests: truth.Requests, folder: Path, ended: RunEnded | None, summary: RunSummary,
    ended_wall: float,
) -> Iterator[str]:  # fmt: skip
    log = truth.read_log(folder / "state.jsonl")
    job = make_job(write_back=True, tests=1)
    allowed = allowed_for(job, writing=sequence.script.decision == "write back")
    heeding = truth.before_runaway(log)
    yield from truth.broken_supervision(heeding, allowed)
    yield from truth.broken_loss(heeding, requests)
    yield from truth.broken_end(heeding, ended_wall)
    yield from truth.broken_limits(heeding, allowed)
    yield from truth.broken_runaway(
        log, ended.outcome if ended else "no connection", str((ended.error or {}).get("remedy")) if ended else ""
    )
    yield from truth.broken_permission(log, allowed)
    yield from _broken_outcome(sequence, log, ended, summary)


def _broken_outcome(sequence: Sequence, log: list[Any], ended: RunEnded | None, summary: RunSummary) -> Iterator[str]:
    """The end state and what `runs show` says of the parameters, against the drive itself."""
    held = truth.parameters(log)
    in_use, stored = (truth.which_set(values, OLD_ON_THE_WIRE, NEW_ON_THE_WIRE) for values in held)
    if "mixture" in (in_use, stored):
        yield f"the drive holds a mixture: in use {held[0]}, stored {held[1]}"
    if ended is None:
        if truth.of(log, "energised") or truth.of(log, "write"):
            yield "the drive was touched without a connection"
        return
    if ended.outcome not in ("commissioned", "rejected", "aborted", "faulted"):
        yield f"the run ended as {ended.outcome}"
    if ended.outcome != summary.outcome:
        yield f"ended as {ended.outcome}, the archive says {summary.outcome}"
    yield from _broken_success(sequence, log, ended, in_use, stored)
    yield from _broken_words(summary.written, in_use, stored)


def _broken_success(sequence: Sequence, log: list[Any], ended: RunEnded, in_use: str, stored: str) -> Iterator[str]:
    script = sequence.script
    if ended.outcome in ("commissioned", "rejected") and not _only_while_off(log):
        yield f"{ended.outcome} though the drive tripped while energised"
    if ended.outcome == "commissioned":
        wanted = "new" if script.decision == "write back" else "old"
        if (in_use, stored) != (wanted, wanted):
            yield f"commissioned, but in use is {in_use} and stored is {stored}"
        if script.decision == "reject":
            yield "commissioned against the verdict"
        if len(truth.of(log, "energised")) < script.tests:
            yield "commissioned without its tests"


def _broken_promise(sequence: Sequence, ended: RunEnded | None) -> Iterator[str]:
    """Where nothing was done to a run, it ends as its verdict says."""
    script = sequence.script
    was_left_alone = not sequence.faults and not script.rogue and sequence.stop_after is None
    wanted = "rejected" if script.decision == "reject" else "commissioned"
    if was_left_alone and script.strength < 1.0 and (ended is None or ended.outcome != wanted):
        yield f"nothing happened, and the run ended as {ended.outcome}: {ended.reason}" if ended else "no connection"
    if ended and ended.outcome == "rejected" and script.decision != "reject" and not sequence.faults:
        yield "rejected without a reason"


def _only_while_off(log: list[Any]) -> bool:
    return not any(end is not None and str(end["why"]).startswith("trip") for _, end in truth.sessions(log))


def _broken_words(written: str, in_use: str, stored: str) -> Iterator[str]:
    """What the archive tells the technician about the parameters must be true."""
    if written.startswith("as before") and (in_use, stored) != ("old", "old"):
        yield f"the archive says {written!r}, the drive holds {in_use}, stored {stored}"
    if written.startswith("new") and (in_use, stored) != ("new", "new"):
        yield f"the archive says {written!r}, the drive holds {in_use}, stored {stored}"
