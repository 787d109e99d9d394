"""Non-volatile memory of the drive: one JSON file written whole or not at all, or only in this process."""

from __future__ import annotations

import json
import os
import zlib
from pathlib import Path
from typing import Any


class Memory:
    """Stored motor parameters (wire units), how often they were written, and how often the drive was powered."""

    def __init__(self, path: Path | None, factory: list[float]) -> None:
        self.path = path
        self.content: dict[str, Any] = {"parameters": factory, "store_count": 0, "power_ups": 0}
        self.is_intact = True
        if path is not None and path.exists():
            self._load(path)

    def _load(self, path: Path) -> None:
        try:
            saved = json.loads(path.read_text("utf-8"))
            self.is_intact = saved.get("check") == _check(saved["content"])
            self.content = saved["content"]
        except (ValueError, KeyError):
            self.is_intact = False

    def power_up(self) -> int:
        """Count and return this power-up."""
        self.content["power_ups"] += 1
        self._save()
        return int(self.content["power_ups"])

    def store(self, parameters: list[float]) -> None:
        """Write the parameters; the counter grows by one. OSError where the medium fails."""
        self.content["store_count"] += 1
        self.content["parameters"] = parameters
        self._save()

    def wear(self) -> None:
        """A write that spent a cycle of the memory and left nothing."""
        self.content["store_count"] += 1
        self._save()

    def _save(self) -> None:
        if self.path is None:
            return
        temporary = self.path.with_name(self.path.name + ".part")
        temporary.write_text(json.dumps({"content": self.content, "check": _check(self.content)}), "utf-8")
        os.replace(temporary, self.path)  # noqa: PTH105 - Path.replace is the same call


def _check(content: dict[str, Any]) -> int:
    return zlib.crc32(json.dumps(content, sort_keys=True).encode())
