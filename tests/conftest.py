"""Every run draws the same examples; `pytest --hypothesis-profile=fresh` draws new ones. What is said here of workers holds
under xdist only: which tests stay together on one, and that the costliest begin."""

import gc
import json
import os
import re
import tempfile
from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("same", derandomize=True)
settings.register_profile("fresh", derandomize=False, print_blob=True)
settings.load_profile("same")
_LOCKS = tempfile.TemporaryDirectory(prefix="commissioner-locks-", ignore_cleanup_errors=True)
os.environ["COMMISSIONER_LOCKS"] = _LOCKS.name
"""Of this process and the commands it starts: two workers may both speak to the same made-up address."""

TESTS = Path(__file__).parent
REALTIME = (
    "campaigns/test_short_campaigns.py",
    "campaigns/hostile_run",
    "conformance/test_conformance.py",
    "integration/service",
    "integration/link",
    "integration/test_kill.py",
    "integration/test_stopped.py",
    "sim/test_faults.py",
    "sim/test_server.py",
)
"""Judged by answers, time-outs and watchdogs of 10 to 250 ms of wall time: nothing heavy may run beside them. Whole runs
of the service against `sim --speed max` are not: the reader paces them, and they allow 250 ms for what takes one. Nor are
defects that a rule must catch: what comes late fails it all the more. `NOT_REALTIME` are the tests of these files that
no clock judges."""
ALONE = ("campaigns/test_short_campaigns.py", "campaigns/hostile_run", "integration/test_kill.py", "sim/test_faults.py")
"""Of those, the ones whose whole course is counted in wall time. The others mostly wait: three at a time do one another no harm."""
NOT_REALTIME = (
    "test_a_full_three_axis_run_at_115200_ends_commissioned",
    "test_what_is_found_at_115200_is_true_within_three_of_its_errors",
    "test_the_flux_stays_under_its_limit_at_115200_in_truth",
    "test_the_recording_of_means_gives_the_runs_answer_offline",
    "test_a_run_of_means_is_decided_again_bit_for_bit",
    "test_a_run_at_19200_captures_downloads_and_is_true_within_three_of_its_errors",
    "test_the_firmwares_own_tests_pass_and_its_fuzzer_finds_nothing_with_the_sanitizers_on",
    "test_the_firmwares_item_table_is_the_drive_files",
    "test_every_rule_that_was_tried_shows_requests_replies_and_times",
    "test_an_open_interlock_keeps_every_energising_rule_untried",
    "test_nobody_there_is_exit_code_5_and_a_commercial_drive_file_is_2",
    "test_the_mutator_changes_one_thing_at_a_time",
    "test_every_explained_survivor_is_still_in_the_code",
    "test_the_same_session_is_the_same_samples_over_every_wire",
    "test_parameters_are_written_stored_and_restored_over_the_wire",
    "test_a_drive_that_must_not_be_energised_is_not",
    "test_an_unusable_tls_file_is_a_usage_error_and_never_asks_for_a_password",
    "test_debts_are_paid_by_their_shape_alone",
    "test_the_list_of_pymodbus_errors_is_complete",
    "test_at_max_the_same_seed_gives_the_same_words",
    "test_command_line_serves_and_prints_where",
)
PATIENT = ("integration/link/test_tune_verb.py",)
"""Files of these that wait for a drive which tunes itself, seconds long: no clock judges them either. A browser's stay where no other
test needs an event loop of its own."""
TOGETHER = "integration/service"
"""Its files share a costly fixture of a whole session: a file's tests stay on one worker."""
NIGHT = TESTS.parent / ".ci" / "night.txt"
"""Whole diagnoses and runs whose claims have shorter witnesses beside them: `.ci/night` runs them, by name."""
COSTS = TESTS.parent / ".ci" / "costs.json"
"""Seconds of the tests that take one or more, as `tests/support/suite/durations.py` writes them."""
_GROUP = re.compile(r"@[\w/]+\.py$")
"""A group is called after its file."""
USUAL_S, WHOLE_DIAGNOSIS_S = 0.1, 5.0
"""What a test is taken to cost that the table does not name; those of `hidden_effects` are whole diagnoses."""


@pytest.fixture
def is_short(request: pytest.FixtureRequest) -> bool:
    """By day a recording is as short as its claim allows; at night it is whole."""
    return request.node.get_closest_marker("campaign") is None


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Whoever asks for realtime tests alone does not import the files that hold none."""
    asked = set(config.getoption("markexpr").split(" and "))
    is_none = collection_path.is_file() and not _is_in(REALTIME, collection_path)
    return True if asked & {"realtime", "alone"} and is_none else None


@cache
def _is_in(names: tuple[str, ...], path: Path) -> bool:
    return any(path.is_relative_to(TESTS / name) for name in names)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """To whoever gave the tests out a test has its own name again: by the one that xdist gives it (`name@group`) `--lf` knew no test that had
    failed, and judged all of them once more, one by one."""
    if "PYTEST_XDIST_WORKER" not in os.environ:
        report.nodeid = _GROUP.sub("", report.nodeid)


def pytest_collection_finish() -> None:
    """What collecting has made is not looked through again: 0.3 s each time, with all threads of a worker standing."""
    gc.freeze()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    at_night = set(NIGHT.read_text("utf-8").split("\n"))
    for item in items:
        if item.nodeid in at_night:
            item.add_marker(pytest.mark.campaign)
        is_patient = item.name.split("[")[0] in NOT_REALTIME or _is_in(PATIENT, item.path)
        if _is_in(REALTIME, item.path) and not is_patient:
            item.add_marker(pytest.mark.realtime)
            if _is_in(ALONE, item.path):
                item.add_marker(pytest.mark.alone)
    if hasattr(config, "workerinput"):
        _costliest_first(items)


def _costliest_first(items: list[pytest.Item]) -> None:
    """Groups that share what one made, and single tests, by their cost; in a group as they stand in their file."""
    costs = json.loads(COSTS.read_text("utf-8")) if COSTS.exists() else {}
    groups, cost = defaultdict(list), defaultdict(float)
    for item in items:
        shared = _shared(item)
        if shared and item.get_closest_marker("xdist_group") is None:
            item.add_marker(pytest.mark.xdist_group(shared))
        mark = item.get_closest_marker("xdist_group")
        group = str(mark.args[0]) if mark else item.nodeid
        groups[group].append(item)
        is_whole = item.path.is_relative_to(TESTS / "hidden_effects")
        cost[group] += costs.get(item.nodeid, WHOLE_DIAGNOSIS_S if is_whole else USUAL_S)
    items[:] = [item for group in sorted(groups, key=cost.__getitem__, reverse=True) for item in groups[group]]


def _shared(item: pytest.Item) -> str | None:
    """What the tests that belong together are called: their file, where they share a costly fixture or what a function keeps."""
    file = item.path.relative_to(TESTS).as_posix()
    if file.startswith(TOGETHER):
        return file
    fixtures = getattr(item, "_fixtureinfo").name2fixturedefs.values()  # noqa: B009
    if any(fixture.scope == "module" and fixture.baseid.endswith(file) for made in fixtures for fixture in made):
        return file
    kept = (value for value in vars(getattr(item, "module", None) or object).values() if hasattr(value, "cache_info"))
    return file if any(True for _ in kept) else None
