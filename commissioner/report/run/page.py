"""The report of a commissioning run: what was found, whether to trust it, what was written."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from commissioner.motor.space_vector import axis_current_a
from commissioner.procedure.steps import Findings
from commissioner.procedure.verdict import evidence_of
from commissioner.records import Signal
from commissioner.report.page import Page, Picture, Section, Table, Tone, picture, render
from commissioner.report.run import figures
from commissioner.report.run.standing import ACCEPTED, finding_sentences, standing
from commissioner.report.run.summary import diagnosis_sentences

_TONES: dict[str, Tone] = {"commissioned": "good", "rejected": "warn", "aborted": "warn", "faulted": "bad"}
_STANDING = {ACCEPTED: "Measured and accepted, not written: the drive holds its old values"}
_NAMES = (
    ("stator_resistance_ohm", "Stator resistance R_s", 1.0, "Ω"),
    ("rotor_resistance_ohm", "Rotor resistance R_R", 1.0, "Ω"),
    ("leakage_inductance_h", "Leakage inductance L_σ", 1e3, "mH"),
    ("magnetizing_inductance_h", "Magnetizing inductance L_M", 1e3, "mH"),
    ("rotor_time_constant_s", "Rotor time constant", 1e3, "ms"),
)


def run_page(result: Mapping[str, Any], journal: Sequence[Mapping[str, Any]], findings: Findings) -> str:
    """The whole page as one self-contained HTML text, for every way a run can end."""
    outcome = str(result["outcome"])
    return render(
        Page(
            title=f"commissioner · run {result['run']}",
            headline=_headline(result),
            tone="warn" if standing(result) in _STANDING else _TONES.get(outcome, "bad"),
            facts=list(_facts(result, journal)),
            sections=[section for section in _sections(result, journal, findings) if section.parts],
            footer="SI units; per-phase star equivalent, rotor quantities referred to the stator; inverse-Gamma "
            f"circuit. Intervals are 95 %. commissioner {version('commissioner')}.",
        )
    )


def _headline(result: Mapping[str, Any]) -> str:
    reason = str(result["reason"])
    sentence = reason[:1].upper() + reason[1:]
    return f"{_STANDING.get(standing(result), str(result['outcome']).capitalize())}. {sentence}."


def _facts(result: Mapping[str, Any], journal: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, str]]:
    if journal:
        yield "Begun (UTC)", str(journal[0]["utc"])[:16].replace("T", " ")
    plate = next((line["record"]["nameplate"] for line in journal if line["kind"] == "job"), None)
    if plate:
        yield (
            "Motor",
            (
                f"{1e-3 * plate['rated_power_w']:g} kW, {plate['rated_voltage_v']:g} V {plate['connection']}, "
                f"{plate['rated_current_a']:g} A, {plate['rated_speed_rpm']:g} 1/min"
            ),
        )
    drive = result.get("drive") or {}
    if drive:
        yield "Drive", f"{drive['drive_type']} #{drive['serial_number']}"
    yield "Energised in all", f"{result['energised_s']:.1f} s"
    peak = (result.get("flux_guard") or {}).get("peak_fraction")
    if peak:
        yield "Largest flux, of the limit", f"{100 * peak:.0f} %"
    written = result.get("written") or ()
    yield "Parameters in the drive", "new values, read back, at the end of this run" if written else "unchanged"


def _sections(result: Mapping[str, Any], journal: Sequence[Mapping[str, Any]], findings: Findings) -> Iterator[Section]:
    tests = _tests(journal)
    yield Section("Result", list(_result_parts(result)))
    yield Section("What objects", list(_objections(result)))
    yield Section("What a simulation would have got wrong", list(_diagnosis_parts(result)))
    yield Section("Axes side by side", list(_axes_parts(result, findings)))
    if tests:
        limit = (result.get("flux_guard") or {}).get("limit_wb")
        yield Section(
            "Course of the tests",
            [
                picture(
                    figures.convergence(tests),
                    "Online estimate of each test with two standard errors, at whatever flux it has reached; the result "
                    "above is fitted to all samples together.",
                ),
                *_flux_parts(tests, limit),
            ],
        )
    yield Section("Magnetizing curve", list(_curve_parts(result)))
    yield Section("Currents and residual", list(_current_parts(findings)))
    yield Section("Checks before energising", list(_check_parts(result)))
    yield Section("What happened, in order", [_course(journal)])


def _result_parts(result: Mapping[str, Any]) -> Iterator[str | Table]:
    error = result.get("error")
    if error:
        yield Table(
            ("What", "Seen"),
            [(name, str(error[name])) for name in ("step", "value", "limit", "remedy") if error.get(name)],
        )
    parameters = result.get("parameters") or {}
    if not parameters:
        return
    before = result.get("before") or {}
    written = {row["field"]: row for row in result.get("written") or ()}
    rows = []
    for name, words, factor, unit in _NAMES:
        if name not in parameters:
            continue
        value, std = parameters[name]["value"], parameters[name]["std"] or 0.0
        old = before.get(name)
        rows.append(
            (
                words,
                f"{factor * value:.4g} {unit}",
                f"± {100 * 1.96 * std / abs(value):.2g} %",
                f"{factor * old:.4g} {unit}" if old else "—",
                f"{100 * (value / old - 1):+.1f} %" if old else "—",
                _written_cell(written.get(name), factor, unit),
            )
        )
    yield Table(("Parameter", "Value", "95 % interval", "In the drive before", "Change", "Read back"), rows)
    yield from _conditions(result)
    yield from (f"{sentence[:1].upper()}{sentence[1:]}." for sentence in finding_sentences(result))
    about_samples = set(_diagnosis_sentences(result))
    yield from (
        f"{remark[:1].upper()}{remark[1:]}." for remark in result.get("remarks") or () if remark not in about_samples
    )


def _diagnosis_sentences(result: Mapping[str, Any]) -> list[str]:
    return diagnosis_sentences(result["diagnosis"], result["parameters"]) if result.get("diagnosis") else []


def _diagnosis_parts(result: Mapping[str, Any]) -> Iterator[str | Table]:
    """What `diagnose` said about the run's samples, and how to see all of it."""
    diagnosis = result.get("diagnosis")
    if not diagnosis:
        return
    yield (
        "An autotune without these causes would have written other values. This run does not depend on the diagnosis: "
        "it measured the inverter's loss, the delay and the iron itself."
    )
    for sentence in _diagnosis_sentences(result):
        yield f"{sentence[:1].upper()}{sentence[1:]}."
    yield from diagnosis.get("remarks") or ()
    yield f"All of it, with curves: commissioner diagnose {result['run']}/recording.parquet (in the folder of the runs)."


