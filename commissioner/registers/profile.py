"""A drive as its file describes it: frozen records, and the consistency that no single key can show."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from types import MappingProxyType

from commissioner.errors import ConfigurationError, UsageError
from commissioner.registers.tuning import Tuning

WORDS_PER_ELEMENT = MappingProxyType({"u16": 1, "i16": 1, "u32": 2, "i32": 2, "f32": 2, "ascii": 1})
"""Registers one element of a type takes; an ascii element is a register with two characters."""

IDENTITY_ITEMS = (
    "magic",
    "map_version",
    "firmware_version",
    "serial_number",
    "drive_type",
    "rated_drive_current_a",
    "control_period_s",
    "switching_frequency_hz",
)
"""What a drive's identity is read from."""
STATUS_ITEMS = (
    "status_word",
    "fault_code",
    "trip_cause",
    "trip_value",
    "trip_limit",
    "heartbeat_echo",
    "session_id",
    "interlocks",
    "dc_link_v",
    "heatsink_degc",
    "winding_degc",
    "shaft_speed_rad_per_s",
    "current_magnitude_a",
    "present_scale",
    "samples_produced",
    "overruns",
    "test_time_left_s",
    "present_bias_v",
)
"""What a status is read from."""
COMMISSIONING_ITEMS = (
    *IDENTITY_ITEMS,
    "echo",
    "control_word",
    "mode",
    "heartbeat",
    "window_index",
    *STATUS_ITEMS,
    "current_limit_a",
    "test_time_limit_s",
    "voltage_limit_v",
    "axis_deg",
    "dc_bias_v",
    "bias_ramp_v_per_s",
    "amplitude_scale",
    "scale_ramp_per_s",
    "duration_s",
    "tone_count",
    "tones",
    "channel_mask",
    "decimation",
    "current_scale_a",
    "voltage_scale_v",
    "dc_link_scale_v",
    "current_full_scale_a",
    "commit",
    "store",
    "commit_result",
    "store_result",
    "store_count",
)
"""What a drive of kind `commissioning_map` must have, beside the watchdog's register and the parameter items."""

CLAIM_ITEMS = ("owner_token", "owner_timeout_s", "owner_name", "owner_left_s")
"""What a drive may have, all of them or none: the claim of one master against the others."""
CIRCUIT = ("stator_resistance", "rotor_resistance", "leakage_inductance", "magnetizing_inductance")
WINDOW_FLAGS = ("running", "clipped", "overrun", "voltage_clamped", "ended")


@dataclass(frozen=True)
class Item:
    """One value in the drive. `address` is the wire address; value = raw * `scale`, in `unit`, by `convention`."""

    name: str
    address: int
    type: str
    length: int = 1
    scale: float = 1.0
    unit: str = ""
    convention: str = ""
    quantity: str = ""
    access: str = "r"
    needs_stop: bool = False
    minimum: float | None = None
    maximum: float | None = None
    word_order: str = "big"
    source: str = ""
    parameter: int | None = None
    """Its number, where it stands behind the drive's mailbox and in no register; `address` is then beyond every register."""
    index: int = 0

    @property
    def place(self) -> int:
        """What a person looks it up by: its register on the wire, or the number of its parameter."""
        return self.address if self.parameter is None else self.parameter

    @property
    def bounds(self) -> str:
        """What the drive file allows: `2 ... 9`, `at least 2`, `at most 9`, in its unit."""
        ends = [f"{end:.10g}" for end in (self.minimum, self.maximum) if end is not None]
        side = "" if len(ends) == 2 else "at most " if self.minimum is None else "at least "
        return side + " ... ".join(ends)

    @property
    def words(self) -> int:
        """Registers the item takes."""
        return self.length * WORDS_PER_ELEMENT[self.type]

    @property
    def end(self) -> int:
        return self.address + self.words


@dataclass(frozen=True)
class LinkLimits:
    """What the drive can take on the wire."""

    max_read_registers: int
    max_write_registers: int
    has_read_write_multiple: bool
    turnaround_s: float
    device_id: int
    write_pause_s: float = 0.0
    write_functions: tuple[int, ...] = (16,)
    """Modbus functions by which the drive takes registers: 6 one, 16 several."""
    reply_s: float | None = None
    """How long this drive may take to answer; None: the caller's own time."""
    busy_exceptions: tuple[int, ...] = ()
    """Exceptions of the vendor's own by which the drive says that it is at work and has not carried the request out."""

    @property
    def longest_write(self) -> int:
        """Registers that one request can write."""
        return self.max_write_registers if 16 in self.write_functions else 1


