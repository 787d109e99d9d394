"""A port through which parameters behind a mailbox are read and written as if they stood in registers of their own.

Their addresses lie beyond every register (`registers.mailbox`); all others go through as they are. A question is put again
where its answer was lost, as a register is read again; what is written never is.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from commissioner.errors import ReplyTimeout
from commissioner.link.wire.port import LinkStats, Port, Words, ask_again
from commissioner.registers.mailbox import HEAD, UNDER_WAY, answered, not_yet, request
from commissioner.registers.profile import DriveProfile, Item, Mailbox

EVERY_S = 0.02


def behind_mailbox(
    port: Port,
    profile: DriveProfile,
    sleep: Callable[[float], None] = time.sleep,
    clock: Callable[[], float] = time.monotonic,
) -> Port:
    """The port itself where the drive file has no mailbox."""
    return port if profile.mailbox is None else MailboxPort(port, profile, profile.mailbox, sleep, clock)


class MailboxPort:
    """A `Port` on another one."""

    def __init__(
        self,
        port: Port,
        profile: DriveProfile,
        box: Mailbox,
        sleep: Callable[[float], None],
        clock: Callable[[], float],
    ) -> None:
        self._port, self._box, self._sleep, self._clock = port, box, sleep, clock
        self._behind = {item.address: item for item in profile.items.values() if item.parameter is not None}
        self._reference = 0
        self.stats: LinkStats = port.stats
        self.reply_timeout_s: float = port.reply_timeout_s

    @property
    def read_retries(self) -> int:
        return self._port.read_retries

    @read_retries.setter
    def read_retries(self, retries: int) -> None:
        self._port.read_retries = retries

    @property
    def patience_s(self) -> float:
        return self._port.patience_s

    @patience_s.setter
    def patience_s(self, seconds: float) -> None:
        self._port.patience_s = seconds

    def read(self, address: int, count: int) -> Words:
        item = self._behind.get(address)
        if item is None:
            return self._port.read(address, count)
        return ask_again(lambda: self._ask(item), self.read_retries, self.patience_s, self._clock)

    def write(self, address: int, values: Sequence[int]) -> None:
        item = self._behind.get(address)
        if item is None:
            self._port.write(address, values)
        else:
            self._ask(item, values)

    def exchange(
        self, write_address: int, values: Sequence[int], read_address: int, count: int, *, proves_itself: bool = False
    ) -> Words:
        if write_address not in self._behind and read_address not in self._behind:
            return self._port.exchange(write_address, values, read_address, count, proves_itself=proves_itself)
        self.write(write_address, values)
        return self.read(read_address, count)

    def write_coil(self, address: int, value: bool) -> None:
        self._port.write_coil(address, value)

    def read_coil(self, address: int) -> bool:
        return self._port.read_coil(address)

    def doubt(self) -> None:
        self._port.doubt()

    def close(self) -> None:
        self._port.close()

    def _ask(self, item: Item, value: Sequence[int] = ()) -> Words:
        """One parameter request, waited for. ReplyTimeout: the drive gave no answer in the mailbox's time."""
        self._reference = self._reference % 0xFF + 1
        self._port.write(self._box.address, request(self._box, item, self._reference, value))
        end = self._clock() + self._box.within_s
        while (seen := self._port.read(self._box.address, HEAD + item.words))[0] == UNDER_WAY:
            if self._clock() > end:
                raise ReplyTimeout(
                    not_yet(item), step="ask through the mailbox", value="still under way",
                    limit=f"an answer within {self._box.within_s:g} s", remedy="see whether another master uses the mailbox",
                )  # fmt: skip
            self._sleep(EVERY_S)
        return answered(self._box, item, self._reference, seen, writes=bool(value))
