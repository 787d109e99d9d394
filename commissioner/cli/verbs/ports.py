"""`commissioner ports`: the serial adapters of this computer, each with the URL that names it."""

from __future__ import annotations

from typing_extensions import TypedDict

from commissioner.cli.screens import screen


class Adapter(TypedDict):
    """`url`: what `--drive` takes."""

    url: str
    device: str
    description: str
    hardware: str


class FoundAdapters(TypedDict):
    """The serial adapters that this computer shows."""

    ports: list[Adapter]


def ports(*, as_json: bool) -> None:
    """Lists what pyserial finds; opens nothing."""
    from serial.tools.list_ports import comports

    found = [
        Adapter(url=url_of(p.device), device=p.device, description=p.description or "", hardware=p.hwid or "")
        for p in sorted(comports())
    ]
    if as_json:
        screen.emit(FoundAdapters(ports=found))
        return
    if not found:
        screen.out.print("no serial adapter is plugged in, or this user may not see it")
        return
    rows = [
        (screen.text(port["url"]), screen.text(port["description"]), screen.text(port["hardware"])) for port in found
    ]
    screen.out.print(screen.table("", ("--drive", "adapter", "hardware"), rows))


def url_of(device: str) -> str:
    """`rtu://COM3` for a Windows port, `rtu:///dev/ttyUSB0` for a path."""
    return f"rtu://{device}"
