"""The drive as ours, from its identification to its release: the lock by serial number, the claim in the drive."""

from __future__ import annotations

from contextlib import suppress

from commissioner.errors import CommissionerError, DriveInUse
from commissioner.link.drive.inverter import Inverter
from commissioner.records import DriveIdentity
from commissioner.run.holding.drive_lock import DriveLock, find_holder, in_use, is_of_here


class Mastery:
    """One drive, one master. A context: at its end the drive is nobody's."""

    def __init__(self, inverter: Inverter, lock: DriveLock) -> None:
        self._inverter, self._lock = inverter, lock
        self._is_claimed = False

    def take(self, identity: DriveIdentity) -> None:
        """DriveInUse: another run, on this computer or another, holds the drive. Nothing was changed then."""
        self._lock.identified(identity, self._inverter.profile)
        if self._is_claimed:
            return
        if self.look():
            self._inverter.claim.release()
        holder = self._lock.holder
        if not self._inverter.claim.take(holder.token, f"{holder.person}@{holder.host}"):
            self.look()
            raise in_use(None, holder.drive)
        self._is_claimed = True

    def look(self) -> bool:
        """DriveInUse where the drive's own register says that it is somebody else's. True where a killed run of this
        computer left its claim there. Changes nothing."""
        claimed = self._inverter.claim.holder()
        if claimed is None or (self._is_claimed and claimed.token == self._lock.holder.token):
            return False
        local, is_alive = find_holder(claimed.token)
        if local is None and not is_of_here(claimed.token):
            raise DriveInUse(
                f"the drive is in use: {claimed.name or 'a master without a name'}, on another computer",
                step="take the drive", value=f"claim 0x{claimed.token:08X} of {claimed.name!r}", limit="one master for one drive",
                remedy=f"wait until that run has ended; without a sign of life its claim ends in {claimed.left_s} s",
            )  # fmt: skip
        is_ours = local == self._lock.holder  # not claimed yet: the token of a record that is gone, drawn once more
        if local is not None and is_alive and not is_ours:
            raise in_use(local, self._lock.holder.drive)
        return True

    def __enter__(self) -> Mastery:
        return self

    def __exit__(self, *_: object) -> None:
        if self._is_claimed:
            with suppress(CommissionerError):  # the claim ends by itself
                held = self._inverter.claim.holder()
                if held is not None and held.token == self._lock.holder.token:
                    self._inverter.claim.release()
            self._is_claimed = False