@dataclass(frozen=True)
class Identity:
    """What `check` expects to read; None where the file makes no claim."""

    magic: int | None = None
    map_version: int | None = None
    drive_type: str | None = None
    firmware_min: int | None = None
    firmware_max: int | None = None


@dataclass(frozen=True)
class Watchdog:
    """The drive's own supervision of the link; times in ms. `default_ms` None: no vendor source says."""

    register: str
    min_ms: float
    max_ms: float
    default_ms: float | None
    fed_by: str
    action: str


@dataclass(frozen=True)
class WindowLayout:
    """The sample window: header fields (name, type), then `data_registers` words; flags are bit masks."""

    address: int
    header: tuple[tuple[str, str], ...]
    data_registers: int
    flags: Mapping[str, int]

    @cached_property
    def header_words(self) -> int:
        return sum(WORDS_PER_ELEMENT[kind] for _, kind in self.header)

    @cached_property
    def words(self) -> int:
        return self.header_words + self.data_registers

    @cached_property
    def header_names(self) -> tuple[str, ...]:
        return tuple(name for name, _ in self.header)

    @cached_property
    def header_form(self) -> struct.Struct:
        codes = {"u16": "H", "i16": "h", "u32": "I", "i32": "i"}
        return struct.Struct(">" + "".join(codes[kind] for _, kind in self.header))


@dataclass(frozen=True)
class ParameterGroup:
    """The motor parameters in the order the drive wants them. Without `staged_crc` each is written directly."""

    order: tuple[str, ...]
    staged_crc: str | None
    settle_s: float
    enter: tuple[tuple[int, int], ...] = ()
    """Raw (address, value) writes by which values written before come into use; only then can they be read back."""

    @property
    def is_staged(self) -> bool:
        return self.staged_crc is not None


@dataclass(frozen=True)
class Store:
    """How values become non-volatile: raw (address, value) writes after, or one coil before the values are written.

    `done`: the register that holds this value once the memory is written; looked at for `within_s`.
    """

    endurance_writes: int | None
    writes: tuple[tuple[int, int], ...] = ()
    coil: int | None = None
    done: tuple[int, int] | None = None
    within_s: float = 5.0


@dataclass(frozen=True)
class Unlock:
    """Raw (address, value) writes after which the drive takes parameters, and those that lock it again."""

    writes: tuple[tuple[int, int], ...]
    locks: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Mailbox:
    """Registers through which PROFIdrive's parameter requests go: `registers` of them from `address` on. `data_set`: the
    function code in the second; `errors`: what the drive's error values mean. An answer is there after at most `within_s`."""

    address: int
    registers: int
    data_set: int
    drive_object: int
    within_s: float
    errors: Mapping[int, str]

    @property
    def end(self) -> int:
        return self.address + self.registers


@dataclass(frozen=True)
class Worked:
    """An example from the cited document: these words on the wire are this value, which is so much per phase in SI, in the
    circuit of the item's convention; a reactance or per cent is so of the example's rated motor. To write it through the
    mailbox `request` goes out."""

    item: str
    source: str
    wire: int | None = None
    words: tuple[int, ...] = ()
    value: float | None = None
    per_phase: float | None = None
    rated_voltage_v: float | None = None
    rated_current_a: float | None = None
    rated_frequency_hz: float | None = None
    request: tuple[int, ...] = ()


@dataclass(frozen=True)
class DriveLimits:
    """Ranges the pre-energise checks hold the drive to; None where the file makes no claim."""

    dc_link_min_v: float | None = None
    dc_link_max_v: float | None = None
    heatsink_max_degc: float | None = None
    winding_max_degc: float | None = None


