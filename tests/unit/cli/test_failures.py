"""Every verb's failure is one sentence with step, value, limit and remedy, one document with --json, and its exit code."""

import contextlib
import errno
import io
import json
import os
import pathlib
import signal
import subprocess
import time

import pytest
import typer
from rich.console import Console

from commissioner.cli import failures
from commissioner.cli.app import app
from commissioner.cli.failures import run_to_exit
from commissioner.cli.screens import screen
from commissioner.cli.signals import let_end
from commissioner.errors import ConfigurationError, DataRefused, DriveFault, UsageError
from commissioner.link.files.drive_file import DRIVES_FOLDER
from commissioner.link.wire.secrets import Secrets
from tests.support.command_line import COMMAND, call

ONE_RUN = "20260101-000000-simulated"


@pytest.fixture(autouse=True)
def signals_as_a_terminal_gives_them():
    """And as they were before: who leaves is deaf to them."""
    default = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
    before = {number: signal.signal(number, handler) for number, handler in default.items()}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def leave(capsys, *arguments, of=app):
    """(exit code, the document on stdout) of a call in this process."""
    with pytest.raises(SystemExit) as left:
        run_to_exit(of, [*map(str, arguments), "--json"])
    return left.value.code or 0, json.loads(capsys.readouterr().out)


def raising(error):
    made = typer.Typer()

    @made.command()
    def verb(as_json: bool = typer.Option(False, "--json")):
        raise error

    return made


@pytest.mark.parametrize(
    ("error", "code", "outcome"),
    [
        (DriveFault("it tripped", step="enable", remedy="look"), 5, "faulted"),
        (KeyboardInterrupt(), 4, "aborted"),
        (typer.Abort(), 4, "aborted"),
        (PermissionError(13, "Permission denied", "/somewhere/file"), 2, "usage"),
        (OSError(28, "No space left on device"), 5, "faulted"),
        (OSError(27, "File too large"), 5, "faulted"),
        (MemoryError(), 3, "rejected"),
        (ZeroDivisionError("a defect"), 5, "faulted"),
    ],
)
def test_whatever_is_raised_is_one_document_with_its_exit_code(capsys, error, code, outcome):
    left, document = leave(capsys, of=raising(error))
    assert (left, document["outcome"]) == (code, outcome)
    assert {"kind", "what", "step", "value", "limit", "remedy"} <= document["error"].keys()
    assert document["reason"] and document["error"]["step"] and document["error"]["remedy"]


@pytest.mark.parametrize(
    ("error", "value"),
    [
        (OSError(27, "File too large"), "--json"),
        (ConfigurationError(file="a.toml", key="files", value=None, expected="a pattern"), "nothing"),
        (UsageError("no number", step="command line", value=float("nan"), limit="0 ... 1", remedy="give one"), "nan"),
    ],
)
def test_a_value_is_named_also_where_none_was_seen(capsys, error, value):
    _, document = leave(capsys, of=raising(error))
    assert value in document["error"]["value"]


@pytest.mark.parametrize(
    ("number", "remedy"),
    [(errno.EROFS, "make its disk writable"), (errno.ENOSPC, "make room"), (errno.EACCES, "give another")],
)
def test_the_remedy_of_a_file_in_the_way_is_that_of_its_kind(capsys, number, remedy):
    _, document = leave(capsys, of=raising(OSError(number, os.strerror(number), "/somewhere/file")))
    assert document["error"]["remedy"].startswith(remedy) and document["error"]["value"] == "/somewhere/file"


