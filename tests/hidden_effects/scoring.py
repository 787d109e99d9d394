"""Scores of the blind protocol, from its rows: rates with Wilson intervals, targets beside them, failures by name."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import erf

from tests.hidden_effects.cases import class_of

MATERIAL_SIGMA = 0.1
CONFIDENT = 0.8
TIE_CHI2 = 10.0
IN_LIBRARY = ("one", "two", "three", "four", "wrong_form")
Row = dict[str, Any]


@dataclass(frozen=True)
class Line:
    """One line of the table. `value` as text, the number of cases behind it, the target as text."""

    metric: str
    value: str
    cases: int
    target: str


def required(row: Row) -> list[str]:
    """True causes large enough that they must be named."""
    return [t["name"] for t in row["truth"] if (t["strength"] or 0.0) >= MATERIAL_SIGMA]


def hidden(row: Row) -> list[str]:
    return [t["name"] for t in row["truth"]]


def is_class_correct(cause: Row, names: Iterable[str]) -> bool:
    own = {cause["name"], *cause["equivalent"]}
    return any(own & class_of(name) for name in names)


def top(row: Row) -> Row | None:
    """The cause with the largest share of the gain; what the audit found where nothing was fitted."""
    return max(row["causes"], key=lambda c: (c["gain_share"], c["confidence"]), default=None)


def is_exact(row: Row) -> bool:
    """Every required class named, and no class that is not in the data."""
    named = row["causes"]
    complete = all(any(is_class_correct(c, [name]) for c in named) for name in required(row))
    return complete and all(is_class_correct(c, hidden(row)) for c in named)


def is_separable(row: Row) -> bool:
    return row["margin"] is None or row["margin"] >= TIE_CHI2


def is_tie_reported(row: Row) -> bool:
    return any(c["equivalent"] and is_class_correct(c, hidden(row)) for c in row["causes"])


def table(rows: Sequence[Row]) -> list[Line]:
    """The scored protocol. Rows that raised count as failures of their stratum."""
    by = {s: [r for r in rows if r["stratum"] == s] for s in ("null", *IN_LIBRARY, "absent", "tie")}
    single = [r for r in by["one"] if required(r)]
    lines = [
        _rate("null: any finding", by["null"], lambda r: bool(r["causes"]), "0"),
        _rate("null: called unexplained", by["null"], lambda r: r["verdict"] == "unexplained", "0"),
        _rate("one cause: class correct", single, _is_top_correct, ">= 99 %"),
        _rate("one cause: name correct where separable", [r for r in single if is_separable(r)], _is_top_name, ">= 98 %"),
        _rate("one cause: exact set", single, is_exact, ""),
        *(_rate(f"{s} causes: exact set", [r for r in by[s] if required(r)], is_exact, goal)
          for s, goal in (("two", ">= 95 %"), ("three", ">= 90 %"), ("four", ""))),
        *_precision_recall("wrong form", by["wrong_form"], ">= 0.95"),
        *_precision_recall("all in the library", [r for s in IN_LIBRARY for r in by[s]], ""),
        _rate("in the library: called unexplained", [r for s in IN_LIBRARY for r in by[s]],
              lambda r: r["verdict"] == "unexplained", ""),
        _rate("absent cause: flagged unexplained", [r for r in by["absent"] if _absent_strength(r) >= MATERIAL_SIGMA],
              lambda r: r["verdict"] == "unexplained", ">= 99 %"),
        _rate("absent cause: confident wrong name", by["absent"], _is_confidently_wrong, "<= 2 %"),
        *_ties(rows),
        *_distributions(rows),
        *_calibration(rows),
    ]  # fmt: skip
    return [line for line in lines if line.cases]


def _is_top_correct(row: Row) -> bool:
    best = top(row)
    return best is not None and is_class_correct(best, hidden(row))


def _is_top_name(row: Row) -> bool:
    best = top(row)
    return best is not None and best["name"] in hidden(row) and not best["equivalent"]


def _absent_strength(row: Row) -> float:
    return row["unlisted_strength"] or max((t["strength"] or 0.0 for t in row["truth"]), default=0.0)


def _is_confidently_wrong(row: Row) -> bool:
    return any(c["confidence"] >= CONFIDENT for c in row["causes"] if not c["from_audit"])


def _rate(metric: str, rows: Sequence[Row], holds: Callable[[Row], bool], target: str) -> Line:
    count = sum(1 for r in rows if not r.get("error") and holds(r))
    low, high = wilson(count, len(rows))
    value = f"{count} of {len(rows)} = {count / max(len(rows), 1):.1%} [{low:.1%}, {high:.1%}]"
    return Line(metric, value, len(rows), target)


def wilson(count: int, total: int, z: float = 1.96) -> tuple[float, float]:
    """95 % interval of a rate (E. B. Wilson, 1927)."""
    if total == 0:
        return 0.0, 1.0
    rate, shrink = count / total, 1.0 + z * z / total
    middle = (rate + z * z / (2 * total)) / shrink
    half = z * math.sqrt(rate * (1 - rate) / total + z * z / (4 * total * total)) / shrink
    # of none and of all by definition, whatever is rounded
    return max(min(middle - half, rate), 0.0), min(max(middle + half, rate), 1.0)


def _precision_recall(title: str, rows: Sequence[Row], target: str) -> list[Line]:
    named = [(c, r) for r in rows for c in r["causes"]]
    right = sum(is_class_correct(c, hidden(r)) for c, r in named)
    wanted = [(n, r) for r in rows for n in required(r)]
    met = sum(any(is_class_correct(c, [n]) for c in r["causes"]) for n, r in wanted)
    return [
        Line(f"{title}: precision", f"{right} of {len(named)} = {right / max(len(named), 1):.3f}", len(named), target),
        Line(f"{title}: recall", f"{met} of {len(wanted)} = {met / max(len(wanted), 1):.3f}", len(wanted), target),
    ]


def _ties(rows: Sequence[Row]) -> list[Line]:
    alone = [r for r in rows if len(r["truth"]) == 1 and required(r) and not r["excluded"] and r["causes"]]
    tied = [r for r in alone if not is_separable(r)]
    return [
        _rate("ties reported as ties", tied, is_tie_reported, ">= 95 %"),
        _rate("false ties", [r for r in alone if is_separable(r)], is_tie_reported, "<= 3 %"),
    ]


def _distributions(rows: Sequence[Row]) -> list[Line]:
    sized = [(t, r) for r in rows for t in r["truth"] if t["size_error"] is not None and (t["strength"] or 0) >= 0.1]
    errors = [t["size_error"] for t, _ in sized]
    gains = [r["capture"] for r in rows if r["capture"] is not None and r["stratum"] in IN_LIBRARY and required(r)]
    times = [r["seconds"] for r in rows if r["seconds"]]
    out = []
    if errors:
        middle, high = np.quantile(errors, [0.5, 0.95])
        out.append(Line("size error: median, 95th percentile", f"{middle:.2%}, {high:.1%}", len(errors), "0.5 %, 5 %"))
    spreads = [
        _spread_of_largest(c["sizes"]) for t, r in sized for c in r["causes"]
        if c["name"] == t["name"] and c.get("sizes") and not c["equivalent"]
    ]  # fmt: skip
    spreads = [s for s in spreads if s]
    if spreads:
        middle, high = quantiles_of_noise(spreads, (0.5, 0.95))
        out.append(
            Line("the same if noise of the stated spreads alone acted", f"{middle:.2%}, {high:.1%}", len(spreads), "")
        )
    if gains:
        low, middle = np.quantile(gains, [0.01, 0.5])
        text = f"{low:.4f}, {middle:.5f}"
        out.append(
            Line("gain on another excitation over the oracle's: 1st percentile, median", text, len(gains), ">= 0.995")
        )
    if times:
        text = f"{np.median(times):.1f} s, {max(times):.1f} s at {int(np.median([r['samples'] for r in rows]))} samples x 3"
        out.append(Line("time of a diagnosis: median, worst", text, len(times), "10 s, 40 s at 1e5 x 3"))
    return out


def _spread_of_largest(sizes: dict[str, Any]) -> float:
    """Stated standard deviation over size, of the largest of the sizes that have the first one's unit."""
    unit = next(iter(sizes.values()))[2]
    value, spread, _ = max((x for x in sizes.values() if x[2] == unit), key=lambda x: abs(x[0]))
    return abs(spread / value) if value else 0.0


