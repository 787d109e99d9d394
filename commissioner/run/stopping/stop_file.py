"""STOP for a run that somebody else started: a file in its folder, which the run looks for all the time."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from commissioner.run.archive.documents import read_document
from commissioner.run.stopping.operator_stop import OperatorStop

NAME = "stop.json"
EVERY_S = 0.02


def ask_to_stop(folder: Path, person: str, reason: str) -> None:
    """The run in `folder` is to end; without effect where it has ended."""
    part = folder / f"{NAME}.part"
    part.write_text(json.dumps({"person": person, "reason": reason}), encoding="utf-8")
    part.replace(folder / NAME)


@contextmanager
def stopped_by_file(folder: Path, stop: OperatorStop) -> Iterator[None]:
    """Meanwhile the file, when it comes, asks `stop`. A disk that fails asks nothing: other ways to stop remain."""
    over = threading.Event()
    looking = threading.Thread(target=_look, args=(folder / NAME, stop, over), name="stop file", daemon=True)
    looking.start()
    try:
        yield
    finally:
        over.set()
        looking.join(1.0)


def _look(path: Path, stop: OperatorStop, over: threading.Event) -> None:
    while not over.wait(EVERY_S):
        try:
            said = read_document(path.read_text("utf-8", "replace"))
        except OSError:
            continue
        stop.ask(str(said.get("person", "")), str(said.get("reason", "")) or "STOP")
        return
