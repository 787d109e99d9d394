"""A lock per drive across all processes of this computer; the system drops it with the process, however that ends.

Two files for each drive in `locks_folder()`: the lock, and beside it who holds it. By the drive's endpoint from the first
request on; by its serial number as well once that is known and the drive has no register for a claim of its own.
"""

from __future__ import annotations

import datetime as dt
import hashlib
import json
import os
import secrets
import sys
import time
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from filelock import FileLock, Timeout

from commissioner.errors import DriveInUse, UsageError
from commissioner.link.wire.url import DriveUrl
from commissioner.records import DriveIdentity
from commissioner.registers.profile import DriveProfile
from commissioner.run.archive.documents import read_document
from commissioner.run.archive.origin import machine_part, this_process
from commissioner.run.holding.endpoint import endpoint

LOCKS = "COMMISSIONER_LOCKS"
"""Environment: the folder of the locks, where the usual one will not do. All processes must have the same."""
LOOK, ACT = "check", "run"
LOOK_S = 5.0
"""So long is waited for somebody who only looks at the drive."""
POLL_S = 0.05


@dataclass(frozen=True)
class Holder:
    """Who holds a drive: for `doing`, since when. `token`: what stands in the drive's own claim; see `is_of_here`."""

    person: str
    host: str
    process: int
    doing: str
    run: str
    since_utc: str
    drive: str
    token: int

    @property
    def words(self) -> str:
        """`person on host (process 4711), run 2026..., since 2026-01-01 12:00:00 UTC`"""
        what = f"run {self.run}" if self.run else self.doing
        return f"{self.person} on {self.host} (process {self.process}), {what}, since {self.since_utc}"