def quantiles_of_noise(spreads: Sequence[float], shares: Sequence[float]) -> list[float]:
    """Quantiles of absolute errors that are normal, each with a standard deviation of its own: what no estimator is better than
    where these are the Cramér-Rao bound's.
    """
    known = np.array(spreads)

    def missing(error: float, share: float) -> float:
        return float(np.mean(erf(error / (math.sqrt(2.0) * known)))) - share

    return [float(brentq(missing, 0.0, 10.0 * float(known.max()), args=(share,))) for share in shares]


def claims(rows: Sequence[Row], part: str = "causes") -> list[tuple[float, bool, list[float]]]:
    """(confidence, class correct, features) of every cause named by a fit; `part` "unsure": of those kept back."""
    return [
        (c["confidence"], not r["excluded"] and is_class_correct(c, hidden(r)), c["features"])
        for r in rows for c in r.get(part, []) if not c["from_audit"]
    ]  # fmt: skip


def _calibration(rows: Sequence[Row]) -> list[Line]:
    said = [(p, ok) for p, ok, _ in claims(rows)]
    if len(said) < 20:
        return []
    sure = np.array([p for p, _ in said])
    right = np.array([ok for _, ok in said], dtype=float)
    text = f"{sweep_error(sure, right):.3f}, Brier {np.mean((sure - right) ** 2):.3f}"
    return [Line("calibration error of the confidence (ECE, sweep)", text, len(said), "<= 0.03")]


