"""An answer that trickles in keeps no request beyond its deadline, in plain TCP; TLS uses the same code."""

import socket
import threading
import time

import pytest

from commissioner.errors import ReplyTimeout
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.clients import TcpClient, TlsClient
from commissioner.link.wire.modbus import open_port
from commissioner.link.wire.url import TcpUrl

TIMEOUT_S, PIECE_S = 0.25, 0.08


class Trickle:
    """Answers any request with bytes one by one."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.over = threading.Event()
        self.thread = threading.Thread(target=self.serve)

    def serve(self) -> None:
        line, _ = self.listener.accept()
        with line:
            line.recv(300)
            for k in range(len(self.data)):
                if self.over.wait(PIECE_S):
                    return
                line.sendall(self.data[k : k + 1])

    def __enter__(self):
        self.thread.start()
        return self.listener.getsockname()[1]

    def __exit__(self, *_):
        self.over.set()
        self.thread.join()
        self.listener.close()


def test_bytes_that_trickle_over_tcp_do_not_stretch_the_deadline():
    with Trickle(b"\0\1\0\0\0\x83\1\3\x80" + bytes(128)) as number:
        port = open_port(TcpUrl("127.0.0.1", number), load_profile("simulated"), reply_timeout_s=TIMEOUT_S)
        port.read_retries = 0
        start = time.monotonic()
        with pytest.raises(ReplyTimeout):
            port.read(48, 1)
        took_s = time.monotonic() - start
        port.close()
    assert TIMEOUT_S - 0.01 < took_s < TIMEOUT_S + 0.2


def test_both_kinds_of_connection_keep_the_same_deadline():
    assert TcpClient.recv is TlsClient.recv and TcpClient.send is TlsClient.send
