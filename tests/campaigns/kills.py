"""Campaign 2: `python -m tests.campaigns.kills --kills 300 [--seed N] [--wire tcp|rtu]`.

A child process carries a short run out against the simulated drive and is ended by SIGKILL: once behind every journal
record, then before and behind random wire requests and at random instants. One drive lives through it all. After each
kill its log, its memory file and a ledger beside the archive say whether a promise was broken; then `restore` is run.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import signal
import sys
import tempfile
import time
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from commissioner.errors import CommissionerError, LinkError
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.modbus import ModbusPort, open_port
from commissioner.link.wire.url import parse_url
from commissioner.procedure.steps import Findings
from commissioner.records import SampleBlock
from commissioner.run.archive.blocks import read_blocks
from commissioner.run.archive.catalogue import find_run
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.journal import read_journal
from commissioner.run.archive.summary import RunSummary
from commissioner.run.job import bounds, watch_limits
from commissioner.run.restore import restore
from commissioner.run.runner import Runner
from tests.campaigns.short_run import truth
from tests.campaigns.short_run.one_run import make_job
from tests.campaigns.short_run.sequences import WIRES
from tests.campaigns.short_run.short_course import (
    NEW_ON_THE_WIRE,
    OLD_ON_THE_WIRE,
    REPLY_TIMEOUT_S,
    WATCHDOG_S,
    Script,
    plate,
    short_course,
)
from tests.support.preloaded import PRELOADED
from tests.support.sim_process import SimProcess

LONGEST_RUN_S = 60.0
PROFILE = "simulated"
VICTIMS = PRELOADED
WHOLE_RUN_ATTEMPTS = 5
"""A busy machine can miss the short reply time-out of these runs."""


@dataclass(frozen=True)
class Moment:
    """`journal`: behind the n-th record; `asking`, `answered`: around the n-th request; `time`: after n seconds."""

    kind: str
    n: float


@dataclass
class Killed:
    """One kill and what it broke; `dead_after_s` from the kill to the output's end, 0 where it was off."""

    moment: Moment
    was_killed: bool = True
    broken: list[str] = field(default_factory=list)
    had_ended: bool = False
    dead_after_s: float = 0.0
    was_energised: bool = False
    written: str = ""
    was_restored: bool = False
    held: tuple[str, str] = ("old", "old")
    blocks: int = 0


# --- the victim ------------------------------------------------------------------------------------------------------