def _conditions(result: Mapping[str, Any]) -> Iterator[str | Table]:
    """What the values hold for: flux, circuit, inverter."""
    rated, held = result["rated_flux_wb"]["stator_peak"], result["holds_for_stator_flux_wb"]
    yield (
        f"L_M and R_R hold at a peak stator flux of {held:.3g} Wb, {100 * held / rated:.0f} % of the rated"
        + ("; nearer to it the iron saturates further and L_M is lower." if held < 0.95 * rated else ".")
    )
    leg = (result.get("inverter") or {}).get("leg_error_v")
    if leg:
        yield f"Each inverter leg loses {leg['value']:.3g} V to dead time and device drop; it was identified and taken off."
    cold, winding_degc = result.get("stator_resistance_20degc_ohm"), result.get("winding_temperature_degc")
    if cold and winding_degc is not None:
        yield f"R_s was measured at a winding temperature of {winding_degc:.3g} °C; at 20 °C it is {cold['value']:.4g} Ω."
    circuit = result["t_model"]
    names = (("R_s", "stator_resistance_ohm", 1.0, "Ω"), ("R_r", "rotor_resistance_ohm", 1.0, "Ω"),
             ("L_ls", "stator_leakage_h", 1e3, "mH"), ("L_lr", "rotor_leakage_h", 1e3, "mH"),
             ("L_m", "magnetizing_inductance_h", 1e3, "mH"))  # fmt: skip
    row = [f"{factor * circuit[name]['value']:.4g} {unit}" for _, name, factor, unit in names]
    yield Table([n[0] for n in names], [row], caption=f"T circuit, under the assumption: {circuit['assumption']}.")


def _written_cell(row: Mapping[str, Any] | None, factor: float, unit: str) -> str:
    return f"{factor * row['read_back']:.4g} {unit}" if row else "not written"


def _objections(result: Mapping[str, Any]) -> Iterator[Table]:
    rows = [(o["what"], str(o["value"]), str(o["limit"]), o["remedy"]) for o in result.get("objections") or ()]
    if rows:
        yield Table(("Objection", "Seen", "Limit", "Remedy"), rows, tones=["warn"] * len(rows))


