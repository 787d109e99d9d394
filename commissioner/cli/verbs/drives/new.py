"""`commissioner drives new`: asks, probes, and writes a drive file of what was read and said; everything else is unknown."""

from __future__ import annotations

import math
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

import typer

from commissioner.cli.screens import screen
from commissioner.cli.verbs.drives.files import show_drive
from commissioner.errors import CheckFailed, UsageError
from commissioner.link.drive.ordinary import probing
from commissioner.link.drive.ordinary.probing import Known, Reading
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.modbus import ModbusPort, open_port
from commissioner.link.wire.url import parse_url
from commissioner.registers.profile import DriveProfile, Identity, LinkLimits

ASKED = {
    "rated_voltage_v": ("V", "rated voltage of the motor"),
    "rated_current_a": ("A", "rated current of the motor"),
    "rated_frequency_hz": ("Hz", "rated frequency of the motor"),
    "rated_speed_rpm": ("1/min", "rated speed of the motor"),
    "rated_power_w": ("W", "rated power of the motor"),
    "dc_link_v": ("V", "DC link voltage, as its display shows it now"),
}
FEWEST = 2
"""One value may fit by chance; two that agree on one address base seldom do."""
OPEN_TOPICS = {
    "identity": "not asked: no register that tells this drive from another of its type",
    "watchdog": "not asked: look up the link's supervision, its unit and reaction",
    "status_word": "not asked: look up the status word and its bits before anything is written",
    "parameters": "not asked: look up register, scale and convention of the motor's parameters",
    "write_back": "no parameter's register, convention and worked example are in this file",
    "restore": "no parameter's register is in this file",
    "tune": "not asked: what starts, ends and stops the drive's own tuning needs sources",
    "excite": "drives as sold have no single-axis test mode; record with a scope and use `identify`",
    "stream": "drives as sold have no sample window; record with a scope or logger",
}


@dataclass(frozen=True)
class Probed:
    """What the drive itself has proved."""

    readings: dict[str, tuple[Known, Reading]]
    blocks: probing.Blocks
    functions: tuple[int, ...]
    median_s: float
    longest_s: float


def new_drive(url: str, out: Path, *, may_write: bool, as_json: bool) -> None:
    """Writes `out`; asks on stderr. UsageError: it is there already. CheckFailed: the values on the label are not in the registers named."""
    if out.exists():
        raise UsageError(
            "the file is there already",
            step="drives new",
            value=str(out),
            limit="a new file",
            remedy="give another --out",
        )
    address = parse_url(url)
    name = typer.prompt("Name of the drive", err=True).strip()
    source = typer.prompt("Document or manual with its register table", err=True).strip()
    known = _labels(source)
    with closing(open_port(address, _bare(name))) as port:
        probed = _probe(port, known, may_write=may_write)
    out.write_text(text_of(name, source, probed), encoding="utf-8", newline="\n")
    if as_json:
        show_drive(str(out), as_json=True)
        return
    profile = load_profile(str(out))
    screen.out.print(
        f"[green]{screen.text(str(out))}[/]: {len(profile.items)} items, read and proved; the rest is \\[unknown] in it"
    )


def _labels(source: str) -> list[Known]:
    known = []
    for name, (unit, words) in ASKED.items():
        if not typer.confirm(f"Is the register of the {words} in the manual?", err=True):
            continue
        printed = typer.prompt("  its register as printed (decimal, or 0x...)", value_proc=_register, err=True)
        value = typer.prompt(f"  its value in {unit}", value_proc=_label, err=True)
        page = typer.prompt("  page", err=True).strip()
        known.append(Known(name, printed, value, unit, f"{source}, {page}"))
    if len(known) < FEWEST:
        raise UsageError(
            "too little to prove an address base", step="drives new", value=len(known), limit=f"at least {FEWEST} values",
            remedy="look up one more register whose value stands on the label or the display",
        )  # fmt: skip
    return known


def _register(text: str) -> int:
    """As printed; leading zeros are no octal number. BadParameter: it is asked again."""
    try:
        return int(text, 16 if text.strip().lower().startswith("0x") else 10)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is no register: write it as 1220, 40101 or 0x31A") from None


