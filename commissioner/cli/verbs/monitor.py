"""`commissioner monitor FILE`: speed, torque and load torque of a running motor from its terminals."""

from __future__ import annotations

from commissioner.cli.screens.monitoring import show, show_partial, show_refused
from commissioner.cli.screens.screen import busy, emit
from commissioner.operations.recordings.monitor import MonitorRequest, NotMonitored, PartlyMonitored
from commissioner.operations.recordings.monitor import monitor as carry_out


def monitor(request: MonitorRequest, *, as_json: bool) -> None:
    """Shows the answer; exit 3 where the recording cannot carry one. The JSON then still says what was learned."""
    with busy("looking for speed and load"):
        done = carry_out(request)
    if as_json:
        emit(done.document)
    elif isinstance(done, PartlyMonitored):
        show_partial(done.document)
    elif isinstance(done, NotMonitored):
        show_refused(done.seen, done.document)
        raise done.error
    else:
        show(done.seen, done.document, done.verdict)
    if isinstance(done, NotMonitored):
        raise SystemExit(done.error.exit_code)
