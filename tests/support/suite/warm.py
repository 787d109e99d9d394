"""Compile the kernels once, before several workers would each compile them: `python -m tests.support.suite.warm`.

Two processes side by side: one diagnoses a short blind recording, the other identifies, monitors and starts the simulator.
A kernel that only a few tests need is left to them.
"""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from collections.abc import Callable


def diagnosing() -> None:
    """The simulator's recorder, and all that a search compiles until its first causes are accepted."""
    from tests.hidden_effects.blind import diagnosed
    from tests.hidden_effects.cases import Case

    diagnosed(Case("one", 40, "dead_time", noise="white"))


def running() -> None:
    """A commissioning's steps and judgement, a running motor's chain, and the simulated drive."""
    from commissioner.identify.analysis import identify
    from commissioner.procedure.energised.excite import warm_up
    from commissioner.settings import load_motor
    from sim.recordings.standstill import record
    from tests.campaigns.inverter import draw, to_recording
    from tests.support.running import seen_in, taken
    from tests.support.sim_process import SimProcess

    with SimProcess("--scenario", "default", "--tcp", "0"):
        pass
    warm_up(load_motor("motor_2kw2"))
    scenario = draw(302, "tones")
    columns, metadata, _ = record(dataclasses.replace(scenario, segments=scenario.segments[:1]), 302)
    identify(to_recording(columns, metadata), is_final=False)
    seen_in(*taken("running_compressor", 1, 10.0)[:2])


PARTS: dict[str, Callable[[], None]] = {"diagnosing": diagnosing, "running": running}


def main() -> int:
    children = [subprocess.Popen([sys.executable, "-m", "tests.support.suite.warm", name]) for name in PARTS]
    return max(child.wait() for child in children)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        PARTS[sys.argv[1]]()
    else:
        sys.exit(main())
