"""A link too slow for every sample: `check` says what a run would do instead, before anything is energised."""

from tests.support.command_line import call
from tests.support.sim_process import SimProcess


def test_check_says_the_plan_for_a_slow_link_and_what_it_costs(tmp_path):
    with SimProcess("--tcp", "0", "--fault", "late:0.03@1+") as sim:
        answer = call("check", "--drive", sim.url, "--motor", "motor_2kw2", "--json", timeout_s=300.0)
        states = [row for row in sim.log() if row.get("event") == "state"]
    assert answer.code == 0, answer.stdout
    (pace,) = [check for check in answer.json["checks"] if check["name"] == "the link keeps up with the samples"]
    assert "the mean of" in pace["value"] and "standard errors" in pace["value"]
    assert "5.8 ms" in pace["limit"] and "Bd" in pace["remedy"]
    assert not any("ENABLED" in str(row["name"]).upper() for row in states)