@dataclass(frozen=True)
class DriveProfile:
    """A drive file, checked. `unknown` maps an item or topic to the sentence that says what no source told."""

    file: str
    name: str
    kind: str
    capabilities: frozenset[str]
    status_decoder: str
    link: LinkLimits
    identity: Identity
    items: Mapping[str, Item]
    watchdog: Watchdog | None = None
    window: WindowLayout | None = None
    parameters: ParameterGroup | None = None
    store: Store | None = None
    commands: Mapping[str, int] = field(default_factory=dict)
    status_bits: Mapping[str, int] = field(default_factory=dict)
    interlock_bits: Mapping[str, int] = field(default_factory=dict)
    faults: Mapping[int, str] = field(default_factory=dict)
    trip_units: Mapping[int, str] = field(default_factory=dict)
    exceptions: Mapping[int, str] = field(default_factory=dict)
    limits: DriveLimits = field(default_factory=DriveLimits)
    unknown: Mapping[str, str] = field(default_factory=dict)
    worked: tuple[Worked, ...] = ()
    tuning: Tuning | None = None
    unlock: Unlock | None = None
    mailbox: Mailbox | None = None

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Of the motor parameters, in the drive file's order; none where it describes none."""
        return self.parameters.order if self.parameters else ()

    def item(self, name: str) -> Item:
        """The item; UsageError says why where the file does not know it."""
        if name in self.items:
            return self.items[name]
        why = self.unknown.get(name, "the drive file does not describe it")
        raise UsageError(
            f"{self.name} has no known register for {name}",
            step="look up register",
            value=name,
            limit="an item of the drive file",
            remedy=why,
        )

    def require(self, capability: str) -> None:
        """Nothing where the drive can do it; UsageError with what it can do otherwise."""
        if capability not in self.capabilities:
            raise UsageError(
                f"{self.name} cannot {capability.replace('_', ' ')}",
                step="check capabilities",
                value=capability,
                limit=", ".join(sorted(self.capabilities)) or "none",
                remedy=self.unknown.get(capability, "use a drive or firmware whose file lists this capability"),
            )

    @property
    def has_claim(self) -> bool:
        """True where one master can claim the drive against those on other computers."""
        return all(name in self.items for name in CLAIM_ITEMS)

    def fault_text(self, code: int) -> str:
        return self.faults.get(code, f"fault code {code}, not in the drive file")


@dataclass(frozen=True)
class Span:
    """Items that lie side by side and fit into one request."""

    address: int
    count: int
    items: tuple[Item, ...]


def plan_spans(items: Iterable[Item], max_registers: int) -> tuple[Span, ...]:
    """The fewest requests that cover exactly the items' registers: no address between them is touched."""
    groups: list[list[Item]] = []
    for item in sorted(items, key=lambda i: i.address):
        last = groups[-1] if groups else None
        if last and last[-1].end == item.address and item.end - last[0].address <= max_registers:
            last.append(item)
        else:
            groups.append([item])
    return tuple(Span(g[0].address, g[-1].end - g[0].address, tuple(g)) for g in groups)


def check_consistency(profile: DriveProfile) -> DriveProfile:
    """The profile itself. Raises ConfigurationError for overlaps, missing items and references that lead nowhere."""
    _check_overlaps(profile)
    _check_sizes(profile)
    _check_references(profile)
    _check_mailbox(profile)
    if profile.kind == "commercial":
        _check_sources(profile)
    if profile.kind == "commissioning_map":
        _check_commissioning_map(profile)
    return profile


def _refuse(profile: DriveProfile, key: str, value: object, expected: str) -> ConfigurationError:
    return ConfigurationError(file=profile.file, key=key, value=value, expected=expected)


def _check_overlaps(profile: DriveProfile) -> None:
    spans = [(i.address, i.end, f"items.{i.name}") for i in profile.items.values()]
    if profile.window is not None:
        spans.append((profile.window.address, profile.window.address + profile.window.words, "window"))
    if profile.mailbox is not None:
        spans.append((profile.mailbox.address, profile.mailbox.end, "mailbox"))
    for (_, end, earlier), (start, _, later) in pairwise(sorted(spans)):
        if start < end:
            raise _refuse(profile, f"{later}.address", start, f"at least {end}: {earlier} reaches to {end - 1}")
    in_registers = (span for span in spans if span[0] < 0x10000)
    last = max(in_registers, default=(0, 0, ""), key=lambda span: span[1])
    if last[1] > 0x10000:
        raise _refuse(profile, f"{last[2]}.address", last[0], "registers inside 0 ... 65535")


def _check_sizes(profile: DriveProfile) -> None:
    for item in (i for i in profile.items.values() if i.parameter is None):
        room = profile.link.max_read_registers
        if item.words > room:
            raise _refuse(profile, f"items.{item.name}.length", item.length, f"at most {room} registers per read")
        if item.access != "r" and item.words > profile.link.longest_write:
            limit = profile.link.longest_write
            raise _refuse(profile, f"items.{item.name}.length", item.length, f"at most {limit} registers per write")
    if profile.window is not None and profile.window.words > profile.link.max_read_registers:
        room = profile.link.max_read_registers - profile.window.header_words
        raise _refuse(profile, "window.data_registers", profile.window.data_registers, f"at most {room}")