def _label(text: str) -> float:
    """A value that proves something: zero stands in registers that nobody uses. BadParameter: it is asked again."""
    with suppress(ValueError):
        value = float(text.strip().replace(",", "."))
        if 0.0 < value < math.inf:
            return value
    raise typer.BadParameter(f"{text!r} is no value above zero: write it as 400 or 5.1")


def _probe(port: ModbusPort, known: list[Known], *, may_write: bool) -> Probed:
    found = [probing.readings(port, label) for label in known]
    for label, readings in zip(known, found, strict=True):
        if not readings:
            raise CheckFailed(
                f"no reading of register {label.printed} gives {label.value:g} {label.unit}", step="prove the address base",
                value=label.name, limit="u16, i16, u32 or f32, either word order, counted from 0, from 1 or as 4xxxx, scales of ten",
                remedy="check register and value; a value on the label may not be set in the drive",
            )  # fmt: skip
    agreed = probing.agreed(found)
    if agreed is None:
        raise CheckFailed(
            "the values do not agree on one address base and word order", step="prove the address base",
            value=", ".join(label.name for label in known), limit="one base, one order",
            remedy="give one more value, best one of two registers",
        )  # fmt: skip
    chosen = {k.name: (k, probing.chosen(r, *agreed)) for k, r in zip(known, found, strict=True)}
    first = next(iter(chosen.values()))[1].item
    functions: tuple[int, ...] = ()
    if may_write and typer.confirm(
        f"Write the value of register {first.address} back into it, to see which functions it takes?", err=True
    ):
        functions = probing.write_functions(port, first.address)
    return Probed(chosen, probing.blocks(port, first.address), functions, *probing.answer_times(port, first.address))


def text_of(name: str, source: str, probed: Probed) -> str:
    """The drive file. Texts from the terminal are quoted as TOML."""
    widest = max(reading.item.words for _, reading in probed.readings.values())
    order = next((r.item.word_order for _, r in probed.readings.values() if r.item.words == 2), "big")
    functions = list(probed.functions) or [16]
    lines = [
        "# Written by `commissioner drives new`: address base, word order, scales and blocks below were proved at the drive.",
        f"# A read of {probed.blocks.longest + 1} registers: {probed.blocks.gap}; an unmapped register: {probed.blocks.unmapped}.",
        f"# Answers after {1e3 * probed.median_s:.1f} ms, at most {1e3 * probed.longest_s:.1f} ms.",
        "", "[drive]", f"name = {_quoted(name)}", 'kind = "commercial"', "capabilities = []", 'status_decoder = "none"',
        f"source = {_quoted(source)}", "", "[link]", "address_base = 0",
        f"max_read_registers = {max(probed.blocks.longest, widest)}", f"max_write_registers = {widest}", f'word_order = "{order}"',
        "has_read_write_multiple = false", "turnaround_s = 0.05", "device_id = 1", f"write_functions = {functions}", "",
    ]  # fmt: skip
    for label, reading in probed.readings.values():
        item = reading.item
        lines += [
            f"[items.{label.name}]", f"address = {item.address}", f'type = "{item.type}"', f"scale = {item.scale}",
            f'unit = "{label.unit}"', 'access = "r"', f"source = {_quoted(label.source)}", "",
        ]  # fmt: skip
    open_topics = dict(OPEN_TOPICS)
    if not probed.functions:
        open_topics["write_functions"] = "not probed: which of functions 6 and 16 the drive takes"
    lines += ["[unknown]", *(f"{topic} = {_quoted(text)}" for topic, text in open_topics.items()), ""]
    return "\n".join(lines)


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'


def _bare(name: str) -> DriveProfile:
    """Nothing is known but how to ask one register."""
    link = LinkLimits(
        max_read_registers=125, max_write_registers=2, has_read_write_multiple=False, turnaround_s=0.05, device_id=1
    )
    return DriveProfile(
        file="new", name=name, kind="commercial", capabilities=frozenset(), status_decoder="none", link=link,
        identity=Identity(), items={},
    )  # fmt: skip
