"""A handful of hostile runs in real time, judged by the simulator's truth; the whole campaign is `tests.campaigns.hostile`.

Chosen to end early: what is wrong is found before or in the first session, or the link cannot carry a run at all.
"""

import pytest

from commissioner.procedure.energised.excite import warm_up
from commissioner.settings import load_motor
from tests.campaigns.hostile_run.one_run import run_one
from tests.campaigns.hostile_run.troubles import FOR_EVER_S, Trouble

RUNS = {
    "currents doubled": (Trouble("currents_doubled", 0, 0.0, FOR_EVER_S, 1.0), "current"),
}


@pytest.fixture(scope="module", autouse=True)
def _kernels():
    warm_up(load_motor("motor_2kw2"))


@pytest.mark.timeout(300)
@pytest.mark.parametrize("name", RUNS)
def test_a_hostile_run_passes_no_limit_and_writes_nothing(tmp_path, name):
    trouble, said = RUNS[name]
    judged = run_one(31, "default", trouble, tmp_path)
    assert not judged.broken, judged
    assert judged.ended in ("rejected", "aborted", "faulted"), judged
    assert said in judged.reason
    assert judged.flux < 0.9
