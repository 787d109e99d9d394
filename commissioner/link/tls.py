"""Modbus Security (MODBUS/TCP Security Protocol Specification v21): secure defaults, verified names."""

from __future__ import annotations

import socket
import ssl
from typing import NoReturn

from pymodbus.client import ModbusTlsClient

from commissioner.errors import UsageError
from commissioner.link.url import TlsUrl


class TlsClient(ModbusTlsClient):
    """pymodbus's TLS client with a deadline on the handshake and the server's name checked, which it leaves out."""

    @classmethod
    def for_url(cls, url: TlsUrl) -> TlsClient:
        return cls(url.host, port=url.port, sslctx=client_context(url), retries=0)

    def connect(self) -> bool:
        """True when the handshake is done. Raises OSError (ssl.SSLError included) with the reason where it fails."""
        if self.socket:
            return True
        wanted = self.comm_params
        plain = socket.create_connection((wanted.host, wanted.port), timeout=wanted.timeout_connect)
        try:
            self.socket = wanted.sslctx.wrap_socket(plain, server_hostname=wanted.host)  # type: ignore[union-attr]
        except BaseException:
            plain.close()
            raise
        return True


def client_context(url: TlsUrl) -> ssl.SSLContext:
    """Server certificate and name verified, TLS 1.2 at least, our certificate shown. UsageError: an unusable file."""
    try:
        context = ssl.create_default_context(ssl.Purpose.SERVER_AUTH, cafile=str(url.ca) if url.ca else None)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        if url.cert and url.key:
            context.load_cert_chain(url.cert, url.key, password=_refuse_password)
    except (ssl.SSLError, OSError) as error:
        raise UsageError(
            f"the TLS files for {url} cannot be used", step="read TLS files", value=str(error),
            limit="PEM files: CA certificates, our certificate and its key", remedy="check ca=, cert= and key=",
        ) from error
    return context


def _refuse_password() -> NoReturn:
    raise UsageError(
        "the TLS key is encrypted", step="read TLS files", value="key=", limit="a key without a pass phrase",
        remedy="give a key file that only this user can read, without a pass phrase",
    )
