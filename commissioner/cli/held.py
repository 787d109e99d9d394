"""A verb that a service holds by the pipe at our standard input: nobody is asked and nothing is shown but JSON documents."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from commissioner.cli.signals import let_end
from commissioner.run.commission import Origin
from commissioner.run.stopping.dead_man import DeadMan
from commissioner.run.stopping.operator_stop import OperatorStop


@contextmanager
def held_by_a_service() -> Iterator[tuple[DeadMan, OperatorStop, Origin]]:
    """The pipe, the stop it asks for, and who began, once the service has said so."""
    stop = OperatorStop()
    held = DeadMan(sys.stdin.fileno(), stop)
    held.start()
    facts = held.wait_for_begin()
    with stop:
        yield held, stop, Origin(facts, _say_folder, stop)
        let_end()


def _say_folder(folder: Path) -> None:
    """A line of its own as soon as there is a folder."""
    sys.stdout.write(json.dumps({"run": folder.name, "folder": str(folder)}) + "\n")
    sys.stdout.flush()
