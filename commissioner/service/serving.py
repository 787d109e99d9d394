"""The process that serves: the socket first, so that its port is known, then uvicorn until a signal."""

from __future__ import annotations

import logging
import queue
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import uvicorn
from filelock import FileLock, Timeout

from commissioner.errors import UsageError
from commissioner.service.application import create_app
from commissioner.service.configuration import Settings, bracketed, check_may_listen
from commissioner.service.parts import make_parts

OPEN_FILES = 10_000
MOST_RECORDS, LAST_WORDS_S = 1000, 1.0
"""Of the log, while the console takes none; so long it may take the last ones."""


def serve_until_stopped(settings: Settings, ready: Callable[[str], None]) -> None:
    """Serve; `ready` is told the address once requests are answered. UsageError: it may not, or cannot, listen there, or another
    service works in its folder."""
    with _alone_in(settings.data):
        _serve(settings, ready)


def _serve(settings: Settings, ready: Callable[[str], None]) -> None:
    _open_more_files()
    parts = make_parts(settings)
    check_may_listen(settings, bool(parts.accounts.all()))
    listening = _listen(settings.host, settings.port)
    port = listening.getsockname()[1]
    url = f"{settings.scheme}://{bracketed(settings.host)}:{port}"
    app = create_app(parts, url=url, ready=lambda: ready(url))
    tls = settings.file.tls
    config = uvicorn.Config(
        app,
        ws="websockets-sansio",
        log_level="warning",
        access_log=False,
        server_header=False,
        date_header=True,
        ssl_certfile=tls.certificate if tls else None,
        ssl_keyfile=tls.key if tls else None,
        ws_ping_interval=1.0,
        ws_per_message_deflate=False,  # a message is a few hundred bytes
        ws_ping_timeout=2.0,
        ws_max_size=65536,
        timeout_graceful_shutdown=8,
        timeout_keep_alive=20,
    )
    with _told_apart(logging.getLogger("uvicorn")):
        _Server(config, parts.closing.set).run(sockets=[listening])


class _Server(uvicorn.Server):
    """Tells the streams that it is closing before it waits for them."""

    def __init__(self, config: uvicorn.Config, closing: Callable[[], None]) -> None:
        super().__init__(config)
        self._closing = closing

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._closing()
        await super().shutdown(sockets)


class _Aside(logging.Handler):
    """Takes records without ever waiting: what finds no place is lost."""

    def __init__(self) -> None:
        super().__init__()
        self.records: queue.Queue[logging.LogRecord | None] = queue.Queue(MOST_RECORDS)

    def emit(self, record: logging.LogRecord) -> None:
        with suppress(queue.Full):
            self.records.put_nowait(record)


@contextmanager
def _told_apart(logger: logging.Logger) -> Iterator[None]:
    """What is logged inside goes to the console by a thread of its own: a terminal that is held (Ctrl-S), or a pipe that nobody reads,
    would else stand the whole service still, STOP included."""
    handlers, aside = logger.handlers, _Aside()

    def tell() -> None:
        while (record := aside.records.get()) is not None:
            for handler in handlers:
                handler.handle(record)

    telling = threading.Thread(target=tell, name="log", daemon=True)
    logger.handlers = [aside]
    telling.start()
    try:
        yield
    finally:
        logger.handlers = handlers
        with suppress(queue.Full):
            aside.records.put_nowait(None)
        telling.join(LAST_WORDS_S)


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Two services would break the chain of one audit, and each would clear away what was uploaded to the other. The system drops
    the lock with the process, however that ends."""
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    lock = FileLock(folder / "service.lock")
    try:
        held = lock.acquire(timeout=0)
    except Timeout:
        raise UsageError(
            f"another service works in {folder}", step="serve", value=str(folder), limit="one service for one folder",
            remedy="use that one's page, or give this one another folder: --runs, or `data` in the file of --config",
        ) from None  # fmt: skip
    with held:
        yield


def _open_more_files() -> None:
    """Each connection is one, and a run that cannot be followed for want of one is stopped; many systems give 256 or 1024."""
    if sys.platform == "win32":  # has no such limit
        return
    import resource

    given, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = OPEN_FILES if most == resource.RLIM_INFINITY else min(OPEN_FILES, most)
    if given != resource.RLIM_INFINITY and given < wanted:
        with suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        listening = socket.create_server((host.strip("[]"), port), family=family, backlog=256)
    except OSError as failure:
        raise UsageError(
            f"nothing can listen on {host}:{port}: {failure.strerror or failure}",
            step="serve",
            value=f"{host}:{port}",
            limit="a free port of this computer",
            remedy="give another --port; 0 picks a free one",
        ) from failure
    return listening
