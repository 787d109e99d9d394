"""SIGKILL at the moments that matter most. The full count: `python -m tests.campaigns.kills --kills 300`."""

import pytest

from tests.campaigns.kills import Moment, counts_of_a_whole_run, scene


@pytest.fixture(scope="module")
def stage():
    with scene("tcp", seed=3) as made:
        made.counts = counts_of_a_whole_run(made)
        yield made


def held_after(stage, moment):
    killed = stage.kill(moment)
    assert not killed.broken
    assert killed.was_killed
    return killed


def test_killed_while_energised_the_drive_dies_by_its_watchdog_and_keeps_its_parameters(stage):
    killed = held_after(stage, Moment("asking", int(0.6 * stage.counts["asking"])))
    assert killed.was_energised
    assert killed.dead_after_s > 0.0
    assert killed.held == ("old", "old")
    assert killed.blocks > 0


@pytest.mark.parametrize(
    "back", [n if n in (4, 8) else pytest.param(n, marks=pytest.mark.campaign) for n in range(1, 12)]
)
def test_killed_at_one_of_the_last_records_the_drive_holds_old_or_new_and_restore_brings_the_old(stage, back):
    killed = held_after(stage, Moment("journal", stage.counts["journal"] - back + 1))
    assert killed.was_restored


@pytest.mark.campaign  # how many requests a run makes depends on the host
@pytest.mark.parametrize("back", [2, 5, 8, 11, 14])
def test_killed_between_request_and_answer_of_the_write_back(stage, back):
    killed = held_after(stage, Moment("asking", stage.counts["asking"] - back))
    assert killed.was_restored


def test_killed_before_the_first_request_nothing_has_happened(stage):
    killed = held_after(stage, Moment("asking", 1))
    assert killed.written == "as before"
    assert not killed.was_restored
