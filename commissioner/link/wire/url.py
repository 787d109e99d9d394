"""Drive URLs: `tcp://host:port?device=1`, `tls://host:802?ca=..&cert=..&key=..`, `rtu:///dev/ttyUSB0?baud=115200`, `rtu://COM3`."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import SplitResult, parse_qsl, unquote, urlsplit

from commissioner.errors import UsageError

BAUD_RATES = (1200, 2400, 4800, 9600, 14400, 19200, 38400, 57600, 115200, 230400, 460800, 500000, 921600, 1000000)
WINDOWS_PORT = re.compile(r"COM[1-9]\d{0,2}", re.IGNORECASE)
PARITIES = ("E", "O", "N")
REPLY_TIME = re.compile(r"\d{1,2}(\.\d{1,4})?")


USERINFO = re.compile(
    r"(?:(?<=://)(?!/)|(?:^|(?<==))(?!\w+://)[^\s/:@=]*:)(?:(?!\?(?:device|reply|ca|cert|key)=).)*@", re.DOTALL
)
"""Up to the last @, since a password may hold any character; an @ in an option's value is none of it. Without a scheme only
where a colon stands between user and password."""


@dataclass(frozen=True)
class TcpUrl:
    """Modbus TCP. `device` None: the drive file's, as in the others; `reply_s`: how long an answer may take."""

    host: str
    port: int = 502
    device: int | None = None
    reply_s: float | None = None

    def __str__(self) -> str:
        return f"tcp://{_bracketed(self.host)}:{self.port}"


@dataclass(frozen=True)
class TlsUrl:
    """Modbus Security: TLS with the MBAP header inside. `ca` None: the system's trust store."""

    host: str
    port: int = 802
    device: int | None = None
    ca: Path | None = None
    cert: Path | None = None
    key: Path | None = None
    reply_s: float | None = None

    def __str__(self) -> str:
        return f"tls://{_bracketed(self.host)}:{self.port}"


@dataclass(frozen=True)
class RtuUrl:
    """Modbus RTU on a serial line: 8 data bits, 1 stop bit (2 without parity, as the standard asks, unless said)."""

    path: str
    baud: int = 19200
    parity: str = "E"
    stop_bits: int = 1
    device: int | None = None
    reply_s: float | None = None

    @property
    def character_s(self) -> float:
        """Time of one character: start, 8 data, parity, stop bits."""
        return (1 + 8 + (self.parity != "N") + self.stop_bits) / self.baud

    def __str__(self) -> str:
        return f"rtu://{self.path}"


DriveUrl = TcpUrl | TlsUrl | RtuUrl


def parse_url(text: str) -> DriveUrl:
    """The drive's address. Raises UsageError naming the part that cannot be right."""
    if not text.isprintable():
        raise _refuse(text, "a character that is no text", "printable characters")
    if USERINFO.search(text):
        raise _refuse(text, "a user", "no user, password or fragment")
    try:
        parts = urlsplit(text)
        _ = parts.port
    except ValueError as error:
        raise _refuse(text, str(error), "a port between 1 and 65535") from error
    parsers: dict[str, Callable[[str, SplitResult], DriveUrl]] = {"tcp": _tcp, "tls": _tls, "rtu": _rtu}
    if parts.scheme not in parsers:
        raise _refuse(text, parts.scheme or "no scheme", "tcp://, tls:// or rtu://")
    if parts.username is not None or parts.fragment:
        raise _refuse(text, parts.fragment or "a user", "no user, password or fragment")
    return parsers[parts.scheme](text, parts)


def without_secrets(text: str) -> str:
    """The address as it may be shown and archived: no user, no password, not where certificate and key are."""
    address, mark, query = USERINFO.sub("", text).partition("?")
    shown = [pair for pair in query.split("&") if unquote(pair.partition("=")[0]).lower() not in ("cert", "key")]
    return (address + mark + "&".join(shown)).rstrip("?&") if mark else address


def _tcp(text: str, parts: SplitResult) -> TcpUrl:
    options = _options(text, parts, ("device", "reply"))
    return TcpUrl(
        _host(text, parts), _port(text, parts, 502), _device(text, options, range(256)), _reply(text, options)
    )


