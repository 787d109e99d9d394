"""Worked examples of a drive file: address, words, value and conversion carried out as the cited document does, to the last digit."""

from __future__ import annotations

from collections.abc import Iterator

from commissioner.errors import ConfigurationError, ReplyMismatch, UsageError
from commissioner.registers.codec import decode_item, encode_item
from commissioner.registers.convention import CONVENTIONS, per_phase_value
from commissioner.registers.mailbox import request
from commissioner.registers.profile import DriveProfile, Item, Worked

DIGITS = 12
"""Compared after rounding to so many significant digits: scales like 0.0001 have no exact binary form."""
FLOAT_DIGITS = 7
"""Of a 32-bit float, which holds no more."""


def check_worked(profile: DriveProfile) -> DriveProfile:
    """The profile itself. ConfigurationError where an example does not come out, or a parameter that can be written has none."""
    for index, example in enumerate(profile.worked):
        for key, seen, wanted in _compared(profile, example, index):
            digits = FLOAT_DIGITS if profile.item(example.item).type == "f32" else DIGITS
            if not _same(seen, wanted, digits):
                raise ConfigurationError(
                    file=profile.file, key=f"worked[{index}].{key}", value=wanted, expected=f"{seen!r} by this file"
                )
    if profile.kind == "commercial" and "write_back" in profile.capabilities:
        _check_each_has_one(profile)
    return profile


def _check_each_has_one(profile: DriveProfile) -> None:
    proved = {w.item for w in profile.worked if w.words and w.value is not None and w.per_phase is not None}
    for name in profile.parameter_names:
        if profile.item(name).convention and name not in proved:
            raise ConfigurationError(
                file=profile.file, key="worked", value=None,
                expected=f"an example with item = {name!r}, words, value and per_phase: what is written must be proved",
            )  # fmt: skip


def _compared(profile: DriveProfile, example: Worked, index: int) -> Iterator[tuple[str, object, object]]:
    """Key, what the file makes of it, what the document says."""
    if example.item not in profile.items:
        raise ConfigurationError(
            file=profile.file,
            key=f"worked[{index}].item",
            value=example.item,
            expected="the name of a table [items.NAME]",
        )
    item = profile.item(example.item)
    if example.wire is not None:
        yield "wire", item.address, example.wire
    if example.words and example.value is not None:
        try:
            yield "value", decode_item(item, example.words), example.value
            yield "words", encode_item(item, example.value), example.words
        except (ReplyMismatch, UsageError) as error:
            raise ConfigurationError(
                file=profile.file, key=f"worked[{index}].words", value=list(example.words), expected=str(error.limit)
            ) from error
    if example.request:
        yield "request", _as_written(profile, example), example.request
    if example.per_phase is not None and example.value is not None:
        yield "per_phase", _per_phase(profile, item, example, f"worked[{index}].per_phase"), example.per_phase


def _per_phase(profile: DriveProfile, item: Item, example: Worked, key: str) -> float:
    assert example.value is not None
    try:
        if item.convention in CONVENTIONS:
            return per_phase_value(item, example.value, example)
        expected = "left out where the item has no convention"
    except UsageError as error:
        expected = f"beside {error.limit} of the document's motor"
    raise ConfigurationError(file=profile.file, key=key, value=example.per_phase, expected=expected)


def _as_written(profile: DriveProfile, example: Worked) -> tuple[int, ...] | None:
    """The request by which this file writes the example's words, with the reference of the printed one; None without mailbox."""
    item = profile.item(example.item)
    if profile.mailbox is None or item.parameter is None or len(example.request) < 3:
        return None
    return request(profile.mailbox, item, example.request[2] >> 8, example.words)


def _same(seen: object, wanted: object, digits: int) -> bool:
    if isinstance(seen, float) and isinstance(wanted, int | float):
        return f"{seen:.{digits}g}" == f"{float(wanted):.{digits}g}"
    return seen == wanted
