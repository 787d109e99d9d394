"""The verdict of a diagnosis in words: headline, what it means for the motor, what to do."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from commissioner.diagnose.causes import TOGETHER
from commissioner.report.diagnosis.names import (
    COUNTS,
    Cause,
    class_name,
    is_together,
    listed,
    main_name,
    main_size,
    members,
    plain_of,
    said,
    sentence,
)
from commissioner.report.diagnosis.numbers import number, percent
from commissioner.report.page import Tone
from commissioner.report.sheet.marks import capitalised

Document = Mapping[str, Any]
UNFINISHED, HIDDEN = "The time allowed was over", "Helps the fit, but"
"""How the remarks begin that are said in the headline, and in the block of uncertain names."""
MOST_OF_LINK = 0.04
"""Share of the link voltage that a leg usually loses at most: 4 µs of dead time at 8 kHz and a volt or two of the switches."""
EQUAL_LEGS = 0.25
"""Of the mean of the three, by which a leg may differ before somebody should look at it."""
GO_ON = "commissioner diagnose recording.csv --out diagnosis"


def ordered(document: Document) -> list[Cause]:
    """The causes, the one with most of the error first, those that leave no waveform last."""
    return sorted(document["causes"], key=lambda c: (c.get("found_by") == "audit", -c["gain_share"]))


def is_finished(document: Document) -> bool:
    """Whether every cause was tried."""
    return bool(document.get("is_complete", True))


def headline(document: Document) -> str:
    """The one sentence of the verdict: what it is, and whether that is normal."""
    causes = ordered(document)
    if document["verdict"] == "refused":
        return "These data cannot carry an answer."
    if not is_finished(document):
        found = f"Found so far: {listed([class_name(c) for c in causes])}." if causes else "No cause is named yet."
        return f"Not finished: stopped when its time was over, before all causes were tried. {found}"
    if document["kind"] == "points":
        return _points_headline(document)
    if document["verdict"] == "unexplained":
        known = f" Known beside it: {listed([class_name(c) for c in causes])}." if causes else ""
        return f"Something is in these data that no cause in the catalogue makes.{known}"
    if not causes:
        return "Nothing significant: the plain four-parameter simulation already fits to within the noise."
    return f"{sentence(causes[0])}.{_how_normal(causes[0], document)} {_how_much(document, causes)}"


def _points_headline(document: Document) -> str:
    if document["verdict"] == "unexplained":
        return "No circuit of the catalogue describes these points."
    if not document["causes"]:
        return str(document["reason"]).replace(" (1 causes tested)", " (one cause tested)")
    named = [
        f"{class_name(c)} ({main_name(c)} {size})" if (size := main_size(c)) else class_name(c)
        for c in ordered(document)
    ]
    return f"Constant parameters are not enough for these points; what is missing: {listed(named)}."


def _share(document: Document) -> str:
    """Of the plain simulation's error, what the causes explain: on data kept aside where there are any."""
    gain = document["gain"]
    return percent(max(gain["held_out"] if gain["held_out"] is not None else gain["explained_share"], 0.0))


def _how_much(document: Document, causes: list[Cause]) -> str:
    rest = len(causes) - 1
    lesser = (
        f"With {COUNTS.get(rest, rest)} lesser cause{'s' if rest > 1 else ''} it explains" if rest else "It explains"
    )
    return f"{lesser} {_share(document)} of the simulation's error."


def _how_normal(cause: Cause, document: Document) -> str:
    if not plain_of(cause).is_normal:
        return ""
    if members(cause) & frozenset().union(*TOGETHER):
        if (apart := _legs_apart(cause)) > EQUAL_LEGS:
            return f" Its legs should lose alike; one is {percent(apart)} off their mean: check its gate driver and the compensation."
        link = document.get("dc_link_v")
        lost = cause["parameters"].get("voltage_v", {}).get("value")
        if not link or lost is None:
            return " Every inverter loses some."
        if lost > MOST_OF_LINK * link:
            return f" Every inverter loses some; {percent(lost / link)} of its DC link is much."
    return " That is normal."


def _legs_apart(cause: Cause) -> float:
    """Of the mean of the three, by which the leg that is furthest from it differs."""
    v, w = (cause["parameters"].get(k, {}).get("value", 0.0) for k in ("unequal_v", "unequal_w"))
    return float(max(abs(v), abs(w), abs(v + w)))


def tone(document: Document) -> Tone:
    """Green: nothing is open. A class whose members always come together leaves nothing open that matters."""
    if document["verdict"] in ("unexplained", "refused"):
        return "bad" if document["verdict"] == "refused" or is_finished(document) else "warn"
    tied = [c for c in document["causes"] if c["equivalent"] and not is_together(members(c))]
    return "warn" if tied or not is_finished(document) else "good"


