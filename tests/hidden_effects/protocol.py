"""The blind protocol: `python -m tests.hidden_effects.protocol --cases 1480 --jobs 2 --out build/protocol.json`.

Draws machines, causes, shapes and noise from seeds, gives the diagnosis the recording alone, opens the key afterwards and
scores. Rows are appended to the JSON-lines file as they come, so a killed campaign continues where it stopped; beside it
a markdown table and a reliability diagram are written. `--from-rows` scores what is there and runs nothing; with
`--jobs 1` a diagnosis has all cores, as its user's has.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import threading
import time
import traceback
import warnings
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

from sim.recordings.hidden import STRATA
from tests.hidden_effects import scoring
from tests.hidden_effects.cases import Case, key_of, plan, recording_of, sealed

Row = dict[str, Any]


def run(case: Case, seconds: float) -> Row:
    """One case: recorded, diagnosed, then compared with the key."""
    scenario = case.scenario(seconds)
    recording = recording_of(scenario, case.seed)
    row: Row = {
        "case": case.name, "stratum": case.stratum, "seed": case.seed, "excluded": list(case.excluded),
        "noise": case.noise, "segment_seconds": seconds, "samples": int(recording.time_s.size), "seconds": 0.0,
        "verdict": "", "causes": [], "truth": key_of(scenario), "margin": None, "capture": None, "unlisted_strength": None,
    }  # fmt: skip
    for cause in row["truth"]:
        cause |= {"strength": None, "size_error": None}
    try:
        seen = _diagnosed(row, case, recording)
        _open_key(row, case, scenario, seen, recording)
    except Exception:  # a case that raises is a failed case, and the campaign goes on
        row["error"] = traceback.format_exc()
    return row


def _diagnosed(row: Row, case: Case, recording: Any) -> Any:
    from commissioner.diagnose.diagnosis import diagnose

    start = time.perf_counter()
    seen = diagnose([recording], excluded=case.excluded)
    row["seconds"] = time.perf_counter() - start
    row["verdict"], row["reason"] = seen.verdict, seen.reason
    row["left_sigma"] = seen.left.sigma if seen.left else None
    row["held_out"] = seen.held_out.share if seen.held_out else None
    row["causes"], row["unsure"] = ([_claim(c) for c in some] for some in (seen.causes, seen.unsure))
    return seen


def _claim(cause: Any) -> Row:
    return {
        "name": cause.name, "equivalent": list(cause.equivalent), "confidence": cause.confidence,
        "gain_share": cause.gain_share, "strength": cause.strength_sigma, "features": list(cause.features),
        "from_audit": cause.from_audit, "sizes": {k: list(v) for k, v in cause.sizes.items()},
    }  # fmt: skip


def _open_key(row: Row, case: Case, scenario: Any, seen: Any, recording: Any) -> None:
    from tests.hidden_effects.oracle import gain_capture, strength_sigma, twin_margin
    from tests.hidden_effects.sizes import size_error

    if seen.noise is None:
        return
    peak = max(float(np.abs(c).max()) for c in (recording.current_u_a, recording.current_v_a))
    sizes = {c.name: c.sizes for c in seen.causes}
    for entry, effect in zip(row["truth"], scenario.plant.effects, strict=True):
        entry["strength"] = strength_sigma(scenario, case.seed, [effect.name], seen.noise)
        if effect.name in sizes:
            entry["size_error"] = size_error(effect, scenario.plant, sizes[effect.name], peak)
    if scenario.document.get("unlisted"):
        row["unlisted_strength"] = strength_sigma(scenario, case.seed, [], seen.noise)
    if len(row["truth"]) == 1 and not case.excluded:
        row["margin"] = twin_margin(seen, row["truth"][0]["name"])
    row["capture"] = gain_capture(seen, scenario, case.seed)


def campaign(cases: Sequence[Case], seconds: float, jobs: int, rows_file: Path) -> list[Row]:
    """Rows of all cases; those already in the file are not run again."""
    rows = (
        [json.loads(line) for line in rows_file.read_text(encoding="utf-8").splitlines()] if rows_file.is_file() else []
    )
    done = {(r["case"], r["segment_seconds"]) for r in rows}
    todo = [c for c in cases if (c.name, seconds) not in done]
    names = {c.name for c in cases}
    rows = [r for r in rows if r["case"] in names and r["segment_seconds"] == seconds]
    with (
        ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), _worker, (jobs > 1,)) as pool,
        rows_file.open("a", encoding="utf-8") as file,
    ):
        waiting = [pool.submit(run, case, seconds) for case in todo]
        for count, future in enumerate(as_completed(waiting), 1):
            row = future.result()
            file.write(json.dumps(row) + "\n")
            file.flush()
            rows.append(row)
            named = ", ".join(c["name"] for c in row["causes"])
            true = ", ".join(t["name"] for t in row["truth"])
            print(
                f"{count}/{len(todo)} {row['seconds']:5.1f} s {row['case']}: {true} -> {named} {row['verdict']}",
                flush=True,
            )
    return rows


def _worker(has_others: bool) -> None:
    """One thread of arithmetic, one in all beside others; warnings as errors, and no life beyond the campaign's."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", *(["NUMBA_NUM_THREADS"] if has_others else [])):
        os.environ[name] = "1"
    warnings.simplefilter("error")
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


