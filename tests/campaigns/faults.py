"""Campaign 1: `python -m tests.campaigns.faults --sequences 5000 [--seed N] [--wire tcp|rtu|both]`.

One sequence is a whole short run (connect, check, one or two guarded tests, verdict, write-back) of the product's own
runner against the simulated drive, with up to four random faults of the wire, the server and the drive, sometimes a
defective procedure or an operator's stop. The simulator's log and memory judge it; the product's log is only compared
with them. Seed N of a failure is run alone by `--seed N --sequences 1`.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import multiprocessing
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from commissioner.errors import CommissionerError
from commissioner.link.drive_file import load_profile
from commissioner.link.inverter import Inverter
from commissioner.link.modbus import open_port
from commissioner.link.url import parse_url
from commissioner.motor.nameplate import rated_flux
from commissioner.procedure.excite import warm_up
from commissioner.procedure.findings import RunEnded
from commissioner.procedure.steps import Findings, Job
from commissioner.run.archive import RunFolder
from commissioner.run.catalogue import RunSummary, summarise
from commissioner.run.commission import _bounds, _drive_limits, _parameter_names, _watch
from commissioner.run.runner import Runner
from sim.faults import SERVER, WIRE, Fault
from sim.scenario import Scenario, build, read_document
from sim.server import Options, Running, run_in_thread
from tests.campaigns import truth
from tests.campaigns.short_course import (
    DECISIONS,
    NEW_ON_THE_WIRE,
    OLD_ON_THE_WIRE,
    PLAN,
    REPLY_TIMEOUT_S,
    ROGUES,
    Script,
    plate,
    short_course,
)

LINK_LATENCY_S = 0.02
TRUE_STATOR_RESISTANCE_OHM = 3.7
WIRES = ("tcp", "rtu")
WIRE_FAULTS = (
    "late:0.03", "late:0.09", "late:0.2", "late:0.5", "lost", "lost_request", "repeated", "truncated", "truncated:1",
    "corrupted", "reordered", "stray_before", "stray_before:01", "stray_after", "wrong_unit", "wrong_function",
    "short_reply", "short_reply:4", "wrong_transaction", "stall:0.05", "stall:0.4", "restart:0.02", "restart:0.3",
    "half_open",
)  # fmt: skip
DRIVE_FAULTS = (
    "overcurrent", "heatsink", "winding", "earth_fault", "sto", "undervoltage", "overrun:50", "overrun:600",
    "sample_gap:3", "sample_gap:400", "power_cycle", "stuck_commit", "store_fails", "heartbeat_ignored",
    "ignore:control_word", "ignore:watchdog_ms", "ignore:current_limit_a", "ignore:amplitude_scale",
    "ignore:staged_stator_resistance", "ignore:commit", "ignore:tones", "refuse:watchdog_ms", "refuse:amplitude_scale",
    "refuse:commit", "other_map",
)  # fmt: skip
SHARE = 25
"""Sequences that a process takes at a time: seeds stay together, and the time limit cuts off whole shares."""
REPEATS, STALL_S = 3, 0.02
"""A sequence that broke something while this machine let threads wait for so long is run again."""
MOMENTS = ("commit", "store")
REQUESTS = {1: 170, 2: 270}
"""About how many requests a sound run of one or two tests makes."""


@dataclass(frozen=True)
class Sequence:
    """All that is random in one run."""

    seed: int
    wire: str
    script: Script
    faults: tuple[str, ...]
    stop_after: int | None


@dataclass
class Outcome:
    """How the run ended and which invariants broke; `dead_after_s` is the longest time energised after a loss."""

    sequence: Sequence
    ended: RunEnded | None
    broken: list[str] = field(default_factory=list)
    dead_after_s: float = 0.0
    sessions: int = 0
    harmed: int = 0
    seconds: float = 0.0
    stall_s: float = 0.0
    repeats: int = 0


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


def draw(seed: int, wire: str) -> Sequence:
    """The sequence of this seed."""
    rng = np.random.default_rng([seed, 20260101])
    chosen = wire if wire in WIRES else str(rng.choice(WIRES))
    tests = int(rng.choice([1, 2], p=[0.8, 0.2]))
    rogue = str(rng.choice(list(ROGUES))) if rng.random() < 0.15 else ""
    script = Script(
        str(rng.choice(DECISIONS, p=[0.6, 0.2, 0.2])), tests, float(rng.uniform(0.8, 2.5)), rogue,
        int(rng.integers(REQUESTS[tests])),
    )  # fmt: skip
    count = int(rng.choice([0, 1, 2, 3, 4], p=[0.04, 0.4, 0.3, 0.16, 0.1]))
    faults = tuple(_draw_fault(rng, REQUESTS[tests]) for _ in range(count))
    stop = int(rng.integers(REQUESTS[tests])) if rng.random() < 0.05 else None
    return Sequence(seed, chosen, script, faults, stop)


def _draw_fault(rng: np.random.Generator, requests: int) -> str:
    if rng.random() < 0.6:
        name = str(rng.choice(WIRE_FAULTS))
        first = int(rng.integers(1, requests))
        form = "one" if name.startswith(tuple(SERVER)) else rng.choice(["one", "some", "on"], p=[0.5, 0.35, 0.15])
        return name + {"one": f"@{first}", "some": f"@{first}x{rng.integers(2, 8)}", "on": f"@{first}+"}[str(form)]
    name = str(rng.choice(DRIVE_FAULTS))
    if name == "other_map":
        return name if rng.random() < 0.3 else "sto@30"
    when = str(rng.choice(["request", "energised", "command"], p=[0.4, 0.4, 0.2]))
    if when == "command":
        return f"{name}@{rng.choice(MOMENTS)}"
    return f"{name}@{rng.integers(1, requests)}" if when == "request" else f"{name}@e{rng.uniform(0.0, 0.6):.4f}s"


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
        ended, summary = _run(sequence, _url(running, sequence.wire), folder)
        ended_wall = time.time()
        time.sleep(0.002)
        outcome = Outcome(sequence, ended)
        outcome.broken += _judge(sequence, requests, folder, ended, summary, ended_wall)
        outcome.harmed = sum(harmed for _, harmed in requests.seen)
    log = truth.read_log(folder / "state.jsonl")
    outcome.sessions = len(truth.of(log, "energised"))
    for _, end in truth.sessions(log):
        if end is not None:
            outcome.dead_after_s = max(outcome.dead_after_s, requests.loss_before(end["wall"]) or 0.0)
            if end["why"] == "trip 6":
                outcome.dead_after_s = max(outcome.dead_after_s, end["since_heartbeat_s"])
    outcome.seconds = time.perf_counter() - began
    return outcome


def run_until_undisturbed(sequence: Sequence, scenario: Scenario, root: Path) -> Outcome:
    """As `run_one`; once more, at most thrice, where something broke while the machine itself stalled."""
    for repeats in range(REPEATS + 1):
        with StallWatch() as watch:
            outcome = run_one(sequence, scenario, root)
        outcome.stall_s, outcome.repeats = watch.longest_s, repeats
        if not outcome.broken or outcome.stall_s < STALL_S:
            break
        print(f"repeated: seed {sequence.seed}, machine stalled {outcome.stall_s:.3f} s: {outcome.broken}", flush=True)
    return outcome


def _url(running: Running, wire: str) -> str:
    address = running.addresses[wire]
    return f"tcp://{address}" if wire == "tcp" else f"rtu://{address}?parity=N&stop=1&baud=921600"


def _watch_requests(running: Running, wire: str) -> truth.Requests:
    """Note every request as the simulator's station counts it."""
    plan, requests = running.drive.plan, truth.Requests()
    count = plan.next_request

    def next_request(drive: Any) -> list[Any]:
        hits = count(drive)
        requests.seen.append((time.time(), _deny_the_answer(hits, wire)))
        return hits

    plan.next_request = next_request  # type: ignore[method-assign]
    return requests


