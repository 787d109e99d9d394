"""The archive as the service shows it: the one place that knows where runs lie and how they are listed and compared."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from commissioner.encoding import JsonObject
from commissioner.identify.contract import Measured
from commissioner.motor.quantities import plate_words
from commissioner.operations.history.runs import must_be_findable
from commissioner.report.run.standing import Held, Standing
from commissioner.run.archive.catalogue import by_age, is_ahead, read_run
from commissioner.run.archive.documents import identified, origin_of, read_document, read_result
from commissioner.run.archive.summary import NOT_IDENTIFIED
from commissioner.run.holding.unfinished import Word, left_by
from commissioner.run.index.rows import Wanted, utc_of
from commissioner.service.contract.runs import RunWithoutResult
from commissioner.service.problems import Refusal

LOOKED_THROUGH = 100
"""Of the newest runs: what an older one left has been met since."""


@dataclass(frozen=True)
class Entry:
    """One line of the list. `motor` is an id of the library, or empty for runs from the command line; `held_utc`: since when the drive holds what it holds; `lacks_result`: the run judged, and its process ended before that was kept."""

    run: str
    utc: str
    motor: str
    motor_names: tuple[str, ...]
    motor_text: str
    drive: str
    person: str
    outcome: str
    standing: Standing
    reason: str
    energised_s: float | None
    written: str
    parameters: Mapping[str, Measured] | None
    flux_wb: float | None
    folder: Path
    serial_number: int | None
    url: str
    held_utc: str
    lacks_result: bool
    held: Held

    @property
    def drive_key(self) -> str:
        """Tells drives apart: the number, where one has none or did not answer the address."""
        return f"#{self.serial_number}" if self.serial_number is not None else self.url

    @property
    def is_unknown(self) -> bool:
        """Only the drive can tell which parameter set it holds."""
        return self.held is Held.OLD_OR_NEW

    @property
    def can_be_made(self) -> bool:
        """Its result, from the samples it took."""
        return self.lacks_result and _bytes(self.folder / "blocks.bin") > 0

    @property
    def is_restored(self) -> bool:
        """What the run found in the drive was the last to be written there by it."""
        return self.held is Held.RESTORED

    @property
    def can_restore(self) -> bool:
        """The drive may hold other values than the run found, and those are kept."""
        return self.held not in (Held.AS_BEFORE, Held.RESTORED) and (self.folder / "snapshot.json").is_file()


class Archive:
    """Reads each run once, and again when its journal or result has changed."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self._read: dict[str, tuple[tuple[int, int], Entry]] = {}

    def entries(
        self, *, motor: str = "", drive: str = "", outcome: str = "", since: str = "", limit: int = 100
    ) -> list[Entry]:
        """Newest first. UsageError: a date that is none, an outcome that no run has."""
        must_be_findable(Wanted(outcome=outcome, since=since))
        found: list[Entry] = []
        for name in self._names():
            entry = self._entry(name)
            if entry is not None and _matches(entry, motor, drive, outcome, since):
                found.append(entry)
                if len(found) >= limit:
                    break
        return found

    def open_ends(self) -> list[Entry]:
        """Of the newest runs those, newest first, that left something to look after: cut off, and no later run on the drive came to its
        end; or a write that did not end, and nobody has written or restored since."""
        newest = self.entries(limit=LOOKED_THROUGH)
        by_drive: dict[str, list[Entry]] = {}
        for entry in newest:
            by_drive.setdefault(entry.drive_key, []).append(entry)
        left = {left_by(Word(e.run, e.held, e.held_utc) for e in those) for those in by_drive.values()}
        seen: set[str] = set()
        found: list[Entry] = []
        for entry in newest:
            if entry.run in left or (
                entry.standing.has_no_end and not entry.is_unknown and entry.drive_key not in seen
            ):
                found.append(entry)
            if not entry.standing.has_no_end and entry.drive != NOT_IDENTIFIED:
                seen |= {entry.drive_key, entry.url}
        return found

    def written_later(self, entry: Entry) -> Entry | None:
        """Of the newest runs the one that changed what the drive holds last, where that is another one and came later."""
        if entry.held is Held.AS_BEFORE:
            return None
        others = [
            e
            for e in self.entries(limit=LOOKED_THROUGH)
            if e.drive_key == entry.drive_key and e.held_utc > entry.held_utc
        ]
        changed = [e for e in others if e.held not in (Held.AS_BEFORE, Held.NOT_KNOWN) and not is_ahead(e.held_utc)]
        return max(changed, key=lambda e: e.held_utc, default=None)

    def find(self, run: str) -> Entry:
        """Refusal 404 where there is none of this id."""
        entry = self._entry(run) if _is_name(run) else None
        if entry is None:
            raise Refusal(
                404,
                f"there is no run {run[:80]}",
                step="archive",
                value=run[:80],
                limit="a run of this archive",
                remedy="choose one from the list of runs",
            )
        return entry

    def result(self, run: str) -> JsonObject | RunWithoutResult:
        """The result document; of a run without one, what its journal says. DataRefused: it is damaged."""
        entry = self.find(run)
        if (found := read_result(entry.folder)) is not None:
            return {
                **found,
                "run": entry.run,
            }  # the folder may have been renamed: its name is what the archive calls it
        return {
            "run": entry.run,
            "outcome": entry.outcome,
            "reason": entry.reason,
            "energised_s": entry.energised_s,
            "parameters": None,
            "written": [],
            "holds": entry.written,
        }

    def request(self, run: str) -> JsonObject:
        """What the run was asked to do."""
        path = self.find(run).folder / "request.json"
        return read_document(path.read_text("utf-8", "replace")) if path.is_file() else {}

    def file(self, run: str, name: str) -> Path:
        """A file of the run. Refusal 404 where the run left none of this name."""
        path = self.find(run).folder / name
        if not path.is_file():
            raise Refusal(
                404,
                f"{run} has no {name}",
                step="archive",
                value=name,
                limit="a file of this run",
                remedy="a run makes it at its end; a run that was cut off may lack it",
            )
        return path

    def _names(self) -> list[str]:
        try:
            with os.scandir(self.root) as entries:
                return sorted((e.name for e in entries if _is_name(e.name)), key=by_age(), reverse=True)
        except OSError:
            return []

    def _entry(self, name: str) -> Entry | None:
        folder = self.root / name
        try:
            changed = (folder / "journal.jsonl").stat().st_mtime_ns, _mtime(folder / "result.json")
        except OSError:
            return None
        known = self._read.get(name)
        if known is not None and known[0] == changed:
            return known[1]
        entry = _read_entry(folder)
        self._read[name] = (changed, entry)
        return entry


