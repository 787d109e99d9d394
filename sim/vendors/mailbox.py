"""The mailbox of a drive whose parameters stand in no register: PROFIdrive's parameter channel over Modbus, seen from the drive.

Registers in turn: control (1 request, 2 answered), data set and length in bytes, then the request or the answer: reference and
kind, drive object and count, attribute or format and number, parameter, index, value. Source: SINAMICS G120X operating
instructions A5E44751209B AC p. 221 and 253-260.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from sim.vendors.face import Cell, MailboxFace

TAKES_S = 0.06
"""So long the drive has an answer under way."""
FORMAT_OF = {"f": 0x08, "H": 0x06, "h": 0x03, "I": 0x07, "i": 0x04}
NO_PARAMETER, NOT_CHANGEABLE, NO_INDEX, WRONG_TYPE = 0x00, 0x01, 0x03, 0x05
BAD_LENGTH, BAD_SET, NOT_YET = 1, 3, 4


@dataclass
class Mailbox:
    """`take` and `give` are the drive's: words of a cell read, and put (0: taken, else why not)."""

    face: MailboxFace
    cells: dict[str, Cell]
    clock: Callable[[], float]
    give: Callable[[Cell], Sequence[int]]
    take: Callable[[Cell, Sequence[int]], int]

    def __post_init__(self) -> None:
        self._words = [0] * self.face.registers
        self._answer: list[int] = []
        self._ready_s = 0.0

    def covers(self, address: int, count: int) -> bool:
        return self.face.address <= address and address + count <= self.face.address + self.face.registers

    def read(self, address: int, count: int) -> list[int]:
        """The registers now: the answer once it is there."""
        if self._answer and self.clock() >= self._ready_s:
            self._fill(self._answer)
            self._answer = []
        start = address - self.face.address
        return self._words[start : start + count]

    def write(self, address: int, words: Sequence[int]) -> None:
        """A request that begins at the first register is carried out; anything else only stands there."""
        start = address - self.face.address
        self._words[start : start + len(words)] = words
        if start == 0 and words[0] == 1:
            self._answer = self._carried_out(list(words))
            self._ready_s = self.clock() + TAKES_S
            self._fill([1, self.face.data_set << 8, NOT_YET])

    def _fill(self, words: Sequence[int]) -> None:
        self._words[: len(words)] = words

    def _carried_out(self, words: list[int]) -> list[int]:
        data_set, length = divmod(words[1], 256)
        if data_set != self.face.data_set:
            return [2, self.face.data_set << 8, BAD_SET]
        body = words[2:]
        if length != 2 * len(body) or len(body) < 5:
            return [2, self.face.data_set << 8, BAD_LENGTH]
        reference, kind = divmod(body[0], 256)
        error, value = self._parameter(kind, body)
        head = [reference << 8 | (kind | 0x80 if error is not None else kind), body[1]]
        if error is not None:
            head += [0x44 << 8 | 1, error]
        return [2, self.face.data_set << 8 | 2 * (len(head) + len(value)), *head, *value]

    def _parameter(self, kind: int, body: list[int]) -> tuple[int | None, list[int]]:
        """What is wrong, None: nothing; the words of a read value with their format."""
        named = [c for c in self.cells.values() if c.parameter == body[3]]
        if not named:
            return NO_PARAMETER, []
        cell = next((c for c in named if c.index == body[4]), None)
        if cell is None:
            return NO_INDEX, []
        stated = FORMAT_OF[cell.code] << 8 | 1
        if kind == 1:
            return None, [stated, *self.give(cell)]
        if len(body) != 6 + cell.width or body[5] != stated:
            return WRONG_TYPE, []
        return (NOT_CHANGEABLE if not cell.is_writable or self.take(cell, body[6:]) else None), []