class DriveLock:
    """The drive is ours on this computer from `take` to `release`. A context."""

    def __init__(self, holder: Holder, key: str) -> None:
        self.holder = holder
        self._held: dict[str, FileLock] = {}
        self._take(key)

    @classmethod
    def take(cls, url: DriveUrl, profile: DriveProfile, doing: str) -> DriveLock:
        """The lock on the drive at the URL. DriveInUse names who holds it; somebody who only looks is waited for."""
        origin = this_process()
        since = dt.datetime.now(dt.UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
        holder = Holder(origin.person, origin.host, origin.process, doing, "", since, str(url), _new_token())
        return cls(holder, endpoint(url, profile.link.device_id))

    def name_run(self, run: str) -> None:
        """From here on the lock says for which run it is held."""
        self.holder = replace(self.holder, run=run)
        for key in self._held:
            self._write(key)

    def identified(self, identity: DriveIdentity, profile: DriveProfile) -> None:
        """The drive's serial number is known. DriveInUse: it is held under another address."""
        if identity.serial_number and not profile.has_claim:
            self._take(f"{identity.drive_type} #{identity.serial_number}")

    def release(self) -> None:
        """Idempotent; never fails."""
        for key, lock in list(self._held.items()):
            with suppress(OSError):
                _record(key).unlink(missing_ok=True)
            with suppress(OSError):
                lock.release()
            del self._held[key]

    def __enter__(self) -> DriveLock:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def _take(self, key: str) -> None:
        lock = _file_lock(key)
        end = time.monotonic() + LOOK_S
        while True:
            try:
                lock.acquire(timeout=0)
                break
            except Timeout:
                held = _read(key)
                if time.monotonic() > end or (held is not None and held.doing != LOOK):
                    self.release()
                    raise in_use(held, self.holder.drive) from None
                time.sleep(POLL_S)
            except OSError as error:
                self.release()
                raise _no_folder(Path(lock.lock_file), error) from error
        self._held[key] = lock
        self._write(key)

    def _write(self, key: str) -> None:
        path = _record(key)
        part = path.with_suffix(f".{os.getpid()}.part")
        with suppress(OSError):  # a full disk: the lock holds all the same
            part.write_text(json.dumps(asdict(self.holder)), encoding="utf-8")
            _for_everybody(part, 0o666)
            part.replace(path)


def find_holder(token: int) -> tuple[Holder | None, bool]:
    """Who of this computer claimed a drive with the token, and whether that process still holds its lock."""
    for path in locks_folder().glob("*.json"):
        held = _holder(path)
        if held is not None and held.token == token:
            return held, _is_held(path)
    return None, False


def is_of_here(token: int) -> bool:
    """Whether a claim was put on its drive by a process that shares our locks. What became of that one its lock says, and
    where its record was overwritten by whoever took the lock after it, it is gone."""
    return token >> 8 == _here()


def _here() -> int:
    """24 bits that tell this computer, with this folder of locks, from others."""
    marks = f"{machine_part()} {locks_folder()}"
    return int.from_bytes(hashlib.sha256(marks.encode()).digest()[:3], "big")


def _new_token() -> int:
    """32 bits, neither none (no claim) nor all of them (no value), nor those of a record that lies here: by chance alone one in 254 was."""
    taken = {held.token for path in locks_folder().glob("*.json") if (held := _holder(path)) is not None}
    tokens = [_here() << 8 | low for low in range(1, 0xFF)]
    return secrets.choice([token for token in tokens if token not in taken] or tokens)


def holder_of(url: DriveUrl, profile: DriveProfile) -> Holder | None:
    """Who of this computer acts on the drive now; None where nobody does, or somebody only looks at it."""
    record = _record(endpoint(url, profile.link.device_id))
    held = _holder(record)
    return held if held is not None and held.doing != LOOK and _is_held(record) else None


def runs_holding() -> frozenset[str]:
    """The runs whose process has its drive now, whoever of this computer started them: a lock, unlike a record, dies with it."""
    holding = set[str]()
    for path in locks_folder().glob("*.json"):
        with suppress(OSError):
            changed = path.stat().st_mtime_ns
            if _free.get(path) == changed:
                continue
            held = _holder(path)
            if held is not None and held.run and _is_held(path):
                holding.add(held.run)
            else:
                _free[path] = changed
    return frozenset(holding)


_free: dict[Path, int] = {}
"""Records whose lock was seen free, by their time of change: whoever takes it writes the record anew."""


def in_use(held: Holder | None, drive: str) -> DriveInUse:
    """The refusal, with who holds the drive."""
    who = "somebody who does not say who" if held is None else held.words
    remedy = "wait until it has ended, or stop it where it was started" if held is None or not held.run else (
        f"wait until {held.run} has ended, or stop it where it was started (process {held.process} on {held.host})"
    )  # fmt: skip
    return DriveInUse(
        f"the drive is in use: {who}", step="take the drive", value=held.words if held else drive,
        limit="one master for one drive", remedy=remedy,
    )  # fmt: skip


def locks_folder() -> Path:
    """The same for every user of this computer."""
    chosen = os.environ.get(LOCKS)
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        return Path(os.environ.get("PROGRAMDATA", r"C:\ProgramData")) / "commissioner" / "locks"
    return Path("/tmp/commissioner-locks")


def _file_lock(key: str) -> FileLock:
    folder = locks_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _for_everybody(folder, 0o777)
        if folder.is_symlink():
            raise NotADirectoryError("a symbolic link")
    except OSError as error:
        raise _no_folder(folder, error) from error
    return FileLock(folder / f"{_name(key)}.lock", mode=0o666, thread_local=False)


def _is_held(record: Path) -> bool:
    lock = FileLock(record.with_suffix(".lock"), mode=0o666, thread_local=False)
    try:
        lock.acquire(timeout=0)
    except (Timeout, OSError):
        return True
    lock.release()
    return False


def _record(key: str) -> Path:
    return locks_folder() / f"{_name(key)}.json"


def _name(key: str) -> str:
    return hashlib.sha256(key.encode()).hexdigest()[:24]


def _read(key: str) -> Holder | None:
    return _holder(_record(key))


def _holder(path: Path) -> Holder | None:
    try:
        document = read_document(path.read_text("utf-8", errors="replace"))
        texts = ("person", "host", "doing", "run", "since_utc", "drive")
        return Holder(
            **{name: str(document[name]) for name in texts},
            process=int(document["process"]),
            token=int(document["token"]),
        )
    except (OSError, KeyError, TypeError, ValueError):
        return None


def _for_everybody(path: Path, mode: int) -> None:
    """Other users of this computer take the same locks. Where it is somebody else's it has been done."""
    with suppress(OSError):
        path.chmod(mode)


def _no_folder(path: Path, error: OSError) -> UsageError:
    return UsageError(
        f"the drive cannot be locked against other runs: {error.strerror or error}", step="take the drive", value=str(path),
        limit="a folder that every user of this computer may write", remedy=f"set {LOCKS} to such a folder, for all of them",
    )  # fmt: skip
