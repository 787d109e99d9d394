"""A console that lacks a sign gets its spelling."""

import io
import re
import sys

import pytest

from commissioner.cli.console import degrade_output
from commissioner.cli.screens import identification, screen
from commissioner.cli.verbs.ports import url_of
from commissioner.link.wire.url import RtuUrl, parse_url
from commissioner.motor.quantities import FIVE


@pytest.mark.parametrize(
    ("text", "encoding", "seen"),
    [
        ("R_σ 3.7 Ω ± 0.1 %", "ascii", "R_sigma 3.7 ohm +- 0.1 %"),
        ("T_σ → 5 µs", "cp1252", "T_sigma -> 5 µs"),
        ("Prüfstand 4", "ascii", "Prufstand 4"),
        ("电机", "cp1252", "??"),
        ("\udcff", "utf-8", "?"),
    ],
)
def test_a_sign_that_the_console_lacks_is_spelled_out(monkeypatch, text, encoding, seen):
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding=encoding))
    degrade_output()
    sys.stdout.write(text)
    sys.stdout.flush()
    assert raw.getvalue().decode(encoding) == seen


@pytest.mark.parametrize(
    "show", [screen.out.print, lambda text: screen.out.print(screen.table(text, (text,), [(text,)]))]
)
def test_a_control_character_only_shows_wherever_it_stands(capsys, show):
    """The reason of an edited result cleared the screen of whoever looked at it."""
    show("[bold]one[/]\x1b[2J\x9b31m\u202e\ntwo")
    seen = capsys.readouterr().out
    assert "one\\x1b[2J\\x9b31m\\u202e" in seen and "two" in seen and "bold" not in seen
    assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u202e]", seen)


def test_a_file_named_like_markup_is_named(capsys):
    of = {"value": 1.0, "std": 0.1}
    document = {
        "parameters": dict.fromkeys((q.field for q in FIVE), of), "holds_for_stator_flux_wb": 1.0,
        "rated_flux_wb": {"stator_peak": 1.0}, "inverter": {"identified": False}, "axes": [], "duration_s": 1.0,
        "gaps": {"lost_samples": 0, "count": 0}, "findings": [], "remarks": ["[/dim] of [ma]"],
    }  # fmt: skip
    identification.show(document, ["[/red].csv"])
    seen = capsys.readouterr().out
    assert "[/red].csv" in seen and "[/dim] of [ma]" in seen


@pytest.mark.parametrize("device", ["COM3", "/dev/ttyUSB0", "/dev/serial/by-id/usb-FTDI_FT232R-if00-port0"])
def test_the_url_that_ports_prints_opens_that_port(device):
    url = parse_url(url_of(device))
    assert isinstance(url, RtuUrl)
    assert url.path == device


def test_a_remark_has_the_signs_of_the_tables_and_a_file_the_ones_it_had():
    from commissioner.cli.screens.screen import signs

    assert (
        signs("the currents lie +12.7 +- 0.7 us behind the status")
        == "the currents lie +12.7 ± 0.7 µs behind the status"
    )


def test_a_configurations_error_says_each_thing_once(capsys):
    from commissioner.cli.screens.screen import failure
    from commissioner.errors import ConfigurationError

    failure(ConfigurationError(file="m.toml", key="pole_pairs", value=0, expected="pole pairs: 1 or more"))
    shown = " ".join(capsys.readouterr().err.split())
    assert shown.count("1 or more") == 1 and shown.endswith("remedy correct pole_pairs in m.toml")


def test_a_sentence_has_the_signs_of_the_table_above_it():
    from commissioner.cli.screens.screen import signs

    assert (
        signs("6.04 s would narrow L_sigma 0.054 -> 0.051 %, at 60 deg")
        == "6.04 s would narrow L_σ 0.054 → 0.051 %, at 60°"
    )
    assert signs("would have come out as 9.427 ohm instead of 3.728 ohm, R_s") == (
        "would have come out as 9.427 Ω instead of 3.728 Ω, R_s"
    )


def test_columns_stay_in_line_where_signs_are_spelled_out():
    raw = io.BytesIO()
    with io.TextIOWrapper(raw, encoding="cp1252") as console:
        terminal = screen.Terminal(file=console, width=60)
        terminal.print(
            screen.table("", ("", "value"), [("leakage inductance L_σ", "21.5 Ω"), ("stator resistance R_s", "3.7 mH")])
        )
        console.flush()
        lines = raw.getvalue().decode("cp1252").splitlines()
    assert "L_sigma" in lines[1]
    assert lines[1].index("21.5 ohm") == lines[2].index("3.7 mH")


def laid(width, *sentences):
    console = screen.Terminal(width=width, file=io.StringIO(), highlight=False)
    for sentence in sentences:
        console.print(sentence)
    return console.file.getvalue().splitlines()


@pytest.mark.parametrize("width", [40, 80])
@pytest.mark.parametrize(
    ("begin", "beside"), [("  [dim]•[/] ", 4), ("    ", 4), ("  [dim]remedy [/]", 9), ("✓ ", 2), ("", 0)]
)
def test_a_line_goes_on_below_its_own_beginning(width, begin, beside):
    first, *others = laid(width, begin + "word " * 40)
    assert others and all(len(line) <= width for line in (first, *others))
    assert all(line.startswith(" " * beside + "word") for line in others)
    assert sum(line.count("word") for line in (first, *others)) == 40


@pytest.mark.parametrize("quantity", ["4.6 s", "26.33 mH", "125 Hz", "± 0.142 %", "1436 1/min", "2.18 Ω"])
def test_a_number_stays_with_its_unit_wherever_the_line_ends(quantity):
    for width in range(20, 60):
        lines = laid(width, f"  • a longer test would then take {quantity} instead of {quantity}, no more than that")
        assert sum(line.count(quantity) for line in lines) == 2, lines
        assert "\ue000" not in "".join(lines)
    assert quantity in "\n".join(
        laid(60, screen.table("", ("a", "b"), [("word " * 6, f"of it {quantity} are left " * 2)]))
    )


def test_a_path_in_a_line_that_nothing_may_cut_stays_whole():
    console = screen.Terminal(width=20, file=io.StringIO(), highlight=False)
    console.print("report    " + "runs/" * 20 + "report.html", soft_wrap=True)
    assert console.file.getvalue().count("\n") == 1
