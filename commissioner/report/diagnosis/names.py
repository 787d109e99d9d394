"""Names and sizes of causes as people say them; causes that the data cannot tell apart are one entry under both names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from commissioner.diagnose.causes import CATALOGUE, TOGETHER, between
from commissioner.diagnose.causes.cause import AsOne, Words
from commissioner.report.diagnosis.numbers import PLAIN_NUMBERS, quantity, short, sure
from commissioner.report.sheet.words import cause_name, quantity_name

Cause = Mapping[str, Any]
COUNTS = {1: "one", 2: "two", 3: "three", 4: "four", 5: "five"}


def said(text: str) -> str:
    """A sentence with the catalogue's names as people say them."""
    for name in sorted(CATALOGUE, key=len, reverse=True):
        text = text.replace(name, cause_name(name))
    return text


def members(cause: Cause) -> frozenset[str]:
    """The cause and what fits as well."""
    return frozenset((cause["name"], *cause["equivalent"]))


def is_together(names: Iterable[str]) -> bool:
    """Whether every inverter has both: such a class leaves nothing open that matters."""
    return frozenset(names) in TOGETHER


def _as_one(cause: Cause) -> AsOne | None:
    """The words of two that data cannot tell apart."""
    return between(*members(cause)).as_one if len(members(cause)) == 2 else None


def class_name(cause: Cause) -> str:
    """`dead time + device drop, together`; `sampling delay or sensor lag`; a cause alone by its own name."""
    one = _as_one(cause)
    words = one.words if one else _own_words(cause)
    if words.called:
        return words.called
    return " or ".join(cause_name(n) for n in (cause["name"], *cause["equivalent"]))


def listed(names: list[str]) -> str:
    """`a, b and c`, a class in it without its `together`."""
    names = [n.removesuffix(", together") for n in names]
    return " and ".join((", ".join(names[:-1]), names[-1])) if len(names) > 1 else "".join(names)


def sure_words(cause: Cause) -> str:
    """How likely the name is; of a class, that it is one of its members."""
    if not cause["equivalent"]:
        return sure(cause["confidence"])
    if is_together(members(cause)):
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
    one = _as_one(cause)
    shared = one.sizes if one else {}
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
    if not keys or is_together(members(cause)):
        return next(iter(keys), "")
    entries = cause["parameters"]
    alike = [
        k for k in keys if entries[k]["unit"] == entries[keys[0]]["unit"] and (k not in PLAIN_NUMBERS or k == keys[0])
    ]
    return max(alike, key=lambda k: abs(entries[k]["value"]))


def _own_words(cause: Cause) -> Words:
    known = CATALOGUE[cause["name"]]
    return known.words_for({key: size["value"] for key, size in cause.get("parameters", {}).items()})


def plain_of(cause: Cause) -> Words:
    """The words of the cause, or of its class."""
    if one := _as_one(cause):
        return one.words
    own = _own_words(cause)
    if not cause["equivalent"]:
        return own
    others = [CATALOGUE[n].words for n in cause["equivalent"]]
    is_one_side = all(o.motor == own.motor for o in others)
    return Words(
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
