"""A run that is starting: it has its drive from the click on, also while its process is not there yet."""

from __future__ import annotations

from dataclasses import dataclass

from commissioner.service.runs.child import Child
from commissioner.service.runs.control import Party


@dataclass
class Starting:
    """Who starts it. `stopped`: by whom and why, before there was a process to tell."""

    party: Party
    child: Child | None = None
    stopped: tuple[str, str] | None = None

    def hold(self, child: Child) -> Child:
        """The process, told at once where STOP came before it."""
        self.child = child
        if self.stopped is not None:
            child.stop(*self.stopped)
        return child

    def stop(self, person: str, reason: str) -> None:
        if self.child is None:
            self.stopped = person, reason
        else:
            self.child.stop(person, reason)
