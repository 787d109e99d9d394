"""What each test costs: `pytest -p tests.support.suite.durations --costs FILE` writes seconds, its fixtures included.

Measure on a quiet host, two workers as in CI (`-n 2 --dist loadgroup`). `tests/conftest.py` begins the costliest first, from
the table kept under `.ci/`; each worker adds what it ran. `python -m tests.support.suite.durations` makes that table anew.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest
from filelock import FileLock

KEPT_FROM_S = 1.0
TABLE = Path(__file__).parents[3] / ".ci" / "costs.json"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--costs", type=Path, default=None, help="Add the seconds of each test to this file.")


class Costs:
    def __init__(self, file: Path) -> None:
        self.file = file
        self.rows: dict[str, float] = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item):
        began = time.monotonic()
        result = yield
        self.rows[item.nodeid.split("@")[0]] = round(time.monotonic() - began, 1)
        return result

    def pytest_sessionfinish(self) -> None:
        with FileLock(self.file.with_suffix(".lock")):
            table = json.loads(self.file.read_text("utf-8")) if self.file.exists() else {}
            kept = {name: cost for name, cost in (table | self.rows).items() if cost >= KEPT_FROM_S}
            self.file.write_text(json.dumps(kept, indent=0, sort_keys=True) + "\n", "utf-8")


def pytest_configure(config: pytest.Config) -> None:
    if file := config.getoption("--costs"):
        config.pluginmanager.register(Costs(file))


if __name__ == "__main__":
    TABLE.unlink(missing_ok=True)
    sys.exit(subprocess.call([sys.executable, "-m", "pytest", "-p", "tests.support.suite.durations", "--costs", TABLE,
                               "-n", "2", "--dist", "loadgroup"]))  # fmt: skip