def _axes_parts(result: Mapping[str, Any], findings: Findings) -> Iterator[Table | Picture]:
    found = findings.identification
    if found is None or not result.get("parameters"):
        return
    yield picture(
        figures.axes_side_by_side(evidence_of(found).at_one_flux, result["parameters"]),
        f"Each test's estimate at a peak stator flux of {found.holds_for_flux_wb:.3g} Wb with its 95 % interval (blue), "
        "and the combined value (green).",
    )


def _curve_parts(result: Mapping[str, Any]) -> Iterator[Picture]:
    curve = result.get("magnetizing_curve") or ()
    if curve:
        yield picture(
            figures.magnetizing_curve(
                curve, result["holds_for_stator_flux_wb"], result["rated_flux_wb"]["stator_peak"]
            ),
            "Secant magnetizing inductance over the flux the tests visited, with its 95 % interval.",
        )


def _flux_parts(tests: Sequence[Sequence[Mapping[str, Any]]], limit_wb: float | None) -> Iterator[Picture]:
    if limit_wb:
        yield picture(
            figures.fluxes(tests, limit_wb),
            "Peak of both flux estimates over each tenth of a second; the guard acts on the larger, predicted one.",
        )


def _current_parts(findings: Findings) -> Iterator[Picture]:
    """The longest stretch of each test: what was measured and what the batch fit leaves of it."""
    if findings.identification is None:
        return
    segments = _axis_currents(findings)
    for axis in findings.identification.axes:
        residuals = axis.batch.residuals
        currents, segments = segments[: len(residuals)], segments[len(residuals) :]
        longest = max(range(len(residuals)), key=lambda k: residuals[k].size)
        if longest >= len(currents) or currents[longest].size != residuals[longest].size:
            continue
        time_s: Signal = np.arange(residuals[longest].size, dtype=np.float64) * axis.batch.sample_period_s
        yield picture(
            figures.currents(time_s, currents[longest], residuals[longest], f"axis {axis.axis_deg:g}°"),
            "Measured current along the axis, and what the identified model leaves of it.",
            raster=True,
        )


def _axis_currents(findings: Findings) -> list[Signal]:
    """The current along the axis, one array per session, in order."""
    sessions: dict[int, list[Signal]] = {}
    for segment, block in findings.blocks:
        current = axis_current_a(block.current_u_a, block.current_v_a, block.current_w_a, block.axis_deg)
        sessions.setdefault(segment, []).append(current)
    return [np.concatenate(parts) for parts in sessions.values()]


def _check_parts(result: Mapping[str, Any]) -> Iterator[Table]:
    checks = result.get("checks") or ()
    if checks:
        yield Table(
            ("Check", "Seen", "Wanted", "Result"),
            [_check_row(check) for check in checks],
            tones=["good" if c["has_passed"] else "bad" for c in checks],
        )


def _check_row(check: Mapping[str, Any]) -> tuple[str, str, str, str]:
    result = "passed" if check["has_passed"] else str(check["remedy"])
    return check["name"], str(check["value"]), str(check["limit"]), result


_TOLD = (
    "state_entered", "staircase_fitted", "first_look", "guard_acted", "axis_finished", "verdict_reached",
    "parameters_written", "error", "disarmed",
)  # fmt: skip


def _course(journal: Sequence[Mapping[str, Any]]) -> Table:
    rows = [
        (str(line["utc"])[11:23], str(line["kind"]).replace("_", " "), _told(line["record"]))
        for line in journal
        if line["kind"] in _TOLD
    ]
    return Table(("UTC", "What", "Facts"), rows)


def _told(record: Mapping[str, Any]) -> str:
    parts = []
    for key, value in record.items():
        if isinstance(value, float):
            parts.append(f"{key.replace('_', ' ')} {value:.4g}")
        elif isinstance(value, bool):
            parts.append(f"{key.replace('_', ' ')}: {'yes' if value else 'no'}")
        elif isinstance(value, str | int) and value != "":
            parts.append(f"{key.replace('_', ' ')} {value}")
    return ", ".join(parts)


def _tests(journal: Sequence[Mapping[str, Any]]) -> list[list[Mapping[str, Any]]]:
    """The online estimates, one list per test, each with the test's `label`."""
    tests: list[list[Mapping[str, Any]]] = []
    label, number = "", 0
    for line in journal:
        if line["kind"] == "excitation_chosen":
            number += not line["record"]["is_look"]
            label = "first look" if line["record"]["is_look"] else f"test {number}, {line['record']['axis_deg']:g}°"
            tests.append([])
        elif line["kind"] == "estimate_updated" and tests:
            tests[-1].append(line["record"] | {"label": label})
    return [test for test in tests if test]
