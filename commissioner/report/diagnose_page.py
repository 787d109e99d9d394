"""The page of a diagnosis, for a person who knows drives: what the simulation gets wrong, how sure, what to do next."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from commissioner.diagnose.alike import Alike, look_alikes
from commissioner.diagnose.diagnosis import Diagnosis
from commissioner.diagnose.effects import CATALOGUE
from commissioner.diagnose.residuals import Residuals, residuals
from commissioner.report import diagnose_figures as figures
from commissioner.report.page import Page, Picture, Section, Table, Tone, picture

TONES: Mapping[str, Tone] = {
    "explained": "good", "nothing_significant": "good", "not_distinguishable": "warn", "unexplained": "bad", "refused": "bad",
}
SURE = 0.8
"""Names below this probability are marked."""
NAMES = (
    ("stator_resistance_ohm", "stator resistance R_s", 1.0, "ohm"), ("rotor_resistance_ohm", "rotor resistance R_R", 1.0, "ohm"),
    ("leakage_inductance_h", "leakage inductance L_sigma", 1e3, "mH"),
    ("magnetizing_inductance_h", "magnetizing inductance L_M", 1e3, "mH"),
    ("rotor_time_constant_s", "rotor time constant", 1.0, "s"),
    ("stator_inductance_h", "stator inductance L_s", 1e3, "mH"), ("total_resistance_ohm", "total resistance", 1.0, "ohm"),
    ("loss_at_highest_voltage_w", "loss at the highest voltage", 1.0, "W"),
)
HEADLINES = {
    "explained": "The simulation is wrong by known causes, and with them it is right to within the noise: {names}.",
    "nothing_significant": "Nothing significant: the plain four-parameter simulation already fits to within the noise.",
    "not_distinguishable": "The simulation is wrong, and these data cannot tell by which of: {classes}.",
    "unexplained": "Something is in these data that no cause in the catalogue makes.",
    "refused": "These data cannot carry an answer.",
}

POINTS_HEADLINE = "Constant parameters are not enough for these points; what is missing: {names}."


def page_of(seen: Diagnosis, document: Mapping[str, Any], name: str) -> Page:
    """One self-contained page: headline, where the error is, its frequencies, causes, what cannot be told, parameters, data."""
    words = [*in_words(document), *_shares(document), *seen.remarks]
    sections = [Section("In words", words)] if words else []
    if seen.found is not None and seen.noise is not None:
        tones = seen.split.tones_hz if seen.split else ()
        models = (seen.found.nominal.model, seen.found.fit.model)
        left = residuals(seen.found.record, seen.found.layout, *models, seen.noise, tones)
        has = bool(seen.found.accepted)
        sections += [
            _where(left, has, seen.noise.floor_a), _frequencies(left, has, tones, document), _causes(document),
            _untold(document, look_alikes(seen.found.first_screening, seen.found.accepted)), _next(document),
            _limits(document), _parameters(document),
        ]
    sections.append(Section("The data", [*(document["audit"] or ("Nothing unusual was found in the file.",))]))
    return Page(
        title=f"Diagnosis: {name}", headline=headline(document), tone=TONES[seen.verdict.value], facts=_facts(document),
        sections=sections,
        footer="Sizes are SI, per phase of the star equivalent. ± is one standard error: in 19 of 20 cases the true value is "
        "within twice of it. rms: root mean square, the effective value.",
    )


def _shares(document: Mapping[str, Any]) -> list[str]:
    """The headline's share per cause."""
    made = [f"{_spoken(c['name'])} {percent(c['gain_share'])}" for c in document["causes"] if c["found_by"] == "fit"]
    if not made:
        return []
    return [
        f"Share of the error's power that goes when the cause is put in the simulation, and comes back without it: {', '.join(made)}."
        + (" Shares need not add up to 100 %, because causes partly do the same." if len(made) > 1 else "")
    ]


def _where(left: Residuals, has_causes: bool, noise_a: float) -> Section:
    after = " With the causes named (blue) it should lie on zero." if has_causes else ""
    return Section("Where the simulation is wrong", [
        "The curves are measured minus simulated current. An S-shape over current points to the inverter, a "
        "parabola to a sensor, a rise with flux to saturation, a slope over di/dt to a delay." + after,
        picture(figures.over_quantities(left, has_causes), "Error against current, voltage, flux and steepness of the current. "
                "Shaded: what the noise leaves open. A curve within the shade is no error."),
        picture(figures.over_time_and_axis(left, has_causes, noise_a), "Size of the error over time and for each tested axis. "
                "A rise over time points to heating or drifting clocks, unequal axes to unequal sensors or an unequal machine."),
    ])


