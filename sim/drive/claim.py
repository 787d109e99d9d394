"""Who is master of the drive: a token with a time-out that one master writes and the others read."""

from __future__ import annotations

import math
from typing import Any

UNCOUNTED = ("heartbeat", "window_index", "echo", "commit", "store", "owner_token", "owner_timeout_s", "owner_name")
"""Registers whose change is no change of a setting."""


class Claim:
    """The owner's registers in `values`, and when the claim was last renewed."""

    def __init__(self, values: dict[str, Any]) -> None:
        self.values = values
        self.renewed_at = 0.0

    def admits(self, token: int, now: float) -> bool:
        """May this token be written: it releases, it renews, or nobody holds the drive."""
        self.expire(now)
        return token in (0, self.values["owner_token"]) or self.values["owner_token"] == 0

    def renew(self, now: float) -> None:
        """The token was written, or the heartbeat has changed."""
        self.renewed_at = now

    def expire(self, now: float) -> None:
        """Nobody holds a drive whose claim has run out."""
        if self.left_s(now) == 0:
            self.values["owner_token"] = 0

    def left_s(self, now: float) -> int:
        """Whole seconds until the claim ends by itself; 0 = nobody."""
        if self.values["owner_token"] == 0:
            return 0
        return max(0, math.ceil(self.renewed_at + self.values["owner_timeout_s"] - now))
