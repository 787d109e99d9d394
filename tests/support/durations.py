"""What each test costs: `pytest -p tests.support.durations --costs FILE` writes CPU and wall seconds, children's included.

CPU seconds also hold on a busy host. `tests/conftest.py` begins the costliest first, from the table kept under `.ci/`.
"""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--costs", type=Path, default=None, help="Write CPU and wall seconds of each test to this file.")


class Costs:
    def __init__(self, file: Path) -> None:
        self.file = file
        self.rows: dict[str, tuple[float, float]] = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item):
        cpu, wall = _cpu_s(), time.monotonic()
        result = yield
        self.rows[item.nodeid] = (round(_cpu_s() - cpu, 2), round(time.monotonic() - wall, 2))
        return result

    def pytest_sessionfinish(self) -> None:
        table = json.loads(self.file.read_text("utf-8")) if self.file.exists() else {}
        self.file.write_text(json.dumps(table | self.rows, indent=0, sort_keys=True) + "\n", "utf-8")


def pytest_configure(config: pytest.Config) -> None:
    if file := config.getoption("--costs"):
        config.pluginmanager.register(Costs(file))


def _cpu_s() -> float:
    return sum(os.times()[:4])