@pytest.mark.skipif(not pathlib.Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_document_that_its_target_cannot_take_is_told_at_the_terminal(monkeypatch, capsys):
    with pathlib.Path("/dev/full").open("w", encoding="utf-8") as full, pytest.raises(SystemExit) as left:
        monkeypatch.setattr("sys.stdout", full)
        try:
            run_to_exit(app, ["drives", "list", "--json"])
        finally:
            monkeypatch.undo()
            with contextlib.suppress(OSError):
                full.close()
    assert left.value.code == 5
    assert "No space left on device" in capsys.readouterr().err


@pytest.fixture
def archive(tmp_path):
    """A run folder with nothing sound in it."""
    folder = tmp_path / ONE_RUN
    folder.mkdir()
    (folder / "journal.jsonl").write_text('{"n": 0, "utc": "x", "kind": "job", "record": 3}\n')
    return folder


@pytest.mark.parametrize("name", ["request.json", "snapshot.json"])
@pytest.mark.parametrize("content", ["nonsense", "{}", "[1]", '{"url": 5, "profile": "simulated", "nameplate": 7}'])
@pytest.mark.parametrize(
    "verb", [("runs", "show"), ("runs", "report"), ("runs", "export"), ("replay",), ("restore", "--yes")]
)
def test_a_damaged_archive_is_refused_by_name(capsys, archive, name, content, verb):
    (archive / name).write_text(content)
    target = [archive / "x.csv"] if verb == ("runs", "export") else []
    code, document = leave(capsys, *verb, "last", *target, "--runs", archive.parent)
    assert code == (0 if verb == ("runs", "show") else 3), document
    assert code == 0 or "defect" not in document["reason"]


@pytest.mark.parametrize(("verb", "goes_on"), [("study", "--resume"), ("demo", "start again")])
def test_who_stops_a_verb_is_told_how_it_goes_on(verb, goes_on):
    stopped = failures._stopped([verb, "campaign.toml"])
    assert (stopped.exit_code, stopped.what) == (4, "stopped by the operator")
    assert goes_on in stopped.remedy and str(stopped.step).startswith(verb)


@pytest.mark.parametrize(
    "arguments",
    [
        ("simulate", "motor_2kw2", "--out", "x.txt"),
        ("simulate", "motor_2kw2", "--out", "x.csv", "--seconds", "-1"),
        ("simulate", "motor_2kw2", "--out", "x.csv", "--seconds", "1e9"),
        ("simulate", "motor_2kw2", "--out", "x.csv", "--axes", "nan"),
        ("demo", "--scenario", "nowhere"),
        ("demo", "--speed", "fast"),
        ("identify", "x.csv", "--write-back"),
        ("identify", "x.csv", "--write-back", "--drive", "tcp://127.0.0.1:1", "--profile", "danfoss_fc302"),
    ],
)
def test_a_call_that_cannot_be_right_is_a_usage_error(capsys, arguments):
    code, document = leave(capsys, *arguments)
    assert (code, document["outcome"]) == (2, "usage")


@pytest.mark.parametrize(
    ("arguments", "said"), [((), "demo"), (("runs",), "verify"), (("--version",), "commissioner ")]
)
def test_a_call_without_arguments_ends_in_the_help_and_a_version_is_told(capsys, arguments, said):
    with pytest.raises(SystemExit) as left:
        run_to_exit(app, list(arguments))
    assert (left.value.code or 0) == 0
    assert said in capsys.readouterr().out


def test_the_last_argument_hides_its_secret_and_an_option_without_one_hides_nothing():
    assert Secrets(["check", "--password"]).hide("check") == "check"
    assert Secrets(["--password", "hunter2"]).hide("with hunter2") == "with ***"
    assert (
        Secrets(["--password-file", "missing.txt"]).hide("missing.txt cannot be used") == "missing.txt cannot be used"
    )
    assert Secrets([]).hide("anything") == "anything"


def waiting_verb(pipe):
    """A verb that waits at the pipe that it was given for its input."""
    os.mkfifo(pipe)
    script = COMMAND[-1].replace(
        "main()",
        "import commissioner.cli.verbs.archived.runs as r; r.list_runs = lambda archive, **_: open(archive.runs).read(); main()",
    )
    call = [*COMMAND[:-1], script, "runs", "list", "--runs", str(pipe), "--json"]
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job starts deaf to it
    try:
        return subprocess.Popen(call, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize(("arguments", "code"), [(("docs",), 0), (("simulate", "motor_2kw3", "--out", "x.csv"), 2)])
def test_a_verb_whose_reader_has_gone_ends_with_its_own_exit_code(arguments, code):
    """`| head` closes the pipe: 1 is no code of ours."""
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "wb") as pipe:
        assert (
            subprocess.run([*COMMAND, *arguments], check=False, stdout=pipe, stderr=pipe, timeout=60).returncode == code
        )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_verb_with_four_and_one_document(tmp_path, number):
    process = waiting_verb(tmp_path / "pipe")
    with (tmp_path / "pipe").open("w"):  # opens once the verb reads, and wakes it when it closes
        process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 4, err
    assert json.loads(out)["outcome"] == "aborted" and "Traceback" not in err


def test_signals_until_the_process_has_ended_change_nothing(tmp_path):
    """Ctrl-C again and again, while the first is answered and while the interpreter ends."""
    process = waiting_verb(tmp_path / "pipe")
    with (tmp_path / "pipe").open("w"):
        sent = 0
        while process.poll() is None:
            process.send_signal(signal.SIGINT)
            sent += 1
            time.sleep(0.0005)
    out, err = process.communicate(timeout=60)
    assert sent > 3
    assert process.returncode == 4, err
    assert json.loads(out)["outcome"] == "aborted" and "Traceback" not in err


def test_a_signal_behind_the_end_of_a_run_is_not_answered(capsys):
    made = typer.Typer()

    @made.command()
    def verb(as_json: bool = typer.Option(False, "--json")):
        let_end()
        signal.raise_signal(signal.SIGINT)
        screen.emit({"outcome": "commissioned"})

    assert leave(capsys, of=made) == (0, {"outcome": "commissioned"})


def test_a_second_ctrl_c_while_the_first_is_answered_is_no_other_end(capsys, monkeypatch):
    plain = failures._stopped

    def interrupted(*_arguments):
        monkeypatch.setattr(failures, "_stopped", plain)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(failures, "_stopped", interrupted)
    code, document = leave(capsys, of=raising(KeyboardInterrupt()))
    assert (code, document["outcome"]) == (4, "aborted")


@pytest.mark.parametrize(
    "arguments",
    [
        ("check", "--drive", "tcp://bob:hunter2@127.0.0.1:1", "--bogus"),
        ("check", "tcp://bob:hunter2@127.0.0.1:1"),
        ("check", "--drive", "bob:hunter2@127.0.0.1:1", "--motor", "motor_2kw2"),
        ("check", "--drive=bob:hunter2@127.0.0.1:1", "--motor", "motor_2kw2"),
        ("check", "--drive", ":hunter2@127.0.0.1", "--motor", "motor_2kw2"),
        ("check", "--drive", "tcp://bob:%68unter2@h@127.0.0.1:1", "--motor", "motor_2kw2"),
        ("check", "--drive", "tcp://127.0.0.1:1", "--password", "hunter2"),
        ("check", "--drive", "tcp://127.0.0.1:1", "--password=hunter2"),
        ("check", "hunter2", "--api-token", "hunter2"),
        ("hunter2", "--pwd=hunter2"),
        (
            "check",
            "--drive",
            "tls://127.0.0.1:1?cert=/etc/hostname&k%65y=/home/hunter2/key.pem",
            "--motor",
            "motor_2kw2",
        ),
        ("check", "--motor", "bob:hunter2@127.0.0.1:1", "--drive", "tcp://127.0.0.1:1"),
        ("identify", "tcp://bob:hunter2@127.0.0.1:1", "--motor", "motor_2kw2"),
    ],
)
@pytest.mark.parametrize("as_json", [True, False])
def test_a_call_that_is_refused_does_not_repeat_the_password_in_it(capsys, monkeypatch, arguments, as_json):
    monkeypatch.setenv("COLUMNS", "300")
    if as_json:
        code, document = leave(capsys, *arguments)
        said = json.dumps(document)
    else:
        with pytest.raises(SystemExit) as left:
            run_to_exit(app, list(arguments))
        code, said = left.value.code, "".join(capsys.readouterr())
    assert code == 2, said
    assert said and "hunter2" not in said and "%68unter2" not in said


def test_the_file_about_a_defect_holds_no_password_either(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    made = typer.Typer()

    @made.command()
    def verb(drive: str = typer.Option(""), as_json: bool = typer.Option(False, "--json")):
        raise ZeroDivisionError(f"cannot divide {drive}")

    _, document = leave(capsys, "--drive", "tcp://bob:hunter2@127.0.0.1:1", of=made)
    (file,) = tmp_path.iterdir()
    assert "ZeroDivisionError" in file.read_text() and "127.0.0.1" in file.read_text()
    assert "hunter2" not in file.read_text() + json.dumps(document)


def test_what_is_no_secret_is_shown_as_it_was():
    hide = Secrets(["check", "--drive", "tcp://bob:e@127.0.0.1:1", "--motor", "C:/a@b.toml"]).hide
    assert hide({"what": ["the drive tcp://bob:e@127.0.0.1:1", 3.0, None]}) == {
        "what": ["the drive tcp://***@127.0.0.1:1", 3.0, None]
    }
    assert hide("every e stays") == "every *** stays"
    assert (
        Secrets(["check", "--drive", "tcp://127.0.0.1:1"]).hide("check tcp://127.0.0.1:1") == "check tcp://127.0.0.1:1"
    )


@pytest.mark.parametrize(
    "verb", [("identify",), ("diagnose",), ("monitor",), ("recordings", "import"), ("simulate", "--plain")]
)
def test_a_folder_given_for_a_file_is_called_one(verb, tmp_path):
    folder = tmp_path / "recordings.json"
    folder.mkdir()
    done = call(*verb, str(folder), *(("--out", str(tmp_path / "x.csv")) if verb[0] == "simulate" else ()))
    assert done.code == 2 and "is a folder" in " ".join(done.stderr.split()), done.stderr


@pytest.mark.parametrize("verb", [("runs", "show"), ("runs", "verify"), ("replay",), ("runs", "report")])
def test_the_last_run_of_an_empty_archive_is_told_as_such(verb, tmp_path):
    done = call(*verb, "last", "--runs", str(tmp_path))
    assert done.code == 2 and "there is no run in" in " ".join(done.stderr.split()), done.stderr


def test_a_call_that_cannot_be_read_names_step_value_limit_and_remedy(capsys):
    with pytest.raises(SystemExit) as left:
        run_to_exit(app, ["runs", "list", "--nope"])
    said = " ".join(capsys.readouterr().err.split())
    assert left.value.code == 2
    assert "No such option: --nope" in said
    assert (
        "step command line value runs list --nope limit commissioner runs list [OPTIONS] remedy `commissioner runs list --help`"
        in said
    )


def test_what_was_not_there_has_a_value_too(capsys):
    nothing = DataRefused("the metadata lack pole_pairs", step="plate", value=None, limit="a number", remedy="add it")
    _, document = leave(capsys, of=raising(nothing))
    assert document["error"]["value"] == "nothing"


@pytest.mark.parametrize("verb", [("runs", "index"), ("runs", "index", "--rebuild"), ("runs", "verify", "--all")])
def test_a_folder_that_is_not_there_is_a_wrong_call(verb, capsys, tmp_path):
    code, document = leave(capsys, *verb, "--runs", tmp_path / "none")
    assert (code, document["outcome"]) == (2, "usage") and "no folder" in document["reason"]


def test_a_drive_with_a_test_mode_can_be_played_another_cannot(capsys, tmp_path):
    played = [leave(capsys, "simulate", drive, "--seconds", "0.2", "--out", tmp_path / "x.csv") for drive in
              ("simulated", DRIVES_FOLDER / "simulated.toml", "motor_2kw2")]  # fmt: skip
    assert [code for code, _ in played] == [0, 0, 0] and len({done["samples"] for _, done in played}) == 1
    code, refused = leave(capsys, "simulate", "danfoss_fc302", "--out", tmp_path / "y.csv")
    assert (code, refused["error"]["limit"]) == (2, "a drive with the capability `excite`, or a motor")


@pytest.mark.parametrize("name", ["x.csv", "x.csv.gz", "x.parquet"])
def test_a_file_that_cannot_be_written_is_named_as_it_was_given(capsys, tmp_path, name):
    out = tmp_path / "no_folder" / name
    code, refused = leave(capsys, "simulate", "motor_2kw2", "--seconds", "0.2", "--out", out)
    assert (code, refused["error"]["value"]) == (2, str(out)) and ".part" not in refused["reason"]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_the_command_is_taken_of_whatever_identify_reads(capsys, tmp_path, encoding):
    model = ("simulate", "motor_2kw2", "--seconds", "0.2", "--axes", "0")
    leave(capsys, *model, "--out", tmp_path / "first.csv")
    contract = (tmp_path / "first.csv").read_text("utf-8")
    foreign = contract.replace(",", ";").replace(".", ",").replace("time_s", "Zeit [s]")
    (tmp_path / "foreign.csv").write_text(foreign, encoding=encoding)
    code, done = leave(capsys, *model, "--like", tmp_path / "foreign.csv", "--out", tmp_path / "again.csv")
    assert code == 0 and (tmp_path / "again.csv").read_text("utf-8") == contract, done


def test_a_question_that_nobody_can_answer_says_how_to_answer_it(monkeypatch, capsys):
    """With the input at its end the remedy is a terminal or --yes, not to try again."""
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    asking = typer.Typer()
    asking.command()(lambda: typer.confirm("Energise?"))
    with pytest.raises(SystemExit) as left:
        run_to_exit(asking, [])
    told = capsys.readouterr().err
    assert left.value.code == 4
    assert "nobody answered" in told and "--yes" in told


def test_a_time_that_nobody_knows_is_said_so_and_a_known_one_in_seconds():
    assert screen.seconds(46.94, " in all") == "46.9 s in all"
    assert screen.seconds(None, " in all") == "for how long is not known"


def test_a_list_loses_no_letter_of_a_word_wider_than_its_column(capsys):
    row = ("20261128-163213-schneider_atv340-3d243a", "✓ commissioned, restored since", "SIM-INV-7A #20250117")
    narrow = Console(width=60, file=io.StringIO())
    narrow.print(screen.table("", ("run", "outcome", "drive"), [row]))
    assert isinstance(narrow.file, io.StringIO)
    shown = narrow.file.getvalue()
    assert "…" not in shown and row[0] in shown
    assert sorted("".join(shown.split())) == sorted("".join(("run", "outcome", "drive", *row)).replace(" ", ""))


def latin(text):
    """As a terminal of another encoding hands it over."""
    return text.encode("latin-1").decode("utf-8", "surrogateescape")


@pytest.mark.parametrize("argument", ["Süd", "--tag=Süd", "tcp://süd"])
def test_a_word_in_another_encoding_is_refused_before_anything_begins(capsys, argument):
    """A run was made, and archived as one on `S?d`."""
    code, said = leave(capsys, "run", "--tag", latin(argument))
    assert code == 2 and said["error"]["step"] == "command line" and "is no text here" in said["reason"]
    assert "udcfc" in said["error"]["value"] and "encoding" in said["error"]["remedy"]


def test_a_folder_of_another_encoding_keeps_an_archive(capsys, tmp_path):
    """What names no text is a folder all the same: the list is made, and its runs are found."""
    runs = tmp_path / latin("Süd")
    runs.mkdir()
    assert leave(capsys, "runs", "list", "--runs", runs) == (0, {"runs": [], "total": 0})
    assert leave(capsys, "runs", "index", "--rebuild", "--runs", runs)[0] == 0


def test_a_defect_that_shows_no_text_is_reported_all_the_same(capsys):
    code, said = leave(capsys, of=raising(ValueError(latin("Süd"))))
    assert code == 5
    report = pathlib.Path(said["error"]["remedy"].rpartition(" ")[2])
    assert "udcfc" in report.read_text("utf-8")
    report.unlink()


def test_who_said_yes_is_not_sent_to_say_yes(capsys):
    """An assisted tuning asks what `--yes` does not answer."""
    asking = typer.Typer()

    @asking.command()
    def tune(yes: bool = typer.Option(False, "--yes"), as_json: bool = typer.Option(False, "--json")):
        raise typer.Abort

    code, said = leave(capsys, "--yes", of=asking)
    assert code == 4 and "what a person does at the drive" in said["error"]["remedy"]
    assert "`--yes` answers" in leave(capsys, of=asking)[1]["error"]["remedy"]