def meaning(document: Document) -> list[str]:
    """What it means for the motor, and how much of the error is explained, a paragraph each."""
    if document["verdict"] == "refused":
        error = document.get("error")
        return [
            said(str(document["reason"])),
            *([f"Seen: {_seen(error['value'])}; expected: {error['limit']}; step: {error['step']}."] if error else []),
        ]
    causes, out = ordered(document), []
    is_points = document["kind"] == "points"
    if not is_finished(document):
        out.append(f"Go on without a time limit: `{GO_ON}`. What is named here may still change.")
    elif document["verdict"] == "unexplained":
        out.append(str(document["reason"]) if is_points else _left_over(document))
    if document["verdict"] == "nothing_significant" and is_finished(document) and not is_points:
        out.append("Drive, motor and measurement behave as the four values say, to within the noise. Nothing to do.")
    if causes and plain_of(causes[0]).motor:
        is_named = not is_points and document["verdict"] != "unexplained" and is_finished(document)
        out.append(plain_of(causes[0]).motor if is_named else of_cause(causes[0]))
    if causes:
        out.append(_of_points(document) if is_points else _explained(document, causes))
    return out


def _seen(value: object) -> str:
    return number(value, 3) if isinstance(value, float) else said(str(value))


def _left_over(document: Document) -> str:
    left = document["gain"]["structured_error_over_noise"] or 0.0
    how_much = f"What is left is {number(left, 2)} x the noise and belongs to the test: it is not chance."
    return f"{how_much} Until its cause is found, the motor's values may carry a part of it: check them before you enter them."


def of_cause(cause: Cause) -> str:
    """What one cause means for the motor, after its name."""
    return f"{capitalised(class_name(cause))}: {plain_of(cause).motor}"


def _of_points(document: Document) -> str:
    gain = document["gain"]
    before, after = (
        f"{number(gain[f'rmse_{k}_a'], 2)} A ({percent(gain[f'relative_error_{k}'])})" for k in ("before", "after")
    )
    return f"On points kept aside for checking, the error goes from {before} with constant parameters to {after}."


def _explained(document: Document, causes: list[Cause]) -> str:
    gain = document["gain"]
    rest = [class_name(c) for c in causes[1:]]
    lesser = f"Found beside it: {listed(rest)}. " if rest else ""
    before, after = (number(gain[k] * 1e3) for k in ("rmse_before_a", "rmse_after_a"))
    noise = f"; the noise is {number(gain['noise_floor_a'] * 1e3)} mA" if gain["noise_floor_a"] else ""
    return f"{lesser}The error goes from {before} mA of the plain simulation to {after} mA{noise}."


def actions(document: Document) -> list[tuple[str, str]]:
    """Up to three rows: for the drive, for the measurement, next test. What is below the noise needs no action."""
    if document["verdict"] == "refused":
        return []
    worth = [c for c in ordered(document) if c.get("strength_over_noise", 1.0) >= 1.0 or c.get("found_by") == "audit"]
    rows = []
    for who, words in (("for the drive", "drive"), ("for the measurement", "measurement")):
        todo = dict.fromkeys(text for c in worth if (text := getattr(plain_of(c), words)))
        if todo:
            rows.append((who, " ".join(list(todo)[:2])))
    plan = document["next_experiment"]
    if plan:
        rows.append(("next test", next_sentence(plan)))
    return rows


def next_sentence(plan: Mapping[str, Any]) -> str:
    """What to record next and what for."""
    if plan["splits"] == ["unknown"]:
        return f"To find the cause that is in no list: {plan['do']}."
    if is_together(plan["splits"]):
        return f"None is needed. Only to tell {said(' from '.join(sorted(plan['splits'])))}: {plan['do']}."
    return f"To tell {said(' from '.join(plan['splits']))}: {plan['do']}."


def next_promise(plan: Mapping[str, Any]) -> str:
    """How many recordings, and whether they move the motor's values."""
    clear = plan.get("predicted_sigma")
    times = "more than 100" if clear and clear > 100 else f"about {clear:.0f}" if clear else ""
    repeats = plan.get("repeats", 2)
    count = (
        "One new recording is enough"
        if repeats == 1
        else "Record it twice"
        if repeats == 2
        else f"Record it {repeats} times"
    )
    shown = (
        f": the difference will be {times} times its own uncertainty (10 are plenty)"
        if times
        else ("; what differs between equal recordings is chance")
    )
    return f"{count}{shown}."


def remarks(document: Document) -> list[str]:
    """The remarks that are not said elsewhere."""
    return [said(r) for r in document.get("remarks", ()) if not r.startswith((UNFINISHED, HIDDEN))]
