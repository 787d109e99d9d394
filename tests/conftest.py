"""Every run draws the same examples; `pytest --hypothesis-profile=fresh` draws new ones."""

from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("same", derandomize=True)
settings.register_profile("fresh", derandomize=False, print_blob=True)
settings.load_profile("same")

TESTS = Path(__file__).parent
REALTIME = (
    "campaigns",
    "conformance",
    "integration/service",
    "integration/link",
    "integration/test_kill.py",
    "sim/test_faults.py",
    "sim/test_server.py",
)
"""Judged by answers, time-outs and watchdogs of 10 to 250 ms of wall time: nothing heavy may run beside them. Whole runs
of the service against `sim --speed max` are not: the reader paces them, and they allow 250 ms for what takes one."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if any(item.path.is_relative_to(TESTS / name) for name in REALTIME):
            item.add_marker(pytest.mark.realtime)
