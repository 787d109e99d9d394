"""Items of the drive file read and written by name, over as few requests as their registers allow."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping

from commissioner.errors import DriveFault, LinkError, ReplyMismatch, ReplyTimeout, RequestRefused
from commissioner.link.drive.foreign import Watched
from commissioner.link.drive.ordinary.mailbox import behind_mailbox
from commissioner.link.wire.port import MAY_BE_CARRIED_OUT, Port, Words
from commissioner.registers.codec import Value, decode_item, decode_span, encode_span, held_words
from commissioner.registers.profile import DriveProfile, Span, plan_spans


class Items:
    """The drive's items over a port. A value that was written is believed when it has been read back."""

    def __init__(
        self,
        port: Port,
        profile: DriveProfile,
        sleep: Callable[[float], None] = time.sleep,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.port = behind_mailbox(port, profile, sleep, clock)
        self.profile = profile
        self.watched = Watched(profile)

    def read(self, names: Iterable[str]) -> dict[str, Value]:
        """The named items' values; items the drive file does not describe are left out."""
        known = [self.profile.items[name] for name in names if name in self.profile.items]
        values: dict[str, Value] = {}
        for span in plan_spans(known, self.profile.link.max_read_registers):
            values |= decode_span(span, self.port.read(span.address, span.count))
        return values

    def read_number(self, name: str) -> float:
        """One numeric item. Raises UsageError where the file does not describe it."""
        return number(self.read([self.profile.item(name).name])[name])

    def write(self, values: Mapping[str, Value]) -> None:
        """Write without looking: for commands, whose effect is seen in the status."""
        for span in self._spans(values):
            self._write(span, values)

    def give_back(self, name: str, value: Value) -> None:
        """As `write`: a value that was read from the drive, or was seen to fit."""
        for span in self._spans({name: value}):
            self._send(span, {name: value}, encode_span(span, {name: value}, held_words))

    def write_verified(self, values: Mapping[str, Value], step: str) -> None:
        """Write and read back; where the answer was lost, what the drive holds tells whether it was written.

        DriveFault: the drive acknowledged and holds something else.
        """
        spans = self._spans(values)
        lost = [failure for span in spans if (failure := self._try_to_write(span, values)) is not None]
        for span in spans:
            seen = self.port.read(span.address, span.count)
            if lost and seen != encode_span(span, values):
                raise lost[0]
            self._compare(span, seen, values, step)

    def exchange_verified(self, values: Mapping[str, Value], step: str) -> None:
        """As `write_verified`, each span in one transaction: for values that are steered live."""
        for span in self._spans(values):
            words = encode_span(span, values)
            try:
                seen = self.port.exchange(span.address, words, span.address, span.count)
            except (ReplyTimeout, ReplyMismatch):
                self.watched.lost(span, values)
                seen = self.port.read(span.address, span.count)
                if seen != words:
                    raise
            self.watched.wrote(span, values)
            self._compare(span, seen, values, step)

    def same_words(self, name: str, first: Value, second: Value) -> bool:
        """True where both values are the same in the drive's own resolution."""
        item = self.profile.item(name)
        return held_words(item, first) == held_words(item, second)

    def _try_to_write(self, span: Span, values: Mapping[str, Value]) -> LinkError | None:
        """What lost the answer; None where there was one."""
        try:
            self._write(span, values)
        except (ReplyTimeout, ReplyMismatch) as failure:
            return failure
        return None

    def as_held(self, name: str, value: Value) -> Value:
        """The value as the drive's own words hold it."""
        item = self.profile.item(name)
        return decode_item(item, held_words(item, value))

    def _write(self, span: Span, values: Mapping[str, Value]) -> None:
        self._send(span, values, encode_span(span, values))

    def _send(self, span: Span, values: Mapping[str, Value], words: Words) -> None:
        try:
            self.port.write(span.address, words)
        except RequestRefused as refused:
            self.watched.look_again()
            if refused.value not in MAY_BE_CARRIED_OUT or refused.value in self.profile.exceptions:
                raise
        except BaseException:  # it may have arrived all the same
            self.watched.lost(span, values)
            raise
        self.watched.wrote(span, values)

    def _spans(self, values: Mapping[str, Value]) -> tuple[Span, ...]:
        items = [self.profile.item(name) for name in values]
        return plan_spans(items, self.profile.link.max_write_registers)

    def _compare(self, span: Span, seen: Words, values: Mapping[str, Value], step: str) -> None:
        wanted = encode_span(span, values)
        if seen == wanted:
            return
        read = decode_span(span, seen)
        name = next(i.name for i in span.items if not _same(i.address - span.address, i.words, seen, wanted))
        raise DriveFault(
            f"the drive acknowledged {name} = {values[name]} and holds {read[name]}",
            step=step,
            value=read[name],
            limit=values[name],
            remedy="check that the drive file fits the firmware and that no other master writes",
        )


def number(value: Value) -> float:
    """The value as a number; a text or an array where a number was meant is a mistake of the drive file."""
    if isinstance(value, int | float):
        return value
    raise TypeError(f"a number was expected, not {value!r}")


def _same(start: int, count: int, seen: Words, wanted: Words) -> bool:
    return seen[start : start + count] == wanted[start : start + count]