def _deny_the_answer(hits: list[Fault], wire: str) -> bool:
    """Whether no believable answer comes in time. Of several wire faults the simulator carries out the first."""
    first = next((fault for fault in hits if fault.name in WIRE), None)
    acting = [fault for fault in hits if fault is first or fault.name in SERVER or fault.name == "lost_request"]
    return any(_denies_the_answer(fault, wire) for fault in acting)


def _denies_the_answer(fault: Fault, wire: str) -> bool:
    if fault.name in ("late", "stall"):
        return float(fault.argument or 0.0) > REPLY_TIMEOUT_S
    if wire == "rtu" and fault.name in ("stray_before", "wrong_transaction"):  # passed over; no such number in RTU
        return False
    return fault.name not in ("repeated", "stray_after")


def make_job(*, write_back: bool, tests: int) -> Job:
    profile = load_profile("simulated")
    return Job(PLAN, plate(), _drive_limits(profile), _parameter_names(profile), write_back, LINK_LATENCY_S)


def _run(sequence: Sequence, url: str, root: Path) -> tuple[RunEnded | None, RunSummary]:
    profile, script = load_profile("simulated"), sequence.script
    job = make_job(write_back=script.decision == "write back", tests=script.tests)
    folder = RunFolder.create(root, "campaign")
    ended: RunEnded | None = None
    with contextlib.closing(folder):
        try:
            port = open_port(parse_url(url), profile, reply_timeout_s=REPLY_TIMEOUT_S)
        except CommissionerError as error:
            folder.journal("run_ended", RunEnded(error.outcome, error.what, 0.0, error.as_dict()))
            return None, summarise(folder.path)
        with contextlib.closing(port):
            inverter = Inverter(port, profile, lambda intent: folder.journal("about_to", intent))
            runner = Runner(inverter, folder, _bounds(job, profile), _watch(job, profile), lambda record: None)
            ended = runner.perform(_stopping(runner, sequence, short_course(script, job, Findings())))
    return ended, summarise(folder.path)


