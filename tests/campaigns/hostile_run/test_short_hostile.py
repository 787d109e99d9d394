"""A handful of hostile runs in motor time, judged by the simulator's truth; the whole campaign is `tests.campaigns.hostile`.

Chosen to end early: what is wrong is found before anything long is computed, or the link cannot carry a run at all. And proof
that the campaign can fail.
"""

import pytest

from commissioner.run import runner
from tests.campaigns.hostile_run.one_run import run_one
from tests.campaigns.hostile_run.troubles import FOR_EVER_S, FOREIGN, LINKS, Trouble

BUSY_HOST, GATEWAY = LINKS[2:]
SILENT_FLUX = 0.151
"""Where the guards are at work."""
FOREIGN_BIAS = [name for name, _ in FOREIGN].index("dc_bias_v")
RUNS = {
    "currents doubled": (Trouble("currents_doubled", 0, 0.0, FOR_EVER_S, 1.0), "current"),
    "one sensor reversed": (Trouble("sensor_reversed", 0, 0.0, FOR_EVER_S, 1.0, 1), "sensor"),
    "one sensor silent in the climb": (Trouble("sensor_silent", 2, 0.4, FOR_EVER_S, 1.0, 0), "sensor"),
    "all frozen in the climb": (Trouble("all_frozen", 2, 0.4, FOR_EVER_S, 1.0), "current"),
    "a spell of late replies in the climb": (Trouble("spell", 2, 0.4, 2.5, 0.12), ""),
    "the host stopped in the climb": (Trouble("host_stop", 2, 0.5, 0.0, 1.5), ""),
    "every fifth reply lost": (Trouble("drop", 1, 0.2, FOR_EVER_S, 0.2), ""),
    "another master's bias": (Trouble("second_master", 2, 0.5, 0.0, FOREIGN_BIAS), "another master"),
}


@pytest.mark.timeout(300)
@pytest.mark.parametrize("name", RUNS)
def test_a_hostile_run_passes_no_limit_and_writes_nothing(tmp_path, name):
    trouble, said = RUNS[name]
    judged = run_one(31, "default", trouble, tmp_path, BUSY_HOST)
    assert not judged.broken, judged
    assert judged.ended in ("rejected", "aborted", "faulted"), judged
    assert said in judged.reason
    assert judged.flux < 0.95


@pytest.mark.timeout(300)
@pytest.mark.parametrize("motor", ["default", "0k37_large_drive"])
def test_a_slow_link_that_does_nothing_wrong_is_commissioned(tmp_path, motor):
    """Over it the first climb takes most of the time that a first current has: its levels were held too briefly to tell the motor."""
    judged = run_one(273, motor, Trouble("none", 0, 0.0, FOR_EVER_S, 0.0), tmp_path, GATEWAY)
    assert (judged.ended, judged.wrong, judged.broken) == ("commissioned", (), ()), judged
    assert judged.flux < 0.95


@pytest.mark.timeout(300)
def test_another_master_that_raises_the_amplitude_on_a_bias_is_seen_in_the_voltage(tmp_path):
    """Sevenfold, where the direct current alone is near the limit: at the next poll the true flux was at 1.24 of it."""
    amplitude = [name for name, _ in FOREIGN].index("amplitude_scale")
    trouble = Trouble("second_master", 4, 3.2307, 0.0, amplitude)
    judged = run_one(650, "4k_slow_switching", trouble, tmp_path, BUSY_HOST)
    assert not judged.broken, judged
    assert judged.reason.startswith("another master wrote to the drive: it changed amplitude_scale from")
    assert judged.reason.endswith("before that was seen: the drive applies more than it was asked for")
    assert judged.flux < 0.95


def test_a_runner_without_its_guards_is_seen(tmp_path, monkeypatch):
    """Nothing but the drive's own ceilings is left: the campaign must see what the guards were for."""
    monkeypatch.setattr(runner, "stop_if", lambda _reason: None)
    trouble = Trouble("sensor_silent", 2, 0.4, FOR_EVER_S, 1.0, 0)
    judged = run_one(31, "default", trouble, tmp_path, BUSY_HOST)
    assert "sensor" not in judged.reason
    assert judged.flux > 1.2 * SILENT_FLUX


def test_the_same_seed_is_the_same_run(tmp_path):
    trouble = Trouble("jitter", 1, 0.3, FOR_EVER_S, 0.1)
    runs = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        runs.append(run_one(5, "default", trouble, tmp_path / name, BUSY_HOST))
    first, second = runs
    assert (first.ended, first.reason, first.flux, first.current) == (
        second.ended,
        second.reason,
        second.flux,
        second.current,
    )
