"""Which drive a URL leads to: one name for one drive, however it is written."""

from __future__ import annotations

import ipaddress
import os
import socket

from commissioner.link.wire.url import DriveUrl, RtuUrl

HERE = "this computer"


def endpoint(url: DriveUrl, device_id: int) -> str:
    """`localhost`, `127.0.0.1`, `::1` and this computer's other names and addresses are one; so are two paths to one port.

    A serial line is one endpoint whatever devices are on it: only one process can speak on it.
    """
    if isinstance(url, RtuUrl):
        return f"serial line {os.path.realpath(url.path)}"
    return f"{canonical_host(url.host)} port {url.port} device {device_id if url.device is None else url.device}"


def canonical_host(host: str) -> str:
    """The lowest address of the host, `HERE` where that is this computer; the name where it has none."""
    try:
        found = {info[4][0] for info in socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)}
    except (OSError, UnicodeError):
        return host.lower().rstrip(".")
    addresses = sorted(str(address).partition("%")[0] for address in found)
    return HERE if any(map(_is_here, addresses)) else addresses[0]


def _is_here(address: str) -> bool:
    """True for an address that a socket of this computer can be bound to."""
    number = ipaddress.ip_address(address)
    if number.is_loopback or number.is_unspecified:
        return True
    try:
        with socket.socket(socket.AF_INET6 if number.version == 6 else socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind((address, 0))
    except OSError:
        return False
    return True
