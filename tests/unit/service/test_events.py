"""The journal as server-sent events: what a reader that goes leaves behind."""

import asyncio
from types import SimpleNamespace

import pytest

from commissioner.service.routes.events import _stream
from commissioner.service.runs.feed import Feed


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
