"""May what a run folder says be written into a drive? Chain, seal, plausibility and verdict, before anything is sent."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from commissioner.errors import CommissionerError, DataRefused
from commissioner.motor.nameplate import Nameplate
from commissioner.records import ParameterSnapshot
from commissioner.registers.convention import parameter_limits
from commissioner.registers.profile import DriveProfile
from commissioner.run.archive.documents import damaged, read_saved
from commissioner.run.archive.journal import Record, read_journal
from commissioner.run.archive.origin import program_version
from commissioner.run.archive.replay import replay
from commissioner.run.archive.verify import DECIDES, UNVERIFIED, Verified, refuse_damage, verify

ROUNDING = 1e-5
"""A drive's own resolution may put a value on the edge of the box a little outside it."""


def prove(
    folder: Path, profile: DriveProfile, snapshot: ParameterSnapshot, key: bytes | None = None, step: str = "restore"
) -> Verified:
    """The folder is as its run left it, and no value in the snapshot is one that no motor of the plate has.

    DataRefused names the file, the value and the limit. A chain without a seal can be made anew by whoever edits the folder:
    the box and the drive's identity stand behind it.
    """
    verified = verify(folder, key)
    refuse_damage(folder, verified, step, *DECIDES)
    check_plausible(folder, profile, snapshot, step)
    return verified


def prove_verdict(
    folder: Path, verified: Verified, step: str = "restore", observe: Callable[[object], None] | None = None
) -> None:
    """DataRefused: the run's samples do not lead to its verdict. `observe` is told of each decision. Where another version made the run its decisions may
    differ, and an old folder has no version: neither is judged."""
    journal = read_journal(folder / "journal.jsonl")
    if verified.state == UNVERIFIED or _version(journal) != program_version():
        return
    if not {"job", "verdict_reached"} <= {
        line["kind"] for line in journal
    }:  # without a test nothing led to the verdict
        return
    done = replay(folder, salvage=not verified.is_whole, observe=observe)
    if done.difference is not None:
        place, replayed, archived = done.difference.apart
        raise DataRefused(
            f"{folder.name}: its samples do not lead to its decisions{f', in {place}' if place else ''}", step=step, value=replayed,
            limit=archived, remedy="the folder was changed: `commissioner replay` shows where; use another run",
        )  # fmt: skip


def check_plausible(folder: Path, profile: DriveProfile, snapshot: ParameterSnapshot, step: str = "restore") -> None:
    """DataRefused where a parameter is outside what motors of the run's plate can have."""
    plate = read_plate(folder)
    limits = parameter_limits(profile, plate)
    for which, values in (("in_use", snapshot.in_use), ("stored", snapshot.stored)):
        for name, value in values.items():
            low, high = limits.get(name, (float("-inf"), float("inf")))
            if not low * (1 - ROUNDING) <= value <= high * (1 + ROUNDING):
                raise DataRefused(
                    f"{folder.name}: snapshot.json holds a {name} that no motor of this plate has", step=step,
                    value=f"{which}.{name} = {value:.6g} {profile.item(name).unit}", limit=f"{low:.4g} ... {high:.4g}",
                    remedy="if the drive did hold it before the run, enter it at the drive by hand",
                )  # fmt: skip


def read_plate(folder: Path) -> Nameplate:
    """The plate the run was asked to use. DataRefused: there is none."""
    plate = read_saved(folder, "request.json", "nameplate")["nameplate"]
    try:
        return Nameplate(**dict(_pairs(plate)))
    except (TypeError, ValueError, CommissionerError) as error:
        raise damaged(folder, "request.json", f"nameplate: {error}") from error


def _pairs(plate: Any) -> Iterator[tuple[str, Any]]:
    if not isinstance(plate, Mapping):
        raise TypeError(f"{plate!r:.80} is no nameplate")
    yield from plate.items()


def _version(journal: list[Record]) -> str:
    first = journal[0]["record"] if journal and journal[0]["kind"] == "run_started" else None
    return str(first.get("version", "")) if isinstance(first, dict) else ""
