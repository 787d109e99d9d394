"""The reference firmware built with gcc and libmodbus, as it is or with a defect seeded into its sources, and run.

with FirmwareProcess(build()) as drive:
    run_conformance(parse_url(drive.url), ...)
"""

from __future__ import annotations

import hashlib
import json
import os
import selectors
import shutil
import signal
import subprocess
import tempfile
import time
from functools import lru_cache
from pathlib import Path
from types import TracebackType
from typing import Any

import pytest

SOURCES = Path(__file__).resolve().parents[2] / "sim" / "reference_firmware"
FLAGS = ["-std=c99", "-Wall", "-I/usr/include/modbus"]
START_S = 10.0


def missing() -> str:
    """What this machine lacks to build it; empty where nothing."""
    if not shutil.which("gcc") or not shutil.which("make"):
        return "no gcc or make"
    return "" if Path("/usr/include/modbus/modbus.h").is_file() else "no libmodbus-dev"


needs_libmodbus = pytest.mark.skipif(bool(missing()), reason=missing())


@lru_cache(maxsize=1)
def build_folder() -> Path:
    """A folder of this source's own: what has not changed is not built again. Removed by nobody but the system."""
    text = b"".join(path.read_bytes() for path in sorted(SOURCES.rglob("*")) if path.is_file())
    name = f"commissioner-firmware-{os.getuid()}-{hashlib.sha256(text).hexdigest()[:16]}"
    return Path(tempfile.gettempdir()) / name


def make(*targets: str, timeout_s: float = 120.0) -> str:
    """`make` in the firmware's folder, its output; the build folder belongs to one worker at a time."""
    import fcntl

    folder = build_folder()
    folder.mkdir(exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = subprocess.run(
            ["make", "-C", str(SOURCES), f"BUILD={folder}", *targets],
            capture_output=True,
            text=True,
            check=False,
            timeout=timeout_s,
        )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def build() -> Path:
    """The host build of the firmware."""
    make("all")
    return build_folder() / "reference_firmware"


def build_with(file: str, changes: tuple[tuple[str, str], ...], folder: Path) -> Path:
    """The host build with texts of one source replaced, each of which must stand there exactly once."""
    build()
    text = (SOURCES / file).read_text(encoding="utf-8")
    for old, new in changes:
        assert text.count(old) == 1, f"{file} has {text.count(old)} times: {old}"
        text = text.replace(old, new)
    if file.endswith(".h"):
        return _build_all(file, text, folder)
    source = folder / Path(file).name
    source.write_text(text, encoding="utf-8")
    (folder / "changed.o").unlink(missing_ok=True)
    _compile(source, folder / "changed.o", SOURCES / "src", SOURCES / "host")
    objects = [str(o) for o in build_folder().glob("*/*.o") if o.stem != source.stem]
    return _link([*objects, str(folder / "changed.o")], folder)


def _build_all(header: str, text: str, folder: Path) -> Path:
    """A changed header reaches every source."""
    shutil.copytree(SOURCES, folder / "all", ignore=shutil.ignore_patterns("tests"))
    (folder / "all" / header).write_text(text, encoding="utf-8")
    sources = [*(folder / "all" / "src").glob("*.c"), *(folder / "all" / "host").glob("*.c")]
    objects = []
    for source in sources:
        objects.append(str(folder / f"{source.stem}.o"))
        _compile(source, Path(objects[-1]), folder / "all" / "src", folder / "all" / "host")
    return _link(objects, folder)


def _compile(source: Path, into: Path, *include: Path) -> None:
    paths = [f"-I{folder}" for folder in include]
    subprocess.run(["gcc", *FLAGS, "-w", "-O1", *paths, "-c", "-o", str(into), str(source)], check=True, timeout=60)


def _link(objects: list[str], folder: Path) -> Path:
    program = folder / "drive"
    subprocess.run(["gcc", "-o", str(program), *objects, "-lmodbus", "-lm"], check=True, timeout=60)
    return program


class FirmwareProcess:
    """`url` is where it listens; after the `with` block, `truth` is its answer key with what really happened."""

    def __init__(
        self, program: Path, *arguments: str, speed: str = "max", line: tuple[str, ...] = ("--tcp", "0")
    ) -> None:
        self._command = [str(program), *line, "--speed", speed, "--truth", *arguments]
        self.truth: dict[str, Any] = {}

    def __enter__(self) -> FirmwareProcess:
        self.process = subprocess.Popen(self._command, stdout=subprocess.PIPE, text=True, encoding="utf-8")
        kind, address = self._listening().split()[1:3]
        self.url = f"{kind}://{address}" + ("" if kind == "tcp" else "?parity=N&stop=1&baud=115200")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.process.send_signal(signal.SIGTERM)
        try:
            rest, _ = self.process.communicate(timeout=10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            rest, _ = self.process.communicate()
        if rest.strip():
            self.truth = json.loads(rest.splitlines()[-1])

    def _listening(self) -> str:
        assert self.process.stdout is not None
        end = time.monotonic() + START_S
        with selectors.DefaultSelector() as ready:
            ready.register(self.process.stdout, selectors.EVENT_READ)
            while time.monotonic() < end and self.process.poll() is None:
                if ready.select(0.1):
                    line = self.process.stdout.readline()
                    assert line.startswith("listening"), line
                    return line
        raise AssertionError(f"{self._command} does not listen")