def _stopping(runner: Runner, sequence: Sequence, course: Any) -> Iterator[Any]:
    """The operator's Ctrl-C at a random command, as the signal handler would note it."""
    reply, number = None, 0
    while True:
        try:
            command = course.send(reply)
        except StopIteration as stop:
            return stop.value
        if number == sequence.stop_after:
            runner._stop.asked = "Ctrl-C"
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
    yield from truth.broken_supervision(log, allowed)
    yield from truth.broken_loss(log, requests)
    yield from truth.broken_end(log, ended_wall)
    yield from truth.broken_limits(log, allowed)
    yield from truth.broken_permission(log, allowed)
    yield from _broken_outcome(sequence, log, ended, summary)


def _broken_outcome(
    sequence: Sequence, log: list[Any], ended: RunEnded | None, summary: RunSummary
) -> Iterator[str]:
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


def _broken_success(
    sequence: Sequence, log: list[Any], ended: RunEnded, in_use: str, stored: str
) -> Iterator[str]:
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
    if not sequence.faults and not script.rogue and sequence.stop_after is None and script.strength < 1.0:
        wanted = "rejected" if script.decision == "reject" else "commissioned"
        if ended.outcome != wanted:
            yield f"nothing happened, and the run ended as {ended.outcome}: {ended.reason}"
    if ended.outcome == "rejected" and script.decision != "reject" and not sequence.faults:
        yield "rejected without a reason"


def _only_while_off(log: list[Any]) -> bool:
    return not any(end is not None and str(end["why"]).startswith("trip") for _, end in truth.sessions(log))


def _broken_words(written: str, in_use: str, stored: str) -> Iterator[str]:
    """What the archive tells the technician about the parameters must be true."""
    if written.startswith("as before") and (in_use, stored) != ("old", "old"):
        yield f"the archive says {written!r}, the drive holds {in_use}, stored {stored}"
    if written.startswith("new") and (in_use, stored) != ("new", "new"):
        yield f"the archive says {written!r}, the drive holds {in_use}, stored {stored}"


# --- the campaign ----------------------------------------------------------------------------------------------------


def campaign(sequences: int, first_seed: int, wire: str, minutes: float) -> list[Outcome]:
    """All outcomes, until the count or the time is reached; each failure is printed at once."""
    warm_up(plate())
    scenario = build(read_document("default"), "default")
    outcomes, end = [], time.monotonic() + 60 * minutes
    shared = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=shared if shared.is_dir() else None) as root:
        for seed in range(first_seed, first_seed + sequences):
            if time.monotonic() > end:
                break
            outcome = run_until_undisturbed(draw(seed, wire), scenario, Path(root))
            outcomes.append(outcome)
            if outcome.broken:
                print(f"BROKEN seed {seed}: {outcome.broken}\n   {outcome.sequence}\n   {outcome.ended}", flush=True)
    return outcomes


def in_processes(processes: int, sequences: int, first_seed: int, wire: str, minutes: float) -> list[Outcome]:
    """The campaign shared out: a sequence mostly waits for time-outs, so several fit on one core."""
    if processes == 1:
        return campaign(sequences, first_seed, wire, minutes)
    share, end = SHARE, time.monotonic() + 60 * minutes
    starts = range(first_seed, first_seed + sequences, share)
    with ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn")) as pool:
        futures = [
            pool.submit(_until, end, min(share, first_seed + sequences - start), start, wire) for start in starts
        ]
        return [outcome for future in futures for outcome in future.result()]


def _until(end: float, sequences: int, first_seed: int, wire: str) -> list[Outcome]:
    """One share; nothing where the campaign's time is over."""
    return campaign(sequences, first_seed, wire, (end - time.monotonic()) / 60) if time.monotonic() < end else []


def report(outcomes: list[Outcome]) -> dict[str, Any]:
    worst = max(outcomes, key=lambda o: o.dead_after_s)
    return {
        "sequences": len(outcomes),
        "seeds": f"{outcomes[0].sequence.seed} ... {outcomes[-1].sequence.seed}",
        "by wire": Counter(o.sequence.wire for o in outcomes),
        "by end": Counter(o.ended.outcome if o.ended else "no connection" for o in outcomes),
        "energised sessions": sum(o.sessions for o in outcomes),
        "harmed requests": sum(o.harmed for o in outcomes),
        "repeated because the machine stalled": sum(bool(o.repeats) for o in outcomes),
        "with a broken invariant": sum(bool(o.broken) for o in outcomes),
        "worst time energised after a loss, s": round(worst.dead_after_s, 3),
        "watchdog + grace, s": PLAN.supervision.watchdog_s + truth.GRACE_S,
        "seconds per sequence": round(sum(o.seconds for o in outcomes) / len(outcomes), 3),
    }


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.faults", description=__doc__)
    parser.add_argument("--sequences", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=0, help="seed of the first sequence")
    parser.add_argument("--wire", choices=(*WIRES, "both"), default="both")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--minutes", type=float, default=1e9, help="stop after this time and report what was run")
    options = parser.parse_args(arguments)
    outcomes = in_processes(options.processes, options.sequences, options.seed, options.wire, options.minutes)
    print(json.dumps(report(outcomes), indent=1))
    return int(any(outcome.broken for outcome in outcomes))


if __name__ == "__main__":
    sys.exit(main())