class Victim:
    """Runs in the child. Everything archived is noted in a ledger as well, after the archive has taken it."""

    def __init__(self, url: str, runs: Path, ledger: Path, moment: Moment | None) -> None:
        self.url, self.runs, self.moment = url, runs, moment
        self.ledger = os.open(ledger, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
        self.counts: Counter[str] = Counter()

    def run(self) -> None:
        job, profile = make_job(write_back=True, tests=1), load_profile(PROFILE)
        folder = RunFolder.create(self.runs, "victim")
        folder.save("request.json", {"url": self.url, "profile": PROFILE, "nameplate": plate()})
        os.write(self.ledger, b"journal run_started\n")  # by which the folder begins
        self._wrap(folder, "journal", self._journalled)
        self._wrap(folder, "append", self._appended)
        port = open_port(parse_url(self.url), profile, reply_timeout_s=REPLY_TIMEOUT_S)
        self._count_requests(port)
        inverter = Inverter(port, profile, lambda intent: folder.journal("about_to", intent, durable=True))
        runner = Runner(inverter, folder, bounds(job), watch_limits(job), lambda record: None)
        runner.perform(short_course(Script(strength=1.0), job, Findings()))
        port.close()
        folder.close()

    def _wrap(self, folder: RunFolder, name: str, then: Callable[..., None]) -> None:
        act = getattr(folder, name)

        def acted(*arguments: Any, **options: Any) -> None:
            act(*arguments, **options)
            then(*arguments)

        setattr(folder, name, acted)

    def _journalled(self, kind: str, record: object) -> None:
        os.write(self.ledger, f"journal {kind}\n".encode())
        self._reached("journal")

    def _appended(self, block: SampleBlock, segment: int) -> None:
        os.write(self.ledger, f"block {segment} {fingerprint(block)}\n".encode())

    def _count_requests(self, port: ModbusPort) -> None:
        transact = port._transact

        def counted(*arguments: Any) -> Any:
            self._reached("asking")
            reply = transact(*arguments)
            self._reached("answered")
            return reply

        port._transact = counted  # type: ignore[method-assign]

    def _reached(self, kind: str) -> None:
        self.counts[kind] += 1
        if self.moment is not None and self.moment.kind == kind and self.counts[kind] == self.moment.n:
            os.kill(os.getpid(), signal.SIGKILL)


def fingerprint(block: SampleBlock) -> str:
    """The block's place and a check sum over its samples."""
    signals = (block.voltage_axis_v, block.current_u_a, block.current_v_a, block.current_w_a)
    data = b"".join(np.asarray(s, "<f8").tobytes() for s in signals if s is not None)
    return f"{block.session} {block.first_index} {block.count} {zlib.crc32(data)}"


def _live(url: str, runs: Path, ledger: Path, moment: Moment | None) -> None:
    victim = Victim(url, runs, ledger, moment)
    victim.run()
    os.write(victim.ledger, f"counts {json.dumps(victim.counts)}\n".encode())


# --- one kill --------------------------------------------------------------------------------------------------------


class Scene:
    """A drive that survives its masters, and the archive they leave behind."""

    def __init__(self, sim: SimProcess, nvm: Path, root: Path) -> None:
        self.sim, self.nvm, self.root, self.number = sim, nvm, root, 0
        self._entries: list[truth.Entry] = []
        self._read_up_to = 0

    def log(self) -> list[truth.Entry]:
        """The simulator's log so far; read on from where the last reading ended."""
        with self.sim.log_file.open("rb") as file:
            file.seek(self._read_up_to)
            fresh = file.read()
        whole = fresh[: fresh.rfind(b"\n") + 1]
        self._read_up_to += len(whole)
        self._entries += [json.loads(line) for line in whole.splitlines()]
        return self._entries

    def run(self, moment: Moment | None) -> tuple[Path, Path, float, bool]:
        """One victim to its end: (archive, ledger, wall time of its end, whether SIGKILL ended it)."""
        self.number += 1
        runs, ledger = self.root / f"runs{self.number}", self.root / f"ledger{self.number}"
        process = VICTIMS.Process(target=_live, args=(self.sim.url, runs, ledger, moment))
        process.start()
        if moment is not None and moment.kind == "time":
            time.sleep(moment.n)
            process.kill()
        process.join(LONGEST_RUN_S)
        ended = time.time()
        if process.is_alive():
            process.kill()
            raise AssertionError(f"the run did not end: {moment}")
        return runs, ledger, ended, process.exitcode == -signal.SIGKILL

    def kill(self, moment: Moment) -> Killed:
        """One victim killed, judged and cleared away."""
        before = len(self.log())
        runs, ledger, ended, was_killed = self.run(moment)
        killed = Killed(moment, was_killed)
        self._await_death(killed, before, ended)
        killed.broken += self._broken_archive(killed, runs, ledger)
        killed.broken += self._broken_parameters(killed, runs, before)
        self.clear()
        return killed

    def _await_death(self, killed: Killed, before: int, ended: float) -> None:
        deadline = time.monotonic() + WATCHDOG_S + 1.0
        while truth.is_energised(self.log()[before:]) and time.monotonic() < deadline:
            time.sleep(0.01)
        for _, end in truth.sessions(self.log()[before:]):
            if end is None:
                killed.broken.append("still energised a second after the watchdog's time")
            elif end["wall"] > ended - 0.005:
                killed.was_energised, killed.dead_after_s = True, end["wall"] - ended
                if end["wall"] - ended > WATCHDOG_S + truth.GRACE_S:
                    killed.broken.append(f"energised {end['wall'] - ended:.3f} s after the kill")

    def _broken_archive(self, killed: Killed, runs: Path, ledger: Path) -> Iterator[str]:
        """Every block and record that the archive had taken is there, whole and in order."""
        if not runs.is_dir():
            return
        folder = next(runs.iterdir())
        noted = ledger.read_text("utf-8").splitlines() if ledger.is_file() else []
        promised = [line.removeprefix("block ") for line in noted if line.startswith("block ")]
        found = [f"{segment} {fingerprint(block)}" for segment, block in read_blocks(folder / "blocks.bin")]
        killed.blocks, killed.had_ended = len(found), "journal run_ended" in noted
        if found[: len(promised)] != promised or len(found) > len(promised) + 1:
            yield f"{len(promised)} blocks were archived, {len(found)} are there, or they differ"
        kinds = [line.removeprefix("journal ") for line in noted if line.startswith("journal ")]
        journal = [record["kind"] for record in read_journal(folder / "journal.jsonl")]
        if journal[: len(kinds)] != kinds or len(journal) > len(kinds) + 1:
            yield f"{len(kinds)} records were journalled, {len(journal)} are there, or they differ"

    def _broken_parameters(self, killed: Killed, runs: Path, before: int) -> Iterator[str]:
        """Old or new as the archive says, before and after the drive's jobs have ended; then `restore`."""
        yield from self._mixture()
        summary = self._summary(runs)
        patiently(self._let_jobs_end)
        yield from self._mixture()
        killed.held = self.held()
        if summary is None:
            if killed.held != ("old", "old"):
                yield f"a run without a folder left {killed.held}"
            return
        killed.written = summary.written
        yield from _broken_words(summary, killed)
        if not (Path(summary.folder) / "snapshot.json").is_file():
            if any(w["item"].startswith(truth.PARAMETER_ITEMS) for w in truth.of(self.log()[before:], "write")):
                yield "parameters were written without a snapshot"
            return
        patiently(lambda: restore(summary, self.sim.url))
        killed.was_restored = True
        if self.held() != ("old", "old"):
            yield f"after restore the drive holds {self.held()}"
        again = self._summary(runs)
        if again is not None and not again.written.startswith("as before"):
            yield f"after restore the archive says {again.written!r}"

    def _let_jobs_end(self) -> None:
        """A snapshot waits for a commit or store that the victim had started."""
        with self._inverter() as inverter:
            inverter.snapshot()

    def held(self) -> tuple[str, str]:
        in_use, stored = truth.parameters(self.log())
        content = json.loads(self.nvm.read_text("utf-8"))["content"]
        if list(content["parameters"]) != list(stored):
            return truth.which_set(in_use, OLD_ON_THE_WIRE, NEW_ON_THE_WIRE), "not what was logged"
        both = [truth.which_set(values, OLD_ON_THE_WIRE, NEW_ON_THE_WIRE) for values in (in_use, stored)]
        return both[0], both[1]

    def _mixture(self) -> Iterator[str]:
        if not set(self.held()) <= {"old", "new"}:
            yield f"the drive holds {self.held()}: {truth.parameters(self.log())}"

    def _summary(self, runs: Path) -> RunSummary | None:
        return find_run(runs, "last") if runs.is_dir() and any(runs.glob("*/journal.jsonl")) else None

    @contextlib.contextmanager
    def _inverter(self) -> Iterator[Inverter]:
        profile = load_profile(PROFILE)
        with contextlib.closing(open_port(parse_url(self.sim.url), profile)) as port:
            yield Inverter(port, profile)

    def _reset_fault(self) -> None:
        with self._inverter() as inverter:
            inverter.reset_fault()

    def clear(self) -> None:
        """The next victim finds the drive without a fault and with its old parameters."""
        patiently(self._reset_fault)
        if self.held() != ("old", "old"):
            raise AssertionError(f"the scene cannot be cleared: {self.held()}")


def patiently(act: Callable[[], object]) -> None:
    """As an operator would on a bad line: again after a link error, a few times."""
    for _ in range(4):
        try:
            act()
            return
        except LinkError:
            time.sleep(0.2)
    act()


def _broken_words(summary: RunSummary, killed: Killed) -> Iterator[str]:
    """What `runs show` says of the end and of the parameters."""
    held = killed.held
    if summary.written.startswith("as before") and held != ("old", "old"):
        yield f"the archive says {summary.written!r}, the drive holds {held}"
    if summary.written.startswith("new") and held != ("new", "new"):
        yield f"the archive says {summary.written!r}, the drive holds {held}"
    if (summary.outcome == "cut off") is killed.had_ended:
        yield f"shown as {summary.outcome}: {summary.reason}, though its end was {'' if killed.had_ended else 'not '}noted"


# --- the campaign ----------------------------------------------------------------------------------------------------


@contextlib.contextmanager
def scene(wire: str, seed: int) -> Iterator[Scene]:
    """A simulated drive of its own process with a memory file."""
    shared = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=shared if shared.is_dir() else None) as folder:
        nvm = Path(folder) / "nvm.json"
        line = ("--tcp", "0") if wire == "tcp" else ("--rtu", "pty")
        with SimProcess(*line, "--seed", str(seed), "--nvm", str(nvm)) as sim:
            yield Scene(sim, nvm, Path(folder))


