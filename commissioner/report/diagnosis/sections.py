"""The tables of a diagnosis: what to do, causes, uncertain names, next test, what was not there, parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from commissioner.diagnose.causes import CATALOGUE
from commissioner.motor.quantities import FIVE, Quantity
from commissioner.report.diagnosis.names import Cause, class_name, plain_of, size_words, sure_words
from commissioner.report.diagnosis.numbers import PLUS_MINUS, chance, limit_words, number, part_of_error, percent
from commissioner.report.diagnosis.words import (
    Document,
    actions,
    is_finished,
    meaning,
    next_promise,
    next_sentence,
    of_cause,
    ordered,
    remarks,
)
from commissioner.report.page import Section, Table, Tone
from commissioner.report.sheet.marks import coded
from commissioner.report.sheet.words import cause_name

SURE = 0.8
"""Names below this probability are marked."""
PART = (
    "Part: of the error's power, what comes back when this cause alone is left out; causes partly do the same, so parts do not "
    "add up to 100 %."
)
NAMES = (
    *FIVE,
    Quantity("stator_inductance_h", "stator inductance", "L_s", 1e3, "mH"),
    Quantity("total_resistance_ohm", "total resistance", "", 1.0, "Ω"),
    Quantity("loss_at_highest_voltage_w", "loss at the highest voltage", "", 1.0, "W"),
)


def what_it_means(document: Document) -> list[Section]:
    """The paragraphs under the headline and up to three rows of what to do."""
    rows = [(who.replace(" ", "\u00a0"), coded(what)) for who, what in actions(document)]
    table = [Table(("", "what to do"), rows)] if rows else []
    words = [coded(s) for s in (*meaning(document), *remarks(document))]
    return [Section("What it means", *words, *table)] if words or table else []


def causes(document: Document) -> list[Section]:
    """One row per cause or class. Nothing where the headline says all."""
    found = ordered(document)
    if not found:
        if document["verdict"] == "nothing_significant" and is_finished(document):
            return []
        tried = "No cause can be named." if is_finished(document) else "No cause has been named yet."
        below = (
            "What helped to lower the error stands in the next block"
            if document.get("uncertain")
            else ("What these data would have shown is listed further down")
        )
        return [Section("Causes", f"{tried} {below}.")]
    largest = max(c["gain_share"] for c in found)
    rows, tones = [], list[Tone]()
    for cause in found:
        is_fit = cause["found_by"] == "fit"
        rows.append(
            (
                class_name(cause),
                size_words(cause),
                part_of_error(cause["gain_share"], largest) if is_fit else "-",
                f"{number(cause['strength_over_noise'], 2)} x noise" if is_fit else "-",
                sure_words(cause),
                _best_alternative(cause),
                limit_words(document, cause["name"]) if is_fit else "-",
            )
        )
        tones.append("warn" if cause["confidence"] < SURE else "good")
    said_of_others = [of_cause(c) for c in found[1:] if plain_of(c).motor]
    return [
        Section(
            "Causes",
            Table(
                (
                    "cause",
                    "size",
                    "part of the error",
                    "its error",
                    "sure of the name",
                    "next best name",
                    "smallest detectable",
                ),
                rows,
                tones,
                caption=f"{PLUS_MINUS} {PART} Next best name: the other cause that explains most of the same.",
            ),
            *dict.fromkeys(said_of_others),
        )
    ]


def _best_alternative(cause: Cause) -> str:
    """The best cause outside the class, and how much of the same error it explains."""
    worse = {n: loss for n, loss in cause["alternatives"].items() if loss > 0 and n not in cause["equivalent"]}
    if not worse or not cause["delta_chi2"]:
        return "none near"
    name, loss = min(worse.items(), key=lambda item: item[1])
    kept = 1.0 - loss / cause["delta_chi2"]
    return f"{cause_name(name)}, {percent(kept)} of it" if kept > 0.0 else "none near"


def uncertain_names(document: Document) -> list[Section]:
    """What was seen without a sure name, and what was not seen but could hide behind a named cause."""
    out = []
    for title, is_seen in (
        ("Seen, but the name is uncertain", True),
        ("Not seen, but could hide behind a named cause", False),
    ):
        rows = [
            (cause_name(u["name"]), u["why"], coded(u["decides"]))
            for u in document.get("uncertain", ())
            if u["is_seen"] is is_seen
        ]
        if rows:
            tones: list[Tone] = ["warn" if is_seen else "good"] * len(rows)
            out.append(Section(title, Table(("perhaps", "why it is uncertain", "what would decide it"), rows, tones)))
    return out


def next_test(document: Document) -> list[Section]:
    """The procedure of the next experiment, numbered; nothing where nothing is open."""
    plan = document["next_experiment"]
    if not plan:
        return []
    steps = [coded(f"{k}. {step}") for k, step in enumerate(plan.get("steps", ()), 1)]
    command = [coded(f"`{plan['command']}`")] if plan.get("command") else []
    rows = [("how often", next_promise(plan))]
    if plan.get("changes_values"):
        rows.append(("does it change the motor's values?", plan["changes_values"]))
    return [Section("What to measure next", coded(next_sentence(plan)), *steps, *command, Table(("", ""), rows))]


def not_found(document: Document) -> Section:
    """Causes that would have been seen, from which size on; never one that a named cause hides or that was seen."""
    apart = {c["name"] for c in document["causes"]} | {n for c in document["causes"] for n in c["equivalent"]}
    apart |= {u["name"] for u in document.get("uncertain", ())}
    rows = [
        (cause_name(k), limit_words(document, k), coded(CATALOGUE[k].decides if k in CATALOGUE else ""))
        for k in document["detection_limits"]
        if k not in apart
    ]
    caption = "Smallest size that these data show beside the named causes."
    title = "Looked for and not found" if is_finished(document) else "Not found yet, and not all looked for"
    return Section(
        title, Table(("looked for", "smallest detectable", "what would show it better"), rows, caption=caption)
    )


def _off_by(change: float) -> str:
    """`+1.25 %`; what nobody could see in the values is not told with an exponent."""
    return f"{'+' if change > 0.0 else ''}{number(100.0 * change, 3)} %" if abs(change) > 1e-6 else "nothing"


def parameters(document: Document) -> Section:
    """The four values without and with the causes: how far off, never what to enter."""
    rows = []
    for q in NAMES:
        before, after = document["parameters_before"].get(q.field), document["parameters_after"].get(q.field)
        if before and after:
            change = before["value"] / after["value"] - 1.0
            rows.append(
                (
                    q.name,
                    _plain(before, q.factor, q.unit),
                    _plain(after, q.factor, q.unit),
                    _off_by(change),
                )
            )
    return Section(
        "How far the four-parameter values were off",
        coded(
            f"For judging the error only: do not enter these in a drive; use `commissioner identify`.{_flux_of(document)}"
        ),
        Table(("", "plain simulation", "with the causes", "plain one was off by"), rows),
    )


def circuit(document: Document) -> Section:
    """The circuit of three tests, which nothing is left over to judge."""
    after = document["parameters_after"]
    rows = [(q.name, _plain(after[q.field], q.factor, q.unit)) for q in NAMES if q.field in after]
    return Section("The circuit", Table(("inverse-Gamma, per star phase", "value"), rows))


def _flux_of(document: Document) -> str:
    if any(CATALOGUE[c["name"]].bends_l_m for c in document["causes"]):
        return " The magnetizing inductance here is the unsaturated value, above the one at rated flux."
    return (
        " The magnetizing inductance depends on the flux: here it holds for this test."
        if document["kind"] != "points"
        else ""
    )


def _plain(entry: Mapping[str, Any], scale: float, unit: str) -> str:
    return f"{number(entry['value'] * scale)} {unit}"


def points_causes(document: Document) -> Section:
    """The causes of a points table, with the chance that scatter alone made them up."""
    found = ordered(document)
    if not found:
        return Section("Causes", "No cause was found in these points.")
    largest = max(c["gain_share"] for c in found)
    rows = [
        (
            class_name(c),
            size_words(c),
            part_of_error(c["gain_share"], largest),
            chance(c["p_value"]),
        )
        for c in found
    ]
    others = [of_cause(c) for c in found[1:]]
    return Section(
        "Causes",
        str(document["reason"]),
        Table(
            ("cause", "size", "part of the error", "chance that scatter made it up"),
            rows,
            ["good"] * len(rows),
            caption=f"{PLUS_MINUS} {PART}",
        ),
        *others,
    )
