"""What a list of runs or a page of help must not wait for."""

import os
import subprocess
import sys

import pytest

from tests.support.archive.synthetic import make_run

HEAVY = (
    "numpy",
    "scipy",
    "numba",
    "matplotlib",
    "pyarrow",
    "pymodbus",
    "pydantic",
    "sqlalchemy",
    "alembic",
    "jinja2",
    "fastapi",
    "sim",
)
AUDIT = f"""
import sys
from commissioner.cli.failures import run_to_exit
from commissioner.cli.app import app
try:
    run_to_exit(app, sys.argv[1:])
except SystemExit as end:
    print("HEAVY", end.code or 0, *(name for name in {HEAVY!r} if name in sys.modules))
"""


@pytest.mark.parametrize(
    "call",
    [
        ("--help",),
        ("runs", "--help"),
        ("runs", "list"),
        ("runs", "list", "--json"),
        ("runs", "find", "pump"),
        ("runs", "show", "last"),
        ("runs", "index", "--rebuild"),
    ],
)
def test_help_and_lists_import_no_estimator(call, tmp_path):
    make_run(tmp_path / "runs", "20260101-000000-simulated-abcdef")
    where = ("--runs", str(tmp_path / "runs")) if "--help" not in call else ()
    environment = {name: value for name, value in os.environ.items() if name != "COMMISSIONER_ARCHIVE"}
    command = [sys.executable, "-c", AUDIT, *call, *where]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", env=environment, check=False)
    assert done.stdout.splitlines()[-1] == "HEAVY 0", done.stdout[-500:] + done.stderr
