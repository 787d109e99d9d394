"""Test sheets of a motor - direct current, no load, locked rotor - as an identification, and as what a diagnosis says of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from commissioner.diagnose.contract import CONVENTION, DiagnosisDocument
from commissioner.diagnose.points.meters import line_values
from commissioner.diagnose.points.rows import CALLED, LEAST_COLUMNS
from commissioner.diagnose.points.table import is_points_table
from commissioner.errors import DataRefused
from commissioner.identify.contract import Measured, ThreeTestsDocument
from commissioner.identify.intake.plate import NAMEPLATE_KEYS, nameplate_from
from commissioner.motor.circuit import PARAMETERS
from commissioner.operations.recordings.intake import plate_metadata
from commissioner.operations.recordings.trust import Trust, judged
from commissioner.recordings.sheet_names import missing_of_sheet
from commissioner.recordings.table import Table
from commissioner.records import ReadingNote

if TYPE_CHECKING:
    from commissioner.diagnose.points.three_tests import ThreeTests

NOTHING_LEFT = (
    "Three tests fix the circuit and leave nothing over: no cause can be seen or ruled out. The circuit is below; `identify` "
    "shows it with what was assumed."
)


def with_line_values(tables: Sequence[Table], motor: str | None) -> list[Table]:
    """Tables of test points with line volts and amperes, noted from which meters; others as they are. DataRefused: the meters
    contradict each other, or it is not told what `phase` means."""
    return [_with_line_values(t, motor) if is_points_table([*t.columns]) else t for t in tables]


def _with_line_values(table: Table, motor: str | None) -> Table:
    found = line_values(table.columns, {**table.metadata, **plate_metadata(motor)})
    if isinstance(found, DataRefused):
        raise found
    notes = tuple(ReadingNote("line_values", remark.rstrip(".")) for remark in found.remarks)
    return replace(table, columns=found.columns, notes=(*table.notes, *notes))


def are_sheets(tables: Sequence[Table]) -> bool:
    """Whether all files are tables of test points."""
    return all(is_points_table(list(t.columns)) for t in tables)


def require_whole_sheets(tables: Sequence[Table]) -> None:
    """DataRefused: a table without a time has columns of a test sheet and lacks others."""
    for table in tables:
        missing = missing_of_sheet(r.name for r in table.readings) if "time_s" not in table.columns else []
        if missing:
            raise DataRefused(
                f"{table.source}: this looks like a test sheet and lacks {', '.join(missing)}", step="recognise columns",
                value=", ".join(r.name for r in table.readings)[:200],
                limit="one column each of line-to-line volts, line amperes and the watts of all three phases (rms)",
                remedy="name the columns frequency_hz, voltage_line_v (or voltage_neutral_v, voltage_uv_v ...), current_line_a (or current_u_a ...), power_w "
                "(or power_1_w, power_2_w of two wattmeters)",
            )  # fmt: skip


def by_test(tables: Sequence[Table]) -> list[Table]:
    """The tables of test points, one for each test whose rows a table holds."""
    from commissioner.diagnose.points.rows import apart

    return [
        part
        for t in tables
        for part in (_apart(t, apart(t.columns)) if all(c in t.columns for c in LEAST_COLUMNS) else [t])
    ]


def _apart(table: Table, tests: Sequence[tuple[float, Any]]) -> list[Table]:
    if len(tests) < 2:
        return [table]
    path, size = Path(table.source), tests[0][1].size
    left = size - sum(int(rows.sum()) for _, rows in tests)
    note = (
        (ReadingNote("unknown_test", f"{left} rows of no known test or of a loaded motor were not used"),)
        if left
        else ()
    )
    return [
        replace(
            table,
            source=str(path.with_name(f"{path.stem}_{CALLED.get(test, 'rest').replace(' ', '_')}{path.suffix}")),
            columns={name: values[rows] for name, values in table.columns.items()} | _named(test, int(rows.sum())),
            notes=(*table.notes, *note),
        )
        for test, rows in tests
    ]


def _named(test: float, size: int) -> dict[str, Any]:
    return {"test": np.full(size, test)} if np.isfinite(test) else {}


def direct_current(tables: Sequence[Table], motor: str | None) -> tuple[list[Table], float | None, tuple[str, ...]]:
    """The tables (`by_test`) of alternating current, the resistance that those of direct current tell (None: there are none), and how it
    was taken. DataRefused: a row is called by another test's name, or the direct current is ambiguous."""
    from commissioner.diagnose.points.rows import are_of_direct_current, joined, misnamed, pooled
    from commissioner.diagnose.points.three_tests import stator_resistance

    if any(c not in t.columns for t in tables for c in LEAST_COLUMNS):
        return list(tables), None, ()
    if (wrong := misnamed([t.columns for t in tables])) is not None:
        raise wrong
    direct = [t for t in tables if are_of_direct_current(pooled(t.columns))]
    rest = [t for t in tables if not are_of_direct_current(pooled(t.columns))]
    if not direct:
        return rest, None, ()
    said = {**{k: v for t in reversed(tables) for k, v in t.metadata.items()}, **plate_metadata(motor)}
    of_direct, of_rest = (joined([pooled(t.columns) for t in some]) for some in (direct, rest))
    found = stator_resistance(of_direct, [], said, of_rest)
    if isinstance(found, DataRefused):
        raise found
    return rest, found[0], (found[1],)


