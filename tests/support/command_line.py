"""The `commissioner` command as users call it: its own process, its exit code, its JSON."""

from __future__ import annotations

import json
import sys
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.support.preloaded import PreloadedProcess

COMMAND = [sys.executable, "-c", "from commissioner.cli.app import main; main()"]


@dataclass(frozen=True)
class Answer:
    code: int
    stdout: str
    stderr: str

    @property
    def json(self) -> Any:
        """stdout as the one JSON document it must be."""
        return json.loads(self.stdout)


def call(*arguments: str, timeout_s: float = 150.0, cwd: Path | None = None) -> Answer:
    """Run to the end. A traceback on stderr is never right. A run's closing diagnosis is only made where it is asked for."""
    is_quick = arguments[:1] == ("run",) and "--diagnosis" not in arguments
    done = PreloadedProcess("commissioner", [*arguments, *(("--no-diagnosis",) if is_quick else ())], cwd)
    with closing(done):
        answer = Answer(done.wait(timeout_s), done.stdout, done.stderr)
    assert "Traceback" not in answer.stderr, answer.stderr
    return answer


def truth(scenario: str) -> Any:
    """The simulator's answer key."""
    with closing(PreloadedProcess("sim", ["--scenario", scenario, "--truth"])) as done:
        assert done.wait(60.0) == 0, done.stderr
        return json.loads(done.stdout)


def at_flux(key: Any, stator_flux_wb: float) -> dict[str, float]:
    """The answer key's secant inverse-Gamma set at a flux, interpolated between its rows."""
    rows = key["inverse_gamma"]["over_flux"]
    after = next(k for k, row in enumerate(rows) if row["stator_flux_wb"] >= stator_flux_wb)
    low, high = rows[after - 1], rows[after]
    share = (stator_flux_wb - low["stator_flux_wb"]) / (high["stator_flux_wb"] - low["stator_flux_wb"])
    names = ("rotor_resistance_ohm", "leakage_inductance_h", "magnetizing_inductance_h")
    found = {name: (1 - share) * low["secant"][name] + share * high["secant"][name] for name in names}
    return found | {"stator_resistance_ohm": key["apparent_stator_resistance_ohm"]}
