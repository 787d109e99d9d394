"""Hostile links, hosts and sensors: `python -m tests.campaigns.hostile --runs 500 --seed 1 [--processes 3] [--log FILE]`.

Each run is a whole one-axis commissioning in motor time through a man in the middle (`hostile_run.motor_time`): replies late, in
spells or by jitter, one stall of a reply or a request, losses, repeats, bit errors, busy exceptions, the host stopped, another
master's write, and current columns rescaled, reversed, silent, frozen, exchanged, clipped. Judged by the simulator's truth: stator
and rotor flux never above 1.02 of the limit, nothing commissioned that is wrong by more than three standard errors and three per
cent, no false sensor that lets the true current past its limit, no drive live after the end. Every run is a line of the log; runs
whose seeds are in it already are not made again, so that a campaign can be cut off and continued.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from commissioner.procedure.energised.excite import warm_up
from commissioner.settings import load_motor
from tests.campaigns.hostile_run.one_run import MOTORS, Judged, run_one
from tests.campaigns.hostile_run.troubles import KINDS, LINK_WEIGHTS, LINKS, SENSORS, Trouble, draw


def one(seed: int, kind: str | None = None, motor: str | None = None) -> Judged:
    """The run of a seed."""
    rng = np.random.default_rng(seed)
    chosen = KINDS[seed % len(KINDS)] if kind is None else kind
    trouble = draw(rng, chosen)
    drawn_motor, link = str(rng.choice(MOTORS)), LINKS[int(rng.choice(len(LINKS), p=LINK_WEIGHTS))]
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        return run_one(seed, motor or drawn_motor, trouble, Path(folder), link)


def campaign(seeds: Sequence[int], processes: int, kind: str | None = None) -> Iterator[Judged]:
    with ProcessPoolExecutor(processes, get_context("spawn"), initializer=_warm) as pool:
        for future in as_completed([pool.submit(one, seed, kind) for seed in seeds]):
            yield future.result()


def _warm() -> None:
    os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))
    warm_up(load_motor("motor_2kw2"))


def summary(judged: Sequence[Judged]) -> str:
    ended = Counter(j.ended for j in judged)
    by_kind = {kind: [j for j in judged if j.trouble.kind == kind] for kind in KINDS}
    rows = [
        f"{kind:17s} {len(of):4d} runs, commissioned {sum(j.ended == 'commissioned' for j in of):3d}, worst flux "
        f"{max(j.flux for j in of):.3f}, worst current {max(j.current for j in of):.2f}"
        for kind, of in by_kind.items()
        if of
    ]
    false = [j for j in judged if j.trouble.kind in SENSORS]
    return "\n".join(
        [
            *rows,
            f"{len(judged)} runs: {dict(ended)}; worst true flux {max(j.flux for j in judged):.3f} of the limit; "
            f"{sum(bool(j.wrong) for j in judged)} with wrong parameters written; of {len(false)} false sensors "
            f"{sum(j.current > 1.0 for j in false)} past the current limit; {sum(bool(j.broken) for j in judged)} broken",
        ]
    )


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.hostile", description=__doc__)
    parser.add_argument("--runs", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--kind", choices=KINDS)
    parser.add_argument(
        "--log", type=Path, default=Path("hostile.jsonl"), help="one line a run; continued where it exists"
    )
    options = parser.parse_args(arguments)
    done = _read(options.log)
    known = {judged.seed for judged in done}
    seeds = [s for s in range(options.seed, options.seed + options.runs) if s not in known]
    with options.log.open("a", encoding="utf-8") as log:
        for judged in campaign(seeds, options.processes, options.kind):
            done.append(judged)
            log.write(json.dumps(asdict(judged)) + "\n")
            log.flush()
            mark = "BROKEN " + "; ".join(judged.broken) if judged.broken else "ok"
            print(
                f"{judged.seed} {judged.motor} {judged.link} {judged.trouble} -> {judged.ended}: {judged.reason[:110]}; flux "
                f"{judged.flux:.3f} (told {judged.told:.3f}) current {judged.current:.2f} {judged.seconds:.1f} s {mark}", flush=True,
            )  # fmt: skip
    print(summary(done))
    return int(any(judged.broken for judged in done))


def _read(log: Path) -> list[Judged]:
    """What a log holds; a line torn by a kill is left out."""
    if not log.is_file():
        return []
    rows = [json.loads(line) for line in log.read_text("utf-8").splitlines() if line.endswith("}")]
    return [Judged(**(row | {"trouble": Trouble(**row["trouble"]), "wrong": tuple(row["wrong"])})) for row in rows]


if __name__ == "__main__":
    sys.exit(main())
