"""The page of a diagnosis, for a person who knows drives: what the simulation gets wrong, how sure, what to do next."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from commissioner.diagnose.diagnosis import Diagnosis
from commissioner.diagnose.effects import CATALOGUE
from commissioner.diagnose.residuals import residuals
from commissioner.report import diagnose_figures as figures
from commissioner.report.page import Page, Section, Table, Tone, picture

TONES: Mapping[str, Tone] = {
    "explained": "good", "nothing_significant": "good", "not_distinguishable": "warn", "unexplained": "bad", "refused": "bad",
}
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


def page_of(seen: Diagnosis, document: Mapping[str, Any], name: str) -> Page:
    """One self-contained page, in the order: headline, causes, error plots, spectrum, parameters, limits, data."""
    sections = [Section("In one sentence", [_in_words(seen.reason), *seen.remarks])]
    if seen.found is not None and seen.noise is not None:
        left = residuals(seen.found.record, seen.found.layout, seen.found.nominal.model, seen.found.fit.model, seen.noise)
        tones = seen.split.tones_hz if seen.split else ()
        sections += [
            _causes(document), _next(document),
            Section("Where the simulation is wrong", [
                "Each curve is the mean error of the simulated current. An S-shape over current points to the inverter, a "
                "parabola to a sensor, a rise with flux to saturation, a slope over di/dt to a delay. After naming the "
                "causes the curves should lie on zero.",
                picture(figures.over_quantities(left), "Mean error against current, voltage, flux and slope. Shaded: two "
                        "standard errors."),
                picture(figures.over_time_and_axis(left), "Size of the error over time and for each tested axis. A rise over "
                        "time points to heating or drifting clocks, a difference between axes to unequal sensors or asymmetry."),
                picture(figures.spectrum(left, tones), "Lines of the error. Errors only at excited frequencies are linear "
                        "(delay, skin effect, iron loss); lines between them are distortion.", raster=True),
            ]),
            _classes(document), _parameters(document), _limits(document, _units(seen)),
        ]
    sections.append(Section("The data", [*(seen.audit.sentences or ("Nothing unusual was found in the file.",))]))
    return Page(
        title=f"Diagnosis: {name}", headline=headline(document), tone=TONES[seen.verdict.value], facts=_facts(document),
        sections=sections,
        footer="Sizes are SI, per phase of the star equivalent; ± is one standard deviation. Shares do not add up to "
        "100 % where causes resemble each other.",
    )


def headline(document: Mapping[str, Any]) -> str:
    """The one sentence of the verdict, with the names."""
    names = ", ".join(_spoken(c["name"]) for c in document["causes"]) or "none"
    if document["kind"] == "points":
        return str(document["reason"])
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


def _in_words(reason: str) -> str:
    """The reason with the names of causes as people say them."""
    for name in CATALOGUE:
        reason = reason.replace(name, _spoken(name))
    return reason


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
        facts.append(("of the error explained on data not used in the fit", f"{gain['held_out']:.2%}"))
    return facts


def _causes(document: Mapping[str, Any]) -> Section:
    if not document["causes"]:
        return Section("Causes", ["No cause passed the rules. The last table lists what would have been seen."])
    rows: list[tuple[str, ...]] = []
    tones: list[Tone] = []
    for cause in document["causes"]:
        sizes = "; ".join(f"{_quantity_name(k)} {quantity(v, k)}" for k, v in cause["parameters"].items())
        also = " or ".join(_spoken(n) for n in cause["equivalent"]) or "-"
        rows.append((
            _spoken(cause["name"]), sizes, f"{cause['gain_share']:.1%}", f"{cause['strength_over_noise']:.3g}",
            f"{cause['confidence']:.0%}", also,
        ))
        tones.append("warn" if cause["equivalent"] or cause["confidence"] < 0.8 else "good")
    meanings = [f"{_spoken(c['name']).capitalize()}: {CATALOGUE[c['name']].signature}." for c in document["causes"]]
    return Section("Causes", [
        Table(
            ("cause", "size", "share of the error", "its error over the noise", "probability that the name is right", "could as well be"),
            rows, tones,
        ),
        *meanings,
    ])


PLAIN_NUMBERS = frozenset({"exponent", "samples", "without_gap_in_time"})


def quantity(entry: Mapping[str, Any], key: str = "") -> str:
    """`1.69 ± 0.02 us`; shares as `11.6 ± 0.4 %`."""
    if entry["unit"] == "1" and key not in PLAIN_NUMBERS:
        entry = {"value": 100.0 * entry["value"], "std": 100.0 * (entry["std"] or 0.0), "unit": "%"}
    spread = f" ± {entry['std']:.2g}" if entry["std"] else ""
    unit = "" if entry["unit"] == "1" else f" {entry['unit']}"
    return f"{entry['value']:.4g}{spread}{unit}"


def _next(document: Mapping[str, Any]) -> Section:
    plan = document["next_experiment"]
    if not plan:
        return Section("What to measure next", ["Nothing is left open by these data."])
    what = " from ".join(_spoken(n) for n in plan["splits"])
    sure = plan.get("predicted_sigma")
    promise = f" It would show the difference at {sure:.0f} standard deviations." if sure else ""
    return Section("What to measure next", [f"To tell {what}: {plan['do']}.{promise}"])


def _classes(document: Mapping[str, Any]) -> Section:
    words = {
        "excited": "excited lines", "odd": "odd distortion lines", "even": "even distortion lines",
        "cross_axis": "axis that gets no voltage", "drifting": "difference between repeats",
    }
    rows = [(words[k], f"{v:.1f} dB") for k, v in document["line_levels_db"].items()]
    return Section("Before any model: how the current splits by frequency class", [
        Table(("class", "power relative to the excited lines"), rows,
              caption="Odd: inverter, saturation. Even: sensor parabola, DC bias. Difference between repeats: noise, heating, drift."),
    ])


def _parameters(document: Mapping[str, Any]) -> Section:
    rows = []
    for key, title, scale, unit in NAMES:
        before, after = document["parameters_before"].get(key), document["parameters_after"].get(key)
        if before and after:
            change = after["value"] / before["value"] - 1.0
            rows.append((
                title, f"{before['value'] * scale:.5g} ± {before['std'] * scale:.2g} {unit}",
                f"{after['value'] * scale:.5g} ± {after['std'] * scale:.2g} {unit}", f"{change:+.2%}",
            ))
    return Section("Motor parameters", [
        Table(("", "fitted without the causes", "fitted with the causes", "moved by"), rows),
        "A parameter that moves was carrying part of the model's error.",
    ])


def _units(seen: Diagnosis) -> dict[str, str]:
    """Unit of every effect's detection limit: that of its first number."""
    return {} if seen.found is None else {n: x.terms[0].unit for n, x in seen.found.first_screening.scores.items()}


