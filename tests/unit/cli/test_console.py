"""A console that lacks a sign gets its spelling."""

import io
import sys

import pytest

from commissioner.cli.console import degrade_output
from commissioner.cli.verbs.ports import url_of
from commissioner.link.wire.url import RtuUrl, parse_url


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


@pytest.mark.parametrize("device", ["COM3", "/dev/ttyUSB0", "/dev/serial/by-id/usb-FTDI_FT232R-if00-port0"])
def test_the_url_that_ports_prints_opens_that_port(device):
    url = parse_url(url_of(device))
    assert isinstance(url, RtuUrl)
    assert url.path == device