def counts_of_a_whole_run(stage: Scene) -> dict[str, float]:
    """How many records, requests and seconds a run has that nobody kills; the drive is as before afterwards."""
    for _ in range(WHOLE_RUN_ATTEMPTS):
        began = time.time()
        runs, ledger, ended, _ = stage.run(None)
        summary = find_run(runs, "last")
        if summary.outcome == "commissioned":
            break
        stage.clear()
    if summary.outcome != "commissioned" or stage.held() != ("new", "new"):
        raise AssertionError(f"the run without a kill ended as {summary.outcome}: {summary.reason}, {stage.held()}")
    restore(summary, stage.sim.url)
    line = next(line for line in ledger.read_text("utf-8").splitlines() if line.startswith("counts "))
    return json.loads(line.removeprefix("counts ")) | {"time": ended - began}


def moments(count: int, counts: dict[str, float], rng: np.random.Generator) -> Iterator[Moment]:
    """Behind every journal record first, or `count` of them; then without end, half around random requests (half of
    them late), half at any time."""
    records = np.arange(1, int(counts["journal"]) + 1)
    for n in sorted(rng.choice(records, min(count, len(records)), replace=False)):
        yield Moment("journal", int(n))
    last = int(counts["asking"])
    while True:
        if rng.random() < 0.5:
            first = last - 40 if rng.random() < 0.5 else 1
            yield Moment(str(rng.choice(["asking", "answered"])), int(rng.integers(first, last + 1)))
        else:
            yield Moment("time", float(rng.uniform(0.0, counts["time"])))


