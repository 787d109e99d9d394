"""Campaign 1: `python -m tests.campaigns.faults --sequences 5000 [--seed N] [--wire tcp|rtu|both]`.

One sequence is a whole short run (connect, check, one or two guarded tests, verdict, write-back) of the product's own
runner against the simulated drive, with up to four random faults of the wire, the server and the drive, sometimes a
defective procedure or an operator's stop. Hypothesis draws them in shares of SHARE, share k from seed N + k. The
simulator's log and memory judge. A broken sequence is printed as JSON and run alone by `--sequence JSON`;
`--shrink --seed K` lets Hypothesis look for the smallest sequence of share K that breaks.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import multiprocessing
import os
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import suppress
from pathlib import Path
from typing import Any

import hypothesis
from hypothesis import HealthCheck, Phase

from commissioner.procedure.energised.excite import warm_up
from sim.scenario import Scenario
from tests.campaigns.short_run import truth
from tests.campaigns.short_run.one_run import Outcome, run_until_undisturbed, short_scenario
from tests.campaigns.short_run.sequences import WIRES, Sequence, sequences
from tests.campaigns.short_run.short_course import PLAN, Script, plate
from tests.support.preloaded import PRELOADED

SHARE = 50
"""Sequences drawn from one seed. Hypothesis begins each share with its simplest sequences."""
WORKERS = PRELOADED


def share(count: int, seed: int, wire: str, end: float = float("inf"), *, shrinks: bool = False) -> list[Outcome]:
    """`count` different sequences of one seed, or as many as are done at `end` (monotonic).

    With `shrinks` the first broken one is reduced and raised as an AssertionError.
    """
    warm_up(plate())
    scenario, outcomes, seen = short_scenario(), [], set()
    with tempfile.TemporaryDirectory(dir=_shared_memory()) as root:

        @hypothesis.seed(seed)
        @hypothesis.settings(
            max_examples=count,
            deadline=None,
            database=None,
            phases=[Phase.generate, *([Phase.shrink] if shrinks else [])],
            suppress_health_check=list(HealthCheck),
        )
        @hypothesis.given(sequences(wire))
        def each(sequence: Sequence) -> None:
            hypothesis.assume(shrinks or sequence not in seen)
            seen.add(sequence)
            if time.monotonic() < end:
                outcomes.append(_told(run_until_undisturbed(sequence, scenario, Path(root)), seed))
                assert not (shrinks and outcomes[-1].broken), outcomes[-1]

        each()
    return outcomes


def _told(outcome: Outcome, seed: int) -> Outcome:
    if outcome.broken:
        sequence = json.dumps(dataclasses.asdict(outcome.sequence))
        print(f"BROKEN seed {seed}: {outcome.broken}\n  --sequence '{sequence}'\n  {outcome.ended}", flush=True)
    return outcome


def campaign(
    count: int, first_seed: int, wire: str, *, size: int = SHARE, processes: int = 1, minutes: float = 1e9,
    tell: Callable[[str], None] = lambda text: None,
) -> list[Outcome]:  # fmt: skip
    """All shares, each of `size`. A sequence mostly waits for time-outs, so several processes fit on one core."""
    end = time.monotonic() + 60 * minutes
    shares = [(min(size, count - start), first_seed + k) for k, start in enumerate(range(0, count, size))]
    if processes == 1:
        return [outcome for one, seed in shares for outcome in share(one, seed, wire, end)]
    outcomes: list[Outcome] = []
    with ProcessPoolExecutor(processes, mp_context=WORKERS, initializer=_end_with_the_parent) as pool:
        futures: dict[Future[list[Outcome]], int] = {
            pool.submit(share, one, seed, wire, end): seed for one, seed in shares
        }
        for done in as_completed(futures):
            outcomes += done.result()
            broken = sum(bool(outcome.broken) for outcome in outcomes)
            tell(f"seed {futures[done]} done: {len(outcomes)} sequences so far, {broken} broken")
    return outcomes


def _end_with_the_parent() -> None:
    """A worker whose parent was killed would wait for work for ever."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def end() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=end, daemon=True).start()


def _shared_memory() -> Path | None:
    folder = Path("/dev/shm")
    return folder if folder.is_dir() else None


def report(outcomes: list[Outcome]) -> dict[str, Any]:
    worst = max(outcomes, key=lambda o: o.dead_after_s)
    return {
        "sequences": len(outcomes),
        "by wire": Counter(o.sequence.wire for o in outcomes),
        "by end": Counter(o.ended.outcome if o.ended else "no connection" for o in outcomes),
        "energised sessions": sum(o.sessions for o in outcomes),
        "harmed requests": sum(o.harmed for o in outcomes),
        "repeated because the machine stalled": sum(bool(o.repeats) for o in outcomes),
        "disturbed to the last repetition": sum(o.was_disturbed for o in outcomes),
        "with a broken invariant": sum(bool(o.broken) for o in outcomes),
        "worst time energised after a loss, s": round(worst.dead_after_s, 3),
        "watchdog + grace, s": PLAN.supervision.watchdog_s + truth.GRACE_S,
        "seconds per sequence": round(sum(o.seconds for o in outcomes) / len(outcomes), 3),
    }


def _parsed(text: str) -> Sequence:
    given = json.loads(text)
    return Sequence(**given | {"script": Script(**given["script"]), "faults": tuple(given["faults"])})


def _alone(sequence: Sequence, scenario: Scenario) -> list[Outcome]:
    with tempfile.TemporaryDirectory(dir=_shared_memory()) as root:
        outcome = run_until_undisturbed(sequence, scenario, Path(root))
    print(outcome)
    return [outcome]


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.faults", description=__doc__)
    parser.add_argument("--sequences", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=0, help="seed of the first share")
    parser.add_argument("--share", type=int, default=SHARE, help="sequences drawn from one seed")
    parser.add_argument("--wire", choices=(*WIRES, "both"), default="both")
    parser.add_argument("--processes", type=int, default=3)
    parser.add_argument("--minutes", type=float, default=1e9, help="stop after this time and report what was run")
    parser.add_argument("--shrink", action="store_true", help="reduce the first broken sequence of one share")
    parser.add_argument("--sequence", help="run this one alone")
    options = parser.parse_args(arguments)
    if options.sequence:
        warm_up(plate())
        outcomes = _alone(_parsed(options.sequence), short_scenario())
    elif options.shrink:
        outcomes = share(SHARE, options.seed, options.wire, shrinks=True)
    else:
        outcomes = campaign(
            options.sequences, options.seed, options.wire, size=options.share, processes=options.processes,
            minutes=options.minutes, tell=lambda text: print(text, flush=True),
        )  # fmt: skip
    print(json.dumps(report(outcomes), indent=1))
    return int(any(outcome.broken for outcome in outcomes))


if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        sys.exit(main())
