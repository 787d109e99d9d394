"""The kernels, compiled before anybody energises: the first time on a computer it takes a minute, then it is known."""

from __future__ import annotations

import asyncio
import contextlib
import sys
import time
from pathlib import Path


class WarmUp:
    """A child process that compiles, or finds compiled, what a run needs."""

    def __init__(self, logs: Path) -> None:
        self._logs = logs
        self._began_s = time.monotonic()
        self.is_done = False
        self.failed = ""

    @property
    def seconds(self) -> float:
        """So far."""
        return time.monotonic() - self._began_s

    async def work(self) -> None:
        """Until it is done, however it ends: a run compiles for itself what is missing."""
        self._began_s = time.monotonic()
        self._logs.mkdir(parents=True, exist_ok=True)
        with (self._logs / "warm.txt").open("wb") as said:
            process = await asyncio.create_subprocess_exec(
                sys.executable, "-m", "commissioner.service.warm", stdin=asyncio.subprocess.DEVNULL, stdout=said, stderr=said,
                start_new_session=True,
            )  # fmt: skip
        try:
            code = await process.wait()
            self.failed = "" if code == 0 else f"exit code {code}, see {self._logs / 'warm.txt'}"
            self.is_done = True
        except asyncio.CancelledError:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            raise


def main() -> None:
    """What the child does, at the lowest priority that the system offers."""
    import os

    if hasattr(os, "nice"):
        os.nice(10)
    from commissioner.paths import MOTOR
    from commissioner.procedure.energised.excite import warm_up
    from commissioner.settings import load_motor

    warm_up(load_motor(MOTOR))


if __name__ == "__main__":
    main()
