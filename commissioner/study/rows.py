"""The table of a study: a line for each case as it ends, a Parquet table of all of them in order at the end."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from commissioner.encoding import plain
from commissioner.errors import UsageError
from commissioner.recordings.whole import whole_file

ENDED, TABLE, ASKED = "ended.jsonl", "cases.parquet", "study.json"
Row = dict[str, Any]


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
                    f"{folder} holds the rows of a study", step="study", value=str(lines), limit="an empty folder, or --resume",
                    remedy="give --resume to finish it, or another --out",
                )  # fmt: skip
            before = json.loads(known.read_text("utf-8")) if known.is_file() else None
            if before != plain(asked):
                raise UsageError(
                    f"{folder} holds another study", step="study", value=str(known), limit="the study that was begun there",
                    remedy="give another --out",
                )  # fmt: skip
            self.ended = {row["case"]: row for row in _whole_lines(lines)}
        with whole_file(known) as temporary:
            temporary.write_text(json.dumps(plain(asked), indent=2) + "\n", "utf-8")
        is_torn = lines.is_file() and not lines.read_bytes().endswith(b"\n") and lines.stat().st_size > 0
        self._file = lines.open("a", encoding="utf-8", newline="\n")
        if is_torn:  # what a kill cut off must not swallow the next line
            self._file.write("\n")

    def add(self, row: Row) -> None:
        """One case has ended; its line is with the operating system when this returns."""
        if row["case"] not in self.ended:
            self.ended[row["case"]] = plain(row)
            self._file.write(json.dumps(plain(row), allow_nan=False) + "\n")
            self._file.flush()

    def close(self) -> Path:
        """The table, in the order of cases."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        self._file.close()
        target = self.folder / TABLE
        ordered = [self.ended[case] for case in sorted(self.ended)]
        with whole_file(target) as temporary:
            pq.write_table(pa.Table.from_pylist(ordered), temporary, compression="zstd")
        return target


def _whole_lines(path: Path) -> Iterable[Row]:
    """Lines up to one that a kill has cut off."""
    for line in path.read_text("utf-8").split("\n"):
        try:
            row = json.loads(line)
        except ValueError:
            continue
        if isinstance(row, dict) and isinstance(row.get("case"), int):
            yield row
