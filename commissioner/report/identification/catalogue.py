"""The page of a motor from its manufacturer's sheet: values with both errors, each printed value beside the circuit's, what stays open."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from commissioner.motor.circuit import QUANTILE
from commissioner.report.page import Page, Section, Table
from commissioner.report.sheet.numbers import digits

NAMES = (
    ("stator_resistance_ohm", "stator resistance R_s, warm", 1.0, "Ω"), ("rotor_resistance_ohm", "rotor resistance R_R at rated slip", 1.0, "Ω"),
    ("leakage_inductance_h", "leakage inductance L_σ", 1e3, "mH"), ("magnetizing_inductance_h", "magnetizing inductance L_M", 1e3, "mH"),
    ("rotor_time_constant_s", "rotor time constant", 1e3, "ms"),
)  # fmt: skip
PLATE = (
    ("rated_power_w", "rated power", 1e-3, "kW"), ("rated_voltage_v", "rated voltage", 1.0, "V"), ("rated_current_a", "rated current", 1.0, "A"),
    ("rated_speed_rpm", "rated speed", 1.0, "1/min"), ("rated_frequency_hz", "frequency", 1.0, "Hz"),
)  # fmt: skip
HEADER = ("", "value", "± of a motor of this type", "± of the type", "rounding", "assumed", "tolerance")


def catalogue_page(document: Mapping[str, Any], name: str) -> Page:
    """`document`: of `identify.catalogue.document`."""
    found = document["parameters"]
    rows = [_row(label, found[key], factor, unit) for key, label, factor, unit in NAMES if key in found]
    circuits = [
        *(_row(f"{n}, one cage at rated slip", q, 1.0, "Ω") for n, q in document["t_circuit"].items()),
        *(_row(f"{n}, two cages", q, 1.0, "Ω") for n, q in document["double_cage"].items()),
    ]
    losses = [_row(n.removesuffix("_w").replace("_", " "), q, 1.0, "W") for n, q in document["losses"].items()]
    met = [
        (v["name"], f"{v['given']:.5g}", f"{v['reproduced']:.5g}", v["unit"],
         f"{v['reproduced'] / v['given'] - 1.0:+.1%}{'' if v['is_fitted'] else ' (not used)'}")
        for v in document["values"]
    ]  # fmt: skip
    sections = [
        Section("Parameters", Table(HEADER, rows, caption="Inverse-Gamma circuit, per phase of the star equivalent.")),
        Section("The sheet's values", Table(("", "on the sheet", "of the circuit", "unit", "off by"), met)),
        Section("T circuit at rated frequency", Table(HEADER, circuits)),
        Section("Losses at rated load", Table(HEADER, losses)),
        Section("What was assumed and what a sheet cannot tell", *document["remarks"]),
    ]
    headline = (
        "The circuit that meets the manufacturer's sheet"
        if not document["withheld"]
        else "The sheet tells a part of the circuit"
    )
    plate = document["nameplate"] or {}
    facts = [(words, f"{factor * plate[key]:.4g} {unit}") for key, words, factor, unit in PLATE if key in plate]
    return Page(f"Motor from its sheet: {name}", headline, "plain", facts, [s for s in sections if s.parts],
                "± holds the true value in 19 of 20 cases; the last three columns are its parts, one standard deviation of the value.")  # fmt: skip


def _row(label: str, q: Mapping[str, Any], factor: float, unit: str) -> tuple[str, ...]:
    value, parts = q["value"], q["from"]
    shares = (f"{parts[k] / value:.1%}" for k in ("rounding", "assumptions", "tolerances"))
    half = (f"{digits(QUANTILE * factor * q[k], 2)} {unit}" for k in ("std", "std_of_type"))
    return label, f"{digits(factor * value, 4)} {unit}", *half, *shares
