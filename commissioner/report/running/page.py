"""The page of a running diagnosis: verdict, what to do, causes, measured against simulated, limits, parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from commissioner.motor.quantities import FIVE, Quantity
from commissioner.report.page import Page, Section, Table, Tone, picture
from commissioner.report.running import figures
from commissioner.report.running.words import (
    Document,
    actions,
    class_name,
    headline,
    meaning,
    number,
    quantity,
    spoken,
    tone,
)
from commissioner.report.sheet.numbers import half_width, with_interval
from commissioner.report.sheet.words import quantity_name
from commissioner.running.causes import CATALOGUE
from commissioner.running.diagnosis import Diagnosis

NAMES = (
    *FIVE,
    Quantity("inertia_kg_m2", "inertia", "", 1.0, "kg m²"),
)


def page_of(seen: Diagnosis, document: Mapping[str, Any], name: str) -> Page:
    """One self-contained page."""
    rows = actions(document)
    parts = [
        Section(
            "What it means",
            *meaning(document),
            *([Table(("", "what to do"), rows)] if rows else []),
        )
    ]
    if seen.found is not None:
        parts += [
            _causes(document),
            *_next(document),
            _where(seen, document),
            _not_found(document),
            _parameters(document),
        ]
    parts.append(Section("The data", _excitation(document), *document["remarks"]))
    return Page(f"Diagnosis of a running motor: {name}", headline(document), tone(document), _facts(document), parts,
                "± holds the true value in 19 of 20 cases. Sizes are SI, per phase of the star equivalent.")  # fmt: skip


def _facts(document: Document) -> list[tuple[str, str]]:
    gain = document["gain"]
    if gain["rmse_before_a"] is None:
        return []
    facts = [("error of the plain simulation", f"{number(1e3 * gain['rmse_before_a'], 4)} mA rms")]
    if document["causes"]:
        facts.append(("error with the named causes", f"{number(1e3 * gain['rmse_after_a'], 4)} mA rms"))
    facts.append(("noise of the measurement", f"{number(1e3 * gain['noise_floor_a'], 4)} mA rms"))
    if gain["held_out"] is not None and document["causes"]:
        facts.append(("of the error explained, on the part kept aside", f"{100 * max(gain['held_out'], 0.0):.1f} %"))
    return facts


def _causes(document: Document) -> Section:
    if not document["causes"]:
        return Section("Causes", "No cause can be named.")
    rows, tones = [], list[Tone]()
    for c in document["causes"]:
        sizes = "; ".join(f"{quantity_name(k)} {quantity(v)}" for k, v in c["parameters"].items())
        rivals = sorted(c["alternatives"].items(), key=lambda item: float(item[1]))
        best = next(
            (
                f"{spoken(n)}, {100 * (1 - lost / c['delta_chi2']):.0f} % of it"
                for n, lost in rivals
                if n not in c["equivalent"]
            ),
            "none near",
        )
        rows.append(
            (
                class_name(c),
                c["form"],
                sizes,
                f"{100 * c['gain_share']:.1f} %",
                f"{number(c['strength_over_noise'])} × noise",
                f"{100 * c['confidence']:.0f} %",
                best,
            )
        )
        tones.append("warn" if c["equivalent"] or c["confidence"] < 0.8 else "good")
    header = (
        "cause",
        "form",
        "size",
        "part of what they explain",
        "strength",
        "sure of the name",
        "best rival explains",
    )
    notes = [
        f"{CATALOGUE[c['name']].title}: {CATALOGUE[c['name']].physics}. Source: {CATALOGUE[c['name']].source}."
        for c in document["causes"]
    ]
    return Section("Causes", Table(header, rows, tones), *notes)


def _next(document: Document) -> list[Section]:
    plan = document["next_experiment"]
    if not plan:
        return []
    return [
        Section("What to measure next", *(f"{k}. {step}" for k, step in enumerate(plan["steps"], 1)), plan["command"])
    ]


def _where(seen: Diagnosis, document: Document) -> Section:
    found = seen.found
    assert found is not None
    states = ", ".join(f"{n} {number(v, 2)}" for n, v in document["left_by_state_over_noise"].items())
    return Section(
        "Where the simulation is wrong",
        picture(
            figures.over_each_other(found),
            "Measured and simulated current over each other, and what each simulation leaves.",
        ),
        picture(figures.over_time(found), "What is left over the noise, every 20 ms; 1 is chance."),
        picture(
            figures.over_frequency(found),
            "What is left over frequency, 0 dB is chance. Left half: negative sequence.",
        ),
        f"Left beyond the noise, in units of it, by state: {states}." if states else "",
    )


def _not_found(document: Document) -> Section:
    apart = {n for c in document["causes"] for n in (c["name"], *c["equivalent"])}
    rows = [
        (spoken(k), quantity({"value": v["value"], "std": None, "unit": v["unit"]}), CATALOGUE[k].signature)
        for k, v in document["detection_limits"].items() if k not in apart
    ]  # fmt: skip
    return Section(
        "Looked for and not found",
        Table(
            ("looked for", "smallest detectable", "where it would show"),
            rows,
            caption="Six standard deviations beside the named causes.",
        ),
    )


def _parameters(document: Document) -> Section:
    rows = []
    for q in NAMES:
        before, after = document["parameters_before"].get(q.field), document["parameters_after"].get(q.field)
        if before and after:
            values = [
                f"{with_interval(x['value'] * q.factor, half_width(x['std'], q.factor))} {q.unit}"
                for x in (before, after)
            ]
            rows.append((q.name, *values, f"{100 * (before['value'] / after['value'] - 1):+.2f} %"))
    flux = (document["parameters_after"].get("magnetizing_inductance_h") or {}).get("at_stator_flux_wb")
    caption = f"R_R, L_sigma, L_M and T_R hold together at a peak stator flux of {number(flux)} Wb." if flux else ""
    return Section(
        "The machine's numbers",
        Table(("", "plain simulation", "with the causes", "plain one was off by"), rows, caption=caption),
    )


def _excitation(document: Document) -> str:
    has = document.get("excitation") or {}
    if not has:
        return "Nothing could be used."
    seconds = ", ".join(f"{v:.2f} s {k}" for k, v in has["seconds"].items())
    return f"{seconds}; speed {'measured' if has['has_speed'] else 'not measured'}; {'three' if has['has_three_currents'] else 'two'} currents."
