"""`commissioner drives list | show | validate`: drive files as they are, nothing is connected."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.markup import escape

from commissioner.cli.screens import screen
from commissioner.link.files.drive_file import known_drives, load_profile
from commissioner.registers.profile import DriveProfile

WORKS = {
    "excite": "run: the whole procedure at standstill",
    "stream": "samples over the link",
    "write_back": "run or identify with --write-back",
    "restore": "restore",
}
"""What a capability in a drive file means for a person at the command line."""


def list_drives(*, as_json: bool) -> None:
    """Name, kind and capabilities of every drive file that comes along."""
    profiles = {name: load_profile(name) for name in known_drives()}
    if as_json:
        screen.emit([_summary(name, profile) for name, profile in profiles.items()])
        return
    rows = [
        (name, profile.name, profile.kind.replace("_", " "), ", ".join(sorted(profile.capabilities)) or "reading")
        for name, profile in profiles.items()
    ]
    screen.out.print(screen.table("", ("name", "drive", "kind", "can"), rows))


def show_drive(name: str, *, as_json: bool) -> None:
    """What works with the drive, and what its file does not know."""
    profile = load_profile(name)
    if as_json:
        screen.emit(_summary(name, profile) | {"unknown": dict(profile.unknown), "file": profile.file})
        return
    screen.out.print(f"[bold]{escape(profile.name)}[/], {profile.kind.replace('_', ' ')}, {len(profile.items)} items")
    rows = [
        ("[green]✓[/]" if capability in profile.capabilities else "[dim]–[/]", text)
        for capability, text in WORKS.items()
    ]
    screen.out.print(screen.table("", ("", "with this drive"), [("[green]✓[/]", "check"), *rows]))
    for topic, sentence in sorted(profile.unknown.items()):
        screen.out.print(f"[yellow]not known[/] {escape(topic)}: {escape(sentence)}")


def validate_drive(file: Path, *, as_json: bool) -> None:
    """Says that the file can be used; ConfigurationError with the first mistake where it cannot."""
    profile = load_profile(str(file))
    document = {"outcome": "valid", "reason": "the file describes a drive without contradiction"}
    if as_json:
        screen.emit(document | _summary(str(file), profile))
        return
    screen.out.print(f"[green]{document['reason']}[/]: {escape(profile.name)}, {len(profile.items)} items")


def _summary(name: str, profile: DriveProfile) -> dict[str, Any]:
    return {
        "name": name,
        "drive": profile.name,
        "kind": profile.kind,
        "capabilities": sorted(profile.capabilities),
        "items": len(profile.items),
    }
