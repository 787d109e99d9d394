"""The drive file that `commissioner drives new` writes: what was proved and said; the rest is [unknown] or a comment to fill in."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from types import SimpleNamespace

from commissioner.cli.verbs.drives.asking import Answers, Parameter
from commissioner.errors import UsageError
from commissioner.link.drive.ordinary import probing
from commissioner.link.drive.ordinary.probing import Reading
from commissioner.registers.codec import encode_item
from commissioner.registers.convention import per_phase_value
from commissioner.registers.profile import Item

RATED = ("rated_voltage_v", "rated_current_a", "rated_frequency_hz")
"""Of the motor that a reactance or a per cent is of."""
DIGITS = 12
"""A scale is a product of two tens' powers, which has no exact binary form."""
OPEN_TOPICS = {
    "identity": "not asked: no register that tells this drive from another of its type",
    "watchdog": "not asked: look up the link's supervision, its unit and reaction",
    "status_word": "not asked: look up the status word and its bits before anything is written",
    "parameters": "not asked: look up register, scale and convention of the motor's parameters",
    "write_back": "no parameter's register, convention and worked example are in this file, or no status word",
    "restore": "no parameter's register is in this file, or no status word",
    "tune": "not asked: what starts, ends and stops the drive's own tuning needs sources",
    "excite": "drives as sold have no single-axis test mode; record with a scope and use `identify`",
    "stream": "drives as sold have no sample window; record with a scope or logger",
}
SKELETON = """\
# Not asked; fill in from the manual what it says, then `commissioner drives validate` this file:
# [faults]
# 5 = "overcurrent"                  # by the code in items.fault_code
# [watchdog]                         # the drive's own supervision of the link
# register = "communication_timeout_s"
# min_ms = 100
# max_ms = 60000
# fed_by = "any request"
# action = "trip"
# A tuning that the bus starts and ends is form = "remote" (config/drives/schneider_atv340.toml); a drive that goes silent
# while it tunes must stay form = "assisted"."""


@dataclass(frozen=True)
class Probed:
    """What the drive itself has proved. `shift`: wire address minus printed one."""

    readings: dict[str, Reading]
    shift: int
    blocks: probing.Blocks
    functions: tuple[int, ...]
    median_s: float
    longest_s: float


def text_of(said: Answers, probed: Probed, device: int) -> str:
    """The drive file. Texts from the terminal are quoted as TOML."""
    may_write = bool(said.parameters and said.status)
    lines = [
        *_head(said, probed, device, may_write=may_write),
        *(line for known in said.labels for line in _item(probed.readings[known.name].item, known.source)),
        *_status(said, probed.shift),
        *(line for parameter in said.parameters for line in _parameter(said, parameter, probed)),
        *_group(said, probed.shift),
        *_tuning(said, may_write=may_write),
        "[unknown]", *(f"{topic} = {_quoted(text)}" for topic, text in _open(said, probed, may_write=may_write)), "", SKELETON, "",
    ]  # fmt: skip
    return "\n".join(lines)


def _head(said: Answers, probed: Probed, device: int, *, may_write: bool) -> list[str]:
    items = [reading.item for reading in probed.readings.values()]
    widest = max(item.words for item in items)
    order = next((item.word_order for item in items if item.words == 2), None)
    return [
        "# Written by `commissioner drives new`: address base, word order, scales and blocks below were proved at the drive.",
        f"# A read of {probed.blocks.longest + 1} registers: {probed.blocks.gap}; an unmapped register: {probed.blocks.unmapped}.",
        f"# Answers after {1e3 * probed.median_s:.1f} ms, at most {1e3 * probed.longest_s:.1f} ms.",
        "", "[drive]", f"name = {_quoted(said.name)}", 'kind = "commercial"',
        f"capabilities = {_list(['write_back', 'restore'] if may_write else [])}",
        f'status_decoder = "{said.status.decoder if said.status else "none"}"', f"source = {_quoted(said.source)}", "",
        "[link]", "address_base = 0", f"max_read_registers = {max(probed.blocks.longest, widest)}", f"max_write_registers = {widest}",
        f'word_order = "{order}"' if order else 'word_order = "big"                    # not proved: no value above takes two registers',
        "has_read_write_multiple = false", "turnaround_s = 0.05", f"device_id = {device}",
        f"write_functions = {list(probed.functions) or [16]}", "",
    ]  # fmt: skip


