"""The feed of a run: read at once, as after a restart, it knows what it knew while the run went; a reader of its events who goes leaves nothing."""

import asyncio
import gzip
import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from commissioner.service.routes.events import _stream
from commissioner.service.runs.feed import Feed, whole

GOLDEN = Path("tests/data/golden_run")


@pytest.mark.parametrize("records", [100, 200, 234])
def test_what_is_read_at_once_is_told_to_the_test_it_was_taken_in(tmp_path, records):
    """The golden run, its first look taken for a whole test of two."""
    text = (GOLDEN / "journal.jsonl").read_text("utf-8")
    text = text.replace('"is_look": true', '"is_look": false').replace('"axes_deg": [0.0]', '"axes_deg": [0.0, 60.0]')
    lines = text.splitlines(keepends=True)[:records]
    blocks = gzip.decompress((GOLDEN / "blocks.bin.gz").read_bytes())
    live = tmp_path / "live"
    live.mkdir()
    following = Feed(live)
    with (live / "journal.jsonl").open("a", encoding="utf-8") as journal, (live / "blocks.bin").open("ab") as samples:
        for line in lines:
            size = json.loads(line)["blocks"][0]
            samples.write(blocks[samples.tell() : size])
            samples.flush()
            following.poll()
            journal.write(line)
            journal.flush()
            following.poll()
    again = whole(Path(shutil.copytree(live, tmp_path / "again"))).state
    told = [(test.axis_deg, test.state, round(test.energised_s, 6)) for test in following.state.tests]
    assert [(test.axis_deg, test.state, round(test.energised_s, 6)) for test in again.tests] == told
    assert sum(seconds for _, _, seconds in told) > 1.0


@pytest.mark.parametrize("leaves", ["reader", "service"])
def test_who_goes_while_nothing_comes_leaves_no_task(tmp_path, leaves):
    async def left() -> set[asyncio.Task]:
        parts = SimpleNamespace(closing=asyncio.Event())
        stream = _stream(parts, Feed(tmp_path), -1)
        reading = asyncio.ensure_future(anext(stream, None))
        await asyncio.sleep(0.01)
        reading.cancel() if leaves == "reader" else parts.closing.set()
        await asyncio.wait([reading])
        await asyncio.sleep(0.01)
        return asyncio.all_tasks() - {asyncio.current_task()}

    assert asyncio.run(left()) == set()
