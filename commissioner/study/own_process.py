"""The simulated inverter as a process of its own, on loopback: what `demo` and a study over sockets start."""

from __future__ import annotations

import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from commissioner.errors import LinkUnreachable, UsageError

START_S, LONG_S = 900.0, 10.0
"""The simulator compiles its kernels at the first start, minutes on a busy computer; later starts take about a second."""


@contextmanager
def simulated_inverter(
    scenario: str, speed: str, seed: int, more: Sequence[str] = (), wait: Callable[[], None] = lambda: None
) -> Iterator[str]:
    """The drive URL of a running `python -m sim`; the process ends with the context. `wait` is called where it takes long."""
    command = [
        sys.executable,
        "-m",
        "sim",
        "--scenario",
        scenario,
        "--tcp",
        "0",
        "--speed",
        speed,
        "--seed",
        str(seed),
        *more,
    ]
    # its own process group: Ctrl-C in the terminal must reach the service, not cut the drive off under it
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", errors="replace",
        start_new_session=True, creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
    )  # fmt: skip
    try:
        yield f"tcp://127.0.0.1:{_port(process, wait)}?device=1"
    finally:
        process.terminate()
        try:
            process.wait(5)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if process.stderr is not None:
            process.stderr.close()


def _port(process: subprocess.Popen[str], wait: Callable[[], None]) -> int:
    """The port the simulator prints as `listening tcp 127.0.0.1:PORT`."""
    lines: queue.Queue[str] = queue.Queue()
    assert process.stdout is not None
    assert process.stderr is not None
    stdout = process.stdout

    def collect() -> None:
        with stdout:
            for line in stdout:
                lines.put(line)

    threading.Thread(target=collect, daemon=True).start()
    began, is_long = time.monotonic(), False
    while time.monotonic() < began + START_S:
        if not is_long and time.monotonic() > began + LONG_S:
            is_long = True
            wait()
        try:
            line = lines.get(timeout=0.1)
        except queue.Empty:
            if process.poll() is not None:
                break
            continue
        if line.startswith("listening tcp "):
            return int(line.rsplit(":", 1)[1])
    said = "" if process.poll() is None else process.stderr.read().strip()
    if process.poll() == UsageError.exit_code:
        raise UsageError(
            "the simulated inverter cannot be started so", step="start simulator", value=said.splitlines()[-1] if said else "no answer",
            limit="a scenario, speed and seed that it takes", remedy="`python -m sim --list` names the scenarios; the speed is 1, N or max",
        )  # fmt: skip
    raise LinkUnreachable(
        "the simulated inverter did not start",
        step="start simulator",
        value=said.splitlines()[-1] if said else "no answer",
        limit=f"listening within {START_S:g} s",
        remedy="start again: what was compiled so far is kept; `python -m sim --tcp 0` shows what the simulator says",
    )
