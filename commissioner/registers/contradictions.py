"""What a drive file says against itself, each key being right alone: limits that cross, names that share a bit, a unit that its
name denies, a register that has to be written and cannot be, a misspelt topic of [unknown]."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from difflib import get_close_matches
from types import MappingProxyType

from commissioner.errors import ConfigurationError
from commissioner.motor.nameplate import RATED_VALUES
from commissioner.registers.convention import INDUCTANCES, QUANTITIES, RESISTANCES, base_values
from commissioner.registers.profile import (
    CLAIM_ITEMS,
    COMMISSIONING_ITEMS,
    IDENTITY_ITEMS,
    STATUS_ITEMS,
    DriveProfile,
    Item,
    LinkLimits,
)

SMALLEST_SCALE, LARGEST_SCALE = 1e-9, 1e9
NO_UNIT = ("", "raw")
"""Units that claim nothing: what the name says stands."""
UNIT_OF_ENDING = MappingProxyType(
    {
        "_rad_per_s": "rad/s", "_v_per_s": "V/s", "_per_s": "1/s", "_degc": "degC", "_deg": "deg", "_rpm": "1/min", "_ohm": "ohm",
        "_nm": "Nm", "_hz": "Hz", "_ms": "ms", "_wb": "Wb", "_v": "V", "_a": "A", "_w": "W", "_s": "s", "_h": "H",
    }
)  # fmt: skip
"""How a name ends -> its unit; the first that fits."""
UNIT_OF_WORD = MappingProxyType({"voltage": "V", "current": "A", "power": "W"})
"""Words by which a last letter is a phase's, not a unit's: `motor_current_v` is a current."""
CODES = (
    "status_word", "interlocks", "fault_code", "trip_cause", "settings_count", "serial_number", "firmware_version", "map_version",
    "heartbeat_echo", "session_id", "samples_produced", "overruns", "store_count",
)  # fmt: skip
"""Items that are read by their bits, as codes or as counts."""
MEASURED = tuple(name for name in (*IDENTITY_ITEMS, *STATUS_ITEMS) if name not in ("drive_type", "magic"))
"""What else of identity and status is a number."""
TIMES = ("s", "ms")
UNITS_OF_QUANTITY: Mapping[str, tuple[str, ...]] = MappingProxyType(
    dict.fromkeys(RESISTANCES, ("ohm", "%"))
    | dict.fromkeys(INDUCTANCES, ("H", "ohm", "%"))
    | {"rotor_time_constant": TIMES, "power_factor": ("%",), "pole_pairs": (), "pole_count": ()}
)
"""Units in which a quantity can stand that has none in its name."""
TOPICS = frozenset(
    {
        "excite", "stream", "write_back", "restore", "tune", "identity", "watchdog", "parameters", "status_bits", "interlock_bits",
        "faults", "exceptions", "limits", "commands", "window", "unlock", "mailbox", "watchdog_ms", "pole_pairs", "pole_count",
        *(f.name for f in fields(LinkLimits)), *RATED_VALUES, *QUANTITIES, *COMMISSIONING_ITEMS, *CLAIM_ITEMS,
    }
)  # fmt: skip
"""What of a drive file is asked for, and so can be unknown: what it can do, its tables, and the items with a meaning here."""

Problem = tuple[str, object, str]


def check_contradictions(profile: DriveProfile) -> DriveProfile:
    """The profile itself. Raises ConfigurationError with the first thing that cannot be together with another."""
    for check in (_limits, _bits, _units, _scales, _copies, _order, _numbers, _written, _bases, _supervision, _topics):
        for key, value, expected in check(profile):
            raise ConfigurationError(file=profile.file, key=key, value=value, expected=expected)
    return profile


def _limits(profile: DriveProfile) -> Iterator[Problem]:
    """Every lower limit is at most its upper one."""
    identity, limits, watchdog = profile.identity, profile.limits, profile.watchdog
    pairs = [
        ("identity.firmware_min", identity.firmware_min, "firmware_max", identity.firmware_max),
        ("limits.dc_link_min_v", limits.dc_link_min_v, "dc_link_max_v", limits.dc_link_max_v),
    ]
    pairs += [(f"items.{i.name}.min", i.minimum, "max", i.maximum) for i in profile.items.values()]
    if watchdog is not None:
        pairs.append(("watchdog.min_ms", watchdog.min_ms, "max_ms", watchdog.max_ms))
    for key, lower, other, upper in pairs:
        if lower is not None and upper is not None and lower > upper:
            yield key, lower, f"at most {other}, which is {upper:.10g}"


def _bits(profile: DriveProfile) -> Iterator[Problem]:
    """One bit has one name."""
    flags = profile.window.flags if profile.window else {}
    tables: tuple[tuple[str, Mapping[str, int]], ...] = (
        ("status_bits.", profile.status_bits),
        ("interlock_bits.", profile.interlock_bits),
        ("window.flag_", flags),
    )
    for table, named in tables:
        first: dict[int, str] = {}
        for name, bit in named.items():
            if bit in first:
                yield f"{table}{name}", bit, f"a bit of its own: {table}{first[bit]} is {bit}"
            first[bit] = name


def _units(profile: DriveProfile) -> Iterator[Problem]:
    for item in profile.items.values():
        allowed = _units_by_name(item)
        if allowed is not None and item.unit not in (*allowed, *NO_UNIT):
            told = " or ".join(map(repr, allowed)) or "no unit"
            yield f"items.{item.name}.unit", item.unit, f"{told}, as the name says, with the scale that makes it so"


def _units_by_name(item: Item) -> tuple[str, ...] | None:
    """The units that an item's name allows; None where it tells none."""
    quantity = item.quantity or item.name.removeprefix("staged_").removeprefix("stored_")
    if quantity in UNITS_OF_QUANTITY:
        return UNITS_OF_QUANTITY[quantity]
    unit = next((unit for ending, unit in UNIT_OF_ENDING.items() if item.name.endswith(ending)), None)
    if unit is None:
        return None
    is_phase = item.name[-2:] in ("_a", "_v", "_w")
    return (unit, *(UNIT_OF_WORD[w] for w in item.name.split("_") if is_phase and w in UNIT_OF_WORD))