def sweep_error(sure: np.ndarray, right: np.ndarray) -> float:
    """ECE with the most equal-mass bins whose accuracies still rise (R. Roelofs et al., AISTATS 2022)."""
    order = np.argsort(sure, kind="stable")
    best = abs(float(sure.mean() - right.mean()))
    for bins in range(2, sure.size + 1):
        parts = [order[k] for k in np.array_split(np.arange(order.size), bins)]
        accuracy = np.array([right[p].mean() for p in parts])
        if np.any(np.diff(accuracy) < 0):
            break
        best = sum(p.size * abs(float(sure[p].mean()) - a) for p, a in zip(parts, accuracy, strict=True)) / sure.size
    return best


def by_strength(rows: Sequence[Row]) -> list[tuple[str, int, int]]:
    """Single causes: (range of strength, named in class, cases), the psychometric curve."""
    edges = (0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, math.inf)
    alone = [r for r in rows if r["stratum"] == "one" and r["truth"]]
    out = []
    for low, high in itertools.pairwise(edges):
        inside = [r for r in alone if low <= (r["truth"][0]["strength"] or 0.0) < high]
        out.append((f"{low:g} to {high:g}", sum(_is_top_correct(r) for r in inside), len(inside)))
    return [entry for entry in out if entry[2]]


def failures(rows: Sequence[Row]) -> list[str]:
    """One sentence for every case that is not as it should be."""
    out = []
    for r in rows:
        named = ", ".join(f"{c['name']} {c['confidence']:.2f}" for c in r["causes"]) or "nothing"
        true = ", ".join(f"{t['name']}({t['shape']}) {t['strength'] or 0:.2g}" for t in r["truth"]) or "nothing"
        if r.get("error"):
            out.append(f"{r['case']}: {r['error'].strip().splitlines()[-1]}")
        elif (r["stratum"] in IN_LIBRARY and not is_exact(r)) or (r["stratum"] == "null" and r["causes"]):
            out.append(f"{r['case']}: true {true}; named {named}; {r['verdict']}")
        elif r["stratum"] == "absent" and (r["verdict"] != "unexplained") and _absent_strength(r) >= MATERIAL_SIGMA:
            out.append(f"{r['case']}: absent {true} at {_absent_strength(r):.2g}; named {named}; {r['verdict']}")
        elif r["stratum"] == "tie" and required(r) and is_tie_reported(r) == is_separable(r):
            out.append(f"{r['case']}: margin {r['margin']:.3g}, true {true}; named {named}; {r['verdict']}")
    return out
