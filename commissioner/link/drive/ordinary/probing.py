"""A first look at an unknown drive: what its registers prove about address base, word order, blocks, gaps and write functions.

Reads only; the one write is a register's own value back into it, and only where the operator allows it. What was not proved is
not said.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from commissioner.errors import LinkError, RequestRefused, UsageError
from commissioner.link.drive.items import number
from commissioner.link.wire.modbus import ModbusPort
from commissioner.registers.codec import decode_item
from commissioner.registers.profile import Item

SCALES = (1.0, 0.1, 0.01, 0.001, 0.0001, 10.0, 100.0)
SAME = 0.005
"""A label is rounded: so near must a register's value be to it."""
LONGEST = 125
FAR = 0xFFF0
LAST = 0xFFFF
MODICON = {40001: 49999, 400001: 465536}
"""First and last holding register where a manual prints the table's 4 before its number, Modbus over serial line's old way."""
TIMES = 20


@dataclass(frozen=True)
class Known:
    """A value that stands on the drive's or the motor's label, and the register that its manual gives for it."""

    name: str
    printed: int
    value: float
    unit: str
    source: str


@dataclass(frozen=True)
class Reading:
    """One way to read a register that gives the label's value."""

    item: Item
    shift: int
    """Wire address minus printed one."""
    value: float


@dataclass(frozen=True)
class Blocks:
    """`longest`: registers in one answered read from a known one; `gap`: what a read across unmapped registers gives."""

    longest: int
    gap: str
    unmapped: str


def readings(port: ModbusPort, known: Known) -> list[Reading]:
    """Every type, word order, scale and shift of the address by which the drive shows the label's value. LinkError: it says nothing at
    all, no refusal either."""
    out: list[Reading] = []
    silence: LinkError | None = None
    has_spoken = False
    for item, shift in _forms(known):
        try:
            words = port.read(item.address, item.words)
        except RequestRefused:
            has_spoken = True
            continue
        except LinkError as silent:
            silence = silent
            continue
        has_spoken = True
        raw = number(decode_item(item, words))
        for scale in SCALES:
            if abs(raw * scale - known.value) <= SAME * abs(known.value):
                out.append(Reading(replace(item, scale=scale), shift, raw * scale))
    if silence is not None and not has_spoken:
        raise silence
    return out


def agreed(found: Sequence[Sequence[Reading]]) -> tuple[int, str] | None:
    """The one shift of addresses and word order by which every label's value is read; None: none, or more than one.

    Values of one register say nothing about the word order: it is `big` then.
    """
    if not found or not all(found):
        return None
    shifts = set.intersection(*({r.shift for r in readings} for readings in found))
    if len(shifts) != 1:
        return None
    shift = shifts.pop()
    wide = [{r.item.word_order for r in readings if r.shift == shift and r.item.words == 2} for readings in found]
    narrow = [any(r.shift == shift and r.item.words == 1 for r in readings) for readings in found]
    needed = [orders for orders, is_narrow in zip(wide, narrow, strict=True) if not is_narrow]
    orders = set.intersection(*needed) if needed else {"big"}
    return (shift, orders.pop()) if len(orders) == 1 else None


def chosen(found: Sequence[Reading], shift: int, order: str) -> Reading:
    """The narrowest reading of one value that fits what was agreed for all."""
    fitting = [r for r in found if r.shift == shift and (r.item.words == 1 or r.item.word_order == order)]
    return min(fitting, key=lambda r: (r.item.words, r.item.scale != 1.0))


def blocks(port: ModbusPort, address: int) -> Blocks:
    """By halving: the longest read that is answered; then what lies behind it, and a register that nobody has."""
    low, high = 1, LONGEST
    while low < high:
        middle = (low + high + 1) // 2
        if _answers(port, address, middle) == "":
            low = middle
        else:
            high = middle - 1
    gap = "none seen" if low == LONGEST else _answers(port, address, low + 1)
    return Blocks(low, gap, _answers(port, FAR, 1) or "it is answered as if it existed")


def write_functions(port: ModbusPort, address: int) -> tuple[int, ...]:
    """By which of 6 and 16 the drive takes its own value of a register back. The operator has allowed it."""
    words = list(port.read(address, 1))
    taken = []
    for function, write in ((6, port.write_register), (16, port.write_registers)):
        try:
            write(address, words)
            taken.append(function)
        except LinkError:
            continue
    if list(port.read(address, 1)) != words:
        raise UsageError(
            "the register does not hold its own value after it was written", step="probe write functions", value=address,
            limit=words[0], remedy="look at it at the keypad and set it back",
        )  # fmt: skip
    return tuple(taken)


def answer_times(port: ModbusPort, address: int) -> tuple[float, float]:
    """Median and longest of some reads, in seconds."""
    took = []
    for _ in range(TIMES):
        began = time.monotonic()
        port.read(address, 1)
        took.append(time.monotonic() - began)
    return sorted(took)[TIMES // 2], max(took)


def _forms(known: Known) -> Iterator[tuple[Item, int]]:
    base = Item(known.name, known.printed, "u16", unit=known.unit, source=known.source)
    for shift in _shifts(known.printed):
        for kind, orders in (
            ("u16", ("big",)),
            ("i16", ("big",)),
            ("u32", ("big", "little")),
            ("f32", ("big", "little")),
        ):
            for order in orders:
                yield replace(base, address=known.printed + shift, type=kind, word_order=order), shift


def _shifts(printed: int) -> list[int]:
    """From zero, from one, and from one behind the table's 4."""
    tables = [-first for first, last in MODICON.items() if first <= printed <= last]
    return [shift for shift in (0, -1, *tables) if 0 <= printed + shift <= LAST]


def _answers(port: ModbusPort, address: int, count: int) -> str:
    """Empty: it is answered; else how it is not."""
    try:
        port.read(address, count)
    except RequestRefused as refused:
        return f"exception {refused.value}"
    except LinkError:
        return "silence"
    return ""
