"""A process of our programs whose imports are done: forked from a server that has made them, so that it begins in 0.05 s
instead of 3 CPU-seconds.

It is a process all the same: exit code, streams, signals, folder and environment of its own, no threads or open files of
the tests'. What a fresh interpreter does is tested where that is the claim (`tests/architecture`, the main job, the service).
"""

from __future__ import annotations

import multiprocessing
import os
import runpy
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

PRELOADED = multiprocessing.get_context("forkserver")
"""The one server of a process: whoever else forks from it takes it from here, with all that any of them needs."""
PRELOADED.set_forkserver_preload(
    ["tests.support.preload", "tests.campaigns.short_run.one_run", "tests.campaigns.short_run.warm"]
)


class PreloadedProcess:
    """`python -m module arguments`, begun at once. `stdout`, `stderr`: what it has written so far."""

    def __init__(self, module: str, arguments: Sequence[str], cwd: Path | None = None) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="preloaded-")
        self._streams = [Path(self._folder.name) / name for name in ("stdout", "stderr")]
        for stream in self._streams:
            stream.touch()
        names = tuple(map(str, self._streams))
        self.process = PRELOADED.Process(
            target=_begin, args=(module, list(arguments), names, str(cwd or Path.cwd()), dict(os.environ))
        )
        self.process.start()

    @property
    def stdout(self) -> str:
        return self._streams[0].read_text("utf-8")

    @property
    def stderr(self) -> str:
        return self._streams[1].read_text("utf-8")

    def first_line(self, timeout_s: float) -> str:
        """Of stdout, once it is whole; what there is where the process ended or the time is over."""
        end = time.monotonic() + timeout_s
        while "\n" not in (text := self.stdout) and self.process.is_alive() and time.monotonic() < end:
            time.sleep(0.005)
        return (text or self.stdout).partition("\n")[0]

    def wait(self, timeout_s: float) -> int:
        """The exit code. TimeoutError: killed."""
        self.process.join(timeout_s)
        if self.process.exitcode is None:
            self.kill()
            raise TimeoutError(f"not ended after {timeout_s:g} s; it wrote {self.stdout[-2000:]}{self.stderr[-2000:]}")
        return self.process.exitcode

    def send_signal(self, number: int) -> None:
        assert self.process.pid is not None
        os.kill(self.process.pid, number)

    def kill(self) -> None:
        with suppress(ProcessLookupError):
            self.process.kill()
        self.process.join()

    def close(self) -> None:
        """Killed where it still runs; what it wrote is gone."""
        self.kill()
        self._folder.cleanup()


def _begin(module: str, arguments: list[str], streams: Sequence[str], cwd: str, environment: dict[str, str]) -> None:
    for number, name in enumerate(("/dev/null", *streams)):
        descriptor = os.open(name, os.O_RDWR | os.O_APPEND)
        os.dup2(descriptor, number)
        os.close(descriptor)
    sys.stdin, sys.stdout, sys.stderr = (
        open(number, mode, encoding="utf-8", closefd=False)  # noqa: SIM115
        for number, mode in enumerate(("r", "w", "w"))
    )
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(cwd)
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name="__main__", alter_sys=True)
