"""A table of runs, a row each: who, what, when, how it ended, the four parameters with their errors. CSV and Parquet."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from commissioner.errors import UsageError
from commissioner.identify.intake.plate import NAMEPLATE_KEYS
from commissioner.motor.quantities import FIELDS
from commissioner.recordings.whole import whole_file
from commissioner.text import visible

TEXTS = (
    "run", "started_utc", "ended_utc", "outcome", "standing", "reason", "written", "drive", "url", "profile", "person", "host",
    "version", "motor_tag", "motor_serial", "motor_name", "folder",
)  # fmt: skip
ENDINGS = (".csv", ".parquet")


def write_table(summaries: Iterable[Mapping[str, Any]], target: Path) -> int:
    """The number of rows written. `summaries`: as `runs list --json` shows them. SI units; empty where a run did not get so far.
    `at_stator_flux_wb`: the peak stator flux that L_M and T_R hold at. UsageError: another ending than `ENDINGS`."""
    if target.suffix not in ENDINGS:
        raise UsageError(
            f"{target.name} is no name of a table", step="export", value=target.suffix or "none", limit=" or ".join(ENDINGS),
            remedy="end the name in .csv or .parquet",
        )  # fmt: skip
    rows = [_row(summary) for summary in summaries]
    with whole_file(target) as temporary:
        (_write_csv if target.suffix == ".csv" else _write_parquet)(rows, temporary)
    return len(rows)


def _row(summary: Mapping[str, Any]) -> dict[str, str | float | None]:
    row: dict[str, str | float | None] = {name: visible(str(summary.get(name) or "")) for name in TEXTS}
    row["drive_serial"] = "" if summary.get("serial_number") is None else str(summary["serial_number"])
    row["energised_s"] = _number(summary.get("energised_s"))
    plate, found = summary.get("motor") or {}, summary.get("parameters") or {}
    row |= {name: _number(plate.get(name)) for name in NAMEPLATE_KEYS}
    for name in FIELDS:
        quantity = found.get(name) or {}
        row |= {name: _number(quantity.get("value")), f"{name}_std": _number(quantity.get("std"))}
    row["at_stator_flux_wb"] = _number((found.get("magnetizing_inductance_h") or {}).get("at_stator_flux_wb"))
    return row


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def _write_csv(rows: list[dict[str, str | float | None]], target: Path) -> None:
    with target.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, _row({}), lineterminator="\n")
        writer.writeheader()
        writer.writerows({name: "" if value is None else value for name, value in row.items()} for row in rows)


def _write_parquet(rows: list[dict[str, str | float | None]], target: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    texts = {*TEXTS, "drive_serial"}
    schema = pa.schema([(name, pa.string() if name in texts else pa.float64()) for name in _row({})])
    pq.write_table(pa.Table.from_pylist(rows, schema), target)
