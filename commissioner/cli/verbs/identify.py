"""`commissioner identify FILE...`: the motor's parameters from recordings at standstill or of a running motor."""

from __future__ import annotations

from pathlib import Path

from commissioner.cli.screens import screen
from commissioner.cli.screens.identification import show, show_catalogue, show_running, show_sheets
from commissioner.errors import UsageError
from commissioner.operations.recordings.identify import (
    IdentifiedCatalogue,
    IdentifiedRunning,
    IdentifiedSheets,
    IdentifyRequest,
)
from commissioner.operations.recordings.identify import identify as carry_out
from commissioner.operations.recordings.identify import identify_any as of_any_kind


def identify(request: IdentifyRequest, *, as_json: bool) -> None:
    """Identify a motor from standstill recordings, with the estimators a live run uses, or from a start or loads of a running one."""
    with screen.busy("identifying"):
        done = of_any_kind(request)
    if as_json:
        screen.emit(done.document)
    elif isinstance(done, IdentifiedRunning):
        show_running(done.document, [str(path) for path in done.files])
    elif isinstance(done, IdentifiedCatalogue):
        show_catalogue(done.document, [str(path) for path in done.files], request.out)
    elif isinstance(done, IdentifiedSheets):
        show_sheets(done.document, [str(path) for path in done.files])
    else:
        show(done.document, [str(path) for path in done.files])


def identify_and_write(
    request: IdentifyRequest, *, drive: str | None, profile: str | None, yes: bool, procedure: Path | None, runs: Path,
    as_json: bool,
) -> None:  # fmt: skip
    """As `identify`; then the verdict, and an accepted result into the drive. Exits with the code of the outcome."""
    from commissioner.cli.screens.ending import show_and_exit
    from commissioner.cli.screens.live import LiveView
    from commissioner.operations.write import WriteRequest, write_recorded

    if drive is None or profile is None:
        raise UsageError(
            "--write-back needs to know the drive", step="command line", value=None, limit="--drive URL --profile NAME",
            remedy="add both; `commissioner check` shows whether they fit",
        )  # fmt: skip
    screen.require_yes(yes, as_json=as_json)
    with screen.busy("identifying"):
        identified = carry_out(request)
    if not as_json:
        show(identified.document, [str(path) for path in identified.files])
    if not yes:
        screen.out.print(f"If the result is accepted it will be written into the drive at {drive} and stored.")
        screen.confirm("Write?", otherwise="nothing was written")
    with LiveView(screen.err if as_json else screen.out) as view:
        done = write_recorded(WriteRequest(drive, profile, runs, procedure), identified, view)
    show_and_exit(done, as_json=as_json)
