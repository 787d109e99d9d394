"""`config/drives/*.toml` -> DriveProfile. Strict: what is unknown, of a wrong type or missing is named, not guessed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, ValidationError

import commissioner
from commissioner.errors import ConfigurationError, UsageError
from commissioner.registers.convention import CONVENTIONS, QUANTITIES
from commissioner.registers.profile import (
    WINDOW_FLAGS,
    DriveLimits,
    DriveProfile,
    Identity,
    Item,
    LinkLimits,
    ParameterGroup,
    Store,
    Watchdog,
    WindowLayout,
    check_consistency,
)
from commissioner.registers.status import STATUS_BITS
from commissioner.settings import read_toml

DRIVES_FOLDER = Path(commissioner.__file__).resolve().parent.parent / "config" / "drives"

Word = Annotated[int, Field(ge=0, le=0xFFFF)]
Bit = Annotated[int, Field(ge=0, le=15)]
Count = Annotated[int, Field(ge=1, le=125)]
Seconds = Annotated[float, Field(ge=0, le=60, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Capability = Literal["excite", "stream", "write_back", "restore"]
HeaderField = Literal[
    "session_id:u16", "first_index:u32", "count:u16", "channel_mask:u16", "flags:u16", "dc_link_raw:i16", "crc16:u16"
]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class _Drive(_Table):
    name: Annotated[str, Field(min_length=1)]
    kind: Literal["commissioning_map", "commercial"]
    capabilities: list[Capability]
    status_decoder: Literal["cia402", "bits", "none"]
    source: str = ""


class _Link(_Table):
    address_base: Literal[0, 1]
    max_read_registers: Count
    max_write_registers: Annotated[int, Field(ge=1, le=123)]
    word_order: Literal["big", "little"]
    has_read_write_multiple: bool
    turnaround_s: Seconds
    device_id: Annotated[int, Field(ge=1, le=247)]
    write_pause_s: Seconds = 0.0


class _Identity(_Table):
    magic: Annotated[int, Field(ge=0, le=0xFFFFFFFF)] | None = None
    map_version: Word | None = None
    drive_type: str | None = None
    firmware_min: Annotated[int, Field(ge=0, le=0xFFFFFFFF)] | None = None
    firmware_max: Annotated[int, Field(ge=0, le=0xFFFFFFFF)] | None = None


class _Watchdog(_Table):
    register_name: Annotated[str, Field(alias="register")]
    min_ms: Annotated[float, Field(ge=0, le=1e6)]
    max_ms: Annotated[float, Field(gt=0, le=1e6)]
    default_ms: Annotated[float, Field(ge=0, le=1e6)] | None = None
    fed_by: str
    action: str


class _Store(_Table):
    endurance_writes: Annotated[int, Field(ge=1)] | None = None
    writes: list[Annotated[list[Word], Field(min_length=2, max_length=2)]] = []
    coil: Word | None = None


class _Item(_Table):
    address: Word
    type: Literal["u16", "i16", "u32", "i32", "f32", "ascii"]
    length: Annotated[int, Field(ge=1, le=125)] = 1
    scale: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1.0
    unit: str = ""
    convention: str = ""
    quantity: str = ""
    access: Literal["r", "w", "rw"]
    needs_stop: bool = False
    volatile: bool = False
    min: Finite | None = None
    max: Finite | None = None
    word_order: Literal["big", "little"] | None = None
    source: str = ""


class _Window(_Table):
    address: Word
    header: Annotated[list[HeaderField], Field(min_length=7, max_length=7)]
    data_registers: Annotated[int, Field(ge=4, le=125)]
    crc: Literal["modbus"]
    flag_running: Word
    flag_clipped: Word
    flag_overrun: Word
    flag_voltage_clamped: Word
    flag_ended: Word


class _Parameters(_Table):
    order: Annotated[list[str], Field(min_length=1)]
    staged_crc: str | None = None
    settle_s: Seconds = 0.0


class _Commands(_Table):
    commit: Word | None = None
    store: Word | None = None


class _Limits(_Table):
    dc_link_min_v: Finite | None = None
    dc_link_max_v: Finite | None = None
    heatsink_max_degc: Finite | None = None
    winding_max_degc: Finite | None = None


class DriveFile(_Table):
    """The document as it may be written."""

    drive: _Drive
    link: _Link
    identity: _Identity = _Identity()
    items: dict[str, _Item]
    watchdog: _Watchdog | None = None
    window: _Window | None = None
    parameters: _Parameters | None = None
    store: _Store | None = None
    commands: _Commands = _Commands()
    status_bits: dict[str, Bit] = {}
    interlock_bits: dict[str, Bit] = {}
    faults: dict[str, str] = {}
    exceptions: dict[str, str] = {}
    limits: _Limits = _Limits()
    unknown: dict[str, str] = {}


def load_profile(name_or_path: str | Path) -> DriveProfile:
    """The drive named in `config/drives`, or in a file. UsageError: no such drive; ConfigurationError: bad file."""
    path = _locate(str(name_or_path))
    return build(read_toml(path), str(path))


def build(document: Mapping[str, Any], file: str) -> DriveProfile:
    """The profile in a parsed document. Raises ConfigurationError naming file, key, value and what would be right."""
    try:
        model = DriveFile.model_validate(dict(document))
    except ValidationError as error:
        raise _explained(error, file) from error
    return check_consistency(_profile(model, file))


def known_drives() -> tuple[str, ...]:
    """Names that `load_profile` takes."""
    return tuple(sorted(path.stem for path in DRIVES_FOLDER.glob("*.toml")))


def _locate(name_or_path: str) -> Path:
    if name_or_path.endswith(".toml") or "/" in name_or_path:
        return Path(name_or_path)
    if name_or_path in known_drives():
        return DRIVES_FOLDER / f"{name_or_path}.toml"
    raise UsageError(
        f"there is no drive named {name_or_path!r}", step="read configuration", value=name_or_path,
        limit="one of: " + ", ".join(known_drives()), remedy="give one of these names or the path of a .toml file",
    )


def _profile(model: DriveFile, file: str) -> DriveProfile:
    return DriveProfile(
        file=file,
        name=model.drive.name,
        kind=model.drive.kind,
        capabilities=frozenset(model.drive.capabilities),
        status_decoder=model.drive.status_decoder,
        link=_link(model.link),
        identity=Identity(**model.identity.model_dump()),
        items={name: _item(name, table, model.link, file) for name, table in model.items.items()},
        watchdog=_watchdog(model.watchdog) if model.watchdog else None,
        window=_window(model.window, file) if model.window else None,
        parameters=_parameters(model.parameters) if model.parameters else None,
        store=_store(model.store) if model.store else None,
        commands={name: word for name, word in model.commands.model_dump().items() if word is not None},
        status_bits=_status_bits(model, file),
        interlock_bits=model.interlock_bits,
        faults=_by_code(model.faults, "faults", file),
        exceptions=_by_code(model.exceptions, "exceptions", file),
        limits=DriveLimits(**model.limits.model_dump()),
        unknown=model.unknown,
    )


def _link(table: _Link) -> LinkLimits:
    return LinkLimits(**table.model_dump(exclude={"address_base", "word_order"}))


def _item(name: str, table: _Item, link: _Link, file: str) -> Item:
    key = f"items.{name}"
    if table.address < link.address_base:
        raise ConfigurationError(file=file, key=f"{key}.address", value=table.address, expected="1 or more: base is 1")
    if table.length > 1 and table.type != "ascii" and table.type not in ("f32", "u16", "i16", "u32", "i32"):
        raise ConfigurationError(file=file, key=f"{key}.length", value=table.length, expected="1")
    for what, value, known in (
        ("convention", table.convention, CONVENTIONS), ("quantity", table.quantity, QUANTITIES)
    ):
        if value and value not in known:
            raise ConfigurationError(
                file=file, key=f"{key}.{what}", value=value, expected="one of: " + ", ".join(sorted(known))
            )
    return Item(
        name=name,
        address=table.address - link.address_base,
        is_volatile=table.volatile,
        minimum=table.min,
        maximum=table.max,
        word_order=table.word_order or link.word_order,
        **table.model_dump(
            include={"type", "length", "scale", "unit", "convention", "quantity", "access", "needs_stop"}
        ),
    )


def _watchdog(table: _Watchdog) -> Watchdog:
    return Watchdog(register=table.register_name, **table.model_dump(exclude={"register_name"}))


def _window(table: _Window, file: str) -> WindowLayout:
    header = tuple((name, kind) for name, kind in (entry.split(":") for entry in table.header))
    if len(set(header)) != len(header) or header[-1][0] != "crc16":
        raise ConfigurationError(
            file=file, key="window.header", value=table.header, expected="each of the seven fields once, crc16 last"
        )
    flags = {name: getattr(table, f"flag_{name}") for name in WINDOW_FLAGS}
    return WindowLayout(table.address, header, table.data_registers, flags)


def _parameters(table: _Parameters) -> ParameterGroup:
    return ParameterGroup(tuple(table.order), table.staged_crc, table.settle_s)


def _store(table: _Store) -> Store:
    return Store(table.endurance_writes, tuple((a, v) for a, v in table.writes), table.coil)


def _status_bits(model: DriveFile, file: str) -> dict[str, int]:
    missing = [name for name in STATUS_BITS if name not in model.status_bits]
    if model.drive.status_decoder == "bits" and missing:
        raise ConfigurationError(
            file=file, key=f"status_bits.{missing[0]}", value=None, expected="the bit's number in status_word, 0 ... 15"
        )
    return model.status_bits


def _by_code(table: Mapping[str, str], section: str, file: str) -> dict[int, str]:
    try:
        return {int(code, 0): text for code, text in table.items()}
    except ValueError as error:
        raise ConfigurationError(
            file=file, key=section, value=", ".join(table), expected="codes as whole numbers: 5 or 0x05"
        ) from error


def _explained(error: ValidationError, file: str) -> ConfigurationError:
    first = error.errors()[0]
    location = [str(part) for part in first["loc"]]
    value = None if first["type"] == "missing" else first["input"]
    return ConfigurationError(file=file, key=".".join(location), value=value, expected=_expected(first))


def _expected(problem: Any) -> str:
    if problem["type"] == "missing":
        return "this key is needed; see config/drives/simulated.toml for a complete file"
    if problem["type"] == "extra_forbidden":
        return "no such key; known here: " + ", ".join(_keys_at(problem["loc"][:-1]))
    return str(problem["msg"])


def _keys_at(location: tuple[object, ...]) -> list[str]:
    model: type[BaseModel] = DriveFile
    for part in location:
        if str(part) in model.model_fields:
            model = _table_in(model.model_fields[str(part)].annotation) or model
    return sorted(model.model_fields)


def _table_in(annotation: Any) -> type[BaseModel] | None:
    """The table model inside an annotation such as `X`, `X | None` or `dict[str, X]`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    if get_origin(annotation) in (UnionType, Union, dict):
        return next((found for part in get_args(annotation) if (found := _table_in(part))), None)
    return None
