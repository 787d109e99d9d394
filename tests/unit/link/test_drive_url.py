"""Drive URLs are read strictly; what is wrong is named."""

from pathlib import Path

import pytest

from commissioner.errors import UsageError
from commissioner.link.wire.url import RtuUrl, TcpUrl, TlsUrl, parse_url, without_secrets


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("tcp://192.168.0.7:1502?device=3", TcpUrl("192.168.0.7", 1502, 3)),
        ("tcp://drive.local", TcpUrl("drive.local", 502, None)),
        ("tcp://[::1]:5020/", TcpUrl("::1", 5020, None)),
        ("tcp://[fe80::1%25eth0]", TcpUrl("fe80::1%eth0", 502, None)),
        ("tcp://[fe80::1%eth0]", TcpUrl("fe80::1%eth0", 502, None)),
        ("tls://drive", TlsUrl("drive", 802)),
        ("rtu:///dev/ttyUSB0?baud=115200&parity=E&device=1", RtuUrl("/dev/ttyUSB0", 115200, "E", 1, 1)),
        ("rtu:///dev/ttyUSB0", RtuUrl("/dev/ttyUSB0", 19200, "E", 1, None)),
        ("rtu:///dev/ttyUSB0?parity=n", RtuUrl("/dev/ttyUSB0", 19200, "N", 2, None)),
        ("rtu:///dev/pts/3?parity=N&stop=1", RtuUrl("/dev/pts/3", 19200, "N", 1, None)),
        ("rtu:///tmp/a%20b", RtuUrl("/tmp/a b", 19200, "E", 1, None)),
    ],
)
def test_addresses_are_read(text, url):
    assert parse_url(text) == url


def test_tls_files_must_exist_and_come_in_pairs(tmp_path):
    ca, cert, key = (tmp_path / name for name in ("ca.pem", "cert.pem", "key.pem"))
    for file in (ca, cert, key):
        file.write_text("x")
    url = parse_url(f"tls://drive:802?ca={ca}&cert={cert}&key={key}&device=9")
    assert url == TlsUrl("drive", 802, 9, Path(ca), Path(cert), Path(key))
    assert "pem" not in str(url)
    with pytest.raises(UsageError) as caught:
        parse_url(f"tls://drive?cert={cert}")
    assert caught.value.limit == "cert and key together"
    with pytest.raises(UsageError) as caught:
        parse_url("tls://drive?ca=/nowhere.pem")
    assert "existing" in str(caught.value.limit)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "drive",
        "http://drive",
        "tcp:drive",
        "tcp://",
        "tcp://:502",
        "tcp://drive:0",
        "tcp://drive:70000",
        "tcp://drive:x",
        "tcp://drive/path",
        "tcp://user:pw@drive",
        "tcp://drive#1",
        "rtu:///dev/ttyUSB0?device=0",
        "tcp://drive?device=256",
        "tcp://drive?device=one",
        "tcp://drive?device=",
        "tcp://drive?device=1&device=2",
        "tcp://drive?baud=9600",
        "tcp://drive?device",
        "tcp://[::1",
        "rtu://ttyUSB0",
        "rtu:///",
        "rtu:///dev/x?baud=12345",
        "rtu:///dev/x?parity=M",
        "rtu:///dev/x?stop=3",
        "rtu:///dev/x?host=1",
        "tls://drive?device=1&device=1",
        "tcp://drive?device=١",
        "tcp://\udcff",
        "tcp://drive\0",
    ],
)
def test_what_is_not_an_address_is_refused_with_the_form_that_is(text):
    with pytest.raises(UsageError) as caught:
        parse_url(text)
    assert "tcp://HOST:PORT" in caught.value.remedy
    assert caught.value.limit


def test_a_refused_address_does_not_repeat_its_password():
    with pytest.raises(UsageError) as caught:
        parse_url("tcp://operator:hunter2@drive")
    assert "hunter2" not in str(caught.value.as_dict())
    with pytest.raises(UsageError) as caught:
        parse_url("tcp://drive?password=hunter2")
    assert caught.value.value == "password"


@pytest.mark.parametrize(
    ("text", "kept"),
    [
        ("tcp://drive:502?device=1", "tcp://drive:502?device=1"),
        ("tls://drive?ca=/a.pem&cert=/b.pem&key=/c.pem", "tls://drive?ca=/a.pem"),
        ("tls://drive?key=/c.pem&cert=/b.pem&device=3", "tls://drive?device=3"),
        ("tls://drive?cert=/b.pem&key=/c.pem", "tls://drive"),
        ("tcp://user:pw@drive?device=1", "tcp://drive?device=1"),
        ("tcp://user:p/w@x@drive?device=1", "tcp://drive?device=1"),
        ("tls://drive?k%65y=/c.pem&device=3", "tls://drive?device=3"),
        ("tls://drive?ca=/a@b.pem", "tls://drive?ca=/a@b.pem"),
        ("rtu:///dev/x@1?baud=9600", "rtu:///dev/x@1?baud=9600"),
        ("rtu:///dev/ttyUSB0?baud=9600", "rtu:///dev/ttyUSB0?baud=9600"),
    ],
)
def test_what_is_archived_of_an_address_leads_to_the_drive_and_to_no_secret(text, kept):
    assert without_secrets(text) == kept


def test_a_character_has_eleven_bits_on_a_standard_line():
    assert RtuUrl("/dev/x", 115200).character_s == pytest.approx(11 / 115200)
    assert RtuUrl("/dev/x", 9600, "N", 1).character_s == pytest.approx(10 / 9600)
