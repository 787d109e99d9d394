"""`commissioner simulate MODEL`: play a motor, plain or extended by `diagnose`, into a recording."""

from __future__ import annotations

from commissioner.cli.screens.screen import busy, emit, err, text
from commissioner.operations.recordings.simulate import SimulateRequest
from commissioner.operations.recordings.simulate import simulate as carry_out


def simulate(request: SimulateRequest, *, as_json: bool) -> None:
    """Writes the recording and says where."""
    with busy("playing"):
        done = carry_out(request)
    if as_json:
        emit(done)
    else:
        err.print(f"{done.samples} samples in {done.segments} segments written to {text(done.recording)}")
        for remark in done.remarks:
            err.print(f"- {text(remark)}")
