"""`commissioner drives new`: asks, probes, and writes a drive file of what was read and said; everything else is unknown."""

from __future__ import annotations

import tomllib
from contextlib import closing
from pathlib import Path

import typer

from commissioner.cli.screens import screen
from commissioner.cli.verbs.drives.asking import Answers, Status, answers
from commissioner.cli.verbs.drives.files import show_drive
from commissioner.cli.verbs.drives.written import Probed, text_of
from commissioner.errors import CheckFailed, UsageError
from commissioner.link.drive.ordinary import probing
from commissioner.link.drive.ordinary.probing import Known, Reading
from commissioner.link.files.drive_file import build
from commissioner.link.wire.modbus import ModbusPort, open_port
from commissioner.link.wire.url import parse_url
from commissioner.records import plain_name
from commissioner.registers.profile import DriveProfile, Identity, LinkLimits
from commissioner.registers.status import DriveState, decode_state
from commissioner.text import counted


def new_drive(url: str, out: Path, *, may_write: bool, as_json: bool) -> None:
    """Writes `out`; asks on stderr. UsageError: it is there already. CheckFailed: what was said is not in the registers named."""
    if out.exists():
        raise UsageError(
            "the file is there already",
            step="drives new",
            value=str(out),
            limit="a new file",
            remedy="give another --out",
        )
    address = parse_url(url)
    with closing(open_port(address, _bare())) as port:
        said = answers(lambda known: probing.readings(port, known))
        probed = _prove(port, said, may_write=may_write)
    text = text_of(said, probed, 1 if address.device is None else address.device)
    profile = build(tomllib.loads(text), str(out))
    out.write_text(text, encoding="utf-8", newline="\n")
    if as_json:
        show_drive(str(out), as_json=True)
        return
    screen.out.print(
        f"[green]{screen.text(str(out))}[/]: {counted(len(profile.items), 'item')}, read and proved; the rest is \\[unknown] in it"
    )
    verbs = [
        "check",
        *(["tune"] if profile.tuning else []),
        *(["restore"] if "restore" in profile.capabilities else []),
    ]
    screen.out.print(
        f'it serves {", ".join(verbs)}: commissioner check --drive "{screen.text(url)}" --profile {screen.text(str(out))} --motor MOTOR.toml'
    )


def _prove(port: ModbusPort, said: Answers, *, may_write: bool) -> Probed:
    found = [probing.readings(port, known) for known in said.known]
    agreed = probing.agreed(found)
    if agreed is None:
        raise CheckFailed(
            "the values do not agree on one address base and word order", step="prove the address base",
            value=", ".join(known.name for known in said.known), limit="one base, one order",
            remedy="give one more value, best one of two registers",
        )  # fmt: skip
    chosen = {k.name: _chosen(k, r, *agreed) for k, r in zip(said.known, found, strict=True)}
    for known in said.known:
        item, value = chosen[known.name].item, chosen[known.name].value
        screen.err.print(
            f"  {plain_name(known.name)}: {value:g} {known.unit} = register {item.address} on the wire, {item.type} x {item.scale:g}"
        )
    first = next(iter(chosen.values())).item
    functions: tuple[int, ...] = ()
    if may_write and typer.confirm(
        f"Write the value of register {first.address} back into it, to see which functions it takes?", err=True
    ):
        functions = probing.write_functions(port, first.address)
    if said.status is not None:
        _see_at_rest(port, said.status, agreed[0])
    times = probing.answer_times(port, first.address)
    return Probed(chosen, agreed[0], probing.blocks(port, first.address), functions, *times)


def _chosen(known: Known, found: list[Reading], shift: int, order: str) -> Reading:
    """The reading that fits what was agreed for all; where one register and two both give the value, a person tells by the manual."""
    narrow = probing.chosen(found, shift, order)
    wide = [r for r in found if r.shift == shift and r.item.words > narrow.item.words and r.item.word_order == order]
    if wide and typer.confirm(
        f"{plain_name(known.name)} fits one register and two: does it take two in the manual?", err=True
    ):
        return wide[0]
    return narrow


def _see_at_rest(port: ModbusPort, status: Status, shift: int) -> None:
    """A drive at rest and without a fault says so by the bits that were named. CheckFailed: it does not."""
    (word,) = port.read(status.printed + shift, 1)
    state = decode_state(status.decoder, word, status.bits)
    screen.err.print(f"  status word: 0x{word:04X} = {state.value}")
    if state.may_be_energised or state is DriveState.FAULT:
        raise CheckFailed(
            "the drive does not say that it is at rest and without a fault", step="prove the status word",
            value=f"0x{word:04X}: {state.value}", limit="output blocked, no fault",
            remedy="check the register and its bits in the manual; stop the drive and reset its fault at its keypad",
        )  # fmt: skip


def _bare() -> DriveProfile:
    """Nothing is known but how to ask one register."""
    link = LinkLimits(
        max_read_registers=125, max_write_registers=2, has_read_write_multiple=False, turnaround_s=0.05, device_id=1
    )
    return DriveProfile(
        file="new", name="a new drive", kind="commercial", capabilities=frozenset(), status_decoder="none", link=link,
        identity=Identity(), items={},
    )  # fmt: skip
