"""The pipe by which a service holds a run: while words come the run goes on; silence or its end means zero volts.

One line each, UTF-8: `begin {"person": ..., ...}` once, `beat` twice a second, `stop {"person": ..., "reason": ...}`,
`answer {"number": ..., "done": ...}` to a question that the run's journal asks.
"""

from __future__ import annotations

import os
import queue
import threading
import time
from collections.abc import Callable

from commissioner.encoding import JsonObject
from commissioner.errors import Aborted
from commissioner.run.archive.documents import read_document
from commissioner.run.stopping.operator_stop import SERVICE, OperatorStop

BEAT_S, SILENCE_S = 0.5, 2.0
"""Between two beats; no beat for SILENCE_S ends the run."""
TICK_S = 0.1


class DeadMan:
    """Follows the pipe from `descriptor` in a thread of its own and asks `stop` where the service falls silent."""

    def __init__(self, descriptor: int, stop: OperatorStop, clock: Callable[[], float] = time.monotonic) -> None:
        self._descriptor, self._stop, self._clock = descriptor, stop, clock
        self._heard = clock()
        self._begun = threading.Event()
        self._origin: JsonObject = {}
        self._answers: queue.SimpleQueue[tuple[int, bool]] = queue.SimpleQueue()
        self.is_gone = False
        """The service went away or fell silent: nobody answers any more."""

    def start(self) -> None:
        """Two threads: one reads, so that a word acts at once; one counts the silence."""
        self._heard = self._clock()
        for work in (self._read, self._count):
            threading.Thread(target=work, name="dead man", daemon=True).start()

    def wait_for_begin(self) -> JsonObject:
        """What the service says about the run it wants. Aborted: it went away, or stopped, before it wanted one."""
        while not self._begun.wait(0.05):
            if self._stop.asked:
                raise Aborted(
                    "stopped before anything began", step="wait for the service", value=self._stop.asked,
                    limit="a word to begin", remedy="start again when ready",
                )  # fmt: skip
        return self._origin

    def answer(self, number: int) -> bool | None:
        """What was answered to question `number`, waited for a tick; None: nothing yet. Answers to others are dropped."""
        try:
            answered, is_done = self._answers.get(timeout=TICK_S)
        except queue.Empty:
            return None
        return is_done if answered == number else None

    def _read(self) -> None:
        rest = b""
        # not sys.stdin: its lock, held by a thread that waits, would break the interpreter's end
        while piece := _piece(self._descriptor):
            *lines, rest = (rest + piece).split(b"\n")
            for line in lines:
                self._take(line.decode("utf-8", "replace").strip())
        self.is_gone = True
        self._stop.ask(SERVICE, "the service that started this run is gone")

    def _take(self, line: str) -> None:
        self._heard = self._clock()
        word, _, rest = line.partition(" ")
        said = read_document(rest)
        if word == "stop":
            self._stop.ask(str(said.get("person", "")), str(said.get("reason", "")) or "STOP")
        elif word == "answer":
            self._answers.put((int(said.get("number") or 0), said.get("done") is True))
        elif word == "begin":
            self._origin = said
            self._begun.set()

    def _count(self) -> None:
        """Silence is what this process listened through: while it was itself held up, words may wait in the pipe."""
        silent_s, heard, before = 0.0, self._heard, self._clock()
        while not self._stop.asked:
            time.sleep(TICK_S)
            now = self._clock()
            if self._heard != heard:
                heard, silent_s = self._heard, 0.0
            silent_s += min(now - before, 2.0 * TICK_S)
            before = now
            if silent_s > SILENCE_S:
                self.is_gone = True
                self._stop.ask(SERVICE, f"nothing heard from the service for {SILENCE_S:g} s")


def _piece(descriptor: int) -> bytes:
    """What there is; empty at the end, and where the pipe broke."""
    try:
        return os.read(descriptor, 4096)
    except OSError:
        return b""
