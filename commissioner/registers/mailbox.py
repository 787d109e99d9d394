"""Parameters behind a mailbox of registers: PROFIdrive's parameter requests and their answers as words.

    request   control, data set and bytes that follow, reference and what is asked, drive object and 1 parameter,
              attribute and 1 element, number, index; to write also format and 1 value, the value
    answer    control, data set and bytes that follow, reference and what is answered, drive object and 1 parameter,
              format and 1 value, the value

Sources: PROFIdrive profile, parameter channel, as SINAMICS G120X operating instructions A5E44751209B AC p. 221 and 253-258
print it; G220 A5E51781573B AB p. 395.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from commissioner.errors import LinkError, ReplyMismatch, RequestRefused
from commissioner.registers.profile import Item, Mailbox

Words = tuple[int, ...]

BEYOND = 0x10000
"""From here on addresses are no registers."""
_STRIDE = 8
"""Further apart than a value is long: two parameters never share a request."""
START, UNDER_WAY, ANSWERED = 1, 1, 2
READ, WRITE = 1, 2
REFUSED = 0x80
VALUE = 0x10
ERROR_FORMAT = 0x44
HEAD = 5
"""Words of an answer before its value."""
FORMATS: Mapping[str, tuple[int, ...]] = MappingProxyType(
    {"f32": (0x08,), "u16": (0x06, 0x42), "i16": (0x03,), "u32": (0x07, 0x43), "i32": (0x04,)}
)
"""How the drive may call an item's type; the first one is written."""
MAILBOX_ERRORS: Mapping[int, str] = MappingProxyType(
    {
        1: "invalid length",
        2: "not in the drive's present state",
        3: "invalid function code",
        4: "the answer is not there yet",
        5: "general system fault",
    }
)  # fmt: skip


def address_of(parameter: int, index: int) -> int:
    """Where the parameter stands among the addresses of a drive file: beyond every register."""
    return BEYOND + _STRIDE * (parameter * 0x10000 + index)


def request(box: Mailbox, item: Item, reference: int, value: Sequence[int] = ()) -> Words:
    """The words from the mailbox's first register on; with a `value` it is written, else read."""
    assert item.parameter is not None
    asked = WRITE if value else READ
    body: Words = (reference << 8 | asked, box.drive_object << 8 | 1, VALUE << 8 | 1, item.parameter, item.index)
    if value:
        body += (FORMATS[item.type][0] << 8 | 1, *value)
    return (START, box.data_set << 8 | 2 * len(body), *body)


def answered(box: Mailbox, item: Item, reference: int, seen: Sequence[int], *, writes: bool) -> Words:
    """The value's words in a complete answer; none of a write's. RequestRefused: the drive said no, and why.
    ReplyMismatch: another request's answer, or of another format than the file's."""
    if seen[0] != ANSWERED or seen[1] >> 8 != box.data_set:
        raise _mismatch(item, f"{seen[0]}, {seen[1]:04x}h", f"{ANSWERED}, {box.data_set:02x}h and the length")
    if seen[1] & 0xFF == 0:
        raise _refused(item, seen[2], MAILBOX_ERRORS.get(seen[2], "an error without a name"))
    asked = WRITE if writes else READ
    if seen[2] >> 8 != reference or seen[2] & 0x7F != asked:
        raise _mismatch(item, f"{seen[2]:04x}h", f"{reference << 8 | asked:04x}h")
    if seen[2] & REFUSED or (not writes and seen[4] >> 8 == ERROR_FORMAT):
        raise _refused(item, seen[HEAD], box.errors.get(seen[HEAD], "its meaning is not in the drive file"))
    if writes:
        return ()
    if seen[4] >> 8 not in FORMATS[item.type] or seen[4] & 0xFF != 1:
        formats = " or ".join(f"{known:02x}h" for known in FORMATS[item.type])
        raise _mismatch(item, f"format {seen[4] >> 8:02x}h", f"format {formats}, for {item.type}")
    return tuple(seen[HEAD : HEAD + item.words])


def not_yet(item: Item) -> str:
    """What is said where no answer comes."""
    return f"the mailbox gave no answer for {named(item)}"


def named(item: Item) -> str:
    """The item as a person finds it in the vendor's list."""
    return f"parameter {item.parameter}[{item.index}]"


def _mismatch(item: Item, seen: str, wanted: str) -> LinkError:
    return ReplyMismatch(
        f"the mailbox gave another answer than for {named(item)}", step="ask through the mailbox", value=seen, limit=wanted,
        remedy="check the item's parameter, index and type in the drive file, and that no other master uses the mailbox",
    )  # fmt: skip


def _refused(item: Item, code: int, meaning: str) -> LinkError:
    return RequestRefused(
        f"the drive refused {named(item)}: {meaning}", step="ask through the mailbox", value=f"error {code:#04x}",
        limit="a request the drive allows now", remedy="see the error values of PROFIdrive in the drive's manual",
    )  # fmt: skip