def _item(item: Item, source: str, **more: object) -> list[str]:
    keys = {"address": item.address, "type": item.type, "scale": item.scale, "unit": item.unit, "access": "r", **more}
    kept = [
        f"{key} = {_quoted(value) if isinstance(value, str) else str(value).lower()}"
        for key, value in keys.items()
        if value != ""
    ]
    return [f"[items.{item.name}]", *kept, f"source = {_quoted(source)}", ""]


def _status(said: Answers, shift: int) -> list[str]:
    if said.status is None:
        return []
    bits = [f"{name} = {bit}" for name, bit in said.status.bits.items()]
    word = Item("status_word", said.status.printed + shift, "u16")
    return [*(["[status_bits]", *bits, ""] if bits else []), *_item(word, said.status.source)]


def _parameter(said: Answers, parameter: Parameter, probed: Probed) -> list[str]:
    """Item and worked example: the words that the drive held while its keypad showed the value."""
    known, reading = parameter.known, probed.readings[parameter.known.name]
    scale = float(f"{reading.item.scale * parameter.factor:.{DIGITS}g}")
    item = replace(reading.item, scale=scale, unit=parameter.unit, convention=parameter.convention)
    value = float(f"{reading.value * parameter.factor:.{DIGITS}g}")
    rated = {label.name: label.value for label in said.labels if label.name in RATED}
    try:
        per_phase = per_phase_value(item, value, SimpleNamespace(**dict.fromkeys(RATED) | rated))
    except UsageError as missing:
        missing.remedy = "answer the questions for these rated values, too"
        raise
    needed = rated if parameter.needs_rated else {}
    return [
        *_item(item, known.source, convention=item.convention, access="rw", needs_stop=True),
        "[[worked]]", f'item = "{item.name}"', f"words = {list(encode_item(item, value))}", f"value = {value!r}",
        f"per_phase = {per_phase!r}", *(f"{name} = {number!r}" for name, number in needed.items()),
        f"source = {_quoted(f'{known.source}; the drive held these words while its keypad showed {known.value:g} {known.unit}')}", "",
    ]  # fmt: skip


def _group(said: Answers, shift: int) -> Iterator[str]:
    if not said.parameters:
        return
    yield from ("[parameters]", f"order = {_list([p.known.name for p in said.parameters])}")
    yield from ("settle_s = 0.5                        # no source: a cautious guess, the read-back decides", "")
    if said.keeping is not None:
        yield from ("[store]", f"writes = [[{said.keeping.printed + shift}, {said.keeping.value}]]", "")


def _tuning(said: Answers, *, may_write: bool) -> list[str]:
    """Assisted: a person starts it, so that nothing that energises needs a source."""
    if not (said.tuning_page and may_write):
        return []
    source = f"{said.source}, {said.tuning_page}"
    start = f"See that nobody is at the motor and that nothing turns its shaft. Start the tuning at standstill at the keypad as {source} says. Done?"
    end = "Has the drive ended its tuning without an error, and did the shaft stay at rest?"
    steps = [line for text in (start, end) for line in ("[[tune.step]]", 'do = "ask"', f"text = {_quoted(text)}")]
    return [
        "[tune]", 'form = "assisted"', 'kind = "standstill"',
        'energises = "the drive feeds the motor by itself once the person starts it; the shaft may move slightly"',
        f"results = {_list([p.known.name for p in said.parameters])}", "longest_s = 1800.0",
        "pause_s = 600.0                       # no source: repeats heat the motor, a cautious guess",
        f"source = {_quoted(source)}", "proved_on = []", *steps, "",
    ]  # fmt: skip


def _open(said: Answers, probed: Probed, *, may_write: bool) -> Iterator[tuple[str, str]]:
    told = {
        "status_word": said.status is not None, "parameters": bool(said.parameters), "write_back": may_write, "restore": may_write,
        "tune": bool(said.tuning_page and may_write),
    }  # fmt: skip
    yield from ((topic, text) for topic, text in OPEN_TOPICS.items() if not told.get(topic))
    if not probed.functions:
        yield "write_functions", "not probed: which of functions 6 and 16 the drive takes"


def _list(names: list[str]) -> str:
    return "[" + ", ".join(map(_quoted, names)) + "]"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'