def are_three(tables: Sequence[Table]) -> bool:
    """Whether they are the few rows of different tests that make a circuit together."""
    from commissioner.diagnose.points.rows import are_three_tests

    return are_three_tests([t.columns for t in tables])


def identified(tables: Sequence[Table], motor: str | None, trust: Trust | None) -> ThreeTestsDocument:
    """The circuit's document. DataRefused: a test is missing or impossible, or contradicts the plate and nobody decided."""
    from commissioner.diagnose.points.three_tests import solve

    plate = plate_metadata(motor)
    found = solve([t.columns for t in tables], [{**t.metadata, **plate} for t in tables])
    if isinstance(found, DataRefused):
        raise found
    decided = _against_plate(found, {**{k: v for t in tables for k, v in t.metadata.items()}, **plate}, trust)
    circuit = found.circuit
    std = None if found.slow is None else found.slow.std_ohm
    values = dict(zip(PARAMETERS, circuit.as_tuple(), strict=True))
    parameters: dict[str, Measured] = {
        n: {"value": v, "std": std if n == "rotor_resistance_ohm" else None} for n, v in values.items()
    }
    parameters["rotor_time_constant_s"] = {"value": circuit.rotor_time_constant_s, "std": None}
    for name in ("magnetizing_inductance_h", "rotor_time_constant_s"):
        parameters[name]["at_stator_flux_wb"] = found.flux_wb
    return {
        "outcome": "identified",
        "reason": "The circuit of a direct-current, a no-load and a locked-rotor test.",
        "kind": "three tests",
        "method": found.method,
        "convention": CONVENTION,
        "parameters": parameters,
        "t_circuit": asdict(found.t_circuit),
        "textbook": dict(found.textbook),
        "at_terminals": {
            "resistance_uv_ohm": 2.0 * circuit.stator_resistance_ohm,
            "inductance_uv_h": 2.0 * (circuit.leakage_inductance_h + circuit.magnetizing_inductance_h),
            "leakage_uv_h": 2.0 * circuit.leakage_inductance_h,
        },
        "losses": asdict(found.losses),
        "rows": dict(found.rows),
        "remarks": [*decided, *found.assumed, *notes_of(tables)],
    }


def of_circuit(document: DiagnosisDocument) -> DiagnosisDocument:
    """`diagnosed`'s, where a test has rows enough to be judged by itself."""
    return cast(
        "DiagnosisDocument",
        {**document, "reason": "Direct current, no load and locked rotor together make the circuit below."},
    )


def diagnosed(tables: Sequence[Table], motor: str | None, trust: Trust | None) -> DiagnosisDocument:
    """What a diagnosis says of them: their circuit, and that nothing is left over."""
    made = identified(tables, motor, trust)
    document: dict[str, Any] = {
        "verdict": "nothing_significant", "reason": NOTHING_LEFT, "kind": "points", "test": "three tests",
        "convention": CONVENTION, "causes": [],
        "gain": {"held_out": None, "rmse_before_a": None, "rmse_after_a": None, "noise_floor_a": None,
                 "relative_error_before": None, "relative_error_after": None},
        "parameters_before": {}, "parameters_after": made["parameters"], "remarks": made["remarks"],
        "next_experiment": None, "model_file": None,
        **{k: made[k] for k in ("t_circuit", "textbook", "at_terminals", "losses", "method")},
    }  # fmt: skip
    return cast("DiagnosisDocument", document)


def _against_plate(found: ThreeTests, plate: Mapping[str, float | str], trust: Trust | None) -> list[str]:
    if any(not isinstance(plate.get(key), float | int) for key in NAMEPLATE_KEYS):
        return []
    return judged(found.circuit, nameplate_from(plate), trust)


def notes_of(tables: Sequence[Table]) -> list[str]:
    return [f"{Path(t.source).name}: {note.what}." for t in tables for note in t.notes]
