"""Follow a run from outside, while it goes or afterwards: journal and blocks from an offset on."""

from __future__ import annotations

from pathlib import Path

from commissioner.encoding import JsonObject
from commissioner.run.archive.blocks import Placed, follow_blocks
from commissioner.run.archive.documents import read_document


class JournalFollower:
    """The records of a journal as they come. `offset`: bytes of whole lines read so far."""

    def __init__(self, path: Path, offset: int = 0) -> None:
        self._path, self.offset = path, offset

    def new(self) -> list[JsonObject]:
        """The whole records since the last call; a line that is still being written waits for the next one."""
        if not self._path.is_file():  # none yet, or a pipe in its place, which would be waited for
            return []
        with self._path.open("rb") as file:
            file.seek(self.offset)
            data = file.read()
        whole = data[: data.rfind(b"\n") + 1]
        self.offset += len(whole)
        records = (read_document(line.decode("utf-8", "replace")) for line in whole.splitlines())
        return [record for record in records if "kind" in record and "record" in record]


class BlocksFollower:
    """The sample blocks of a run as they come. `offset`: bytes of whole blocks read so far."""

    def __init__(self, path: Path, offset: int = 0) -> None:
        self._path, self.offset = path, offset

    def new(self, most: int = 10_000) -> list[tuple[int, Placed]]:
        """The whole (segment, block) pairs since the last call, `most` at a time, each with the byte of the file where it ends."""
        blocks = follow_blocks(self._path, self.offset, most)
        self.offset = blocks[-1][0] if blocks else self.offset
        return blocks
