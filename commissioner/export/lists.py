"""The parameter list: a row for each value, with its error, its register and what the drive held before. CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator

from typing_extensions import TypedDict

from commissioner.export.found import CONVENTION, Found


class ParameterRow(TypedDict):
    """One value under the contract's name; the drive's before and after in SI, null where it was not written."""

    name: str
    value: float
    std: float
    unit: str
    circuit: str
    at_stator_flux_wb: float | None
    register: int | None
    drive_before: float | None
    drive_after: float | None
    drive_read_back: float | None


COLUMNS = tuple(ParameterRow.__annotations__)
_UNITS = {"ohm": "ohm", "h": "H", "s": "s"}


def rows(found: Found) -> Iterator[ParameterRow]:
    """SI values under the contract's names; the drive's are SI, too."""
    written = {row["field"]: row for row in found.drive if row.get("field")}
    for circuit, values in (("inverse-Gamma", found.parameters), (f"T, {found.t_assumption}", found.t_model)):
        for name, quantity in values.items():
            row = written.get(name) if circuit == "inverse-Gamma" else None
            is_iron = "magnetizing" in name or "time_constant" in name
            yield {
                "name": name, "value": quantity.value, "std": quantity.std, "unit": _UNITS[name.rpartition("_")[2]],
                "circuit": circuit, "at_stator_flux_wb": found.holds_for_wb if is_iron else None,
                "register": row["register"] if row else None, "drive_before": row["before"] if row else None,
                "drive_after": row["after"] if row else None, "drive_read_back": row["read_back"] if row else None,
            }  # fmt: skip


def as_csv(found: Found) -> bytes:
    """Comment lines as in a recording, one header line, then the rows."""
    text = io.StringIO()
    text.write(f"# run: {found.run}\n# utc: {found.utc}\n# convention: {CONVENTION}\n")
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: "" if value is None else value for key, value in row.items()} for row in rows(found))
    return text.getvalue().encode()


def as_json(found: Found) -> bytes:
    document = {
        "run": found.run, "utc": found.utc, "convention": CONVENTION, "nameplate": dict(found.plate),
        "parameters": list(rows(found)),
        "magnetizing_curve": [{"stator_flux_wb": a, "magnetizing_inductance_h": b} for a, b in found.curve],
        "leg_loss": [{"leg_current_a": a, "leg_voltage_v": b} for a, b in found.leg],
    }  # fmt: skip
    return (json.dumps(document, indent=2, allow_nan=False) + "\n").encode()