def _check_mailbox(profile: DriveProfile) -> None:
    """What stands behind a mailbox is one number of one or two words, asked for by function 16."""
    behind = [item for item in profile.items.values() if item.parameter is not None]
    for item in behind:
        key = f"items.{item.name}"
        if profile.mailbox is None:
            raise _refuse(profile, f"{key}.parameter", item.parameter, "a table [mailbox] through which it is reached")
        if item.length != 1 or item.type == "ascii":
            raise _refuse(profile, f"{key}.length", item.length, "one number: no text and no array through the mailbox")
        if item.word_order != "big":
            raise _refuse(profile, f"{key}.word_order", item.word_order, "big, as PROFIdrive has it")
    if profile.mailbox is not None and 16 not in profile.link.write_functions:
        raise _refuse(profile, "link.write_functions", list(profile.link.write_functions), "16: the mailbox needs it")


def is_a_lead(source: str) -> bool:
    """Whether a text says of itself that it is no vendor source."""
    return re.search(r"\b(lead|unknown)\b", source, re.IGNORECASE) is not None


def _check_sources(profile: DriveProfile) -> None:
    """What no source told is no address: it stands in [unknown]. A commissioning map is its own source."""
    for item in profile.items.values():
        if not item.source.strip():
            raise _refuse(profile, f"items.{item.name}.source", None, "the manual, page or code the register is from")
        if is_a_lead(item.source):
            raise _refuse(profile, f"items.{item.name}.source", item.source, "a source; a lead goes into [unknown]")


def _check_references(profile: DriveProfile) -> None:
    named = {"watchdog.register": profile.watchdog.register} if profile.watchdog else {}
    if profile.watchdog and profile.watchdog.fed_by in profile.items:
        named["watchdog.fed_by"] = profile.watchdog.fed_by
    if profile.parameters:
        named |= {f"parameters.order[{i}]": name for i, name in enumerate(profile.parameters.order)}
        if profile.parameters.staged_crc:
            named["parameters.staged_crc"] = profile.parameters.staged_crc
    for key, name in named.items():
        if name not in profile.items:
            raise _refuse(profile, key, name, "the name of a table [items.NAME] in this file")
    both = set(profile.items) & set(profile.unknown)
    for name in sorted(both):
        raise _refuse(profile, f"unknown.{name}", profile.unknown[name], "either described or unknown, not both")


def _check_commissioning_map(profile: DriveProfile) -> None:
    sections = ("watchdog", "window", "parameters", "store")
    for section in sections:
        if getattr(profile, section) is None:
            raise _refuse(profile, section, None, f"a table [{section}]: a commissioning map needs it")
    parameters = profile.parameters
    assert parameters is not None
    needed = [*COMMISSIONING_ITEMS]
    for prefix in ("staged_", "stored_"):
        needed += [prefix + name for name in parameters.order]
    for name in needed:
        if name not in profile.items:
            raise _refuse(profile, f"items.{name}", None, f"a table [items.{name}]: a commissioning map needs it")
    if sorted(parameters.order) != sorted(CIRCUIT):
        raise _refuse(profile, "parameters.order", list(parameters.order), "the four names " + ", ".join(CIRCUIT))
    if parameters.staged_crc is None:
        raise _refuse(profile, "parameters.staged_crc", None, "the item that takes the check sum of the staged values")
    for command in ("commit", "store"):
        if command not in profile.commands:
            raise _refuse(profile, f"commands.{command}", None, "the word that starts the action")
    _check_neighbours(profile, ("heartbeat", "window_index"), "one transaction writes both")
    if any(name in profile.items for name in CLAIM_ITEMS):
        for name in CLAIM_ITEMS:
            if name not in profile.items:
                raise _refuse(profile, f"items.{name}", None, "all of " + ", ".join(CLAIM_ITEMS) + ", or none")
        _check_neighbours(profile, CLAIM_ITEMS[:3], "one transaction writes the claim")
    _check_neighbours(profile, [f"staged_{n}" for n in parameters.order], "the check sum runs over them in this order")


def _check_neighbours(profile: DriveProfile, names: Iterable[str], why: str) -> None:
    for first, second in pairwise(profile.item(name) for name in names):
        if second.address != first.end:
            raise _refuse(profile, f"items.{second.name}.address", second.address, f"{first.end}: {why}")
