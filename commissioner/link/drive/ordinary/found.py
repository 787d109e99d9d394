"""What a drive holds before anything is written: could it be this, read as its file says? Reads only.

A drive file that takes a 32-bit value for a 16-bit one reads its high word as the value, writes the new value there, reads
it back and calls it verified. What gives it away is the value found before: no motor of the plate has it, and read in
another width it would be one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from commissioner.errors import CheckFailed, LinkError
from commissioner.link.drive.items import Items, number
from commissioner.registers.codec import decode_item
from commissioner.registers.profile import Item

MARGIN = 10.0
"""A value found may stem from another motor: it is doubted beyond so many times the limits of this one's plate."""
_OTHER_TYPES: Mapping[str, tuple[tuple[str, str], ...]] = {
    "u16": (("u32", "big"), ("u32", "little")),
    "i16": (("i32", "big"), ("i32", "little")),
    "u32": (("u32", "other"), ("u16", "big")),
    "i32": (("i32", "other"), ("i16", "big")),
    "f32": (("f32", "other"),),
}


@dataclass(frozen=True)
class Implausible:
    """A value that no motor near this plate has. `reading`: how else it would be one; empty where nothing fits."""

    name: str
    value: float
    low: float
    high: float
    unit: str
    reading: str

    def as_error(self) -> CheckFailed:
        hint = f"; {self.reading}" if self.reading else ""
        return CheckFailed(
            f"{self.name} as found in the drive is not plausible for this nameplate{hint}",
            step="look at what the drive holds", value=f"{self.value:.6g} {self.unit}", limit=f"{self.low:.4g} ... {self.high:.4g}",
            remedy="check the item's width, word order, scale and address in the drive file against the keypad; a drive that was "
            "never set up for this motor first needs its own nameplate data or tuning",
        )  # fmt: skip


def implausible(
    items: Items, held: Mapping[str, float], limits: Mapping[str, tuple[float, float]]
) -> list[Implausible]:
    """The held values outside `limits` by more than MARGIN, each read in other widths at the drive as well."""
    out = []
    for name, (low, high) in limits.items():
        if name in held and not _fits(held[name], low, high):
            item = items.profile.item(name)
            out.append(Implausible(name, held[name], low, high, item.unit, _reading(items, item, low, high)))
    return out


def _reading(items: Items, item: Item, low: float, high: float) -> str:
    for other in _readings(item):
        try:
            value = number(decode_item(other, items.port.read(other.address, other.words)))
        except LinkError:
            continue
        if _fits(value, low, high):
            where = "" if other.address == item.address else f" at {other.address}"
            order = f", {other.word_order} word first" if other.words == 2 else ""
            return f"read as {other.type}{where}{order} it would be {value:.6g} {item.unit}"
    return ""


def _readings(item: Item) -> Iterator[Item]:
    if item.parameter is not None:
        return  # the mailbox's answer names its own format
    for kind, order in _OTHER_TYPES.get(item.type, ()):
        opposite = "little" if item.word_order == "big" else "big"
        yield replace(item, type=kind, word_order=opposite if order == "other" else order)
    for shift in (-1, 1):
        if item.address + shift >= 0 and item.address + shift + item.words <= 0x10000:
            yield replace(item, address=item.address + shift)


def _fits(value: float, low: float, high: float) -> bool:
    return low / MARGIN <= value <= high * MARGIN
