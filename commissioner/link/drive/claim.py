"""The claim in the drive: a token with a time-out, by which masters on different computers know of each other."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

from commissioner.errors import RequestRefused
from commissioner.link.drive.items import Items
from commissioner.registers.codec import Value

TIMEOUT_S = 120
"""Longer than any computation between two requests; every heartbeat renews the claim."""
NAME_CHARACTERS = 24


@dataclass(frozen=True)
class Claimed:
    """Who holds the drive by its own registers, and for how long without a renewal."""

    token: int
    name: str
    left_s: int


class Claim:
    """Reads and writes the claim. Of a drive without one every call does nothing."""

    def __init__(self, items: Items) -> None:
        self._items = items
        self._values: dict[str, Value] = {}

    def holder(self) -> Claimed | None:
        """Who holds the drive now; None: nobody, or it has no claim."""
        if not self._items.profile.has_claim:
            return None
        seen = self._items.read(("owner_token", "owner_timeout_s", "owner_name", "owner_left_s"))
        token = int(str(seen["owner_token"]))
        return Claimed(token, str(seen["owner_name"]), int(str(seen["owner_left_s"]))) if token else None

    def take(self, token: int, name: str) -> bool:
        """Put the claim on the drive; False where somebody else was faster."""
        if not self._items.profile.has_claim:
            return True
        plain = name.encode("ascii", "replace").decode("ascii")[:NAME_CHARACTERS]
        self._values = {"owner_token": token, "owner_timeout_s": TIMEOUT_S, "owner_name": plain}
        return self.renew()

    def renew(self) -> bool:
        """Once more for the whole time; False where the drive is somebody else's by now."""
        if not self._values:
            return True
        with suppress(RequestRefused):
            self._items.write(self._values)
        held = self.holder()
        return held is not None and held.token == self._values["owner_token"]

    def release(self) -> None:
        """Nobody holds the drive afterwards. Only for the holder, or on behalf of one that is known to be gone."""
        if self._items.profile.has_claim:
            self._items.write({"owner_token": 0})
        self._values = {}
