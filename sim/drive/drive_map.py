"""The wire map as the drive's firmware sees it: which item lives where, and its value as 16-bit words.

Reads the same published TOML as any service would, with code of its own.
"""

from __future__ import annotations

import math
import struct
import tomllib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

MAP_FILE = Path(__file__).parents[2] / "config" / "drives" / "simulated.toml"
FORMATS = {"u16": ">H", "i16": ">h", "u32": ">I", "i32": ">i", "f32": ">f"}


@dataclass(frozen=True)
class Item:
    """One entry of the map. `length` counts registers for text and values for numbers."""

    name: str
    address: int
    kind: str
    length: int
    is_writable: bool
    needs_stop: bool
    lowest: float
    highest: float
    scale: float

    @cached_property
    def words_each(self) -> int:
        return struct.calcsize(FORMATS[self.kind]) // 2 if self.kind != "ascii" else 1

    @cached_property
    def words(self) -> int:
        return self.length * self.words_each

    def encode(self, value: Any) -> list[int]:
        """16-bit words of a raw value (wire units), text, or a list of raw values; high word first."""
        if self.kind == "ascii":
            raw = str(value).encode("ascii", "replace").ljust(2 * self.length, b"\0")[: 2 * self.length]
        else:
            values = value if isinstance(value, list) else [value]
            raw = b"".join(struct.pack(FORMATS[self.kind], v) for v in values)
        return [int.from_bytes(raw[k : k + 2], "big") for k in range(0, len(raw), 2)]

    def decode(self, words: list[int]) -> Any:
        """Raw value (wire units) of these words; a list where the item has several."""
        raw = struct.pack(f">{len(words)}H", *words)
        if self.kind == "ascii":
            return raw.rstrip(b"\0").decode("ascii", "replace")
        if self.length == 1:
            return struct.unpack(FORMATS[self.kind], raw)[0]
        return [v for (v,) in struct.iter_unpack(FORMATS[self.kind], raw)]

    def accepts(self, value: Any) -> bool:
        """No NaN or infinity, and inside the map's limits."""
        if self.kind == "ascii":
            return True
        if isinstance(value, list):
            return all(self._is_inside(v) for v in value)
        return self._is_inside(value)

    def _is_inside(self, value: float) -> bool:
        return math.isfinite(value) and self.lowest <= value <= self.highest


@dataclass(frozen=True)
class DriveMap:
    """The whole file: items by name and by address, the window's place, words and bits."""

    items: dict[str, Item]
    by_address: dict[int, Item]
    window_address: int
    window_header_words: int
    window_data_words: int
    flags: dict[str, int]
    document: dict[str, Any]

    @property
    def window_words(self) -> int:
        return self.window_header_words + self.window_data_words

    @property
    def device_id(self) -> int:
        return int(self.document["link"]["device_id"])


def load_map(path: Path = MAP_FILE, shift: int = 0) -> DriveMap:
    """The drive's map; `shift` moves every address but the identity's (a firmware of another generation)."""
    document = tomllib.loads(path.read_text("utf-8"))
    items = {name: _item(name, entry, shift) for name, entry in document["items"].items()}
    by_address = {item.address + k: item for item in items.values() for k in range(item.words)}
    window = document["window"]
    return DriveMap(
        items,
        by_address,
        window["address"] + shift,
        sum(_header_words(h) for h in window["header"]),
        window["data_registers"],
        {k[5:]: v for k, v in window.items() if k.startswith("flag_")},
        document,
    )


def _header_words(entry: str) -> int:
    return 2 if entry.endswith("32") else 1


def _item(name: str, entry: dict[str, Any], shift: int) -> Item:
    address = entry["address"] + (shift if entry["address"] >= 32 else 0)
    return Item(
        name,
        address,
        entry["type"],
        entry.get("length", 1),
        "w" in entry["access"],
        entry.get("needs_stop", False),
        entry.get("min", -math.inf),
        entry.get("max", math.inf),
        entry.get("scale", 1.0),
    )