def campaign(kills: int, seed: int, wire: str, minutes: float = 1e9) -> list[Killed]:
    """So many kills, and the runs that ended by themselves before theirs; each broken promise is printed at once."""
    rng, end, done = np.random.default_rng(seed), time.monotonic() + 60 * minutes, []
    with scene(wire, seed) as stage:
        for moment in moments(kills, counts_of_a_whole_run(stage), rng):
            if time.monotonic() > end or sum(killed.was_killed for killed in done) >= kills:
                break
            killed = stage.kill(moment)
            done.append(killed)
            if killed.broken:
                print(f"BROKEN {wire} seed {seed} {moment}: {killed.broken}", flush=True)
    return done


def report(done: list[Killed]) -> dict[str, Any]:
    return {
        "kills": sum(k.was_killed for k in done),
        "ended by themselves before the moment": sum(not k.was_killed for k in done),
        "by moment": Counter(k.moment.kind for k in done),
        "while energised": sum(k.was_energised for k in done),
        "the archive said": Counter(k.written.split(";")[0] for k in done),
        "the drive held (in use, stored)": Counter("/".join(k.held) for k in done),
        "restored and verified": sum(k.was_restored for k in done),
        "with a broken promise": sum(bool(k.broken) for k in done),
        "worst time energised after the kill, s": round(max(k.dead_after_s for k in done), 3),
        "watchdog + grace, s": WATCHDOG_S + truth.GRACE_S,
        "archived blocks checked": sum(k.blocks for k in done),
    }


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.kills", description=__doc__)
    parser.add_argument("--kills", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--wire", choices=WIRES, default="tcp")
    parser.add_argument("--minutes", type=float, default=1e9, help="stop after this time and report what was run")
    options = parser.parse_args(arguments)
    try:
        done = campaign(options.kills, options.seed, options.wire, options.minutes)
    except CommissionerError as error:
        print(f"the campaign cannot go on: {error.as_dict()}")
        return 1
    print(json.dumps(report(done), indent=1))
    return int(any(killed.broken for killed in done))


if __name__ == "__main__":
    sys.exit(main())
