"""The product starts where POSIX is not: proved by hiding what only POSIX has, on whatever system the suite runs."""

import os
import pathlib
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
HIDE = """
import builtins, importlib, pkgutil
HIDDEN = {"termios", "tty", "pty", "fcntl", "resource", "pwd", "grp", "syslog", "posix", "readline", "curses", "crypt", "spwd"}
real = builtins.__import__
def ours_only(name, globals=None, locals=None, fromlist=(), level=0):
    asked_by = (globals or {}).get("__name__", "")
    if name.split(".")[0] in HIDDEN and asked_by.split(".")[0] in ("commissioner", "sim"):
        raise ImportError(f"{asked_by} imports {name}, which only POSIX has")
    return real(name, globals, locals, fromlist, level)
builtins.__import__ = ours_only
import commissioner, sim
for package in (commissioner, sim):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if not module.name.endswith(("__main__", "migrations.env")):  # alembic runs that one, nobody imports it
            importlib.import_module(module.name)
import sim.__main__, commissioner.cli.app
print("all imported")
"""


def test_every_module_imports_where_posix_is_hidden():
    done = subprocess.run([sys.executable, "-c", HIDE], cwd=ROOT, capture_output=True, encoding="utf-8", check=False)
    assert done.stdout.strip().endswith("all imported"), done.stderr


@pytest.mark.parametrize("platform", ["win32", "darwin"])
def test_types_hold_on_other_systems(platform, tmp_path):
    command = [
        sys.executable,
        "-m",
        "mypy",
        "--platform",
        platform,
        "--cache-dir",
        str(ROOT / ".mypy_cache" / platform),
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("encoding", ["cp1252", "cp850", "ascii"])
def test_a_console_of_another_encoding_ends_no_verb(encoding, tmp_path):
    """A folder with a space and an umlaut, words with signs that the console lacks."""
    folder = tmp_path / "Läufe und Motoren Ω"
    folder.mkdir()
    environment = os.environ | {"PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}
    for arguments in (["runs", "list", "--runs", folder], ["--help"], ["runs", "show", "Ω→σ", "--runs", folder]):
        command = [sys.executable, "-m", "commissioner", *map(str, arguments)]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, env=environment, check=False)
        said = (done.stdout + done.stderr).decode(encoding)
        assert done.returncode in (0, 2), said
        assert "Traceback" not in said
        assert "defect" not in said
