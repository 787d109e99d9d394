"""Why a line did not open, told so that the right thing is looked at first: the port, its settings, the name, or the drive."""

from __future__ import annotations

import errno
import socket
import ssl
from pathlib import Path

from commissioner.errors import LinkUnreachable
from commissioner.link.wire.url import DriveUrl, RtuUrl

NOT_OURS = frozenset({errno.EACCES, errno.EPERM})
"""The port is there and this user may not open it."""
HELD = frozenset({errno.EBUSY, errno.EAGAIN})
"""It is there, and another program has it for itself."""
NO_ROUTE = frozenset({errno.ENETUNREACH, errno.EHOSTUNREACH, errno.ENETDOWN})
NO_SERIAL_PORT = frozenset({errno.ENOTTY, errno.ENODEV, errno.EISDIR})
HANDSHAKE = "handshake operation timed out"
"""What Python's ssl says within a TimeoutError: something listens there and does not speak TLS."""
OUT_OF_DATE = frozenset({9, 10})
"""OpenSSL's X509_V_ERR_CERT_NOT_YET_VALID and X509_V_ERR_CERT_HAS_EXPIRED."""
RENEW = "its certificate is out of date by this computer's clock: have it renewed, or set the clock"
PARITIES = {"N": "no parity", "E": "even parity", "O": "odd parity"}


def unopened(url: DriveUrl, error: Exception, limit: str) -> LinkUnreachable:
    """The failure to raise `from error`. `limit`: what was waited for."""
    what, remedy = (
        _of_serial(url, error) if isinstance(url, RtuUrl) else (f"no connection to {url}", _of_network(error))
    )
    return LinkUnreachable(what, step="connect", value=_said(error), limit=limit, remedy=remedy)


def certificate_remedy(error: ssl.SSLCertVerificationError, otherwise: str) -> str:
    """No other authority helps a certificate that is out of date."""
    return RENEW if getattr(error, "verify_code", None) in OUT_OF_DATE else otherwise


def _of_network(error: Exception) -> str:
    if isinstance(error, ssl.SSLCertVerificationError):
        return certificate_remedy(
            error,
            "its certificate is not accepted: give its authority's PEM file as ca=FILE, and the host by a name that is in the certificate",
        )
    if isinstance(error, ssl.SSLError) or HANDSHAKE in str(error):
        return "what listens there does not take our TLS: check the port and cert= and key=; without TLS it is tcp://HOST:PORT"
    if isinstance(error, socket.gaierror):
        return "this name is not known here: give the drive's number, as tcp://192.168.0.20:502"
    if isinstance(error, ConnectionRefusedError):
        return "nothing listens on this port there: check that Modbus TCP is switched on in the drive, the port, the address and the cable"
    if isinstance(error, OSError) and error.errno in NO_ROUTE:
        return "this computer has no way to that address: check the address, the cable and the network settings of this computer"
    return "check that the drive is powered, the cable, the address and that no other master holds it"


def _of_serial(url: RtuUrl, error: Exception) -> tuple[str, str]:
    """What happened, and what to look at."""
    number = _number(error)
    if number in NO_SERIAL_PORT:
        return f"{url.path} is no serial port", "`commissioner ports` lists the serial ports of this computer"
    if number == errno.EINVAL:
        return (
            f"{url.path} does not take {url.baud} Bd with {PARITIES[url.parity]}",
            "give what the line takes, as ?baud=115200&parity=N; a pseudo-terminal takes parity=N alone",
        )
    if not _is_there(url.path):
        return (
            f"there is no serial port {url.path}",
            "plug the adapter in; `commissioner ports` lists the serial ports of this computer",
        )
    if number in HELD:
        return (
            f"another program holds {url.path}",
            "close the other program, or wait for its end: one alone speaks on a serial line, whichever of its drives it speaks to",
        )
    if number in NOT_OURS or number is None:  # Windows gives no number and refuses a port that is held
        return (
            f"{url.path} cannot be opened by this user, or another program holds it",
            "close the other program; on Linux this user must be in the port's group, often dialout",
        )
    return f"no connection to {url}", "check the adapter, the cable and that no other master holds the line"


def _said(error: Exception) -> str:
    """In words: termios' error is a bare pair of number and words, which would be shown as one."""
    is_pair = len(error.args) == 2 and not isinstance(error, OSError)
    return str(error.args[1]) if is_pair else str(error)


def _number(error: BaseException | None) -> int | None:
    """The system's. pyserial wraps some errors and lets termios' through, of which it is the first argument."""
    while error is not None:
        if error.args and isinstance(error.args[0], int):
            return error.args[0]
        error = error.__context__
    return None


def _is_there(path: str) -> bool:
    from serial.tools.list_ports import comports

    return Path(path).exists() or any(port.device == path for port in comports())