def _scales(profile: DriveProfile) -> Iterator[Problem]:
    for item in profile.items.values():
        if not SMALLEST_SCALE <= item.scale <= LARGEST_SCALE:
            limits = f"{SMALLEST_SCALE:g} ... {LARGEST_SCALE:g}: value = raw number * scale"
            yield f"items.{item.name}.scale", item.scale, limits


def _copies(profile: DriveProfile) -> Iterator[Problem]:
    """A parameter's staged and stored registers count as its own does, where they are of its type: it is written in one and read in another."""
    for name in profile.parameter_names:
        own = profile.items.get(name)
        for copy in (profile.items.get(f"staged_{name}"), profile.items.get(f"stored_{name}")):
            if own is not None and copy is not None and copy.type == own.type and copy.scale != own.scale:
                yield (
                    f"items.{copy.name}.scale",
                    copy.scale,
                    f"{own.scale:g}, as items.{name} has, which is the same value",
                )


def _order(profile: DriveProfile) -> Iterator[Problem]:
    order = profile.parameter_names
    for k, name in enumerate(order):
        if name in order[:k]:
            yield (
                f"parameters.order[{k}]",
                name,
                f"each parameter once: parameters.order[{order.index(name)}] is it too",
            )


def _numbers(profile: DriveProfile) -> Iterator[Problem]:
    """What is read as one number is one; what is read by its bits or as a code is counted as it stands."""
    watchdog = [profile.watchdog.register] if profile.watchdog else []
    for name in dict.fromkeys(
        (*CODES, *MEASURED, *RATED_VALUES, "pole_pairs", "pole_count", *profile.parameter_names, *watchdog)
    ):
        item = profile.items.get(name)
        if item is None:
            continue
        key = f"items.{name}"
        if item.type == "ascii":
            yield f"{key}.type", item.type, "a number's type"
        if item.length != 1:
            yield f"{key}.length", item.length, "1: it is one number"
        if name in CODES and item.type == "f32":
            yield f"{key}.type", item.type, "a whole number's type: it is read by its bits, as a code or as a count"
        if name in CODES and item.scale != 1.0:
            yield f"{key}.scale", item.scale, "1: it is read by its bits, as a code or as a count"
        if "r" not in item.access:
            yield f"{key}.access", item.access, "'r' or 'rw': it is read"


