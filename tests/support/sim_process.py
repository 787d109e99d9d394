"""`python -m sim` as a process of its own, for tests that speak to it over a wire.

with SimProcess("--tcp", "0") as sim:
    open_port(parse_url(sim.url), ...)
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from types import TracebackType

from tests.support.preloaded import PreloadedProcess

START_S = 120.0
"""The first start on a fresh machine compiles the simulator's kernels."""


class SimProcess:
    """`url` is where it listens. `log()` is what was really true. Killed at the end, whatever happened."""

    def __init__(self, *arguments: str, speed: str = "max") -> None:
        self._folder = tempfile.TemporaryDirectory()
        self.log_file = Path(self._folder.name) / "state.jsonl"
        self._arguments = ["--speed", speed, "--state-log", str(self.log_file), *arguments]

    def __enter__(self) -> SimProcess:
        self._process = PreloadedProcess("sim", self._arguments)
        line = self._process.first_line(START_S)
        if not line.startswith("listening "):
            self._process.kill()
            raise AssertionError(f"sim did not start: {line} {self._process.stderr}")
        kind, address = line.split()[1:3]
        self.url = {
            "tcp": f"tcp://{address}",
            "tls": f"tls://{address}",
            "rtu": f"rtu://{address}?parity=N&stop=1&baud=921600",
        }[kind]
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.close()
        self._folder.cleanup()

    def log(self) -> list[dict[str, object]]:
        """The simulator's own record of states, writes and trips so far."""
        return [json.loads(line) for line in self.log_file.read_text().splitlines() if line.endswith("}")]
