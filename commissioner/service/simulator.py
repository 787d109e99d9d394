"""The packaged simulator as a process of its own: a commissioning without a drive, one minute after installing."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from pathlib import Path

from commissioner.service.configuration import SimulatorTable
from commissioner.service.library import Library
from commissioner.service.problems import Refusal
from commissioner.study.own_process import START_S

SCENARIOS = (
    "default", "linear", "small_motor", "large_motor", "sto_open", "fault_present", "overtemperature", "flux_hazard",
    "poor", "rich", "watchdog_refused", "wrong_identity",
)  # fmt: skip
"""What it can be: healthy machines first, then faults, to see how the page answers."""


class Simulator:
    """Started on the first wish; ends with the service."""

    def __init__(self, table: SimulatorTable, library: Library, logs: Path) -> None:
        self._table, self._library, self._logs = table, library, logs
        self._process: asyncio.subprocess.Process | None = None
        self._lock = asyncio.Lock()
        self.scenario = table.scenario

    @property
    def is_running(self) -> bool:
        return self._process is not None and self._process.returncode is None

    async def start(self, scenario: str | None = None) -> str:
        """Its address; running already, the same one, unless another scenario is wanted. Refusal: it did not start."""
        async with self._lock:
            wanted = scenario or self.scenario
            if self.is_running and wanted == self.scenario and self._library.simulator_url:
                return self._library.simulator_url
            await self._end()
            self.scenario = wanted
            self._library.simulator_url = await self._begin()
            return self._library.simulator_url

    async def close(self) -> None:
        async with self._lock:
            await self._end()

    async def _begin(self) -> str:
        table = self._table
        command = [sys.executable, "-m", "sim", "--scenario", self.scenario, "--tcp", "0", "--speed", table.speed,
                   "--seed", str(table.seed), "--state-log", str(self._logs / "simulator.jsonl")]  # fmt: skip
        self._logs.mkdir(parents=True, exist_ok=True)
        (self._logs / "simulator.jsonl").unlink(missing_ok=True)
        self._process = await asyncio.create_subprocess_exec(
            *command, stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
            start_new_session=True,
        )  # fmt: skip
        assert self._process.stdout is not None
        with contextlib.suppress(TimeoutError, asyncio.TimeoutError):
            line = (await asyncio.wait_for(self._process.stdout.readline(), START_S)).decode()
            if line.startswith("listening tcp "):
                return f"tcp://127.0.0.1:{line.rsplit(':', 1)[1].strip()}?device=1"
        said = await self._said()
        await self._end()
        raise Refusal(503, "the simulator did not start", step="start simulator", value=said,
                      limit=f"listening within {START_S:g} s", remedy="try again: what was compiled so far is kept; `python -m sim --tcp 0` shows what it says")  # fmt: skip

    async def _said(self) -> str:
        if self._process is None or self._process.returncode is None or self._process.stderr is None:
            return "no answer"
        lines = (await self._process.stderr.read()).decode("utf-8", "replace").strip().splitlines()
        return lines[-1][:200] if lines else "nothing"

    async def _end(self) -> None:
        process, self._process, self._library.simulator_url = self._process, None, None
        if process is None or process.returncode is not None:
            return
        with contextlib.suppress(ProcessLookupError):
            process.terminate()
        try:
            await asyncio.wait_for(process.wait(), 5)
        except TimeoutError:
            process.kill()
            await process.wait()
