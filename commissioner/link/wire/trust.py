"""When may an answer be believed? On TCP and TLS while the connection lives; on a serial line only while it is in step.

Modbus RTU has no transaction number: after one late answer every later request would get its predecessor's. So after
any doubt a serial line is left to fall silent, drained, and proven with a fresh token before the next request. For
`WATCH_S` after that, and as long as an answer of the same shape is owed (`link.wire.debts`), an answer counts only when it
was alone on the line and another token came back in step. On TCP doubt costs the connection: a new one carries no old
answer.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

from commissioner.errors import LinkError, ReplyMismatch, ReplyTimeout, RequestRefused
from commissioner.link.wire.clients import SerialClient, TcpClient, TlsClient
from commissioner.link.wire.debts import Debts, Shape
from commissioner.link.wire.port import LinkStats
from commissioner.link.wire.rtu import SHORTEST_FRAME, find_answers
from commissioner.link.wire.url import DriveUrl, RtuUrl

MAX_FRAME_CHARACTERS = 256
WATCH_S = 2.0
ATTEMPTS = 4


def longest_frames_s(url: DriveUrl) -> float:
    """What a request and an answer of full length take on a serial line; elsewhere they take none."""
    return 2 * MAX_FRAME_CHARACTERS * url.character_s if isinstance(url, RtuUrl) else 0.0


class Trust(Protocol):
    """Asked around every request."""

    def ready(self) -> None:
        """Before a request: raises LinkError where no answer could be believed."""
        ...

    def asked(self, shape: Shape) -> None:
        """A request goes out, whose answer will have this shape."""
        ...

    def is_owed(self, shape: Shape) -> bool:
        """Whether an answer of this shape may come late."""
        ...

    def confirm(self) -> None:
        """After an answer: raises ReplyMismatch where it may be another request's."""
        ...

    def doubt(self) -> None:
        """The answer to what was asked last may still be under way."""
        ...

    def doubt_content(self) -> None:
        """The content of the last answer says that it was another request's."""
        ...


class ConnectionTrust:
    """A connection in doubt is given up; the next request opens another."""

    def __init__(self, client: TcpClient | TlsClient) -> None:
        self._client = client

    def ready(self) -> None:
        pass

    def asked(self, shape: Shape) -> None:
        pass

    def is_owed(self, shape: Shape) -> bool:
        return False

    def confirm(self) -> None:
        pass

    def doubt(self) -> None:
        self._client.close()  # type: ignore[no-untyped-call]

    def doubt_content(self) -> None:
        """The transaction number has proven whose answer it was."""


class SerialTrust:
    """A serial line: in step, watched, or in doubt. It starts in doubt: the last master may have left answers. `busy`: refusals that
    are waited out where the line is proved, for at most `busy_s`."""

    def __init__(
        self,
        client: SerialClient,
        url: RtuUrl,
        *,
        turnaround_s: float,
        prove: Callable[[], None],
        busy: frozenset[int],
        busy_s: float,
        stats: LinkStats,
        sleep: Callable[[float], None],
        clock: Callable[[], float],
    ) -> None:
        self._client, self._url = client, url
        self._quiet_s = turnaround_s + MAX_FRAME_CHARACTERS * url.character_s
        self._prove, self._stats = prove, stats
        self._busy, self._busy_s = busy, busy_s
        self._sleep, self._clock = sleep, clock
        self._debts = Debts(clock)
        self._asked: Shape = ()
        self._is_in_doubt = True
        self._has_echo = False
        self._watch_until = -math.inf

    def ready(self) -> None:
        if not self._is_in_doubt and self._client.waiting() >= SHORTEST_FRAME:
            self._client.received = bytearray()  # its answer was believed and pays no debt
            self._is_in_doubt = True
        if self._is_in_doubt:
            self._resynchronise()

    def asked(self, shape: Shape) -> None:
        self._asked = shape

    def is_owed(self, shape: Shape) -> bool:
        return self._debts.is_owed(shape)

    def confirm(self) -> None:
        self._expect_one_answer()
        if self._clock() < self._watch_until or any(map(self._debts.may_be_late, self._answers())):
            self._sleep(self._quiet_s)
            self._client.drain()
            self._expect_one_answer()
            self._prove_step()

    def doubt(self) -> None:
        self._debts.owe(self._asked)
        self._is_in_doubt = True

    def doubt_content(self) -> None:
        self.doubt()

    def _answers(self) -> list[bytes]:
        """What came since the last request was sent."""
        return find_answers(bytes(self._client.received), self._client.device)

    def _expect_one_answer(self) -> None:
        """Two answers to one question: which is the right one cannot be told."""
        answers = len(self._answers())
        if answers > 1:
            self._stats.mismatches += 1
            self.doubt()
            raise ReplyMismatch(
                "more than one answer came to one question",
                step="read the line",
                value=answers,
                limit=1,
                remedy="a late answer, an echo, a second master or two devices of one number; the line is brought back into step",
            )

    def _prove_step(self) -> None:
        """A late refusal in the token's place proves as little as any other late answer. One that says busy is waited out, each time
        with the silence after which nothing old is left: many a drive is busy for a while after every write."""
        end = self._clock() + self._busy_s
        while True:
            try:
                self._prove()
                return
            except RequestRefused as refused:
                if refused.value not in self._busy or self._clock() > end:
                    self.doubt()
                    raise ReplyMismatch(
                        "the token was refused",
                        step="prove the line",
                        value=refused.value,
                        limit="the token back",
                        remedy=f"{refused.remedy}; or a late refusal or a second master: the line is brought back into step",
                    ) from refused
            self._stats.waits += 1
            self._fall_silent()

    def _resynchronise(self) -> None:
        """Silence, drain, token; again while old answers keep coming. Leaves the line watched."""
        self._stats.resynchronisations += 1
        failure: LinkError | None = None
        for _ in range(ATTEMPTS):
            self._fall_silent()
            try:
                self._prove_step()
                self._expect_one_answer()
                self._is_in_doubt = False
                self._watch_until = self._clock() + WATCH_S
                return
            except (ReplyTimeout, ReplyMismatch) as error:
                failure = error
        if self._has_echo:
            raise ReplyTimeout(
                f"{self._url}: the line gives back what this host sends",
                step="resynchronise",
                value="our own request",
                limit="answers of the drive alone",
                remedy="switch off the adapter's echo: on two wires its receiver has to be off while it sends",
            ) from failure
        raise ReplyTimeout(
            f"{self._url}: the line does not come into step",
            step="resynchronise",
            value=failure.value if failure else None,
            limit=f"a proven answer within {ATTEMPTS} attempts",
            remedy=(f"{failure.remedy}; " if failure else "")
            + "check device number, baud rate, parity, termination, and that there is one master only and one device of this number",
        ) from failure

    def _fall_silent(self) -> None:
        """Until nothing came for one turn-around and one longest frame; what came is thrown away and no longer owed."""
        for _ in range(ATTEMPTS):
            self._sleep(self._quiet_s)
            if not self._client.drain():
                break
        self._debts.pay(self._answers())
        self._has_echo |= self._client.hears_itself()
        self._client.received = bytearray()
