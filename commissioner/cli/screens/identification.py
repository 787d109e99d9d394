"""An identification on the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from commissioner.motor.quantities import FIVE
from commissioner.report.sheet.numbers import half_width, interval


def _title(sources: Sequence[str]) -> str:
    from commissioner.cli.screens.screen import text

    return text("Identified from " + ", ".join(sources))


def show(document: Mapping[str, Any], sources: Sequence[str]) -> None:
    """The result as a table for a technician, with what holds for which flux, and the remarks."""
    from commissioner.cli.screens.screen import out, signs, table

    rows = []
    for q in FIVE:
        quantity = document["parameters"][q.field]
        rows.append((q.name, *_measured(quantity, q.factor), q.unit))
    out.print(table(_title(sources), ("per phase, star equivalent", "value", "± 95 %", "unit"), rows, right=(1, 2)))
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
        f"Axis tests: {len(white)}, {document['duration_s']:.1f} s energised, residual white in {sum(white)}; "
        + "{lost_samples} samples lost in {count} gaps.".format(**document["gaps"])
    )
    for finding in document["findings"]:
        out.print(
            f"- {finding['sentence']}: {finding['relative_size']:+.2%} ± {half_width(finding['relative_std']):.2%}"
        )
    for remark in document["remarks"]:
        out.print(f"- {signs(remark)}", markup=False)


def show_running(document: Mapping[str, Any], sources: Sequence[str]) -> None:
    """Of a running motor: the same table with what the noise alone allows, inertia and load of a start, remarks."""
    from commissioner.cli.screens.screen import out, signs, table

    rows = []
    for q in FIVE:
        quantity = document["parameters"][q.field]
        bound = half_width(document["bound_std"][q.field], q.factor)
        rows.append((q.name, *_measured(quantity, q.factor), f"{bound:.2g}", q.unit))
    if inertia := document["inertia_kg_m2"]:
        rows.append(("inertia J", *_measured(inertia, 1.0), "", "kg m²"))
    out.print(
        table(
            _title(sources),
            ("per phase, star equivalent", "value", "± 95 %", "least by noise", "unit"),
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
        out.print(f"- {signs(remark)}", markup=False)


def show_sheets(document: Mapping[str, Any], sources: Sequence[str]) -> None:
    """Of test sheets: the circuit as terminals have it, as a T, and by the textbook's approximations; what was assumed."""
    from commissioner.cli.screens.screen import out, signs, table

    rows = []
    for q in FIVE:
        quantity = document["parameters"][q.field]
        rows.append((q.name, *_measured(quantity, q.factor), q.unit))
    ends = document["at_terminals"]
    rows.append(("between two terminals, R", f"{ends['resistance_uv_ohm']:.5g}", "", "Ω"))
    rows.append(("between two terminals, L idle", f"{1e3 * ends['inductance_uv_h']:.5g}", "", "mH"))
    title = _title(sources)
    out.print(table(title, ("per phase, star equivalent", "value", "± 95 %", "unit"), rows))
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
        out.print(f"- {signs(remark)}", markup=False)


def show_catalogue(document: Mapping[str, Any], sources: Sequence[str], out_folder: Path | None = None) -> None:
    """Of a manufacturer's sheet: the four with both errors, the circuits, each value beside the circuit's, what stays open."""
    from commissioner.cli.screens.screen import out, signs, table

    found = document["parameters"]
    rows = [(q.name, *_with_errors(found[q.field], q.factor), q.unit) for q in FIVE if q.field in found]
    heads = ("per phase, star equivalent", "value", "± 95 %", "of the type", "unit")
    out.print(table(_title(sources), heads, rows))
    circuits = (("one cage at rated slip", document["t_circuit"]), ("two cages", document["double_cage"]))
    lines = [
        ("" if k else words, name, *_with_errors(q, 1.0))
        for words, of in circuits
        for k, (name, q) in enumerate(of.items())
    ]
    if lines:
        out.print(table("", ("T circuit, ohm at rated frequency", "", "value", "± 95 %", "of the type"), lines))
    loss = [
        (name.removesuffix("_w").replace("_", " "), *_with_errors(q, 1.0)) for name, q in document["losses"].items()
    ]
    out.print(table("", ("losses at rated load, W", "value", "± 95 %", "of the type"), loss))
    met = [(v["name"], f"{v['given']:.5g}", f"{v['reproduced']:.5g}", v["unit"], "" if v["is_fitted"] else "not used")
           for v in document["values"]]  # fmt: skip
    out.print(table("", ("the sheet's values", "given", "circuit", "unit", ""), met))
    for remark in document["remarks"]:
        out.print(f"- {signs(remark)}", markup=False)
    if out_folder is not None:
        out.print(f"report    {out_folder / 'report.html'}", markup=False, soft_wrap=True)


def _with_errors(quantity: Mapping[str, Any], factor: float) -> tuple[str, str, str]:
    from commissioner.cli.screens.screen import share

    return f"{factor * quantity['value']:.4g}", share(quantity), share(quantity, "std_of_type")


def _measured(quantity: Mapping[str, Any], factor: float) -> tuple[str, str]:
    """The value to the places of its 95 % interval, and half of that, also in per cent."""
    from commissioner.cli.screens.screen import share

    value, half = factor * quantity["value"], half_width(quantity["std"], factor)
    if not half:
        return f"{value:.5g}", "not known"
    shown, spread = interval(value, half)
    return shown, f"{spread} ({share(quantity)})"
