"""A run that is stopped, or killed, while it is energised: what the drive and the archive hold then. Judged by a watchdog's wall time."""

import json
import os
import signal
import subprocess
import time

from commissioner.recordings.table import read_table, to_standstill
from tests.support.command_line import COMMAND, call
from tests.support.sim_process import SimProcess


def started(url, runs):
    """`commissioner run` for the 2.2-kW motor on the drive at the URL, under way."""
    arguments = ["run", "--drive", url, "--motor", "motor_2kw2", "--yes", "--json", "--runs", str(runs)]
    return subprocess.Popen([*COMMAND, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_ctrl_c_while_energised_de_energises_and_still_writes_the_report(tmp_path):
    with SimProcess("--scenario", "default", "--tcp", "0", speed="1") as sim:
        run = started(sim.url, tmp_path)
        _wait_for(lambda: any(row["event"] == "energised" for row in sim.log()))
        time.sleep(0.5)
        run.send_signal(signal.SIGINT)
        stdout, stderr = run.communicate(timeout=60)
        last = [row for row in sim.log() if row["event"] in ("energised", "de_energised")][-1]
    assert run.returncode == 4, stderr
    assert "Traceback" not in stderr
    assert json.loads(stdout)["outcome"] == "aborted"
    assert last["event"] == "de_energised"
    (folder,) = tmp_path.iterdir()
    assert (folder / "report.html").is_file()


def test_a_killed_service_leaves_a_dead_drive_and_a_readable_run(tmp_path):
    with SimProcess("--scenario", "default", "--tcp", "0", speed="1") as sim:
        run = started(sim.url, tmp_path)
        _wait_for(lambda: any(row["event"] == "energised" for row in sim.log()))
        time.sleep(0.7)
        os.kill(run.pid, signal.SIGKILL)
        run.communicate()
        _wait_for(
            lambda: [r for r in sim.log() if r["event"] in ("energised", "de_energised")][-1]["event"] == "de_energised"
        )
    listed = call("runs", "list", "--runs", str(tmp_path), "--json").json["runs"]
    assert listed[0]["outcome"] == "cut off"
    assert listed[0]["written"] == "as before"
    out = tmp_path / "samples.parquet"
    assert call("runs", "export", listed[0]["run"], str(out), "--runs", str(tmp_path)).code == 0
    assert to_standstill(read_table(out)).time_s.size > 100


def _wait_for(condition, seconds: float = 60.0) -> None:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if condition():
            return
        time.sleep(0.02)
    raise AssertionError("it did not happen in time")
