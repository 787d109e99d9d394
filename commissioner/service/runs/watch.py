"""A drive that nobody runs, looked at twice a second while somebody has its page open: the drive's own word, and its age."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass

from commissioner.errors import CommissionerError
from commissioner.records import DriveIdentity, DriveStatus
from commissioner.service.contract.drives import DriveWord

EVERY_S = 0.4
INTEREST_S = 5.0
"""The link is closed so long after the last page asked."""
REPLY_TIMEOUT_S = 0.4


@dataclass(frozen=True)
class Seen:
    """The last word of a drive. `at_s` is monotonic; `status` None where it gave none."""

    at_s: float = float("-inf")
    identity: DriveIdentity | None = None
    status: DriveStatus | None = None
    latency_s: float = 0.0
    error: str = ""
    says_status: bool = True

    @property
    def age_s(self) -> float:
        return time.monotonic() - self.at_s


class DriveWatch:
    """One drive, in a thread of its own. `pause` gives the link away before a run or a check takes it."""

    def __init__(self, url: str, profile: str) -> None:
        self._url, self._profile = url, profile
        self._wanted_s, self._paused = float("-inf"), 0
        self._seen = Seen()
        self._wake = threading.Condition()
        self._thread: threading.Thread | None = None
        self._is_connected = self._is_over = False

    @property
    def seen(self) -> Seen:
        return self._seen

    def want(self) -> None:
        """Somebody looks at this drive."""
        with self._wake:
            self._wanted_s = time.monotonic()
            if self._thread is None and not self._is_over:
                self._thread = threading.Thread(target=self._work, name="drive watch", daemon=True)
                self._thread.start()
            self._wake.notify_all()

    def pause(self, timeout_s: float = 3.0) -> None:
        """Give the link away; returns once it is closed."""
        with self._wake:
            self._paused += 1
            self._wake.notify_all()
            self._wake.wait_for(lambda: not self._is_connected, timeout_s)

    def resume(self) -> None:
        """The link is free again."""
        with self._wake:
            self._paused = max(0, self._paused - 1)
            self._wake.notify_all()

    def close(self) -> None:
        with self._wake:
            self._is_over = True
            self._wake.notify_all()

    @property
    def _may_look(self) -> bool:
        return not self._paused and not self._is_over and time.monotonic() - self._wanted_s < INTEREST_S

    def _work(self) -> None:
        while not self._is_over:
            with self._wake:
                self._wake.wait_for(lambda: self._may_look or self._is_over, 0.5)
                if not self._may_look:
                    continue
                self._is_connected = True
            try:
                self._look()
            except (CommissionerError, OSError) as error:
                what = error.what if isinstance(error, CommissionerError) else str(error)
                self._seen = Seen(self._seen.at_s, self._seen.identity, self._seen.status, error=what)
                self._rest(1.0)
            except Exception as surprise:  # a defect here must not leave an old word standing as a new one
                self._seen = Seen(error=f"{type(surprise).__name__}: {surprise}")
                self._rest(1.0)
            finally:
                with self._wake:
                    self._is_connected = False
                    self._wake.notify_all()

    def _look(self) -> None:
        from commissioner.link.drive.inverter import Inverter
        from commissioner.link.files.drive_file import load_profile
        from commissioner.link.wire.modbus import open_port
        from commissioner.link.wire.url import parse_url
        from commissioner.run.holding.drive_lock import holder_of, in_use

        profile, url = load_profile(self._profile), parse_url(self._url)

        def leave_to_others() -> None:
            """A run, a write-back or a restore of another process of this computer has the drive for itself."""
            if (holder := holder_of(url, profile)) is not None:
                raise in_use(holder, self._url)

        leave_to_others()
        port = open_port(url, profile, reply_timeout_s=REPLY_TIMEOUT_S)
        try:
            inverter = Inverter(port, profile)
            identity = inverter.identify()
            has_status = "status_word" in profile.items
            while self._may_look:
                leave_to_others()
                began = time.monotonic()
                status = inverter.read_status() if has_status else None
                now = time.monotonic()
                self._seen = Seen(now, identity, status, now - began, says_status=has_status)
                self._rest(EVERY_S)
        finally:
            port.close()

    def _rest(self, seconds: float) -> None:
        with self._wake:
            self._wake.wait_for(lambda: not self._may_look, seconds)


def describe(seen: Seen) -> DriveWord:
    """For the API: what the drive said, and how old that is."""
    status, identity = seen.status, seen.identity
    return {
        "drive_type": identity.drive_type if identity else None,
        "serial_number": identity.serial_number if identity else None,
        "firmware_version": identity.firmware_version if identity else None,
        "state": status.state if status else None,
        "is_energised": status.is_energised if status else None,
        "age_s": round(seen.age_s, 3) if seen.at_s > 0 else None,
        "latency_s": round(seen.latency_s, 5) if status else None,
        "error": seen.error,
    }
