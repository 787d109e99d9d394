"""Whether the table [tune] of a drive file can be followed: its steps name what the file knows, and a remote form has a source for all it needs."""

from __future__ import annotations

from collections.abc import Iterator

from commissioner.errors import ConfigurationError
from commissioner.registers.profile import DriveProfile, is_a_lead
from commissioner.registers.tuning import FACTS, Tuning


def check_tuning(profile: DriveProfile, tuning: Tuning) -> Tuning:
    """The table itself. ConfigurationError where a step names what the file does not know, or a remote form is not safe."""
    for key, problem in _problems(profile, tuning):
        raise ConfigurationError(file=profile.file, key=f"tune.{key}", value=problem[0], expected=problem[1])
    return tuning


Problem = tuple[str, tuple[object, str]]


def _problems(profile: DriveProfile, tuning: Tuning) -> Iterator[Problem]:
    yield from _unknown_items(profile, tuning)
    if is_a_lead(tuning.source) or not tuning.source.strip():
        yield "source", (tuning.source, "the vendor's document or code that was seen with the drive")
    yield from _remote(tuning) if tuning.form == "remote" else _assisted(tuning)


def _unknown_items(profile: DriveProfile, tuning: Tuning) -> Iterator[Problem]:
    named = [(f"step[{k}].item", s.item) for k, s in enumerate(tuning.steps) if s.do != "ask"]
    named += [(f"finally[{k}].item", s.item) for k, s in enumerate(tuning.finally_) if s.do != "ask"]
    named += [(f"facts.{name}.item", fact.item) for name, fact in tuning.facts.items()]
    named += [(f"watch[{k}].item", w.item) for k, w in enumerate(tuning.watch)]
    named += [("results", name) for name in (*tuning.results, *tuning.also_changes)]
    for key, name in named:
        if name not in profile.items:
            yield key, (name, "the name of a table [items.NAME] in this file")
        elif key != "results" and profile.items[name].words != 1:
            yield key, (name, "an item of one register")
    for key, steps in (("step", tuning.steps), ("finally", tuning.finally_)):
        for k, step in enumerate(steps):
            if step.do == "write" and step.item in profile.items and "w" not in profile.items[step.item].access:
                yield f"{key}[{k}].item", (step.item, "an item that can be written")
    order = profile.parameter_names
    for name in (*tuning.results, *tuning.also_changes):
        if name in profile.items and "w" in profile.items[name].access and name not in order:
            yield "results", (name, "a name in parameters.order: what tuning changes must be restored")


def _remote(tuning: Tuning) -> Iterator[Problem]:
    for name in FACTS:
        fact = tuning.facts.get(name)
        if fact is None:
            yield f"facts.{name}", (None, "item, value and source: without it the form is assisted")
        elif not fact.source.strip() or is_a_lead(fact.source):
            yield f"facts.{name}.source", (fact.source, "a source; a lead or an unknown makes the form assisted")
    facts = tuning.facts
    writes = [(k, s) for k, s in enumerate(tuning.steps) if s.do == "write"]
    starts = [k for k, s in writes if s.once]
    start = [k for k, s in writes if (s.item, s.value) == (facts["start"].item, facts["start"].value)]
    if len(start) != 1 or starts != start:
        yield "step", (len(start), "exactly one write of the start, with once = true, and no other with it")
        return
    kind = facts["standstill"]
    if (kind.item, kind.value) != (facts["start"].item, facts["start"].value):
        chosen = [k for k, s in writes if (s.item, s.value) == (kind.item, kind.value)]
        looked = [
            k for k, s in enumerate(tuning.steps) if s.do == "expect" and (s.item, s.value) == (kind.item, kind.value)
        ]
        if not chosen or not any(chosen[-1] < k < start[0] for k in looked):
            yield "step", (kind.item, "the standstill value written, then read back, before the start")
    ends = [s for s in tuning.steps[start[0] :] if s.do == "await" and s.item == facts["finished"].item]
    if not any(facts["finished"].value in s.done and facts["failed"].value in s.failed and s.busy for s in ends):
        yield "step", (facts["finished"].item, "an await after the start with the sourced done and failed, and busy")
    stops = [
        k
        for k, s in enumerate(tuning.finally_)
        if (s.do, s.item, s.value) == ("write", facts["stop"].item, facts["stop"].value)
    ]
    rest = [k for k, s in enumerate(tuning.finally_) if s.do == "await"]
    if not stops or not any(k > stops[0] for k in rest):
        yield "finally", (len(tuning.finally_), "a write of the stop, then an await of the drive at rest")


def _assisted(tuning: Tuning) -> Iterator[Problem]:
    kind = tuning.facts.get("standstill")
    for k, step in enumerate((*tuning.steps, *tuning.finally_)):
        is_kind = kind is not None and not is_a_lead(kind.source) and (step.item, step.value) == (kind.item, kind.value)
        if step.do == "write" and not is_kind:
            yield (
                f"step[{k}].do",
                ("write", "expect, await or ask: nothing but the sourced standstill value is written"),
            )
    if not any(step.do == "ask" for step in tuning.steps):
        yield "step", (None, "an ask: a person starts it at the drive")
