"""`config/drives/*.toml` -> DriveProfile. Strict: what is unknown, of a wrong type or missing is named, not guessed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePath
from typing import Any

from pydantic import ValidationError

import commissioner
from commissioner.errors import ConfigurationError
from commissioner.link.files.schema import (
    DriveFile,
    ItemTable,
    LinkTable,
    MailboxTable,
    ParametersTable,
    StepTable,
    StoreTable,
    TuneTable,
    UnlockTable,
    WatchdogTable,
    WindowTable,
    WorkedTable,
    explained,
)
from commissioner.link.files.tune_table import check_tuning
from commissioner.paths import no_such_name
from commissioner.registers.contradictions import check_contradictions
from commissioner.registers.convention import CONVENTIONS, QUANTITIES, UNITS, unit_of
from commissioner.registers.mailbox import address_of
from commissioner.registers.profile import (
    WINDOW_FLAGS,
    DriveLimits,
    DriveProfile,
    Identity,
    Item,
    LinkLimits,
    Mailbox,
    ParameterGroup,
    Store,
    Unlock,
    Watchdog,
    WindowLayout,
    Worked,
    check_consistency,
    is_a_lead,
)
from commissioner.registers.status import STATUS_BITS
from commissioner.registers.tuning import Fact, Limit, Step, Tuning
from commissioner.registers.worked import check_worked
from commissioner.settings import read_toml
from commissioner.text import did_you_mean

AS_WRITTEN = {
    "type", "length", "scale", "unit", "convention", "quantity", "access", "needs_stop", "source", "parameter", "index",
}  # fmt: skip
"""Keys of an item's table that say the same in the profile."""
DRIVES_FOLDER = Path(commissioner.__file__).resolve().parent.parent / "config" / "drives"


def load_profile(name_or_path: str | Path) -> DriveProfile:
    """The drive named in `config/drives`, or in a file. UsageError: no such drive; ConfigurationError: bad file."""
    path = _locate(str(name_or_path))
    return build(read_toml(path), str(path))


def reference(profile: DriveProfile) -> str:
    """By what an archive names the drive file: its name where it comes with this program, which says nothing of the computer
    it was installed on; else its path."""
    path = Path(profile.file)
    return path.stem if path.parent == DRIVES_FOLDER else profile.file


def archived_profile(kept: str) -> DriveProfile:
    """The drive file that an archive names. Older ones kept the path of a file that came with the program, on the computer
    that made them: where it is not there, the one of that name that comes with this one."""
    path = PurePath(kept.replace("\\", "/"))
    is_packaged = path.parent.parts[-2:] == DRIVES_FOLDER.parts[-2:] and path.stem in known_drives()
    return load_profile(path.stem if is_packaged and not Path(kept).is_file() else kept)


def build(document: Mapping[str, Any], file: str) -> DriveProfile:
    """The profile in a parsed document. Raises ConfigurationError naming file, key, value and what would be right."""
    try:
        model = DriveFile.model_validate(dict(document))
    except ValidationError as error:
        raise explained(error, file) from error
    profile = check_worked(check_contradictions(check_consistency(_profile(model, file))))
    if model.tune is None:
        return profile
    return replace(profile, tuning=check_tuning(profile, _tuning(model.tune, file)))


def known_drives() -> tuple[str, ...]:
    """Names that `load_profile` takes."""
    return tuple(sorted(path.stem for path in DRIVES_FOLDER.glob("*.toml")))


def _locate(name_or_path: str) -> Path:
    if name_or_path.endswith(".toml") or "/" in name_or_path:
        return Path(name_or_path)
    if name_or_path in known_drives():
        return DRIVES_FOLDER / f"{name_or_path}.toml"
    raise no_such_name("drive", name_or_path, known_drives())


@dataclass(frozen=True)
class _Wire:
    """From the numbers that a file writes to those of the wire."""

    base: int
    file: str

    def at(self, number: int, key: str) -> int:
        if number < self.base:
            raise ConfigurationError(file=self.file, key=key, value=number, expected="1 or more: base is 1")
        return number - self.base

    def pairs(self, writes: Sequence[Sequence[int]], key: str) -> tuple[tuple[int, int], ...]:
        """Register and value of each."""
        return tuple((self.at(number, f"{key}[{k}]"), value) for k, (number, value) in enumerate(writes))


def _profile(model: DriveFile, file: str) -> DriveProfile:
    wire = _Wire(model.link.address_base, file)
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
        window=_window(model.window, wire) if model.window else None,
        parameters=_parameters(model.parameters, wire) if model.parameters else None,
        store=_store(model.store, wire) if model.store else None,
        commands={name: word for name, word in model.commands.model_dump().items() if word is not None},
        status_bits=_status_bits(model, file),
        interlock_bits=model.interlock_bits,
        faults=_by_code(model.faults, "faults", file),
        trip_units=_by_code(model.trip_units, "trip_units", file),
        exceptions=_by_code(model.exceptions, "exceptions", file),
        limits=DriveLimits(**model.limits.model_dump()),
        unknown=model.unknown,
        worked=tuple(_worked(table) for table in model.worked),
        unlock=_unlock(model.unlock, wire) if model.unlock else None,
        mailbox=_mailbox(model.mailbox, wire) if model.mailbox else None,
    )


