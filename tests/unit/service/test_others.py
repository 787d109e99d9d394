"""A run of another process is shown as long as it goes on; a folder that somebody copied never is one."""

import asyncio
import datetime as dt
import json

import pytest

from commissioner.service.configuration import Settings
from commissioner.service.parts import make_parts


def cut_off(folder, ago):
    """A run's folder whose last line is `ago` old; the file is of now."""
    folder.mkdir(parents=True)
    (folder / "request.json").write_text(json.dumps({"url": "tcp://127.0.0.1:9?device=1"}))
    utc = (dt.datetime.now(dt.UTC) - ago).isoformat()
    line = {"n": 0, "utc": utc, "previous": "", "blocks": [0, ""], "kind": "about_to", "record": {"action": "energise"}}
    (folder / "journal.jsonl").write_text(json.dumps(line) + "\n")
    return folder


@pytest.mark.parametrize(("ago", "is_shown"), [(dt.timedelta(0), True), (dt.timedelta(hours=3), False)])
def test_a_folder_copied_by_hand_is_no_run_that_goes_on(tmp_path, ago, is_shown):
    desk = make_parts(Settings(tmp_path / "runs", tmp_path / "data")).desk
    folder = cut_off(tmp_path / "runs" / "20260101-000000-simulated-abcdef", ago)

    async def look():
        looking = asyncio.create_task(desk.look_around())
        await asyncio.sleep(0.2)
        seen = [run.id for run in desk.live()]
        desk.is_closing = True
        looking.cancel()
        for run in desk.runs.values():
            if run.follower is not None:
                run.follower.cancel()
        return seen

    assert asyncio.run(look()) == ([folder.name] if is_shown else [])
