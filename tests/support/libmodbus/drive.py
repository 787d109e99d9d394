"""A drive of ordinary registers behind libmodbus, built with gcc by the test that needs it: nothing of ours, nothing of pymodbus.

with LibmodbusDrive("--set", "1299=0,37020", "--coil", "64=0") as drive:
    call("check", "--drive", drive.url, "--profile", "danfoss_fc302")
drive.truth["registers"]["1300"]
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import tempfile
from functools import lru_cache
from pathlib import Path

from tests.support.reference_firmware import FirmwareProcess, missing, needs_libmodbus

__all__ = ["LibmodbusDrive", "missing", "needs_libmodbus"]

SOURCE = Path(__file__).resolve().parent / "drive.c"


@lru_cache(maxsize=1)
def program() -> Path:
    """Built once for each text of the source."""
    name = f"commissioner-libmodbus-{os.getuid()}-{hashlib.sha256(SOURCE.read_bytes()).hexdigest()[:16]}"
    target = Path(tempfile.gettempdir()) / name
    if not target.is_file():
        part = target.with_suffix(f".{os.getpid()}")
        flags = ["-std=gnu99", "-O1", "-Wall", "-Werror", "-I/usr/include/modbus"]
        subprocess.run(["gcc", *flags, "-o", str(part), str(SOURCE), "-lmodbus"], check=True, timeout=60)
        part.replace(target)
    return target


class LibmodbusDrive(FirmwareProcess):
    """`url` is where it listens; after the `with` block `truth` tells registers, coils, requests and whether it tripped."""

    def __init__(self, *options: str, line: tuple[str, ...] = ("--tcp", "0")) -> None:
        self._command = [str(program()), *line, *options]
        self.truth = {}
