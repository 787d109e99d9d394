"""Names and sizes of causes as people say them; causes that the data cannot tell apart are one entry under both names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from commissioner.diagnose.catalogue import CATALOGUE
from commissioner.report.diagnosis.numbers import PLAIN_NUMBERS, quantity, quantity_name, short, sure
from commissioner.report.diagnosis.plain import LEGS, PLAIN, READ_LATE, RECORDED_SWING, Plain

Cause = Mapping[str, Any]
TOGETHER = frozenset({"dead_time", "device_drop"})
"""Every inverter has both, and both do the same at one switching frequency and link voltage."""
LATE = frozenset({"sampling_delay", "sensor_lag"})
COMMON: Mapping[frozenset[str], Mapping[str, str]] = {
    TOGETHER: {
        "voltage_v": "lost per leg",
        "half_current_a": "half of it reached at",
        "unequal_v": "leg V against the mean of the three",
        "unequal_w": "leg W against the mean of the three",
    },
    LATE: {"delay_us": "delay in all", "time_constant_us": "delay in all"},
}
"""What the members of a class share: the only sizes that are known while nobody knows which of them it is."""
COUNTS = {1: "one", 2: "two", 3: "three", 4: "four", 5: "five"}


def spoken(name: str) -> str:
    """`dc_link_sag` as `DC link sag`."""
    words = name.replace("_", " ")
    return f"DC{words[2:]}" if words.startswith("dc ") else words


def said(text: str) -> str:
    """A sentence with the catalogue's names as people say them."""
    for name in sorted(CATALOGUE, key=len, reverse=True):
        text = text.replace(name, spoken(name))
    return text


def members(cause: Cause) -> frozenset[str]:
    """The cause and what fits as well."""
    return frozenset((cause["name"], *cause["equivalent"]))


def class_name(cause: Cause) -> str:
    """`dead time + device drop, together`; `sampling delay or sensor lag`; a cause alone by its own name."""
    if members(cause) == TOGETHER:
        return "dead time + device drop, together"
    if "of_the_recorded_swing" in cause.get("parameters", {}):
        return "DC link's recorded swing"
    return " or ".join(spoken(n) for n in (cause["name"], *cause["equivalent"]))


def listed(names: list[str]) -> str:
    """`a, b and c`, a class in it without its `together`."""
    names = [n.removesuffix(", together") for n in names]
    return " and ".join((", ".join(names[:-1]), names[-1])) if len(names) > 1 else "".join(names)


def sure_words(cause: Cause) -> str:
    """How likely the name is; of a class, that it is one of its members."""
    if not cause["equivalent"]:
        return sure(cause["confidence"])
    if members(cause) == TOGETHER:
        return f"{sure(cause['confidence'])} that it is one of the two or both"
    count = len(members(cause))
    return f"{sure(cause['confidence'])} that it is one of the {COUNTS.get(count, count)}"


def sizes(cause: Cause) -> list[tuple[str, str]]:
    """What is measured and how much."""
    return [(name, quantity(cause["parameters"][key], key)) for key, name in _stated(cause).items()]


def _stated(cause: Cause) -> dict[str, str]:
    """Which sizes are stated, and what they are called; of a class only what its members share, with no member's own number."""
    if not cause["equivalent"]:
        return {key: quantity_name(key) for key in cause["parameters"]}
    shared = COMMON.get(members(cause), {})
    return {key: shared[key] for key in cause["parameters"] if key in shared}


def size_words(cause: Cause) -> str:
    """All sizes on one line."""
    known = sizes(cause)
    if not known:
        return "depends on which of them it is" if cause["equivalent"] else "-"
    return "; ".join(f"{name} {size}" for name, size in known)


def main_size(cause: Cause) -> str:
    """The one size of the headline."""
    key = _main_key(cause)
    return short(cause["parameters"][key], key) if key else ""


def main_quantity(cause: Cause) -> str:
    """The same with its interval, for a table."""
    key = _main_key(cause)
    return quantity(cause["parameters"][key], key) if key else "-"


def main_name(cause: Cause) -> str:
    """What it is called."""
    key = _main_key(cause)
    return _stated(cause)[key] if key else ""


def _main_key(cause: Cause) -> str:
    """Of the stated sizes the first; of several sensors or directions the largest. Empty where none is stated."""
    keys = list(_stated(cause))
    if not keys or members(cause) == TOGETHER:
        return next(iter(keys), "")
    entries = cause["parameters"]
    alike = [
        k for k in keys if entries[k]["unit"] == entries[keys[0]]["unit"] and (k not in PLAIN_NUMBERS or k == keys[0])
    ]
    return max(alike, key=lambda k: abs(entries[k]["value"]))


def plain_of(cause: Cause) -> Plain:
    """The words of the cause, or of its class."""
    if members(cause) == TOGETHER:
        return LEGS
    own = PLAIN[cause["name"]]
    if cause["name"] == "sampling_delay" and cause["parameters"].get("delay_us", {"value": 0.0})["value"] < 0.0:
        own = READ_LATE
    if "of_the_recorded_swing" in cause["parameters"]:
        own = RECORDED_SWING
    if not cause["equivalent"]:
        return own
    if members(cause) == LATE:
        return Plain(
            "The current comes {size} late (sampling delay or sensor lag)",
            own.motor,
            "",
            PLAIN["sampling_delay"].measurement,
        )
    others = [PLAIN[n] for n in cause["equivalent"]]
    is_one_side = all(o.motor == own.motor for o in others)
    return Plain(
        f"Part of the error is {class_name(cause)}; this recording cannot say which",
        own.motor if is_one_side else "",
        is_normal=own.is_normal and all(o.is_normal for o in others),
    )


def sentence(cause: Cause) -> str:
    """What the cause does, with its size, without a full stop; brackets without a size are left out."""
    size = main_size(cause)
    text = plain_of(cause).says
    if size:
        return text.format(size=size)
    import re

    return re.sub(r" by \{size\}|: \{size\}[^:]*$| ?\([^()]*\{size\}[^()]*\)|\{size\} ?", "", text)
