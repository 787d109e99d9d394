"""What is really true, for judges: JSON lines with wall time and motor time, written when something changes."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import IO, Any


class StateLog:
    """Appends to a file, or does nothing without one. Every line is on disk's side of the process at once."""

    def __init__(self, path: Path | None) -> None:
        self.file: IO[str] | None = path.open("a", buffering=1, encoding="utf-8") if path else None

    def write(self, event: str, motor_time_s: float, **facts: Any) -> None:
        if self.file is None:
            return
        line = {"event": event, "wall": time.time(), "t": round(motor_time_s, 6), **facts}
        self.file.write(json.dumps(line, default=float) + "\n")

    def close(self) -> None:
        if self.file is not None:
            self.file.close()
            self.file = None
