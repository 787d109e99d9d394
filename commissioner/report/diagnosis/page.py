"""The page of a diagnosis, for a person who knows drives: what is wrong, what it means, what to do; then the evidence."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from commissioner.diagnose.diagnosis import Diagnosis
from commissioner.diagnose.verdict.collinearity import look_alikes
from commissioner.diagnose.verdict.residuals import residuals
from commissioner.report.diagnosis import evidence, figures, sections
from commissioner.report.diagnosis.numbers import PLUS_MINUS, number, percent
from commissioner.report.diagnosis.words import Document, headline, tone
from commissioner.report.page import Page, Section, picture
from commissioner.report.sheet.marks import capitalised


def page_of(seen: Diagnosis, document: Mapping[str, Any], name: str) -> Page:
    """One self-contained page: verdict, what to do, causes, next test; then where, frequencies, limits, parameters, data."""
    parts = sections.what_it_means(document)
    if seen.found is not None and seen.noise is not None:
        tones = seen.split.tones_hz if seen.split else ()
        models = (seen.found.nominal.model, seen.found.fit.model)
        left = residuals(seen.found.record, seen.found.layout, *models, seen.noise, tones)
        has = bool(seen.found.accepted)
        alike = look_alikes(seen.found.first_screening, seen.found.accepted)
        parts += [
            *sections.causes(document),
            *sections.uncertain_names(document),
            *sections.next_test(document),
            evidence.where(document, left, has),
            evidence.frequencies(left, has, tones),
            sections.not_found(document),
            sections.parameters(document),
            evidence.for_experts(document, left, has, alike),
        ]
    audit = document["audit"] or ("Nothing unusual was found in the file.",)
    parts.append(Section("The data", *map(capitalised, audit)))
    return Page(
        title=f"Diagnosis: {name}",
        headline=headline(document),
        tone=tone(document),
        facts=_facts(document),
        sections=parts,
        footer=f"{PLUS_MINUS} Sizes are SI, per phase of the star equivalent; rms: root mean square, the effective value.",
    )


def _facts(document: Document) -> list[tuple[str, str]]:
    gain = document["gain"]
    if gain["rmse_before_a"] is None:
        return []
    facts = [("error of the plain simulation", f"{number(gain['rmse_before_a'] * 1e3)} mA rms")]
    if document["causes"]:
        facts.append(("error with the named causes", f"{number(gain['rmse_after_a'] * 1e3)} mA rms"))
    if gain["noise_floor_a"]:
        facts.append(("noise of the measurement", f"{number(gain['noise_floor_a'] * 1e3)} mA rms"))
    if gain["held_out"] is not None and document["causes"]:
        facts.append(("of the error explained, on data kept aside for checking", percent(max(gain["held_out"], 0.0))))
    return facts


def points_page(document: Mapping[str, Any], name: str) -> Page:
    """The page of a points table."""
    gain = document["gain"]
    facts: list[tuple[str, str]] = []
    below = sections.what_it_means(document)
    if document["verdict"] != "refused":
        if gain["relative_error_before"] is not None:
            facts = [("error, constant parameters", percent(gain["relative_error_before"]))]
            if document["causes"]:
                facts.append(("error, with the named causes", percent(gain["relative_error_after"])))
            facts.append(("measured on", "points kept aside for checking"))
            below += [sections.points_causes(document), *_over_points(document)]
        if document.get("test") == "three tests":
            below.append(sections.circuit(document))
        elif document["verdict"] != "unexplained":
            below.append(sections.parameters(document))
    return Page(
        title=f"Diagnosis of {document.get('test', 'test')} points: {name}",
        headline=headline(document),
        tone=tone(document),
        facts=facts,
        sections=below,
        footer=f"{PLUS_MINUS} Steady-state points; line values are effective values (rms), parameters per phase of the star equivalent.",
    )


def _over_points(document: Document) -> list[Section]:
    if not document.get("points"):
        return []
    is_locked = document["test"] == "locked rotor"
    over = (
        "With leakage saturation or skin effect left out, the error bends over current or frequency"
        if is_locked
        else ("With saturation or a loss that grows with flux left out, the error bends over the flux")
    )
    drawn = figures.over_points(document["points"], is_locked, bool(document["causes"]))
    return [
        Section(
            "Where the circuit is wrong",
            picture(
                drawn,
                "Simulated against measured, every test point. Dots: the circuit was fitted to all points. Rings: it was "
                f"fitted to the other points and had to predict this one. {over}; what is left should scatter about zero.",
            ),
        )
    ]