def _read_entry(folder: Path) -> Entry:
    summary = read_run(folder)
    request = folder / "request.json"
    asked = read_document(request.read_text("utf-8", "replace")) if request.is_file() else {}
    origin, plate = origin_of(asked), asked.get("nameplate")
    return Entry(
        summary.run,
        utc_of(summary.run),
        str(origin.get("motor", "")),
        summary.motor_names,
        plate_words(plate if isinstance(plate, dict) else {}),
        summary.drive,
        str(origin.get("person", "")),
        summary.outcome,
        summary.standing,
        summary.reason,
        summary.energised_s,
        summary.written,
        identified(summary.result or {}, with_errors=False),
        (summary.result or {}).get("holds_for_stator_flux_wb"),
        folder,
        summary.serial_number,
        summary.url,
        summary.held_utc or summary.started_utc,
        summary.lacks_result,
        summary.held,
    )


def _matches(entry: Entry, motor: str, drive: str, outcome: str, since: str) -> bool:
    return (
        (
            not motor
            or motor.lower() in f"{' '.join(entry.motor_names)} {entry.motor_text} {entry.drive} {entry.run}".lower()
        )
        and (not drive or drive.lower() in entry.drive.lower())
        and (not outcome or outcome in (entry.outcome, entry.standing))
        and (not since or entry.utc[: len(since)] >= since)
    )


def _is_name(name: str) -> bool:
    return (
        0 < len(name) < 200 and not name.startswith(".") and "/" not in name and "\\" not in name and "\0" not in name
    )


def _bytes(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0


def _mtime(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0
