"""A drive file as it may be written: its tables, keys and types. Strict: what is unknown, mistyped or missing is named."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from commissioner.errors import ConfigurationError
from commissioner.validation import first_problem

Word = Annotated[int, Field(ge=0, le=0xFFFF)]
Bit = Annotated[int, Field(ge=0, le=15)]
Count = Annotated[int, Field(ge=1, le=125)]
Seconds = Annotated[float, Field(ge=0, le=60, allow_inf_nan=False)]
Pair = Annotated[list[Word], Field(min_length=2, max_length=2)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Above = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Capability = Literal["excite", "stream", "write_back", "restore"]
HeaderField = Literal[
    "session_id:u16", "first_index:u32", "count:u16", "channel_mask:u16", "flags:u16", "dc_link_raw:i16", "crc16:u16"
]


class Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class DriveTable(Table):
    name: Annotated[str, Field(min_length=1)]
    kind: Literal["commissioning_map", "commercial"]
    capabilities: list[Capability]
    status_decoder: Literal["cia402", "bits", "none"]
    source: str = ""


class LinkTable(Table):
    address_base: Literal[0, 1]
    max_read_registers: Count
    max_write_registers: Annotated[int, Field(ge=1, le=123)]
    word_order: Literal["big", "little"]
    has_read_write_multiple: bool
    turnaround_s: Seconds
    device_id: Annotated[int, Field(ge=0, le=255)]
    write_pause_s: Seconds = 0.0
    write_functions: Annotated[list[Literal[6, 16]], Field(min_length=1)] = [16]
    reply_s: Annotated[float, Field(gt=0, le=60, allow_inf_nan=False)] | None = None
    busy_exceptions: list[Annotated[int, Field(ge=1, le=255)]] = []


class IdentityTable(Table):
    magic: Annotated[int, Field(ge=0, le=0xFFFFFFFF)] | None = None
    map_version: Word | None = None
    drive_type: str | None = None
    firmware_min: Annotated[int, Field(ge=0, le=0xFFFFFFFF)] | None = None
    firmware_max: Annotated[int, Field(ge=0, le=0xFFFFFFFF)] | None = None


class WatchdogTable(Table):
    register_name: Annotated[str, Field(alias="register")]
    min_ms: Annotated[float, Field(ge=0, le=1e6)]
    max_ms: Annotated[float, Field(gt=0, le=1e6)]
    default_ms: Annotated[float, Field(ge=0, le=1e6)] | None = None
    fed_by: str
    action: str


class StoreTable(Table):
    endurance_writes: Annotated[int, Field(ge=1)] | None = None
    writes: list[Pair] = []
    coil: Word | None = None
    done: Pair | None = None
    within_s: Seconds = 5.0


class ItemTable(Table):
    """Where it stands: `address`, or `parameter` and `index` behind the mailbox."""

    address: Word | None = None
    parameter: Annotated[int, Field(ge=1, le=0xFFFF)] | None = None
    index: Word = 0
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


class UnlockTable(Table):
    writes: Annotated[list[Pair], Field(min_length=1)]
    locks: list[Pair] = []
    source: Annotated[str, Field(min_length=1)]


class MailboxTable(Table):
    protocol: Literal["profidrive"]
    address: Word
    registers: Annotated[int, Field(ge=10, le=125)]
    data_set: Annotated[int, Field(ge=1, le=255)]
    drive_object: Annotated[int, Field(ge=0, le=255)]
    within_s: Annotated[float, Field(gt=0, le=60, allow_inf_nan=False)]
    errors: dict[str, str] = {}
    source: Annotated[str, Field(min_length=1)]


class WindowTable(Table):
    address: Word
    header: Annotated[list[HeaderField], Field(min_length=7, max_length=7)]
    data_registers: Annotated[int, Field(ge=4, le=125)]
    crc: Literal["modbus"]
    flag_running: Word
    flag_clipped: Word
    flag_overrun: Word
    flag_voltage_clamped: Word
    flag_ended: Word


class ParametersTable(Table):
    order: Annotated[list[str], Field(min_length=1)]
    staged_crc: str | None = None
    settle_s: Seconds = 0.0
    enter: list[Pair] = []


class CommandsTable(Table):
    commit: Word | None = None
    store: Word | None = None


class LimitsTable(Table):
    dc_link_min_v: Finite | None = None
    dc_link_max_v: Finite | None = None
    heatsink_max_degc: Finite | None = None
    winding_max_degc: Finite | None = None


class WorkedTable(Table):
    """One example from the cited document, carried out to the last digit."""

    item: str
    source: Annotated[str, Field(min_length=1)]
    wire: Word | None = None
    words: list[Word] = []
    value: Finite | None = None
    per_phase: Finite | None = None
    rated_voltage_v: Above | None = None
    rated_current_a: Above | None = None
    rated_frequency_hz: Above | None = None
    request: list[Word] = []


class FactTable(Table):
    item: str
    value: Word
    source: str


class StepTable(Table):
    do: Literal["expect", "write", "await", "ask"]
    item: str = ""
    value: Word = 0
    mask: Word = 0xFFFF
    done: list[Word] = []
    busy: list[Word] = []
    failed: dict[str, str] = {}
    within_s: Annotated[float, Field(gt=0, le=3600, allow_inf_nan=False)] = 1.0
    every_s: Annotated[float, Field(gt=0, le=10, allow_inf_nan=False)] = 0.1
    once: bool = False
    why: str = ""
    text: str = ""


class LimitTable(Table):
    item: str
    most: Word
    why: Annotated[str, Field(min_length=1)]


class TuneTable(Table):
    """`step` and `finally` are read as they stand; what they must be together is judged in `registers.tuning`."""

    form: Literal["remote", "assisted"]
    kind: Literal["standstill"]
    energises: Annotated[str, Field(min_length=1)]
    results: Annotated[list[str], Field(min_length=1)]
    also_changes: list[str] = []
    longest_s: Annotated[float, Field(gt=0, le=3600, allow_inf_nan=False)]
    pause_s: Annotated[float, Field(ge=0, le=3600, allow_inf_nan=False)]
    source: str
    proved_on: list[str]
    facts: dict[Literal["standstill", "start", "finished", "failed", "stop"], FactTable] = {}
    step: Annotated[list[StepTable], Field(min_length=1)]
    finally_: Annotated[list[StepTable], Field(alias="finally")] = []
    watch: list[LimitTable] = []


class DriveFile(Table):
    """The document as it may be written."""

    drive: DriveTable
    link: LinkTable
    identity: IdentityTable = IdentityTable()
    items: dict[str, ItemTable]
    watchdog: WatchdogTable | None = None
    window: WindowTable | None = None
    parameters: ParametersTable | None = None
    store: StoreTable | None = None
    commands: CommandsTable = CommandsTable()
    status_bits: dict[str, Bit] = {}
    interlock_bits: dict[str, Bit] = {}
    faults: dict[str, str] = {}
    trip_units: dict[str, str] = {}
    exceptions: dict[str, str] = {}
    limits: LimitsTable = LimitsTable()
    unknown: dict[str, str] = {}
    worked: list[WorkedTable] = []
    tune: TuneTable | None = None
    unlock: UnlockTable | None = None
    mailbox: MailboxTable | None = None


def explained(error: ValidationError, file: str) -> ConfigurationError:
    problem = first_problem(error, DriveFile)
    see = "; see config/drives/simulated.toml for a complete file" if problem.value is None else ""
    return ConfigurationError(file=file, key=problem.key, value=problem.value, expected=problem.expected + see)
