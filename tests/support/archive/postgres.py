"""A PostgreSQL of the test's own: Debian's programs, an unprivileged user, a folder that is thrown away."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

USER = "nobody"


def missing() -> str:
    """What is not there; empty where the server can be started."""
    return "" if _programs() else "no initdb in /usr/lib/postgresql/*/bin: apt-get install postgresql"


@contextmanager
def server() -> Iterator[str]:
    """Its URL for SQLAlchemy. Loopback only, nobody else may connect, gone afterwards."""
    programs = _programs()
    assert programs is not None, missing()
    folder = Path(tempfile.mkdtemp(prefix="commissioner-postgres-"))
    try:
        _as_user(
            folder,
            programs / "initdb",
            "-D",
            folder / "data",
            "-U",
            "workshop",
            "-A",
            "trust",
            "--no-sync",
            "-E",
            "UTF8",
        )
        port = _free_port()
        options = f"-p {port} -k {folder} -c listen_addresses=127.0.0.1 -c fsync=off -c max_connections=40"
        control = (programs / "pg_ctl", "-D", folder / "data", "-w", "-l", folder / "log")
        _as_user(folder, *control, "-o", options, "start")
        try:
            yield f"postgresql+psycopg://workshop@127.0.0.1:{port}/postgres"
        finally:
            _as_user(folder, *control, "-m", "immediate", "stop")
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _as_user(folder: Path, *command: object) -> None:
    """PostgreSQL refuses to run as root."""
    options: dict[str, object] = {}
    if os.geteuid() == 0:
        shutil.chown(folder, USER)
        options = {"user": USER, "group": "nogroup", "extra_groups": []}
    done = subprocess.run(
        [str(part) for part in command], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False,
        timeout=120, **options,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def _programs() -> Path | None:
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    return found[-1].parent if found else None


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
