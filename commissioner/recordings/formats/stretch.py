"""A stretch of a binary file that can only be read within its bounds: files from strangers claim any length."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, NoReturn

from commissioner.errors import DataRefused
from commissioner.recordings.bounds import bounded_bytes


class Stretch:
    """Bytes with a place to read at. Everything that is not there is a DataRefused that names the format."""

    def __init__(self, data: memoryview, path: Path, form: str) -> None:
        self.data, self.path, self.form, self.at = data, path, form, 0

    @classmethod
    def of_file(cls, path: Path, form: str) -> Stretch:
        """The whole file, up to the size limit of recordings."""
        return cls(memoryview(bounded_bytes(path)), path, form)

    @property
    def is_at_end(self) -> bool:
        return self.at >= len(self.data)

    def take(self, count: int) -> memoryview:
        if count < 0 or self.at + count > len(self.data):
            self.refuse(f"{count} bytes are claimed at {self.at} of {len(self.data)}")
        piece = self.data[self.at : self.at + count]
        self.at += count
        return piece

    def read(self, layout: str) -> tuple[Any, ...]:
        """Values by a `struct` layout."""
        return struct.unpack(layout, self.take(struct.calcsize(layout)))

    def part(self, start: int, count: int) -> Stretch:
        """Another stretch inside this one."""
        if not 0 <= start <= len(self.data):
            self.refuse(f"a place {start} of {len(self.data)}")
        self.at = start
        return Stretch(self.take(count), self.path, self.form)

    def refuse(self, reason: str) -> NoReturn:
        raise DataRefused(
            f"{self.path}: this is not a whole {self.form} file, or one that is not read here", step="read recording",
            value=reason, limit=self.form, remedy="export the recording as CSV or Parquet",
        )  # fmt: skip