def _limits(document: Mapping[str, Any], units: Mapping[str, str]) -> Section:
    found = {c["name"] for c in document["causes"]}
    rows = [
        (_spoken(k), f"{limit:.2g} {units.get(k, '1')}".removesuffix(" 1"), CATALOGUE[k].split_by)
        for k, limit in document["detection_limits"].items() if k not in found
    ]
    never = [f"Never visible from the terminals at standstill: {sentence}." for sentence in document["cannot_tell"]]
    below = document["below_materiality"]
    small = [f"Seen, but too small to matter or not separable from the shape of a named cause: {', '.join(map(_spoken, below))}."] if below else []
    return Section("What was looked for and not found, and what cannot be told", [
        *small, Table(("looked for", "these data would have shown it from", "what would show it better"), rows), *never,
    ])


def points_page(document: Mapping[str, Any], name: str) -> Page:
    """The page of a points table."""
    rows = [
        (_spoken(c["name"]), "; ".join(f"{_quantity_name(k)} {quantity(v, k)}" for k, v in c["parameters"].items()),
         f"{c['gain_share']:.1%}", f"{c['p_value']:.1e}")
        for c in document["causes"]
    ]
    gain = document["gain"]
    return Page(
        title=f"Diagnosis of {document.get('test', 'test')} points: {name}",
        headline=document["reason"], tone=TONES[document["verdict"]],
        facts=[
            ("error, constant parameters", f"{gain['relative_error_before']:.2%}"),
            ("error, with the named causes", f"{gain['relative_error_after']:.2%}"),
            ("measured on", "points left out of the fit"),
        ],
        sections=[
            Section("Causes", [
                Table(("cause", "size", "share of the error removed", "chance of this by scatter"), rows)
                if rows else "No cause passed the rules.",
            ]),
            _parameters(document),
        ],
        footer="Steady-state points; line values rms, per-phase star equivalent.",
    )

