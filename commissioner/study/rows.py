"""The table of a study: a line for each case as it ends, a Parquet table of all of them in order at the end."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NotRequired, cast

from typing_extensions import TypedDict

from commissioner.encoding import plain, read_json
from commissioner.errors import UsageError
from commissioner.monitor.contract import Measured
from commissioner.recordings.whole import whole_file, write_text

ENDED, TABLE, ASKED = "ended.jsonl", "cases.parquet", "study.json"
DEFECT = "defect"
"""Outcome of a case that ended in an error of ours, or that took its worker with it."""


class Row(TypedDict):
    """Of one case: what the kind of the study has, `None` where the case did not get so far. SI units; `peak_flux_fraction` of the
    guard's limit; of a parameter what is true, the value found and its standard deviation. `remarks`: of a recording, what its verb remarks on it (rows left
    out, units taken), a line each."""

    case: int
    outcome: str
    reason: str
    seed: NotRequired[int]
    motor: NotRequired[str]
    effects: NotRequired[str]
    rated_power_w: NotRequired[float | None]
    energised_s: NotRequired[float | None]
    peak_flux_fraction: NotRequired[float | None]
    stator_resistance_ohm_true: NotRequired[float | None]
    stator_resistance_ohm_value: NotRequired[float | None]
    stator_resistance_ohm_std: NotRequired[float | None]
    rotor_resistance_ohm_true: NotRequired[float | None]
    rotor_resistance_ohm_value: NotRequired[float | None]
    rotor_resistance_ohm_std: NotRequired[float | None]
    leakage_inductance_h_true: NotRequired[float | None]
    leakage_inductance_h_value: NotRequired[float | None]
    leakage_inductance_h_std: NotRequired[float | None]
    magnetizing_inductance_h_true: NotRequired[float | None]
    magnetizing_inductance_h_value: NotRequired[float | None]
    magnetizing_inductance_h_std: NotRequired[float | None]
    file: NotRequired[str]
    remarks: NotRequired[str]
    causes: NotRequired[str]
    held_out: NotRequired[float | None]
    mean_speed_rad_per_s: NotRequired[Measured]
    mean_torque_nm: NotRequired[Measured]
    cpu_s: NotRequired[float]


class Rows:
    """Of one folder. Opened again with `resume`, it holds what had ended by then."""

    def __init__(self, folder: Path, asked: Mapping[str, Any], *, resume: bool) -> None:
        """UsageError: the folder holds another study, or rows that `resume` was not asked for."""
        self.folder = folder
        self.ended: dict[int, Row] = {}
        lines, known = folder / ENDED, folder / ASKED
        if lines.is_file():
            if not resume:
                raise UsageError(
                    f"the folder {folder} holds a study already", step="study", value=str(lines), limit="an empty folder, or --resume",
                    remedy="give --resume to finish it, or another --out",
                )  # fmt: skip
            if _asked_before(known) != plain(asked):
                raise UsageError(
                    f"{folder} holds another study", step="study", value=str(known), limit="the study that was begun there",
                    remedy="give another --out",
                )  # fmt: skip
            self.ended = {row["case"]: row for row in _whole_lines(lines)}
        write_text(known, json.dumps(plain(asked), indent=2) + "\n")
        is_torn = lines.is_file() and not lines.read_bytes().endswith(b"\n") and lines.stat().st_size > 0
        self._file = lines.open("a", encoding="utf-8", newline="\n")
        if is_torn:  # what a kill cut off must not swallow the next line
            self._file.write("\n")

    def add(self, row: Row) -> None:
        """One case has ended; its line is with the operating system when this returns."""
        if row["case"] not in self.ended:
            self.ended[row["case"]] = cast("Row", plain(row))
            self._file.write(json.dumps(plain(row), allow_nan=False) + "\n")
            self._file.flush()

    def close(self) -> Path | None:
        """The table, in the order of cases; None where no case has ended: the same call may then be made again."""
        self._file.close()
        if not self.ended:
            for name in (ENDED, ASKED):
                (self.folder / name).unlink(missing_ok=True)
            return None
        import pyarrow as pa
        import pyarrow.parquet as pq

        target = self.folder / TABLE
        ordered = [self.ended[case] for case in sorted(self.ended)]
        names = dict.fromkeys(name for row in ordered for name in row)  # Arrow would take the first row's alone
        columns: dict[str, list[Any]] = {name: [row.get(name) for row in ordered] for name in names}
        with whole_file(target) as temporary:
            pq.write_table(pa.table(columns), temporary, compression="zstd")
        return target


def _asked_before(known: Path) -> Any:
    """The study that was begun in the folder; None where nothing says so any more."""
    try:
        return read_json(known.read_bytes()) if known.is_file() else None
    except ValueError:
        return None


def _whole_lines(path: Path) -> Iterable[Row]:
    """The lines that are rows: what a kill has cut off or a disk has spoilt is a case that is still missing."""
    from pydantic import TypeAdapter, ValidationError

    promised = TypeAdapter(Row)
    for line in path.read_bytes().split(b"\n"):
        try:
            row = read_json(line)
            promised.validate_python(row)
        except (ValueError, ValidationError):
            continue
        yield cast("Row", row)
