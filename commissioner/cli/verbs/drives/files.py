"""`commissioner drives list | show | validate`: drive files as they are; nothing is connected."""

from __future__ import annotations

from pathlib import Path
from typing import NotRequired

from rich.markup import escape
from typing_extensions import TypedDict

from commissioner.cli.screens import screen
from commissioner.link.files.drive_file import known_drives, load_profile
from commissioner.registers.profile import DriveProfile
from commissioner.text import counted

WORKS = {
    "excite": "run: the whole procedure at standstill",
    "stream": "samples over the link",
    "write_back": "identify FILE --write-back, and run where it works",
    "restore": "restore",
}
"""What a capability in a drive file means for a person at the command line."""


class WorksRow(TypedDict):
    """Whether a verb works with the drive, and how far or why not."""

    verb: str
    works: bool
    how: str


class DriveRow(TypedDict):
    """A drive file; `drive` is the name inside. `tune`: form of the drive's own tuning. `show` adds what the file does not know, by
    topic, and where it lies; `validate` the outcome."""

    name: str
    drive: str
    kind: str
    capabilities: list[str]
    items: int
    tune: str | None
    proved_on: list[str]
    worked_examples: int
    works: list[WorksRow]
    unknown: NotRequired[dict[str, str]]
    file: NotRequired[str]
    outcome: NotRequired[str]
    reason: NotRequired[str]


def list_drives(*, as_json: bool) -> None:
    """Name, kind and capabilities of every drive file that comes along."""
    profiles = {name: load_profile(name) for name in known_drives()}
    if as_json:
        screen.emit([_summary(name, profile) for name, profile in profiles.items()])
        return
    rows = [(name, profile.name, profile.kind.replace("_", " "), _can(profile)) for name, profile in profiles.items()]
    screen.out.print(screen.table("", ("name", "drive", "kind", "can"), rows))


def _can(profile: DriveProfile) -> str:
    tuning = [f"tune ({profile.tuning.form})"] if profile.tuning else []
    return ", ".join([*(name.replace("_", "-") for name in sorted(profile.capabilities)), *tuning]) or (
        "reading" if profile.items else "nothing: no register has a source"
    )


def show_drive(name: str, *, as_json: bool) -> None:
    """What works with the drive before anything is connected, and what its file does not know."""
    profile = load_profile(name)
    if as_json:
        screen.emit(_summary(name, profile) | {"unknown": dict(profile.unknown), "file": profile.file})
        return
    screen.out.print(
        f"[bold]{escape(profile.name)}[/], {profile.kind.replace('_', ' ')}, {counted(len(profile.items), 'item')}"
    )
    rows = [("[green]✓[/]" if works else "[dim]–[/]", verb, escape(why)) for verb, works, why in works_with(profile)]
    screen.out.print(screen.table("", ("", "with this drive", ""), rows))
    if profile.unknown:
        unknown = [(escape(topic.replace("_", " ")), escape(said)) for topic, said in sorted(profile.unknown.items())]
        screen.out.print(screen.table("", ("not known", ""), unknown))


def works_with(profile: DriveProfile) -> list[tuple[str, bool, str]]:
    """Each verb, whether it works with a drive of this file, and how far or why not."""
    readable = sum("r" in item.access for item in profile.items.values())
    rows = [("check", readable > 0, counted(readable, "value") if readable else "no register to read has a source")]
    for capability, text in WORKS.items():
        works = capability in profile.capabilities
        rows.append((text, works, "" if works else profile.unknown.get(capability, "not in this file")))
    tuning = profile.tuning
    how = (
        f"{tuning.form}: {', '.join(tuning.results)}; {tuning.proof}"
        if tuning
        else profile.unknown.get("tune", "no [tune] in this file")
    )
    return [*rows, ("tune", tuning is not None, how)]


def validate_drive(file: Path, *, as_json: bool) -> None:
    """Says that the file can be used; ConfigurationError with the first mistake where it cannot."""
    profile = load_profile(str(file))
    reason = "the file describes a drive without contradiction"
    if profile.worked:
        reason += f"; {len(profile.worked)} worked examples come out to the last digit"
    document = {"outcome": "valid", "reason": reason}
    if as_json:
        screen.emit(document | _summary(str(file), profile))
        return
    screen.out.print(f"[green]{document['reason']}[/]: {escape(profile.name)}, {counted(len(profile.items), 'item')}")


def _summary(name: str, profile: DriveProfile) -> DriveRow:
    return {
        "name": name,
        "drive": profile.name,
        "kind": profile.kind,
        "capabilities": sorted(profile.capabilities),
        "items": len(profile.items),
        "tune": profile.tuning.form if profile.tuning else None,
        "proved_on": list(profile.tuning.proved_on) if profile.tuning else [],
        "worked_examples": len(profile.worked),
        "works": [{"verb": verb, "works": works, "how": how} for verb, works, how in works_with(profile)],
    }
