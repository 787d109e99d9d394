"""A drive file as the drive itself would have it: where each value lives, how it is counted, what it takes at once."""

from __future__ import annotations

import struct
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parents[2] / "config" / "drives"
OWN = 1 << 20
"""Addresses from here on are no registers: what stands behind a mailbox."""
CODES = {"u16": "H", "i16": "h", "u32": "I", "i32": "i", "f32": "f"}


@dataclass(frozen=True)
class Cell:
    """One value of the drive: its first register on the wire and how it is counted there."""

    name: str
    address: int
    code: str
    scale: float
    is_low_word_first: bool
    is_writable: bool
    needs_stop: bool
    convention: str
    unit: str
    parameter: int | None = None
    """Its number where it stands behind the mailbox; `address` is then of this emulation's own, beyond every register."""
    index: int = 0

    @property
    def width(self) -> int:
        return struct.calcsize(">" + self.code) // 2

    def to_words(self, value: float) -> list[int]:
        """The words of a value in the cell's unit; clipped to what the register holds."""
        raw: float = value / self.scale
        if self.code != "f":
            bits = 16 * self.width
            low, high = (0, 2**bits - 1) if self.code.isupper() else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
            raw = min(max(round(raw), low), high)
        packed = struct.pack(">" + self.code, raw)
        words = list(struct.unpack(f">{self.width}H", packed))
        return words[::-1] if self.is_low_word_first else words

    def to_value(self, words: Sequence[int]) -> float:
        ordered = words[::-1] if self.is_low_word_first else words
        raw = struct.unpack(">" + self.code, struct.pack(f">{self.width}H", *ordered))[0]
        return float(raw) * self.scale


@dataclass(frozen=True)
class MailboxFace:
    """The registers through which parameters are asked for, and the data set that stands in the second."""

    address: int
    registers: int
    data_set: int


@dataclass(frozen=True)
class Face:
    """Everything of the file that shows on the wire. `tune`: its raw table, None where it has none."""

    name: str
    title: str
    cells: dict[str, Cell]
    longest_read: int
    longest_write: int
    functions: frozenset[int]
    turnaround_s: float
    device: int
    decoder: str
    bits: dict[str, int]
    stores: tuple[tuple[int, int], ...]
    store_done: tuple[int, int] | None
    store_coil: int | None
    enters: tuple[tuple[int, int], ...]
    parameters: tuple[str, ...]
    tune: dict[str, Any] | None
    unlocks: tuple[tuple[int, int], ...] = ()
    locks: tuple[tuple[int, int], ...] = ()
    busy_code: int | None = None
    mailbox: MailboxFace | None = None


def read_face(name: str) -> Face:
    """The face of `config/drives/NAME.toml`, or of a file by its path. FileNotFoundError: no such drive."""
    path = Path(name) if name.endswith(".toml") else FOLDER / f"{name}.toml"
    document = tomllib.loads(path.read_text(encoding="utf-8"))
    link, store, group = document["link"], document.get("store", {}), document.get("parameters", {})
    base = link["address_base"]
    cells = {}
    for key, entry in document.get("items", {}).items():
        order = entry.get("word_order", link["word_order"])
        parameter, index = entry.get("parameter"), entry.get("index", 0)
        address = entry["address"] - base if parameter is None else OWN + 4 * (parameter * 1000 + index)
        cells[key] = Cell(
            key, address, CODES[entry["type"]], entry.get("scale", 1.0), order == "little",
            "w" in entry["access"], entry.get("needs_stop", False), entry.get("convention", ""), entry.get("unit", ""), parameter, index,
        )  # fmt: skip
    done, unlock, box = store.get("done"), document.get("unlock", {}), document.get("mailbox")
    return Face(
        name=name,
        title=document["drive"]["name"],
        cells=cells,
        longest_read=link["max_read_registers"],
        longest_write=link["max_write_registers"],
        functions=frozenset({1, 3, 5, *link.get("write_functions", [16])}),
        turnaround_s=link["turnaround_s"],
        device=link["device_id"],
        decoder=document["drive"]["status_decoder"],
        bits=document.get("status_bits", {}),
        stores=tuple((a - base, v) for a, v in store.get("writes", [])),
        store_done=(done[0] - base, done[1]) if done else None,
        store_coil=store["coil"] - base if "coil" in store else None,
        enters=tuple((a - base, v) for a, v in group.get("enter", [])),
        parameters=tuple(group.get("order", [])),
        tune=document.get("tune"),
        unlocks=tuple((a - base, v) for a, v in unlock.get("writes", [])),
        locks=tuple((a - base, v) for a, v in unlock.get("locks", [])),
        busy_code=next(iter(link.get("busy_exceptions", [])), None),
        mailbox=MailboxFace(box["address"] - base, box["registers"], box["data_set"]) if box else None,
    )


def faces() -> list[str]:
    """Every ordinary drive there is a file of."""
    return sorted(p.stem for p in FOLDER.glob("*.toml") if p.stem != "simulated")