def _frequencies(left: Residuals, has_causes: bool, tones: Sequence[float], document: Mapping[str, Any]) -> Section:
    return Section("At which frequencies", [
        picture(figures.spectrum(left.spectrum, tones, has_causes), "Errors at excited frequencies alone are linear (delay, skin "
                "effect, iron loss). Odd distortion lines come from inverter and saturation, even ones from a curved sensor or a DC "
                "bias. Bars at 1 (dashed) are pure noise.", raster=True),
        picture(figures.correlation(left.correlation, has_causes), "How far the error follows the voltage that was applied a "
                "little earlier. Inside the grey band nothing linear is left to model; distortion does not show here."),
        *_classes(document),
    ])


def _untold(document: Mapping[str, Any], alike: Alike) -> Section:
    """Heat map of causes that resemble each other here, and what terminals never tell."""
    parts: list[str | Table | Picture] = []
    tied = [" or ".join(_spoken(n) for n in (c["name"], *c["equivalent"])) for c in document["causes"] if c["equivalent"]]
    if tied:
        parts.append(f"Of the causes found, these data leave open: {'; '.join(tied)}.")
    if len(alike.names) > 1:
        parts.append(picture(figures.look_alikes(alike, [c["name"] for c in document["causes"]]), "Which causes look alike in this "
                     "recording: how much of the row's error the column could imitate. Dark beside the diagonal (96 and more): "
                     "only another experiment tells the two apart. Bold: found here."))
    if alike.alone:
        parts.append(f"Like no other cause in this recording: {', '.join(map(_spoken, alike.alone))}.")
    never = "; ".join(s.replace(" | ", ", or ") for s in document["cannot_tell"])
    parts.append(f"Never told apart at the terminals of a motor at standstill: {never}.")
    return Section("What these data cannot tell apart", parts)


def headline(document: Mapping[str, Any]) -> str:
    """The one sentence of the verdict, with the names."""
    names = ", ".join(_spoken(c["name"]) for c in document["causes"]) or "none"
    if document["kind"] == "points":
        return POINTS_HEADLINE.format(names=names) if document["causes"] else str(document["reason"])
    tied = [c for c in document["causes"] if c["equivalent"]]
    classes = "; ".join(" or ".join(_spoken(n) for n in (c["name"], *c["equivalent"])) for c in tied)
    return HEADLINES[document["verdict"]].format(names=names, classes=classes)


def _spoken(name: str) -> str:
    return name.replace("_", " ")


def _quantity_name(key: str) -> str:
    """`half_current_a` without the unit that the value carries anyway."""
    for unit in ("_a_per_min", "_rad_per_s", "_ppm", "_us", "_ms", "_wb", "_nf", "_v", "_a", "_s"):
        if key.endswith(unit):
            return _spoken(key.removesuffix(unit))
    return _spoken(key)


def in_words(document: Mapping[str, Any]) -> list[str]:
    """The reason where the headline does not say it already, with the names of causes as people say them."""
    if document["verdict"] not in ("unexplained", "refused") or document["kind"] == "points":
        return []
    reason = str(document["reason"])
    for name in CATALOGUE:
        reason = reason.replace(name, _spoken(name))
    return [reason]


