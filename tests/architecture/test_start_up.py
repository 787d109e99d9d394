"""What a list of runs, a page of help or a click that estimates nothing must not wait for."""

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
AUDIT = """
import sys
heavy = sys.argv.pop(1).split(",")
from commissioner.cli.failures import run_to_exit
from commissioner.cli.app import app
try:
    run_to_exit(app, sys.argv[1:])
except SystemExit as end:
    print("HEAVY", end.code or 0, *(name for name in heavy if name in sys.modules))
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
    assert imported(call, tmp_path, HEAVY) == ["0"]


@pytest.mark.parametrize(
    "call",
    [
        ("check", "--drive", "tcp://127.0.0.1:9?device=1", "--motor", "motor_2kw2"),
        ("write-back", "last", "--plan"),
        ("restore", "last", "--plan"),
        ("runs", "verify"),
    ],
)
def test_what_only_reads_a_drive_or_an_archive_imports_no_estimator(call, tmp_path):
    """Each is a click on the page and a process of its own: with the estimators it took 3.3 CPU-seconds to begin, without them 1.5."""
    assert imported(call, tmp_path, ("scipy.optimize", "numba", "matplotlib", "pyarrow"))[1:] == []


def test_identifying_a_recording_imports_nothing_of_a_diagnosis(tmp_path):
    """A third of such a call's time were a diagnosis's imports: it learnt from them whether the file is a test sheet."""
    table = tmp_path / "recording.csv"
    table.write_text("time_s,voltage_axis_v,current_u_a,current_v_a\n0,1,0,0\n0.001,1,0,0\n", encoding="utf-8")
    heavy = ("scipy.signal", "scipy.stats", "matplotlib", "commissioner.diagnose.causes", "commissioner.running")
    assert imported(("identify", str(table)), tmp_path, heavy) == ["3"]


def imported(call, tmp_path, heavy):
    """The verb's exit code, and which of `heavy` it imported."""
    make_run(tmp_path / "runs", "20260101-000000-simulated-abcdef")
    where = ("--runs", str(tmp_path / "runs")) if call[0] not in {"check", "identify"} and "--help" not in call else ()
    environment = {name: value for name, value in os.environ.items() if name != "COMMISSIONER_ARCHIVE"}
    command = [sys.executable, "-c", AUDIT, ",".join(heavy), *call, *where]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", env=environment, check=False)
    assert "HEAVY" in done.stdout, done.stdout[-500:] + done.stderr
    return done.stdout.splitlines()[-1].split()[1:]
