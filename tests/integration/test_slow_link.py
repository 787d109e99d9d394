"""A link too slow for the samples is refused before anything is energised, by `check` as by `run`."""

import pytest

from tests.support.command_line import call
from tests.support.sim_process import SimProcess


@pytest.mark.parametrize("verb", ["check", "run"])
def test_a_constant_latency_that_no_run_can_live_with_is_refused_with_the_figure(tmp_path, verb):
    more = ["--yes", "--runs", str(tmp_path)] if verb == "run" else []
    with SimProcess("--tcp", "0", "--fault", "late:0.03@1+") as sim:
        answer = call(verb, "--drive", sim.url, "--motor", "motor_2kw2", *more, "--json", timeout_s=300.0)
        states = [row for row in sim.log() if row.get("event") == "state"]
    assert answer.code == 3, answer.stdout
    said = answer.json
    failed = [check for check in said["checks"] if not check["has_passed"]]
    assert [check["name"] for check in failed] == ["the link keeps up with the samples"]
    assert "5.8 ms" in failed[0]["limit"] and "Bd" in failed[0]["remedy"]
    assert not any("ENABLED" in str(row["name"]).upper() for row in states)
