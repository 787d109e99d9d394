"""The one place where failures become sentences, JSON and exit codes."""

from __future__ import annotations

import errno
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

import typer
from typer.exceptions import TyperException

from commissioner.cli.signals import be_deaf, listen
from commissioner.errors import OF_DISK, Aborted, CommissionerError, DataRefused, DiskRefused, UsageError
from commissioner.link.wire.secrets import Secrets, shown_call
from commissioner.text import is_sayable, shown

NO_ARGUMENTS = "NoArgsIsHelpError"
"""How the command line's library leaves a call without arguments: its message is the help."""
INTERRUPTED = 130
"""What typer makes of a KeyboardInterrupt."""


def run_to_exit(app: typer.Typer, arguments: Sequence[str]) -> NoReturn:
    """Carry the verb out and leave with its exit code; with --json every failure is one document, too."""
    as_json, hide = "--json" in arguments, Secrets(arguments).hide
    listen()
    try:
        error = _carried_out(app, arguments)
    except KeyboardInterrupt:  # a second one while the first was being answered
        error = _stopped(arguments)
    finally:
        be_deaf()
    _say(error, as_json, hide)
    sys.exit(error.exit_code)


def _carried_out(app: typer.Typer, arguments: Sequence[str]) -> CommissionerError:
    """Why the verb could not be carried out; SystemExit where it could."""
    try:
        _require_text(arguments)
        code = app(list(arguments), standalone_mode=False, prog_name="commissioner") or 0
        if code != INTERRUPTED:
            sys.exit(code)
        error: CommissionerError = _stopped(arguments)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(0)
    except typer.Exit as stop:
        sys.exit(stop.exit_code)
    except TyperException as usage:
        if type(usage).__name__ == NO_ARGUMENTS:
            typer.echo(usage.message)
            sys.exit(0)
        error = _usage(usage, arguments)
    except KeyboardInterrupt:
        error = _stopped(arguments)
    except typer.Abort:
        error = _unanswered(arguments)
    except CommissionerError as failure:
        error = failure
    except OSError as failure:
        error = _file_failure(failure, arguments)
    except MemoryError:
        error = _too_much(arguments)
    except Exception as surprise:
        error = _defect(surprise, arguments)
    return error


def _require_text(arguments: Sequence[str]) -> None:
    """UsageError: an argument of another encoding than this process's, as `Süd` typed in a Latin-1 terminal. A file or folder that
    is there may have such a name; a tag or a serial number would be archived as another one."""
    for argument in arguments:
        if is_sayable(argument):
            continue
        path = Path(argument.partition("=")[2] if argument.startswith("--") and "=" in argument else argument)
        if not path.exists() and not (is_sayable(path.name) and path.parent.is_dir()):
            raise UsageError(
                f"{shown(argument)} is no text here", step="command line", value=shown(argument),
                limit=f"text in the encoding of this terminal's system, {sys.getfilesystemencoding()}",
                remedy="set the terminal to that encoding, or write the word without the letters that are spelled out here",
            )  # fmt: skip


def _say(error: CommissionerError, as_json: bool, hide: Callable[[Any], Any]) -> None:
    from commissioner.cli.screens import screen

    for fact in ("what", "step", "value", "limit", "remedy"):
        setattr(error, fact, hide(getattr(error, fact)))
    if as_json:
        try:
            screen.emit({"outcome": error.outcome, "reason": error.what, "error": error.as_dict()})
        except OSError:  # what the document goes to takes no more: the person at the terminal is told
            screen.failure(error)
    else:
        screen.failure(error)


def _usage(error: Exception, arguments: Sequence[str]) -> CommissionerError:
    text = error.format_message() if hasattr(error, "format_message") else str(error)
    context = getattr(error, "ctx", None)
    return UsageError(
        text, step="command line", value=shown_call(arguments),
        limit=" ".join(context.get_usage().removeprefix("Usage:").split()) if context else "see --help",
        remedy=f"`{context.command_path} --help` says what it takes" if context else "correct the call",
    )  # fmt: skip


def _stopped(arguments: Sequence[str], by: str = "Ctrl-C or SIGTERM") -> CommissionerError:
    again = "the same call with --resume goes on" if "study" in arguments[:1] else "start again when ready"
    return Aborted("stopped by the operator", step=_verb(arguments), value=by, limit="no stop", remedy=again)


def _unanswered(arguments: Sequence[str]) -> CommissionerError:
    """A question whose line still stands open: Ctrl-C, or the end of what is typed."""
    typer.echo(err=True)
    if sys.stdin is not None and sys.stdin.isatty():
        return _stopped(arguments, by="no answer")
    instead = (
        "`--yes` does not answer for what a person does at the drive"
        if "--yes" in arguments
        else "where nobody sits at one, `--yes` answers for those verbs that have it"
    )
    return Aborted(
        "nobody answered", step=_verb(arguments), value="the end of the input", limit="an answer",
        remedy=f"call it from a terminal; {instead}",
    )  # fmt: skip


def _file_failure(failure: OSError, arguments: Sequence[str]) -> CommissionerError:
    """A file or folder that is in the way, closed to us, or on a disk that is full or failing."""
    kind = DiskRefused if failure.errno in OF_DISK else UsageError
    otherwise = "make room on the disk, or use another one" if kind is DiskRefused else "give another file or folder"
    remedy = "make its disk writable, or copy it to one that is" if failure.errno == errno.EROFS else otherwise
    return kind(
        f"{failure.filename or 'a file'} cannot be used: {failure.strerror or failure}", step=_verb(arguments),
        value=failure.filename or shown_call(arguments), limit="a file or folder that this user may read or write", remedy=remedy,
    )  # fmt: skip


def _too_much(arguments: Sequence[str]) -> CommissionerError:
    return DataRefused(
        "this needs more memory than there is", step=_verb(arguments), value=shown_call(arguments),
        limit="what fits into memory", remedy="split the recording, or ask for less",
    )  # fmt: skip


def _defect(surprise: Exception, arguments: Sequence[str]) -> CommissionerError:
    """A defect of ours: the traceback goes to a file, the person gets a sentence."""
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="commissioner-defect-", suffix=".txt", delete=False, encoding="utf-8", errors="backslashreplace"
        ) as file:
            file.write(Secrets(arguments).hide("".join(traceback.format_exception(surprise))))
        where = f"the file {file.name}"
    except OSError:
        where = "what you did"
    return CommissionerError(
        f"a defect in commissioner: {type(surprise).__name__}: {surprise}", step=_verb(arguments),
        value=type(surprise).__name__, limit="no such error", remedy=f"please report it with {where}",
    )  # fmt: skip


def _verb(arguments: Sequence[str]) -> str:
    return " ".join(argument for argument in arguments[:2] if not argument.startswith("-")) or "start"
