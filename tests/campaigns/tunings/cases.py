"""Every family with a [tune], every way a tuning can go, and what must come of it by the answer key.

python -m tests.campaigns.tunings.cases --seeds 4
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from commissioner.link.files.drive_file import known_drives, load_profile
from sim.vendors.drive import Habits
from tests.campaigns.tunings.bench import Tried, try_tune
from tests.support.vendor_process import MADE_UP

SLOW = 4.0


@dataclass(frozen=True)
class Case:
    """`outcome`: by form of tuning. `holds`: what must be true afterwards, each with its name."""

    name: str
    habits: Habits
    outcome: dict[str, str]
    holds: tuple[str, ...]
    more: dict[str, Any] = field(default_factory=dict)


def both(outcome: str) -> dict[str, str]:
    return {"remote": outcome, "assisted": outcome}


def cases() -> tuple[Case, ...]:
    bad = {"remote": "faulted", "assisted": "aborted"}
    return (
        Case("good", Habits(), both("commissioned"), ("a tuned set is kept", "at rest", "as often as asked")),
        Case("good, not written", Habits(), both("commissioned"), ("as before", "at rest"), {"write_back": False}),
        Case("slow", Habits(tuning_s=20.0), both("commissioned"), ("a tuned set is kept", "at rest")),
        Case("five times", Habits(), both("commissioned"), ("as often as asked", "at rest"), {"repeat": 5, "pause_s": 600.0}),
        Case("values need an Enter", Habits(needs_enter=True), both("commissioned"), ("a tuned set is kept", "at rest")),
        Case("busy after each write", Habits(busy_s=0.1), both("commissioned"), ("a tuned set is kept", "at rest")),
        Case("the first fails", Habits(("fails",)), bad, ("as before", "at rest", "once")),
        Case("the second fails", Habits(("good", "fails")), bad, ("as before", "at rest")),
        Case("hangs", Habits(("hangs",)), bad, ("as before", "at rest", "once")),
        Case("the third hangs", Habits(("good", "good", "hangs")), bad, ("as before", "at rest")),
        Case("ended at the keypad", Habits(("keypad",)), both("aborted"), ("as before", "at rest", "once")),
        Case("turns the shaft", Habits(("turns",)), both("aborted"), ("as before", "at rest", "once")),
        Case("turns the second time", Habits(("good", "turns")), both("aborted"), ("as before", "at rest")),
        Case("wrong once", Habits(("good", "wrong", "good")), both("rejected"), ("as before", "at rest")),
        Case("wrong the last time", Habits(("good", "good", "wrong")), both("rejected"), ("as before", "at rest")),
        Case("heats up", Habits(), both("rejected"), ("as before", "at rest"), {"repeat": 12, "pause_s": 0.0}),
        Case("Ctrl-C", Habits(tuning_s=SLOW), both("aborted"), ("as before", "at rest"), {"stops_at": 3.0}),
        Case("the link dies early", Habits(), both("faulted"), ("at rest",), {"lost_after": 6}),
        Case("the link dies", Habits(), {"remote": "faulted"}, ("says isolate or restore",), {"lost_after": 60}),
        Case("it does not store", Habits(stores=False), {}, ("not told as proved",)),
        Case("its start is not answered", Habits(loses_start_answer=True), both("commissioned"), ("as often as asked", "at rest")),
    )  # fmt: skip


def names() -> list[str]:
    """Every family whose file can tune, and the made-up drives."""
    return [*(name for name in known_drives() if load_profile(name).tuning is not None), *MADE_UP]


def applies(case: Case, name: str) -> bool:
    """Heating shows in a resistance; what has no lasting store of its own cannot fail to store."""
    profile = load_profile(name)
    tuning = profile.tuning
    assert tuning is not None
    if case.name == "heats up":
        return "stator_resistance" in tuning.results
    if case.name == "the link dies":
        return tuning.form == "remote"
    if case.name == "it does not store":
        return bool(profile.store and profile.store.writes)
    return True


def judge(case: Case, name: str, tried: Tried) -> list[str]:
    """What is not as it must be; empty where everything is."""
    profile = load_profile(name)
    assert profile.tuning is not None
    wanted = case.outcome.get(profile.tuning.form)
    wrong = (
        [] if wanted in (None, tried.done.ended.outcome) else [f"{tried.done.ended.outcome}: {tried.done.ended.reason}"]
    )
    return wrong + [claim for claim in case.holds if not _CLAIMS[claim](case, name, tried)]


def _can_write(name: str) -> bool:
    return "restore" in load_profile(name).capabilities


def _as_before(case: Case, name: str, tried: Tried) -> bool:
    return tried.truth["held"] == tried.before or (
        not _can_write(name) and "no way to write" in tried.done.result["tune"]["in_the_drive"]
    )


def _kept(case: Case, name: str, tried: Tried) -> bool:
    held = {n: tried.truth["held"][n] for n in tried.truth["tunings"][0]["found"]}
    cells = tried.drive.face.cells
    found = [
        {n: cells[n].to_value(cells[n].to_words(v)) for n, v in t["found"].items()} for t in tried.truth["tunings"]
    ]
    is_lasting = not _can_write(name) or all(tried.truth["stored"][n] == v for n, v in held.items())
    return held in found and is_lasting


def _says(case: Case, name: str, tried: Tried) -> bool:
    error = tried.done.ended.error or {}
    text = f"{error.get('remedy')} {tried.done.result['tune']['in_the_drive']} {tried.done.result['remarks']}"
    return "isolate" in text or "restore" in text or not _can_write(name)


_CLAIMS: dict[str, Callable[[Case, str, Tried], bool]] = {
    "as before": _as_before,
    "a tuned set is kept": _kept,
    "at rest": lambda case, name, tried: not tried.truth["is_energised"],
    "once": lambda case, name, tried: len(tried.truth["tunings"]) == 1,
    "as often as asked": lambda case, name, tried: len(tried.truth["tunings"]) == case.more.get("repeat", 3),
    "says isolate or restore": _says,
    "not told as proved": lambda case, name, tried: (
        "proved: the values outlasted a power-off" not in tried.done.result["remarks"]
    ),
}


def campaign(seeds: range) -> Iterator[tuple[str, str, int, str, list[str]]]:
    """Family, case, seed, outcome, what is wrong."""
    for seed in seeds:
        for name in names():
            for case in cases():
                if applies(case, name):
                    with tempfile.TemporaryDirectory() as folder:
                        tried = try_tune(name, Path(folder), habits=case.habits, seed=seed, **case.more)
                    yield name, case.name, seed, tried.done.ended.outcome, judge(case, name, tried)


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=4)
    began = time.process_time()
    rows = list(campaign(range(parser.parse_args().seeds)))
    bad = [row for row in rows if row[4]]
    for row in bad:
        sys.stdout.write(f"{row}\n")
    outcomes = Counter(row[3] for row in rows)
    sys.stdout.write(
        f"{len(rows)} cases on {len({r[0] for r in rows})} families, {len(rows) - len(bad)} as they must be; "
        f"{dict(outcomes)}; {time.process_time() - began:.1f} CPU s\n"
    )
    return len(bad) > 0


if __name__ == "__main__":
    sys.exit(main())
