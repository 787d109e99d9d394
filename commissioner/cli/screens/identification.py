"""An identification on the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from commissioner.motor.quantities import FIVE


def _title(sources: Sequence[str]) -> str:
    from commissioner.cli.screens.screen import text

    return text("Identified from " + ", ".join(sources))


def show(document: Mapping[str, Any], sources: Sequence[str]) -> None:
    """The result as a table for a technician, with what holds for which flux, and the remarks."""
    from commissioner.cli.screens.screen import out, table

    rows = []
    for q in FIVE:
        quantity = document["parameters"][q.field]
        value, std = q.factor * quantity["value"], q.factor * quantity["std"]
        rows.append((q.name, f"{value:.5g}", f"{std:.2g} ({std / value:.2%})", q.unit))
    out.print(table(_title(sources), ("per phase, star equivalent", "value", "std error", "unit"), rows, right=(1, 2)))
    flux = document["holds_for_stator_flux_wb"]
    rated = document["rated_flux_wb"]["stator_peak"]
    out.print(f"L_M holds for {flux:.3g} Wb peak stator flux ({flux / rated:.0%} of rated {rated:.3g} Wb).")
    inverter = document["inverter"]
    if inverter["identified"]:
        out.print(
            f"Inverter: each leg loses {inverter['leg_error_v']['value']:.2f} V (knee {inverter['knee_a']:.2g} A)."
        )
    white = [a["whiteness"]["is_white"] for a in document["axes"]]
    out.print(
        f"{len(white)} axis test(s), {document['duration_s']:.1f} s energised, residual white in {sum(white)}; "
        + "{lost_samples} samples lost in {count} gaps.".format(**document["gaps"])
    )
    for finding in document["findings"]:
        out.print(f"- {finding['sentence']}: {finding['relative_size']:+.2%} (std {finding['relative_std']:.2%})")
    for remark in document["remarks"]:
        out.print(f"- {remark}", markup=False)


def show_running(document: Mapping[str, Any], sources: Sequence[str]) -> None:
    """Of a running motor: the same table with what the noise alone allows, inertia and load of a start, remarks."""
    from commissioner.cli.screens.screen import out, table

    rows = []
    for q in FIVE:
        quantity = document["parameters"][q.field]
        value, std = q.factor * quantity["value"], q.factor * quantity["std"]
        bound = q.factor * document["bound_std"][q.field]
        rows.append((q.name, f"{value:.5g}", f"{std:.2g} ({std / value:.2%})", f"{bound:.2g}", q.unit))
    if document["inertia_kg_m2"]:
        value, std = document["inertia_kg_m2"]["value"], document["inertia_kg_m2"]["std"]
        rows.append(("inertia J", f"{value:.4g}", f"{std:.2g} ({std / value:.2%})", "", "kg m2"))
    out.print(
        table(
            _title(sources),
            ("per phase, star equivalent", "value", "std error", "least by noise", "unit"),
            rows,
        )
    )
    flux = document["holds_for_stator_flux_wb"]
    out.print(
        f"L_M holds for {flux:.3g} Wb peak stator flux. Residual {document['residual_over_noise']:.3g} x the noise; "
        f"speed {document['speed']}; {document['duration_s']:.1f} s used."
    )
    for name, value in document["load"].items():
        out.print(f"load of the start: {name.replace('_', ' ').removesuffix(' nm')} {value:.3g} N m")
    for remark in document["remarks"]:
        out.print(f"- {remark}", markup=False)


def show_sheets(document: Mapping[str, Any], sources: Sequence[str]) -> None:
    """Of test sheets: the circuit as terminals have it, as a T, and by the textbook's approximations; what was assumed."""
    from commissioner.cli.screens.screen import out, table

    rows = []
    for q in FIVE:
        quantity = document["parameters"][q.field]
        std = "not known" if quantity["std"] is None else f"{q.factor * quantity['std']:.2g}"
        rows.append((q.name, f"{q.factor * quantity['value']:.5g}", std, q.unit))
    ends = document["at_terminals"]
    rows.append(("between two terminals, R", f"{ends['resistance_uv_ohm']:.5g}", "", "Ω"))
    rows.append(("between two terminals, L idle", f"{1e3 * ends['inductance_uv_h']:.5g}", "", "mH"))
    title = _title(sources)
    out.print(table(title, ("per phase, star equivalent", "value", "std error", "unit"), rows))
    t, book = document["t_circuit"], document["textbook"]
    w = 2.0 * 3.141592653589793 * book["frequency_hz"]
    exact = (
        t["stator_resistance_ohm"], t["rotor_resistance_ohm"], w * t["stator_leakage_h"], w * t["rotor_leakage_h"],
        w * t["magnetizing_inductance_h"],
    )  # fmt: skip
    usual = [book[k] for k in ("r1_ohm", "r2_ohm", "x1_ohm", "x2_ohm", "xm_ohm")]
    lines = [
        (name, f"{a:.4g}", f"{b:.4g}")
        for name, a, b in zip(("R_1", "R_2", "X_1", "X_2", "X_M"), exact, usual, strict=True)
    ]
    heads = (f"T circuit at {book['frequency_hz']:g} Hz, ohm", "same terminals", "usual approximations")
    out.print(table("", heads, lines, right=(1, 2)))
    out.print(f"Method: {document['method']}.")
    for remark in document["remarks"]:
        out.print(f"- {remark}", markup=False)


def show_catalogue(document: Mapping[str, Any], sources: Sequence[str], out_folder: Path | None = None) -> None:
    """Of a manufacturer's sheet: the four with both errors, the circuits, each value beside the circuit's, what stays open."""
    from commissioner.cli.screens.screen import out, table

    found = document["parameters"]
    rows = [(q.name, *_with_errors(found[q.field], q.factor), q.unit) for q in FIVE if q.field in found]
    heads = ("per phase, star equivalent", "value", "std error", "of the type", "unit")
    out.print(table(_title(sources), heads, rows))
    circuits = (("one cage at rated slip", document["t_circuit"]), ("two cages", document["double_cage"]))
    lines = [
        ("" if k else words, name, *_with_errors(q, 1.0))
        for words, of in circuits
        for k, (name, q) in enumerate(of.items())
    ]
    if lines:
        out.print(table("", ("T circuit, ohm at rated frequency", "", "value", "std error", "of the type"), lines))
    loss = [
        (name.removesuffix("_w").replace("_", " "), *_with_errors(q, 1.0)) for name, q in document["losses"].items()
    ]
    out.print(table("", ("losses at rated load, W", "value", "std error", "of the type"), loss))
    met = [(v["name"], f"{v['given']:.5g}", f"{v['reproduced']:.5g}", v["unit"], "" if v["is_fitted"] else "not used")
           for v in document["values"]]  # fmt: skip
    out.print(table("", ("the sheet's values", "given", "circuit", "unit", ""), met))
    for remark in document["remarks"]:
        out.print(f"- {remark}", markup=False)
    if out_folder is not None:
        out.print(f"report    {out_folder / 'report.html'}", markup=False, soft_wrap=True)


def _with_errors(quantity: Mapping[str, Any], factor: float) -> tuple[str, str, str]:
    value = quantity["value"]
    return f"{factor * value:.4g}", f"{quantity['std'] / value:.1%}", f"{quantity['std_of_type'] / value:.1%}"
