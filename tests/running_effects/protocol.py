"""The blind protocol for running motors: `python -m tests.running_effects.protocol --nulls 40 --others 60 --out build/running.jsonl`.

Draws motors, mains, causes and sizes from seeds, gives the diagnosis the recording alone, opens the key afterwards. Rows are
appended as they come, so a stopped campaign goes on; `--from-rows` scores what is there.
"""

from __future__ import annotations

import argparse
import json
import time
import traceback
from pathlib import Path
from typing import Any

import numpy as np

from commissioner.estimation.fit import Column, Fit, Machine, refine
from commissioner.estimation.numbers import AT
from commissioner.motor.nameplate import Nameplate
from commissioner.records import RunningRecording
from commissioner.running.causes import CATALOGUE
from commissioner.running.diagnosis import Diagnosis, diagnose
from commissioner.running.playback import play
from commissioner.running.search import Found, Named, Search
from sim.motoring.machine import Scenario
from tests.running_effects.cases import SAME_CLASS, Case, elsewhere, taken, true_size

SHAPED = frozenset({"magnetizing_saturation", "rotor_skin_effect", "stator_heating", "rotor_heating"})
"""Their size depends on the law that is fitted."""
FIRST_SEED = 5000
MATERIAL = 0.3
"""Of the noise, after the refit without it: causes from this strength on count for recall."""
Row = dict[str, Any]


def plan(nulls: int, others: int, first_seed: int = FIRST_SEED) -> list[Case]:
    """Of five others two singles, one pair, one absent or tied, one single elsewhere (ramp, no speed, steady). Nulls and others by
    turns, so that a part is a fair sample; those without a speed, which cost ten times as much, at the end."""
    cases = [
        (k / nulls, Case(first_seed + k, "null", "ramp" if k % 8 == 7 else "start", has_speed=k % 8 != 6))
        for k in range(nulls)
    ]
    cases += [(k / others, _other(k, first_seed)) for k in range(others)]
    return [case for _, case in sorted(cases, key=lambda item: (not item[1].has_speed, item[0]))]


def _other(k: int, first_seed: int) -> Case:
    seed, slot, turn = first_seed + 1000 + k, k % 5, k // 5
    if slot < 2:
        return Case(seed, "one")
    if slot == 2:
        return Case(seed, "two")
    if slot == 3:
        return Case(seed, "absent" if turn % 2 else "tie")
    return Case(seed, "one", ("ramp", "start", "steady")[turn % 3], has_speed=turn % 3 != 1)


def run(case: Case) -> Row:
    """One case: recorded, diagnosed, then compared with the key."""
    scenario = case.scenario()
    recording, plate, truth = taken(scenario, case.seed)
    row: Row = {
        "seed": case.seed, "stratum": case.stratum, "course": case.course, "has_speed": case.has_speed, "power_w": plate.rated_power_w,
        "truth": truth["effects"], "verdict": "", "causes": [],
    }  # fmt: skip
    began = time.process_time()
    try:
        seen = diagnose([recording], plate)
        row["cpu_s"] = time.process_time() - began
        row |= _said(seen) | gains_elsewhere(seen, scenario, case)
        row["truth"] = [_opened(effect, scenario, seen) for effect in truth["effects"]]
    except Exception:  # a case that raises is a failed case, and the campaign goes on
        row["error"] = traceback.format_exc()
    return row


def gains_elsewhere(seen: Diagnosis, scenario: Scenario, case: Case) -> Row:
    """Share of the error power that the extended model removes on another start of this motor, without noise (`elsewhere`): what the truth
    itself, with no error at all, removes is one; and the same of a fit of this recording that was told the causes (`told`). None where
    nothing was named, or where a steady load alone was seen, which tells no start."""
    if seen.found is None or seen.record is None or not seen.causes or case.course == "steady":
        return {"elsewhere": None, "told": None}
    other, plate, _ = taken(elsewhere(scenario), case.seed)
    machines = (
        seen.found.nominal.machine,
        seen.found.fit.machine,
        _told(seen.found, [e.name for e in scenario.effects]).machine,
    )
    before, after, told = (_error_power(seen, machine, other, plate) for machine in machines)
    return {"elsewhere": 1.0 - after / before, "told": 1.0 - told / before}