def _tls(text: str, parts: SplitResult) -> TlsUrl:
    options = _options(text, parts, ("device", "reply", "ca", "cert", "key"))
    if ("cert" in options) != ("key" in options):
        raise _refuse(text, "cert" if "cert" in options else "key", "cert and key together")
    files = {name: Path(options[name]) for name in ("ca", "cert", "key") if name in options}
    for file in files.values():
        if not file.is_file():
            raise _refuse(text, file.name, "an existing PEM file")
    return TlsUrl(
        _host(text, parts), _port(text, parts, 802), _device(text, options, range(256)), reply_s=_reply(text, options),
        **files,
    )  # fmt: skip


def _rtu(text: str, parts: SplitResult) -> RtuUrl:
    options = _options(text, parts, ("device", "reply", "baud", "parity", "stop"))
    device = _serial_device(parts)
    if not device:
        raise _refuse(
            text, parts.netloc or parts.path, "a serial device: rtu:///dev/ttyUSB0 (three slashes), or rtu://COM3"
        )
    parity = options.get("parity", "E").upper()
    if parity not in PARITIES:
        raise _refuse(text, f"parity={parity}", "E, O or N")
    baud = _whole(text, options, "baud", 19200, BAUD_RATES)
    stop = _whole(text, options, "stop", 2 if parity == "N" and "parity" in options else 1, (1, 2))
    return RtuUrl(device, baud, parity, stop, _device(text, options, range(1, 248)), _reply(text, options))


def _serial_device(parts: SplitResult) -> str:
    """A path behind three slashes, or a Windows port behind two or three; empty where neither stands there."""
    named = unquote(parts.netloc or parts.path.strip("/"))
    if WINDOWS_PORT.fullmatch(named) and parts.path.strip("/") in ("", named):
        return named.upper()
    return "" if parts.netloc or not named else unquote(parts.path)


def _options(text: str, parts: SplitResult, known: tuple[str, ...]) -> dict[str, str]:
    try:
        pairs = parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query))
    except ValueError as error:
        raise _refuse(text, "what stands behind the ?", "name=value pairs joined by &") from error
    for name, value in pairs:
        if name not in known or not value:
            raise _refuse(text, name, "one of these options with a value: " + ", ".join(known))
    if len(dict(pairs)) != len(pairs):
        raise _refuse(text, "an option twice", "each option once")
    return dict(pairs)


def _host(text: str, parts: SplitResult) -> str:
    if not parts.hostname or parts.path not in ("", "/"):
        raise _refuse(text, parts.path or "no host", f"{parts.scheme}://HOST:PORT")
    return parts.hostname.replace("%25", "%")  # RFC 6874: how the zone of fe80::1%eth0 stands in an address


def _port(text: str, parts: SplitResult, default: int) -> int:
    port = default if parts.port is None else parts.port
    if port == 0:
        raise _refuse(text, 0, "a port between 1 and 65535")
    return port


def _device(text: str, options: dict[str, str], allowed: range) -> int | None:
    """On TCP 0 and 255 stand for the device at the address itself; on a serial line 0 is everybody, who does not answer."""
    return _whole(text, options, "device", 0, allowed) if "device" in options else None


def _reply(text: str, options: dict[str, str]) -> float | None:
    """Seconds, above 0 and at most 60."""
    written = options.get("reply")
    if written is None:
        return None
    if not REPLY_TIME.fullmatch(written) or not 0.0 < float(written) <= 60.0:
        raise _refuse(text, f"reply={written}", "seconds above 0, at most 60, as reply=0.8")
    return float(written)


def _whole(text: str, options: dict[str, str], name: str, default: int, allowed: range | tuple[int, ...]) -> int:
    written = options.get(name, str(default))
    if name in options and not (written.isascii() and written.isdecimal() and int(written) in allowed):
        span = f"{allowed[0]} ... {allowed[-1]}" if isinstance(allowed, range) else ", ".join(map(str, allowed))
        raise _refuse(text, f"{name}={written}", span)
    return int(written)


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def _refuse(text: str, value: object, expected: str) -> UsageError:
    return UsageError(
        f"{without_secrets(text)!r} is not a drive's address",
        step="read drive URL",
        value=value,
        limit=expected,
        remedy="write tcp://HOST:PORT?device=1, tls://HOST:802?ca=FILE&cert=FILE&key=FILE "
        "or rtu:///dev/ttyUSB0?baud=115200&parity=E&device=1",
    )
