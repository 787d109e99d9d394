"""An ordinary drive as a process, with its keypad and, at the end, its answer key."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import Any

FOLDER = Path(__file__).parents[1] / "data" / "vendors"
BAUD = "115200"
"""Of a serial line."""
MADE_UP = tuple(str(FOLDER / f"{name}.toml") for name in ("behind_a_mailbox", "needs_an_unlock"))
"""Drives that nobody sells, which wear what no file of config/drives has a source for."""
DRIVES = """
[[drives]]
id = "remote"
name = "Pump 7"
url = "{remote}"
profile = "schneider_atv340"
[[drives]]
id = "assisted"
name = "Fan 2"
url = "{assisted}"
profile = "danfoss_fc302"
"""
"""One that begins its tuning when it is told to, one that a person begins at its keypad: a service's `more`."""


class Vendor:
    """`python -m sim.vendors.serve` as a process; `truth` after the block. `turnaround_s`: before each answer, None for that of the drive's
    file."""

    def __init__(self, *arguments: str, turnaround_s: float | None = 0.004) -> None:
        quick = [] if turnaround_s is None else ["--turnaround", str(turnaround_s)]
        self._command = [sys.executable, "-m", "sim.vendors.serve", *quick, "--baud", BAUD, *arguments]
        self.truth: dict[str, Any] = {}

    def __enter__(self) -> Vendor:
        self.process = subprocess.Popen(
            self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8"
        )
        assert self.process.stdout is not None
        _, kind, address = self.process.stdout.readline().split()
        self.url = f"{kind}://{address}" + (f"?parity=N&baud={BAUD}" if kind == "rtu" else "")
        return self

    def press(self, key: str) -> None:
        """A key of its keypad: tune | remote | off-on."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{key}\n")
        self.process.stdin.flush()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.process.send_signal(signal.SIGTERM)
        out, _ = self.process.communicate(timeout=20)
        self.truth = json.loads(out.splitlines()[-1])
