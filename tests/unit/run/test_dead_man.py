"""The pipe by which a service holds a run: silence stops it, a process that was itself held up has heard nothing wrong."""

import contextlib
import os
import time

import pytest

from commissioner.run.stopping.dead_man import SILENCE_S, DeadMan
from commissioner.run.stopping.operator_stop import OperatorStop


@pytest.fixture
def pipe():
    reading, writing = os.pipe()
    yield reading, writing
    for end in (reading, writing):
        with contextlib.suppress(OSError):
            os.close(end)


def wait_asked(stop, timeout_s):
    end = time.monotonic() + timeout_s
    while not stop.asked and time.monotonic() < end:
        time.sleep(0.01)
    return stop.asked


def test_the_end_of_the_pipe_stops_at_once(pipe):
    stop = OperatorStop()
    DeadMan(pipe[0], stop).start()
    os.close(pipe[1])
    assert "is gone" in wait_asked(stop, 1.0)


def test_a_word_names_person_and_reason(pipe):
    stop = OperatorStop()
    man = DeadMan(pipe[0], stop)
    man.start()
    os.write(pipe[1], b'begin {"person": "ada"}\nstop {"person": "otto", "reason": "smoke"}\n')
    assert wait_asked(stop, 1.0) == "smoke (otto)"
    assert man.wait_for_begin() == {"person": "ada"}


def test_silence_stops_and_beats_do_not(pipe):
    stop = OperatorStop()
    DeadMan(pipe[0], stop).start()
    began = time.monotonic()
    for _ in range(3):
        os.write(pipe[1], b"beat\n")
        time.sleep(0.5)
    assert not stop.asked
    assert "nothing heard" in wait_asked(stop, SILENCE_S + 3.0)
    assert time.monotonic() - began > SILENCE_S  # since the first of the beats, so the last one counted


def test_a_process_that_was_held_up_does_not_take_its_own_pause_for_silence(pipe):
    """Its clock shows an hour between two looks; the beats still come."""
    stop, jump = OperatorStop(), [0.0]
    DeadMan(pipe[0], stop, clock=lambda: time.monotonic() + jump[0]).start()
    for _ in range(4):
        os.write(pipe[1], b"beat\n")
        time.sleep(0.2)
        jump[0] += 3600.0
    assert not stop.asked