def _told(found: Found, true: list[str]) -> Fit:
    """The fit of the recording with exactly the true causes, as far as the catalogue has them; one that was named for another of its class
    counts as told."""
    named = {one.cause: one for one in found.accepted}
    alike = {name: next((n for n in named if n in SAME_CLASS.get(name, {name})), name) for name in true}
    wanted = [name for name in alike.values() if name in CATALOGUE]
    if sorted(wanted) == sorted(named):
        return found.fit
    seeking = Search(found.problem, found.nominal, frozenset(), lambda _: None, lambda: True)
    needless = {number: 0.0 for one in found.accepted if one.cause not in wanted for number in one.form.numbers}
    best, causes = seeking.fitted(found.fit.machine.with_values(needless), (), found.fit), ()
    for name in wanted:
        forms = (
            [named[name]]
            if name in named
            else [Named(name, f) for f in CATALOGUE[name].forms if f.needs(found.problem.record)]
        )
        fits = [(seeking.fitted(best.machine, (*causes, one), best), one) for one in forms]
        if fits:
            best, taken_in = min(fits, key=lambda pair: pair[0].chi2)
            causes = (*causes, taken_in)
    return best


def _error_power(seen: Diagnosis, machine: Machine, other: RunningRecording, plate: Nameplate) -> float:
    assert seen.record is not None
    played = play(machine, seen.record.scales, plate, seen.record.period_s, other, {}, 0.0, 0)
    count = played["time_s"].size
    return float(
        sum(np.sum((played[f"current_{p}_a"] - other.currents_a[k][-count:]) ** 2) for k, p in enumerate("uvw"))
    )


def _said(seen: Diagnosis) -> Row:
    fit = seen.found.fit if seen.found else None
    return {
        "verdict": seen.verdict,
        "reason": seen.reason,
        "chi2": fit.chi2 / fit.count if fit else None,
        "left": seen.left.sigma if seen.left else None,
        "burst": seen.left.burst_sigma if seen.left else None,
        "held_out": seen.gain.held_out if seen.gain else None,
        "causes": [
            {
                "name": c.name,
                "equivalent": list(c.equivalent),
                "size": next(iter(c.sizes.items())),
                "delta_chi2": c.delta_chi2,
            }
            for c in seen.causes
        ],
    }


def _opened(effect: Row, scenario: Scenario, seen: Diagnosis) -> Row:
    """The true cause with its strength (where it was named: chi-square that comes back without it) and size error."""
    wanted = SAME_CLASS.get(effect["name"], {effect["name"]})
    out = {**effect, "named": False, "in_class": False, "size_error": None, "strength": None}
    for c in seen.causes:
        if wanted & {c.name, *c.equivalent}:
            out["in_class"] = True
            out["named"] = c.name in wanted
            out["strength"] = c.strength_sigma
            true = true_size(effect, scenario)
            if c.name in wanted and true:
                out["size_error"] = abs(next(iter(c.sizes.values()))[0] / true - 1.0)
    if out["strength"] is None and seen.found is not None:
        out["strength"] = _strength_of_missed(effect["name"], seen)
    return out


def _strength_of_missed(name: str, seen: Diagnosis) -> float | None:
    """What the true cause would gain beside what was named, over the noise."""
    found = seen.found
    assert found is not None
    best = 0.0
    for form in CATALOGUE[name].forms if name in CATALOGUE else ():
        columns = (*found.fit.columns, *(Column("p", AT[n]) for n in form.numbers))
        if len(set(columns)) == len(columns):
            best = max(best, found.fit.chi2 - refine(found.problem, found.fit.machine, columns, most=4).chi2)
    return float(np.sqrt(best / found.fit.count))


def false_names(row: Row) -> list[str]:
    """Names that neither are true nor share a class with a true one."""
    true = set().union(*(SAME_CLASS.get(e["name"], {e["name"]}) for e in row["truth"])) if row["truth"] else set()
    return [c["name"] for c in row["causes"] if not true & {c["name"], *c["equivalent"]}]


