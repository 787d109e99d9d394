"""When may an answer be believed? On TCP and TLS while the connection lives; on a serial line only while it is in step.

Modbus RTU has no transaction number: after one late answer every later request would get its predecessor's. So after
any doubt a serial line is left to fall silent, drained, and proven with a fresh token before the next request. For
`WATCH_S` after that an answer counts only when it was alone on the line and another token came back in step.
On TCP doubt costs the connection: a new one carries no old answer.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

from commissioner.errors import LinkError, ReplyMismatch, ReplyTimeout
from commissioner.link.clients import SerialClient, TcpClient, TlsClient
from commissioner.link.port import LinkStats
from commissioner.link.rtu import SHORTEST_FRAME, find_answers
from commissioner.link.url import RtuUrl

MAX_FRAME_CHARACTERS = 256
WATCH_S = 2.0
ATTEMPTS = 4


class Trust(Protocol):
    """Asked around every request."""

    def ready(self) -> None:
        """Before a request: raises LinkError where no answer could be believed."""
        ...

    def confirm(self) -> None:
        """After an answer: raises ReplyMismatch where it may be another request's."""
        ...

    def doubt(self) -> None:
        """An answer may still be under way."""
        ...


class ConnectionTrust:
    """A connection in doubt is given up; the next request opens another."""

    def __init__(self, client: TcpClient | TlsClient) -> None:
        self._client = client

    def ready(self) -> None:
        pass

    def confirm(self) -> None:
        pass

    def doubt(self) -> None:
        self._client.close()  # type: ignore[no-untyped-call]


class SerialTrust:
    """A serial line: in step, watched, or in doubt. It starts in doubt: the last master may have left answers."""

    def __init__(
        self,
        client: SerialClient,
        url: RtuUrl,
        *,
        turnaround_s: float,
        prove: Callable[[], None],
        stats: LinkStats,
        sleep: Callable[[float], None],
        clock: Callable[[], float],
    ) -> None:
        self._client, self._url = client, url
        self._quiet_s = turnaround_s + MAX_FRAME_CHARACTERS * url.character_s
        self._prove, self._stats = prove, stats
        self._sleep, self._clock = sleep, clock
        self._is_in_doubt = True
        self._watch_until = -math.inf

    def ready(self) -> None:
        if not self._is_in_doubt and self._client.waiting() >= SHORTEST_FRAME:
            self._is_in_doubt = True
        if self._is_in_doubt:
            self._resynchronise()

    def confirm(self) -> None:
        self._expect_one_answer()
        if self._clock() < self._watch_until:
            self._sleep(self._quiet_s)
            self._client.drain()
            self._expect_one_answer()
            self._prove()

    def doubt(self) -> None:
        self._is_in_doubt = True

    def _expect_one_answer(self) -> None:
        """Two answers to one question: which is the right one cannot be told."""
        answers = len(find_answers(bytes(self._client.received), self._client.device))
        if answers > 1:
            self._stats.mismatches += 1
            self._is_in_doubt = True
            raise ReplyMismatch(
                "more than one answer came to one question", step="read the line", value=answers, limit=1,
                remedy="a late answer, an echo or a second master; the line is brought back into step",
            )

    def _resynchronise(self) -> None:
        """Silence, drain, token; again while old answers keep coming. Leaves the line watched."""
        self._stats.resynchronisations += 1
        failure: LinkError | None = None
        for _ in range(ATTEMPTS):
            self._fall_silent()
            try:
                self._prove()
                self._expect_one_answer()
                self._is_in_doubt = False
                self._watch_until = self._clock() + WATCH_S
                return
            except (ReplyTimeout, ReplyMismatch) as error:
                failure = error
        raise ReplyTimeout(
            f"{self._url}: the line does not come into step", step="resynchronise",
            value=failure.what if failure else None, limit=f"a proven answer within {ATTEMPTS} attempts",
            remedy="check device number, baud rate, parity, cable and termination, and that there is one master only",
        ) from failure

    def _fall_silent(self) -> None:
        """Until nothing came for one turn-around and one longest frame; what came is thrown away."""
        for _ in range(ATTEMPTS):
            self._sleep(self._quiet_s)
            if not self._client.drain():
                return
