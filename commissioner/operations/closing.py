"""The closing diagnosis: a process of its own, begun when a run is over and has let its drive go; its result joins the archive when
it is ready. It takes processor time that nobody else wants."""

from __future__ import annotations

import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from commissioner.run.archive.catalogue import find_folder
from commissioner.run.stopping.operator_stop import OperatorStop
from commissioner.run.stopping.stop_file import stopped_by_file

if TYPE_CHECKING:
    from commissioner.report.run.contract import RunDocument

DIAGNOSIS_S = 600.0
"""Four tests with five causes in them take 40 s on two quiet cores, three minutes behind other work; then it is given up, wherever it is."""
LOOK_S, END_S = 0.05, 5.0


def begin_diagnosis(folder: Path, seconds: float, seal: Path | None) -> subprocess.Popen[bytes]:
    """`commissioner runs diagnose` on the run in `folder`; it outlives this process and its terminal."""
    command = [
        sys.executable, "-m", "commissioner", "runs", "diagnose", folder.name, "--runs", str(folder.parent.absolute()),
        "--seconds", f"{seconds:g}", "--json", *(["--seal", str(seal.absolute())] if seal is not None else []),
    ]  # fmt: skip
    flags = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0) | getattr(subprocess, "CREATE_NO_WINDOW", 0)
    return subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
        creationflags=flags,
    )  # fmt: skip


def await_diagnosis(process: subprocess.Popen[bytes], folder: Path, stop: OperatorStop) -> None:
    """Until it has joined the archive; a stop ends it, without one."""
    with stop, stopped_by_file(folder, stop):
        while process.poll() is None and not stop.asked:
            time.sleep(LOOK_S)
    if process.poll() is None:
        process.terminate()
        with suppress(subprocess.TimeoutExpired):
            process.wait(END_S)


def diagnose_archived(runs: Path, run: str, seconds: float = DIAGNOSIS_S, key: bytes | None = None) -> RunDocument:
    """The diagnosis of one archived run, made here and now, for so long at the most. As `run.diagnosed.diagnose_run`."""
    from commissioner.run.diagnosed import diagnose_run

    return diagnose_run(find_folder(runs, run), seconds, key)
