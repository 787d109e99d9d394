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


def live(runs):
    """Ids of the runs that the service takes to go on, once it has looked."""
    desk = make_parts(Settings(runs, runs.parent / "data")).desk

    async def look():
        await desk.look()
        seen = [run.id for run in desk.live()]
        desk.is_closing = True
        for run in desk.runs.values():
            if run.follower is not None:
                run.follower.cancel()
        return seen

    return asyncio.run(look())


@pytest.mark.parametrize(("ago", "is_shown"), [(dt.timedelta(0), True), (dt.timedelta(hours=3), False)])
def test_a_folder_copied_by_hand_is_no_run_that_goes_on(tmp_path, ago, is_shown):
    folder = cut_off(tmp_path / "runs" / "20260101-000000-simulated-abcdef", ago)
    assert live(tmp_path / "runs") == ([folder.name] if is_shown else [])


STRANGE = (
    {"kind": "run_ended", "record": 7}, {"kind": "estimate_updated", "record": {"parameters": None}}, {"kind": [], "record": {}},
    {"kind": "axis_finished", "record": []}, {"kind": "drive_identified", "record": {}}, {"kind": "error", "record": "x"}, {"n": "x", "kind": "error", "record": {}},
)  # fmt: skip


@pytest.mark.parametrize("line", STRANGE)
def test_a_folder_that_is_none_of_ours_hides_no_run_that_goes_on(tmp_path, line):
    good = cut_off(tmp_path / "runs" / "20260101-000000-simulated-abcdef", dt.timedelta(0))
    strange = cut_off(tmp_path / "runs" / "20260102-000000-simulated-abcdef", dt.timedelta(0))
    (strange / "request.json").write_text(json.dumps({"url": 7, "origin": -1}))
    with (strange / "journal.jsonl").open("a") as file:
        file.write(json.dumps({"n": 1, "utc": dt.datetime.now(dt.UTC).isoformat()} | line) + "\n")
    assert good.name in live(tmp_path / "runs")