def _facts(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    gain = document["gain"]
    if gain["rmse_before_a"] is None:
        return []
    facts = [
        ("error of the plain simulation", f"{gain['rmse_before_a'] * 1e3:.4g} mA rms"),
        ("error with the named causes", f"{gain['rmse_after_a'] * 1e3:.4g} mA rms"),
    ]
    if gain["noise_floor_a"]:
        facts.append(("noise of the measurement", f"{gain['noise_floor_a'] * 1e3:.4g} mA rms"))
    if gain["held_out"] is not None and document["causes"]:
        facts.append(("of the error explained on data not used in the fit", percent(gain["held_out"])))
    return facts


def _causes(document: Mapping[str, Any]) -> Section:
    if not document["causes"]:
        return Section("Causes", ["No cause was found. What would have been seen is listed further down."])
    rows: list[tuple[str, ...]] = []
    tones: list[Tone] = []
    for cause in document["causes"]:
        sizes = "; ".join(f"{_quantity_name(k)} {quantity(v, k)}" for k, v in cause["parameters"].items())
        is_fit = cause["found_by"] == "fit"
        rows.append((
            _spoken(cause["name"]), sizes or "-", percent(cause["gain_share"]) if is_fit else "-",
            f"{cause['strength_over_noise']:.2g} x" if is_fit else "-", sure(cause["confidence"]),
            _best_alternative(cause), limit_words(document, cause["name"]) if is_fit else "-",
        ))
        tones.append("warn" if cause["equivalent"] or cause["confidence"] < SURE else "good")
    meanings = [f"{_spoken(c['name']).capitalize()}: {CATALOGUE[c['name']].signature}." for c in document["causes"]]
    return Section("Causes", [
        Table(
            ("cause", "size", "share of the error", "its error, times the noise", "probability that the name is right",
             "best alternative", "seen from"),
            rows, tones, caption="Best alternative: the other cause that would explain the data nearly as well. Seen from: the "
            "smallest size that these data would have shown.",
        ),
        *meanings,
    ])


def _best_alternative(cause: Mapping[str, Any]) -> str:
    """The cause that fits as well, or the next best one and how much worse it does."""
    if cause["equivalent"]:
        return f"{' or '.join(_spoken(n) for n in cause['equivalent'])}, fits as well"
    worse = {n: loss for n, loss in cause["alternatives"].items() if loss > 0}
    if not worse or not cause["delta_chi2"]:
        return "none near"
    name, loss = min(worse.items(), key=lambda item: item[1])
    kept = 1.0 - loss / cause["delta_chi2"]
    return f"{_spoken(name)}, explains {percent(kept)} of it" if kept > 0.0 else "none near"


def limit_words(document: Mapping[str, Any], name: str) -> str:
    """Smallest size these data would have shown, in the unit that the cause's size has; `-` where there is none."""
    for key, entry in document["detection_limit_sizes"].get(name, {}).items():
        value, unit = entry["value"], entry["unit"]
        if unit == "1" and key not in PLAIN_NUMBERS:
            value, unit = 100.0 * value, "%"
        prefix = 0
        while unit in ("A", "V", "Wb", "S", "s") and value < 0.1 and prefix < 3:
            value, prefix = 1000.0 * value, prefix + 1
        return f"{number(value, 2)} {('', 'm', 'u', 'n')[prefix]}{unit}".removesuffix(" 1")
    return "-"


def sure(confidence: float) -> str:
    """Nothing is certain."""
    return "over 99 %" if confidence > 0.99 else f"{100.0 * confidence:.0f} %"


def percent(share: float) -> str:
    """Never 100 % where something is left, never 0 % where something is."""
    if 0.9995 <= share < 1.0:
        return "over 99.9 %"
    return "under 0.1 %" if 0.0 < share < 0.001 else f"{100.0 * share:.1f} %"


PLAIN_NUMBERS = frozenset({"exponent", "samples", "without_gap_in_time"})


def number(value: float, digits: int = 4) -> str:
    """So many significant digits, no exponent between 1e-4 and 1e6."""
    if value == 0.0 or not 1e-4 <= abs(value) < 1e6:
        return f"{value:.{digits}g}"
    places = digits - 1 - math.floor(math.log10(abs(value)))
    return f"{round(value, places):.{max(places, 0)}f}"


def with_spread(value: float, std: float | None, unit: str) -> str:
    """`1.694 ± 0.021 us`: both to two digits of the standard error; four digits of the value where that is unknown."""
    tail = f" {unit}" if unit else ""
    if not std or not math.isfinite(std):
        return f"{value:.4g}{tail}"
    places = min(1 - math.floor(math.log10(std)), 8)
    if max(abs(value), std) < 1e-4 or abs(value) >= 1e6 or places > 6:
        return f"{value:.3g} ± {std:.2g}{tail}"
    return f"{round(value, places):.{max(places, 0)}f} ± {round(std, places):.{max(places, 0)}f}{tail}"


def quantity(entry: Mapping[str, Any], key: str = "") -> str:
    """`1.694 ± 0.021 us`; shares as `11.60 ± 0.40 %`."""
    if entry["unit"] == "1" and key not in PLAIN_NUMBERS:
        return with_spread(100.0 * entry["value"], 100.0 * (entry["std"] or 0.0), "%")
    return with_spread(entry["value"], entry["std"], "" if entry["unit"] == "1" else entry["unit"])


def next_sentence(plan: Mapping[str, Any]) -> str:
    """What to record next, what for, and how clearly it would show."""
    what = " from ".join(_spoken(n) for n in plan["splits"])
    aim = "To find the cause that is in no list" if plan["splits"] == ["unknown"] else f"To tell {what}"
    clear = plan.get("predicted_sigma")
    times = "more than 100" if clear and clear > 100 else f"about {clear:.0f}" if clear else ""
    promise = f" The difference would be {times} times its own uncertainty (10 are plenty)." if times else ""
    return f"{aim}: {plan['do']}.{promise}"


def _next(document: Mapping[str, Any]) -> Section:
    plan = document["next_experiment"]
    return Section("What to measure next", [next_sentence(plan) if plan else "Nothing is left open by these data."])


def _classes(document: Mapping[str, Any]) -> list[str | Table | Picture]:
    """Model-free levels; an infinitely weak class is left out."""
    words = {
        "odd": "odd distortion lines", "even": "even distortion lines",
        "cross_axis": "axis that gets no voltage", "drifting": "difference between repeats of one test",
    }
    rows = [(words[k], f"{v:.0f} dB") for k, v in document["line_levels_db"].items() if k in words and v > -250.0]
    if not rows:
        return []
    return [Table(
        ("in the measured current, before any model", "power relative to the excited lines"), rows,
        caption="20 dB less is a tenth of the current. The difference between repeats is noise, heating or drift.",
    )]


def _parameters(document: Mapping[str, Any]) -> Section:
    rows = []
    for key, title, scale, unit in NAMES:
        before, after = document["parameters_before"].get(key), document["parameters_after"].get(key)
        if before and after:
            change = after["value"] / before["value"] - 1.0
            rows.append((
                title, with_spread(before["value"] * scale, before["std"] * scale, unit),
                with_spread(after["value"] * scale, after["std"] * scale, unit), f"{100.0 * change:+.2f} %",
            ))
    return Section("Motor parameters", [
        Table(("", "fitted without the causes", "fitted with the causes", "moved by"), rows),
        "A parameter that moves was carrying part of the model's error.",
    ])


def _limits(document: Mapping[str, Any]) -> Section:
    found = {c["name"] for c in document["causes"]}
    rows = [
        (_spoken(k), limit_words(document, k), CATALOGUE[k].split_by)
        for k in document["detection_limits"] if k not in found
    ]
    below = document["below_materiality"]
    small = [f"Seen, but too small to matter or not separable from the shape of a named cause: {', '.join(map(_spoken, below))}."] if below else []
    return Section("Looked for and not found", [
        *small, Table(("looked for", "these data would have shown it from", "what would show it better"), rows),
    ])


def _chance(p: float) -> str:
    """`1 in 5000`; a technician reads no exponents."""
    if p < 1e-6:
        return "under 1 in a million"
    return f"1 in {number(1.0 / p, 2)}" if p < 0.2 else f"{100.0 * p:.0f} %"


def _over_points(document: Mapping[str, Any]) -> list[Section]:
    if not document.get("points"):
        return []
    is_locked = document["test"] == "locked rotor"
    over = "With leakage saturation or skin effect left out, the error bends over current or frequency" if is_locked else (
        "With saturation or a loss that grows with flux left out, the error bends over the flux"
    )
    drawn = figures.over_points(document["points"], is_locked, bool(document["causes"]))
    return [Section("Where the circuit is wrong", [
        picture(drawn, "Simulated against measured, every test point. Dots: the circuit was fitted to all points. Rings: it was "
                f"fitted to the other points and had to predict this one. {over}; what is left should scatter about zero."),
    ])]


def points_page(document: Mapping[str, Any], name: str) -> Page:
    """The page of a points table."""
    rows = [
        (_spoken(c["name"]), "; ".join(f"{_quantity_name(k)} {quantity(v, k)}" for k, v in c["parameters"].items()),
         percent(c["gain_share"]), _chance(c["p_value"]))
        for c in document["causes"]
    ]
    gain = document["gain"]
    return Page(
        title=f"Diagnosis of {document.get('test', 'test')} points: {name}",
        headline=headline(document), tone=TONES[document["verdict"]],
        facts=[
            ("error, constant parameters", percent(gain["relative_error_before"])),
            ("error, with the named causes", percent(gain["relative_error_after"])),
            ("measured on", "points left out of the fit"),
        ],
        sections=[
            Section("Causes", [
                *([document["reason"]] if rows else []),
                Table(("cause", "size", "share of the error removed", "chance that scatter made it up"), rows,
                      caption="Share: what comes back when this cause alone is left out. Shares need not add up to 100 %.")
                if rows else "No cause passed the rules.",
            ]),
            *_over_points(document),
            _parameters(document),
        ],
        footer="Steady-state points; line values are effective values (rms), parameters per phase of the star equivalent. ± is one "
        "standard error: in 19 of 20 cases the true value is within twice of it.",
    )

