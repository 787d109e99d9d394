"""The `commissioner` command as users call it: its own process, its exit code, its JSON."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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
    done = subprocess.run(
        [*COMMAND, *arguments, *(("--no-diagnosis",) if is_quick else ())],
        capture_output=True,
        text=True,
        timeout=timeout_s,
        cwd=cwd,
        check=False,
    )
    assert "Traceback" not in done.stderr, done.stderr
    return Answer(done.returncode, done.stdout, done.stderr)


def truth(scenario: str) -> Any:
    """The simulator's answer key."""
    done = subprocess.run(
        [sys.executable, "-m", "sim", "--scenario", scenario, "--truth"],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
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
