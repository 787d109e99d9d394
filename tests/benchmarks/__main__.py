"""All pairs in one table: `python -m tests.benchmarks [--write] [--json FILE] [--against FILE] [--only WORD]`.

`--write` puts the table into the manual (docs/benchmarks.md). `--json` keeps the figures; `--against` compares with kept ones and ends with 1
where a ratio has fallen by more than a fifth: for a night's run on one machine, never for the suite.
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path

from tests.benchmarks import bench_archive, bench_identify, bench_link, bench_sim
from tests.benchmarks.pairs import ROUNDS, Pair, Seen, measured

MANUAL = Path(__file__).parents[2] / "commissioner" / "docs" / "benchmarks.md"
BEGIN, END = "<!-- table -->", "<!-- end -->"
HEAD = (
    "| task | peer | unit, CPU | ours | peer's | ratio | of the rounds |",
    "| --- | --- | --- | --- | --- | --- | --- |",
)
FALLEN = 0.8


def pairs(closing: ExitStack) -> Iterator[Pair]:
    yield from bench_identify.pairs()
    yield from bench_sim.pairs()
    yield from bench_link.pairs(closing)
    yield from bench_archive.pairs(closing)


def fallen(seen: list[Seen], kept: list[dict[str, object]]) -> list[str]:
    """The pairs of which the ratio is less than four fifths of what was kept, in words."""
    before = {(row["task"], row["peer"]): float(str(row["ratio"])) for row in kept}
    return [
        f"{s.task} / {s.peer}: {before[s.task, s.peer]:.3g} -> {s.ratio:.3g}"
        for s in seen
        if s.ratio < FALLEN * before.get((s.task, s.peer), 0.0)
    ]


def table(seen: list[Seen], rounds: int) -> str:
    where = f"{platform.python_implementation()} {platform.python_version()}, {rounds} rounds."
    return "\n".join((BEGIN, where, "", *HEAD, *(one.row() for one in seen), END))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--only", default="", help="Only pairs whose task or peer holds this word.")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--against", type=Path)
    asked = parser.parse_args()
    seen: list[Seen] = []
    print("\n".join(HEAD), flush=True)
    with ExitStack() as closing:
        for pair in pairs(closing):
            if asked.only in f"{pair.task} {pair.peer}":
                seen.append(measured(pair, asked.rounds))
                print(seen[-1].row(), flush=True)
    if asked.write:
        text = MANUAL.read_text("utf-8")
        before, after = text.partition(BEGIN)[0], text.partition(END)[2]
        MANUAL.write_text(before + table(seen, asked.rounds) + after, "utf-8")
    if asked.json:
        asked.json.write_text(json.dumps([asdict(one) for one in seen], indent=1) + "\n", "utf-8")
    lost = fallen(seen, json.loads(asked.against.read_text("utf-8"))) if asked.against else []
    print(*lost, sep="\n")
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
