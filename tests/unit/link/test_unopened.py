"""A line that does not open: what is named is what to look at."""

import errno
import socket
import ssl
from contextlib import closing

import pytest

from commissioner.errors import LinkUnreachable
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.modbus import open_port
from commissioner.link.wire.unopened import unopened
from commissioner.link.wire.url import parse_url
from commissioner.service.page.texts import Texts


def refused(url):
    with (
        pytest.raises(LinkUnreachable) as failure,
        closing(open_port(parse_url(url), load_profile("simulated"), reply_timeout_s=0.1)),
    ):
        pass
    return failure.value


def test_a_port_that_is_not_there():
    failure = refused("rtu:///dev/ttyUSB99?parity=N")
    assert failure.what == "there is no serial port /dev/ttyUSB99"
    assert "commissioner ports" in failure.remedy


def test_a_file_that_is_no_port(tmp_path):
    (tmp_path / "x").write_text("")
    assert refused(f"rtu://{tmp_path}/x?parity=N").what == f"{tmp_path}/x is no serial port"


def test_settings_that_a_line_does_not_take():
    """What termios says of a pseudo-terminal with parity; pyserial lets it through, the number its first argument."""
    failure = unopened(parse_url("rtu:///dev/pts/7"), Exception(errno.EINVAL, "Invalid argument"), "an open line")
    assert failure.what == "/dev/pts/7 does not take 19200 Bd with even parity"
    assert "parity=N" in failure.remedy
    assert failure.value == "Invalid argument", "no pair of number and words"


@pytest.mark.parametrize("number", [errno.EBUSY, errno.EAGAIN])
def test_a_line_that_another_program_holds_is_no_matter_of_permission(tmp_path, number):
    """Two drives on one line, and two programs: who was refused was sent to look for a group of users."""
    failure = unopened(parse_url(f"rtu://{tmp_path}?device=2"), OSError(number, "busy"), "an open line")
    assert failure.what == f"another program holds {tmp_path}"
    assert "whichever of its drives" in failure.remedy
    assert "group" not in failure.remedy


@pytest.mark.parametrize("error", [PermissionError(errno.EACCES, "denied"), OSError("PermissionError(13)")])
def test_a_port_that_this_user_may_not_open_or_that_somebody_holds(tmp_path, error):
    failure = unopened(parse_url(f"rtu://{tmp_path}"), error, "an open line")
    assert "another program holds it" in failure.what


def test_a_drive_that_does_not_listen_and_a_name_that_nobody_knows():
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        port = closed.getsockname()[1]
        assert "nothing listens on this port" in refused(f"tcp://127.0.0.1:{port}").remedy
    assert (
        "name is not known" in unopened(parse_url("tcp://drive:502"), socket.gaierror(-2, "x"), "an open line").remedy
    )


def test_each_is_told_in_german_too():
    errors = [OSError(number, "x") for number in (errno.ENOTTY, errno.EINVAL, errno.ENOENT, errno.EACCES, errno.EIO)]
    for path in ("/dev/ttyUSB99", "/dev"):
        for error in errors:
            failure = unopened(parse_url(f"rtu://{path}?parity=N"), error, "an open line")
            assert Texts("de").knows(failure.what) and Texts("de").knows(failure.remedy)
    for error in (
        socket.gaierror(-2, "x"),
        ConnectionRefusedError(111, "x"),
        OSError(errno.ENETUNREACH, "x"),
        TimeoutError("x"),
    ):
        assert Texts("de").knows(unopened(parse_url("tcp://drive:502"), error, "an open line").remedy)


@pytest.mark.parametrize(
    ("error", "remedy"),
    [
        (ssl.SSLCertVerificationError("certificate verify failed: self-signed certificate"), "ca=FILE"),
        (ssl.SSLError("WRONG_VERSION_NUMBER"), "without TLS it is tcp://"),
        (TimeoutError("_ssl.c:989: The handshake operation timed out"), "without TLS it is tcp://"),
        (TimeoutError("timed out"), "the drive is powered"),
    ],
)
def test_a_server_that_is_no_tls_or_not_trusted_is_told_from_one_that_is_away(error, remedy):
    assert remedy in unopened(parse_url("tls://localhost:802"), error, "a connection within 2 s").remedy
