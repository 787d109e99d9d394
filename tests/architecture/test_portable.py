"""The product starts where POSIX is not: proved by hiding what only POSIX has, on whatever system the suite runs."""

import os
import pathlib
import subprocess
import sys
from functools import cache

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


@cache
def _type_errors(platform):
    """What mypy says where it knows the standard library and us, and nothing else: a quarter of the time, the same use of the system."""
    cache = str(ROOT / ".mypy_cache" / f"standard-{platform}")
    options = ["--config-file=", "--no-site-packages", "--ignore-missing-imports", "--cache-dir", cache]
    command = [sys.executable, "-m", "mypy", *options, "--platform", platform, "commissioner"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    return set(done.stdout.splitlines()[:-1])


@pytest.mark.parametrize("platform", ["win32", "darwin"])
def test_what_is_right_here_is_right_on_other_systems(platform):
    """`mypy` alone, as `.ci/run` calls it, finds nothing on this system; whatever only another has is named here."""
    only_there = sorted(_type_errors(platform) - _type_errors("linux"))
    assert not only_there


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