def table(rows: list[Row]) -> str:
    """Markdown: what was promised and what came out."""
    good = [r for r in rows if "error" not in r]
    nulls = [r for r in good if r["stratum"] == "null"]
    known = [r for r in good if r["stratum"] in ("one", "two")]
    effects = [e for r in known for e in r["truth"]]
    seen = [e for e in effects if (e["strength"] or 0.0) >= MATERIAL]
    named = sum(len(r["causes"]) for r in known)
    false = sum(len(false_names(r)) for r in known)
    absent = [r for r in good if r["stratum"] == "absent"]
    ties = [r for r in good if r["stratum"] == "tie"]
    plain = [e["size_error"] for e in effects if e["size_error"] is not None and e["name"] not in SHAPED]
    shaped = [e["size_error"] for e in effects if e["size_error"] is not None and e["name"] in SHAPED]
    gains = [r["held_out"] for r in known if r["held_out"] is not None and r["causes"]]
    others = [r["elsewhere"] for r in known if r.get("elsewhere") is not None]
    told = [r["elsewhere"] / r["told"] for r in known if r.get("told")]
    lines = [
        ("nulls with a name", f"{sum(bool(r['causes']) for r in nulls)} of {len(nulls)}"),
        ("nulls called unexplained", f"{sum(r['verdict'] == 'unexplained' for r in nulls)} of {len(nulls)}"),
        ("precision of names (class counts)", f"{(named - false) / max(named, 1):.3f} ({false} false of {named})"),
        (f"recall of causes from {MATERIAL} of the noise", f"{sum(e['in_class'] for e in seen) / max(len(seen), 1):.3f} ({len(seen)} causes)"),
        ("recall of all causes", f"{sum(e['in_class'] for e in effects) / max(len(effects), 1):.3f} ({len(effects)} causes)"),
        ("right name first", f"{sum(e['named'] for e in seen) / max(len(seen), 1):.3f}"),
        ("ties reported", f"{sum(r['verdict'] == 'not_distinguishable' for r in ties)} of {len(ties)}"),
        ("absent causes: unexplained, or silent below the noise", f"{sum(r['verdict'] in ('unexplained', 'nothing_significant') for r in absent)} of {len(absent)}"),
        ("absent causes with a name and no doubt", f"{sum(r['verdict'] in ('explained', 'not_distinguishable') for r in absent)} of {len(absent)}"),
        ("size error, median, no shape", f"{np.median(plain) if plain else np.nan:.2%} ({len(plain)})"),
        ("size error, median, with shape", f"{np.median(shaped) if shaped else np.nan:.1%} ({len(shaped)})"),
        ("held-out gain, 5th percentile, median", f"{np.percentile(gains, 5) if gains else np.nan:.3f}, {np.median(gains) if gains else np.nan:.3f}"),
        (
            "gain on another start over the truth's, 5th percentile, median",
            f"{np.percentile(others, 5) if others else np.nan:.3f}, {np.median(others) if others else np.nan:.4f} ({len(others)})",
        ),
        (
            "the same over that of a fit that was told the causes",
            f"{np.percentile(told, 5) if told else np.nan:.3f}, {np.median(told) if told else np.nan:.4f} ({len(told)})",
        ),
        ("CPU seconds, median, largest", f"{np.median([r['cpu_s'] for r in good]):.1f}, {max(r['cpu_s'] for r in good):.1f}"),
        ("cases that raised", f"{len(rows) - len(good)}"),
    ]  # fmt: skip
    return "\n".join(["| measure | value |", "| --- | --- |", *(f"| {a} | {b} |" for a, b in lines)])


def failures(rows: list[Row]) -> list[str]:
    """One line a case that is not as it should be."""
    out = []
    for r in rows:
        if "error" in r:
            out.append(f"{r['stratum']} {r['seed']}: raised {r['error'].strip().splitlines()[-1]}")
            continue
        missed = [
            e["name"]
            for e in r["truth"]
            if r["stratum"] in ("one", "two") and not e["in_class"] and (e["strength"] or 0) >= MATERIAL
        ]
        wrong = false_names(r) if r["stratum"] != "absent" else []
        if missed or wrong or (r["stratum"] == "null" and r["verdict"] != "nothing_significant"):
            true = ", ".join(f"{e['name']} {e['size']:.3g}" for e in r["truth"])
            out.append(
                f"{r['stratum']} {r['seed']} ({r['course']}, {r['power_w']:.0f} W): true {true or 'none'}; said {r['verdict']} {[c['name'] for c in r['causes']]}, missed {missed}"
            )
    return out


def main(arguments: list[str] | None = None) -> int:
    """Run what is missing, print the table and the failures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--nulls", type=int, default=200)
    parser.add_argument("--others", type=int, default=300)
    parser.add_argument("--out", type=Path, default=Path("build/running.jsonl"))
    parser.add_argument("--seed", type=int, default=FIRST_SEED, help="of the first null; others begin 1000 later")
    parser.add_argument("--from-rows", action="store_true")
    options = parser.parse_args(arguments)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    rows = [json.loads(line) for line in options.out.read_text("utf-8").splitlines()] if options.out.exists() else []
    done = {(r["seed"], r["stratum"]) for r in rows}
    for case in [] if options.from_rows else plan(options.nulls, options.others, options.seed):
        if (case.seed, case.stratum) in done:
            continue
        rows.append(run(case))
        with options.out.open("a", encoding="utf-8") as file:
            file.write(json.dumps(rows[-1], default=float) + "\n")
    print(table(rows))
    print("\n".join(failures(rows)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