def markdown(rows: Sequence[Row], cases: Sequence[Case], seconds: float) -> str:
    """The table as it goes into the README, the strengths and the failures after it."""
    out = ["| metric | measured | target |", "| --- | --- | --- |"]
    out += [f"| {x.metric} | {x.value} | {x.target} |" for x in scoring.table(rows)]
    out += ["", "| strength of a single cause, times the noise | named in its class |", "| --- | --- |"]
    out += [f"| {where} | {met} of {count} |" for where, met, count in scoring.by_strength(rows)]
    out += [
        "",
        f"{len(rows)} cases, {seconds:g} s per segment; machines and answers sealed as `{sealed(cases, seconds)[:16]}`.",
    ]
    out += ["", "Failures:", "", *(f"- {sentence}" for sentence in scoring.failures(rows))]
    return "\n".join(out) + "\n"


def reliability(rows: Sequence[Row], path: Path) -> None:
    """Observed share of right names against the stated confidence, ten equal-mass bins, as a picture."""
    from matplotlib.figure import Figure

    said = sorted((p, ok) for p, ok, _ in scoring.claims(rows))
    if len(said) < 20:
        return
    parts = np.array_split(np.arange(len(said)), 10)
    sure = [np.mean([said[k][0] for k in p]) for p in parts]
    right = [np.mean([said[k][1] for k in p]) for p in parts]
    spread = [scoring.wilson(sum(said[k][1] for k in p), len(p)) for p in parts]
    figure = Figure(figsize=(4.6, 4.4), layout="constrained")
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1], color="0.7", linewidth=1)
    axes.errorbar(sure, right, [[r - s[0] for r, s in zip(right, spread, strict=True)],
                                [s[1] - r for r, s in zip(right, spread, strict=True)]], fmt="o", capsize=3)  # fmt: skip
    axes.set(
        xlabel="stated probability that the name is right",
        ylabel="share that was right",
        xlim=(0, 1.02),
        ylim=(0, 1.02),
    )
    axes.set_title(f"{len(said)} named causes")
    figure.savefig(path, dpi=120)


def show(rows: Sequence[Row]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("metric", "measured", "target")
    for line in scoring.table(rows):
        table.add_row(line.metric, line.value, line.target)
    console = Console(width=140)
    console.print(table)
    for sentence in scoring.failures(rows):
        console.print(sentence, markup=False, highlight=False)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1480)
    parser.add_argument("--strata", default=",".join(STRATA))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seconds-per-segment", type=float, default=6.0)
    parser.add_argument(
        "--release", type=int, default=1, help="another number: other machines (0 trains the confidence)"
    )
    parser.add_argument("--out", type=Path, default=Path("protocol.json"))
    parser.add_argument("--from-rows", action="store_true", help="score what is there")
    asked = parser.parse_args()
    seconds = asked.seconds_per_segment
    cases = plan(asked.cases, asked.strata.split(","), asked.release)
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    rows = campaign([] if asked.from_rows else cases, seconds, asked.jobs, asked.out) if not asked.from_rows else [
        json.loads(line) for line in asked.out.read_text().splitlines()
    ]  # fmt: skip
    asked.out.with_suffix(".md").write_text(markdown(rows, cases, seconds))
    reliability(rows, asked.out.with_suffix(".png"))
    show(rows)


if __name__ == "__main__":
    main()