def _written(profile: DriveProfile) -> Iterator[Problem]:
    """What a drive without staging is given and gets back can be written; nothing else is written over it."""
    group = profile.parameters
    if group is None or group.is_staged or not profile.capabilities & {"write_back", "restore"}:
        return
    for k, name in enumerate(group.order):
        if profile.items[name].access != "rw":
            yield (
                f"parameters.order[{k}]",
                name,
                f"an item that can be written: items.{name}.access is {profile.items[name].access!r}",
            )
    unlock, store = profile.unlock, profile.store
    bare = {
        "unlock.writes": unlock.writes if unlock else (), "unlock.locks": unlock.locks if unlock else (),
        "parameters.enter": group.enter, "store.writes": store.writes if store else (),
    }  # fmt: skip
    for key, writes in bare.items():
        for address, _ in writes:
            for item in map(profile.item, group.order):
                if item.address <= address < item.end:
                    yield (
                        key,
                        address,
                        f"a register of its own: items.{item.name} stands there, and would be written over",
                    )


def _bases(profile: DriveProfile) -> Iterator[Problem]:
    """What is written in per cent, or as a reactance, is so much of what stands in the drive, which must be seen to be the job's motor."""
    if profile.kind == "commissioning_map" or "write_back" not in profile.capabilities:
        return
    for item in map(profile.item, profile.parameter_names):
        for name in base_values(item):
            if name not in profile.items:
                form = item.convention.replace("_", " ")
                yield (
                    f"items.{name}",
                    None,
                    f"a table for it: {item.name} is a {form}, which means nothing without the drive's own",
                )


def _supervision(profile: DriveProfile) -> Iterator[Problem]:
    """What arms the watchdog is a time and can be written; so can what feeds it while the drive is energised."""
    watchdog = profile.watchdog
    if watchdog is None:
        return
    register, is_map = profile.item(watchdog.register), profile.kind == "commissioning_map"
    if register.unit not in ("", *TIMES):
        yield f"items.{register.name}.unit", register.unit, "'s' or 'ms': it takes the watchdog's time"
    if is_map and watchdog.fed_by not in profile.items:
        yield "watchdog.fed_by", watchdog.fed_by, "the name of a table [items.NAME] in this file"
    written = {register.name: "the watchdog is armed by writing it"}
    if is_map or "excite" in profile.capabilities:
        written |= dict.fromkeys(("heartbeat", watchdog.fed_by), "the watchdog is fed by writing it")
    for name, why in written.items():
        if name in profile.items and "w" not in profile.items[name].access:
            yield f"items.{name}.access", profile.items[name].access, f"'rw' or 'w': {why}"


def _topics(profile: DriveProfile) -> Iterator[Problem]:
    """A name one letter off a known one: its sentence would reach nobody. Any other is a remark of the file's author."""
    known = TOPICS | set(profile.items)
    for topic in sorted(set(profile.unknown) - known):
        for near in get_close_matches(topic, known, n=1, cutoff=0.85):
            if not topic.startswith(f"{near}_"):
                yield f"unknown.{topic}", profile.unknown[topic], f"perhaps {near}"
