"""Compile the kernels once, before several workers would each compile them: `python -m tests.support.suite.warm`.

A process for each part, side by side, the longest first. A kernel that only a few tests need is left to them.
"""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from collections.abc import Callable


def diagnosing() -> None:
    """What a search compiles until its first cause is accepted, and each cause's part in a prediction."""
    from commissioner.diagnose.causes import CATALOGUE
    from commissioner.diagnose.diagnosis import diagnose
    from commissioner.diagnose.plant.model import Model
    from commissioner.diagnose.plant.prediction import predict
    from commissioner.diagnose.search.journal import Accepted, Step
    from tests.hidden_effects.generators.another_hand import Machine, recorded
    from tests.unit.diagnose.conftest import NOMINAL, setting_of

    made = recorded(Machine(leg_v=4.0, lag_s=1.2e-4), 1.0)
    steps: list[Step] = []
    diagnose([made], report=steps.append, go_on=lambda: not any(isinstance(s, Accepted) for s in steps))
    nominal = Model(NOMINAL)
    setting = setting_of(nominal)
    for cause in CATALOGUE.values():
        if terms := cause.terms(setting):
            model = Model(nominal.nominal, terms, tuple(t.step for t in terms))
            predict(model, setting.record, 1, setting.layout, wanted=terms)


def simulating() -> None:
    """The simulated drive and its recorder."""
    from sim.recordings.standstill import record
    from tests.campaigns.inverter import draw

    drive = subprocess.Popen([sys.executable, "-m", "sim", "--tcp", "0"], stdout=subprocess.PIPE)
    assert drive.stdout is not None
    drive.stdout.readline()
    drive.kill()
    drive.wait()
    scenario = draw(302, "tones")
    record(dataclasses.replace(scenario, segments=scenario.segments[:1]), 302)


def driving() -> None:
    """A commissioning's steps."""
    from commissioner.procedure.energised.excite import warm_up
    from commissioner.settings import load_motor

    warm_up(load_motor("motor_2kw2"))


def observing() -> None:
    """A running motor's chain, and a started one's diagnosis."""
    from commissioner.running.diagnosis import diagnose
    from tests.running_effects.cases import Case, taken
    from tests.support.running import seen_in
    from tests.support.running import taken as taken_running

    seen_in(*taken_running("running_compressor", 1, 10.0)[:2])
    recording, plate, _ = taken(Case(5000, "null").scenario(), 5000)
    diagnose([recording], plate)


PARTS: dict[str, Callable[[], None]] = {p.__name__: p for p in (diagnosing, simulating, driving, observing)}


def main() -> int:
    children = [subprocess.Popen([sys.executable, "-m", "tests.support.suite.warm", name]) for name in PARTS]
    return max(child.wait() for child in children)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        PARTS[sys.argv[1]]()
    else:
        sys.exit(main())
