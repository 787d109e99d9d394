"""Control of a drive passes only to somebody who is there."""

import pytest

from commissioner.service.runs.control import Control, Pages, Party

ANNA, BERT, SCRIPT = Party("a", "anna"), Party("b", "bert"), Party("", "script")


@pytest.fixture
def clock():
    return [100.0]


@pytest.fixture
def pages(clock):
    made = Pages(lambda: clock[0])
    made.opened("a")
    made.opened("b")
    return made


@pytest.fixture
def control(pages, clock):
    made = Control(pages, 15.0, lambda: clock[0])
    made.take(ANNA)
    made.ask(BERT)
    return made


def test_who_asked_and_closed_the_page_takes_control_from_nobody(control, pages, clock):
    """Control without a page would end the run that anna looks after."""
    pages.closed("b")
    clock[0] += 16.0
    assert control.is_held_by(ANNA) and control.asking is None


def test_a_reload_while_asking_takes_nothing_away(control, pages, clock):
    pages.closed("b")
    clock[0] += 1.0
    assert control.asking == BERT
    pages.opened("b")
    clock[0] += 15.0
    assert control.is_held_by(BERT)


def test_control_passes_to_no_page_in_the_midst_of_a_reload(control, pages, clock):
    clock[0] += 14.5
    pages.closed("b")
    clock[0] += 1.0
    assert control.is_held_by(ANNA)
    pages.opened("b")
    assert control.is_held_by(BERT)


def test_a_script_has_no_page_to_lose(pages, clock):
    control = Control(pages, 15.0, lambda: clock[0])
    control.take(ANNA)
    control.ask(SCRIPT)
    clock[0] += 16.0
    assert control.is_held_by(SCRIPT)
