"""One run, followed: its journal and blocks are read once, folded, and sent to everybody who watches."""

from __future__ import annotations

import asyncio
import json
import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from commissioner.encoding import JsonObject
from commissioner.run.archive.blocks import Placed
from commissioner.run.archive.follow import BlocksFollower, JournalFollower
from commissioner.service.runs.live import live_document
from commissioner.service.runs.samples import Envelope
from commissioner.service.runs.state import RunState

TOGETHER_S = 0.09
"""Samples are shown, and whatever a page is sent goes out, so long together, twice as long for a script: a write to a socket costs
half a millisecond of processor time."""
BACKLOG = 2000
"""Messages that one watcher may be behind (some 100 s); then it is let go and can resume from where it was."""


@dataclass(frozen=True)
class Message:
    """`number`: of the journal's record, None for samples. `text`: its JSON, encoded once for all watchers."""

    event: str
    number: int | None
    text: str


class Watcher:
    """One subscription: a page gets summaries, a script the records. `is_lost`: it was too slow and was let go."""

    def __init__(self, is_page: bool) -> None:
        self.is_page = is_page
        self.queue: asyncio.Queue[Message | None] = asyncio.Queue(BACKLOG)
        self.is_lost = False

    def send(self, message: Message | None) -> None:
        if self.is_lost:
            return
        try:
            self.queue.put_nowait(message)
        except asyncio.QueueFull:
            self.is_lost = True

    async def take(self) -> list[Message | None]:
        """What came since the last call, once something has. None last: nothing more will come."""
        taken = [await self.queue.get()]
        if taken[0] is not None:
            await asyncio.sleep(TOGETHER_S if self.is_page else 2.0 * TOGETHER_S)
        while not self.queue.empty():
            taken.append(self.queue.get_nowait())
        return taken


class Feed:
    """Follows the folder of one run. `poll` is called many times a second while the run lives."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.state = RunState(folder.name)
        self._journal = JournalFollower(folder / "journal.jsonl")
        self._blocks = BlocksFollower(folder / "blocks.bin")
        self._envelope = Envelope()
        self._held: list[tuple[int, Placed]] = []
        self._shown_s = 0.0
        self._watchers: set[Watcher] = set()
        self.is_closed = self.is_news = False
        self.current_now_a = 0.0
        self.heard_s = time.monotonic()

    @property
    def age_s(self) -> float:
        """Since the run was last heard of, by this computer's monotonic clock."""
        return time.monotonic() - self.heard_s

    @property
    def watchers(self) -> int:
        return len(self._watchers)

    def poll(self) -> bool:
        """Read what is new; whether there was anything. What the system does not let be read now is read later: no STOP waits for it."""
        try:
            blocks = self._blocks.new()  # before the journal: a block belongs to the state it was taken in
            self._held += blocks
            lines = self._journal.new()
        except OSError:
            return False
        for k, line in enumerate(lines):
            # where much is read at once, the blocks behind a finished axis are another test's
            if k == 0 or line["kind"] == "axis_finished":
                self._show_samples(_blocks_before(line))
            self.state.take(line)
            self._publish(Message(line["kind"], line["n"], json.dumps(line, separators=(",", ":"))))
        if lines or not blocks or time.monotonic() - self._shown_s > TOGETHER_S:
            self._show_samples()
        if lines or blocks:
            self.heard_s = time.monotonic()
            self.is_news = True
        return bool(lines or blocks)

    def _show_samples(self, end: float = math.inf) -> None:
        """What was read since the last time, up to the byte `end` of the blocks, in one piece."""
        before, self._shown_s = self._envelope.energised_s, time.monotonic()
        events = self._envelope.of([block for at, block in self._held if at <= end])
        self._held = [held for held in self._held if held[0] > end]
        if events:
            self.state.energised(self._envelope.energised_s - before)
            self.state.current_high_a = max(
                self.state.current_high_a, *(max(abs(x) for x in (*e["low_a"], *e["high_a"])) for e in events)
            )
            self.current_now_a = max(max(abs(x) for x in (*e["low_a"], *e["high_a"])) for e in events)
        for event in events:
            self._publish(Message("samples", None, json.dumps(event, separators=(",", ":"))))

    def summarise(self) -> None:
        """To the pages: what there is to show now. Called ten times a second; silent where nothing is new."""
        if self.is_news and any(watcher.is_page for watcher in self._watchers):
            self.is_news = False
            self._publish(self._summary())

    def _summary(self) -> Message:
        document = live_document(self.state, self.current_now_a)
        return Message("live", None, json.dumps(document, separators=(",", ":")))

    @contextmanager
    def watch(self, after: int = -1, *, is_page: bool = False) -> Iterator[Watcher]:
        """A subscription that begins with the records after number `after`, without a gap to what follows."""
        watcher = Watcher(is_page)
        for line in [] if is_page else JournalFollower(self.folder / "journal.jsonl").new():
            if after < line["n"] < self.state.records:
                watcher.send(Message(line["kind"], line["n"], json.dumps(line, separators=(",", ":"))))
        if is_page:  # what was news before it came it has not heard
            watcher.send(self._summary())
        if self.is_closed:
            watcher.send(None)
        self._watchers.add(watcher)
        try:
            yield watcher
        finally:
            self._watchers.discard(watcher)

    def close(self) -> None:
        """Nothing more will come."""
        self.is_closed = True
        self._publish(None)

    def _publish(self, message: Message | None) -> None:
        for watcher in self._watchers:
            if message is None or message.event == "samples" or watcher.is_page == (message.event == "live"):
                watcher.send(message)


def _blocks_before(line: JsonObject) -> float:
    """How many bytes of blocks stood when the record was written; all, where another version or person wrote it without."""
    match line.get("blocks"):
        case [int() as size, *_]:
            return size
    return math.inf


def whole(folder: Path) -> Feed:
    """The feed of a run that is over, read to its end."""
    feed = Feed(folder)
    while feed.poll():
        pass
    feed.close()
    return feed
