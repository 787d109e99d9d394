"""`commissioner diagnose FILE...`: what the simulation gets wrong about recordings or test points, by name."""

from __future__ import annotations

from commissioner.cli.screens.diagnosis import show
from commissioner.cli.screens.diagnosis_progress import Progress
from commissioner.cli.screens.running import show as show_running
from commissioner.cli.screens.screen import emit
from commissioner.cli.screens.search import show as show_search
from commissioner.errors import DataRefused
from commissioner.operations.diagnose import DiagnoseRequest
from commissioner.operations.diagnose import diagnose as carry_out


def diagnose(request: DiagnoseRequest, *, as_json: bool, why: bool = False) -> None:
    """Shows the diagnosis, and `why` how the search came to it; exit code 3 where the data cannot carry an answer."""
    done = carry_out(request, Progress(is_quiet=as_json))
    if as_json:
        emit(done.document)
    elif done.running is not None:
        show_running(done.document, done.out)
    else:
        show(done.document, done.out)
        if why:
            show_search(done.document)
    if done.is_refused:
        raise SystemExit(DataRefused.exit_code)