def _link(table: LinkTable) -> LinkLimits:
    lists = {"write_functions", "busy_exceptions"}
    return LinkLimits(
        **table.model_dump(exclude={"address_base", "word_order", *lists}),
        write_functions=tuple(table.write_functions),
        busy_exceptions=tuple(table.busy_exceptions),
    )


def _worked(table: WorkedTable) -> Worked:
    values = table.model_dump(exclude={"words", "request"})
    return Worked(**values, words=tuple(table.words), request=tuple(table.request))


def _unlock(table: UnlockTable, wire: _Wire) -> Unlock:
    _refuse_lead("unlock.source", table.source, wire.file)
    return Unlock(wire.pairs(table.writes, "unlock.writes"), wire.pairs(table.locks, "unlock.locks"))


def _mailbox(table: MailboxTable, wire: _Wire) -> Mailbox:
    _refuse_lead("mailbox.source", table.source, wire.file)
    values = table.model_dump(include={"registers", "data_set", "drive_object", "within_s"})
    errors = _by_code(table.errors, "mailbox.errors", wire.file)
    return Mailbox(address=wire.at(table.address, "mailbox.address"), errors=errors, **values)


def _refuse_lead(key: str, source: str, file: str) -> None:
    if is_a_lead(source):
        raise ConfigurationError(
            file=file, key=key, value=source, expected="a source; what is a lead goes into [unknown]"
        )


def _item(name: str, table: ItemTable, link: LinkTable, file: str) -> Item:
    key = f"items.{name}"
    address = _address(table, _Wire(link.address_base, file), key)
    for what, value, known in (
        ("convention", table.convention, CONVENTIONS),
        ("quantity", table.quantity, QUANTITIES),
        ("unit", table.unit, UNITS),
    ):
        if value and value not in known:
            raise ConfigurationError(
                file=file,
                key=f"{key}.{what}",
                value=value,
                expected="one of: " + ", ".join(sorted(known)) + did_you_mean(str(value), known),
            )
    wanted = unit_of(table.quantity or name, table.convention)
    if wanted is not None and table.unit != wanted:
        raise ConfigurationError(
            file=file, key=f"{key}.unit", value=table.unit, expected=f"{wanted!r}, with the scale that makes it so"
        )
    return Item(
        name=name,
        address=address,
        minimum=table.min,
        maximum=table.max,
        word_order=table.word_order or link.word_order,
        **table.model_dump(include=AS_WRITTEN),
    )


def _address(table: ItemTable, wire: _Wire, key: str) -> int:
    """On the wire; beyond every register for what stands behind a mailbox."""
    if (table.address is None) == (table.parameter is None):
        raise ConfigurationError(
            file=wire.file,
            key=f"{key}.address",
            value=table.address,
            expected="either an address or a parameter's number",
        )
    if table.parameter is not None:
        return address_of(table.parameter, table.index)
    assert table.address is not None
    return wire.at(table.address, f"{key}.address")


def _watchdog(table: WatchdogTable) -> Watchdog:
    return Watchdog(register=table.register_name, **table.model_dump(exclude={"register_name"}))


def _window(table: WindowTable, wire: _Wire) -> WindowLayout:
    header = tuple((name, kind) for name, kind in (entry.split(":") for entry in table.header))
    if len(set(header)) != len(header) or header[-1][0] != "crc16":
        raise ConfigurationError(
            file=wire.file,
            key="window.header",
            value=table.header,
            expected="each of the seven fields once, crc16 last",
        )
    flags = {name: getattr(table, f"flag_{name}") for name in WINDOW_FLAGS}
    return WindowLayout(wire.at(table.address, "window.address"), header, table.data_registers, flags)


def _parameters(table: ParametersTable, wire: _Wire) -> ParameterGroup:
    enter = wire.pairs(table.enter, "parameters.enter")
    return ParameterGroup(tuple(table.order), table.staged_crc, table.settle_s, enter)


def _store(table: StoreTable, wire: _Wire) -> Store:
    done = wire.pairs([table.done], "store.done")[0] if table.done else None
    coil = None if table.coil is None else wire.at(table.coil, "store.coil")
    return Store(table.endurance_writes, wire.pairs(table.writes, "store.writes"), coil, done, table.within_s)


def _tuning(table: TuneTable, file: str) -> Tuning:
    return Tuning(
        form=table.form,
        energises=table.energises,
        results=tuple(table.results),
        also_changes=tuple(table.also_changes),
        longest_s=table.longest_s,
        pause_s=table.pause_s,
        source=table.source,
        proved_on=tuple(table.proved_on),
        facts={name: Fact(**fact.model_dump()) for name, fact in table.facts.items()},
        steps=tuple(_step(step, f"tune.step[{k}].failed", file) for k, step in enumerate(table.step)),
        finally_=tuple(_step(step, f"tune.finally[{k}].failed", file) for k, step in enumerate(table.finally_)),
        watch=tuple(Limit(**limit.model_dump()) for limit in table.watch),
    )


def _step(table: StepTable, key: str, file: str) -> Step:
    values = table.model_dump(exclude={"done", "busy", "failed"})
    return Step(**values, done=tuple(table.done), busy=tuple(table.busy), failed=_by_code(table.failed, key, file))


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
