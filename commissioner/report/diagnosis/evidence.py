"""The pictures of a diagnosis: where the simulation is wrong, at which frequencies, and what only experts want."""

from __future__ import annotations

from collections.abc import Sequence

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.verdict.collinearity import Alike
from commissioner.diagnose.verdict.residuals import Residuals
from commissioner.report.diagnosis import figures
from commissioner.report.diagnosis.names import class_name
from commissioner.report.diagnosis.words import Document
from commissioner.report.page import Folded, Picture, Section, picture
from commissioner.report.sheet.marks import capitalised
from commissioner.report.sheet.words import cause_name


def where(document: Document, left: Residuals, has_causes: bool) -> Section:
    """Error over current, voltage, flux, slope; over time and axis."""
    after = f" {capitalised(figures.AFTER)}: what is left; it should lie on zero." if has_causes else ""
    shade = (
        " Shaded: the range that noise alone leaves (19 of 20 cases)."
        if figures.shade_is_visible(left, has_causes)
        else (" The noise is thinner than the lines." if has_causes else "")
    )
    return Section(
        "Where the simulation is wrong" if document["verdict"] != "nothing_significant" else "The error is noise",
        f"{capitalised(figures.BEFORE)}: measured minus simulated current, with the four numbers fitted as well as they can be.{after} The fit hides a part of "
        "every cause, so these shapes are a hint and no proof; the names come from trying every cause of the catalogue.",
        picture(
            figures.over_quantities(left, has_causes),
            f"Error over current, voltage, flux and how fast the current changes.{shade} "
            "A steep step at zero current is the inverter's; curves that differ between plus and minus come from a sensor or a DC bias.",
        ),
        picture(
            figures.over_time_and_axis(left, has_causes, document["gain"]["noise_floor_a"]),
            "Size of the error over time and for each tested axis. A rise "
            "that goes on from test to test is warming or a drifting clock; unequal axes are unequal sensors or an unequal machine.",
        ),
    )


def frequencies(left: Residuals, has_causes: bool, tones_hz: Sequence[float]) -> Section:
    """Spectrum before and after, and the classes of lines."""
    return Section(
        "At which frequencies",
        picture(
            figures.spectrum(left.spectrum, tones_hz, has_causes),
            "Left: every frequency (to the right many "
            "share one point, and the largest is drawn). Right: the test's own frequencies, those "
            "that distortion adds, and all others; bars at 1 (dashed) are pure noise. Odd distortion comes from the inverter and "
            "from saturation, even distortion from a curved sensor or a DC bias; an error at the test's frequencies alone is a "
            "delay, skin effect or iron loss.",
            raster=True,
        ),
    )


def for_experts(document: Document, left: Residuals, has_causes: bool, alike: Alike) -> Section:
    """What resembles what, the tie to the command, levels before any model, what terminals never tell: folded."""
    same: list[str | Picture] = []
    if len(alike.names) > 1:
        same.append(
            picture(
                figures.look_alikes(alike, [c["name"] for c in document["causes"]]),
                "How much of the row's error the column "
                "could imitate. Dark beside the diagonal (96 and more): only another test tells the two apart. Bold: found here.",
            )
        )
    if alike.alone:
        same.append(f"Like no other cause in this recording: {', '.join(map(cause_name, alike.alone))}.")
    tie: list[str | Picture] = [
        picture(
            figures.correlation(left.correlation, has_causes),
            "How far the error follows the voltage that was applied a little "
            "earlier. Inside the grey band nothing linear is left to model; distortion does not show here.",
        ),
        *_levels(document),
    ]
    shown = [
        f"{capitalised(class_name(c))}: {CATALOGUE[c['name']].signature}. Source: {CATALOGUE[c['name']].source}."
        for c in document["causes"]
    ]
    never = "; ".join(s.replace(" | ", ", or ") for s in document["cannot_tell"])
    parts = [Folded("Which causes look alike in this recording", same)] if same else []
    parts.append(Folded("The error's tie to the voltage, and levels before any model", tie))
    if shown:
        parts.append(Folded("How the named causes show, and sources", shown))
    if never:
        parts.append(
            Folded(
                "What no test at standstill tells apart",
                [f"Never told apart at the terminals of a motor at standstill: {never}."],
            )
        )
    return Section("For experts", *parts)


def _levels(document: Document) -> list[str]:
    """Model-free levels of the classes that could be formed."""
    words = {
        "odd": "odd distortion",
        "even": "even distortion",
        "cross_axis": "the axis that gets no voltage",
        "drifting": "the difference between repeats of one test",
    }
    levels = [f"{words[k]} {v:.0f} dB" for k, v in document["line_levels_db"].items() if k in words]
    if not levels:
        return []
    return [
        f"In the measured current, before any model, against the test's own frequencies: {', '.join(levels)}. 20 dB less is a tenth."
    ]
