"""Rules of the motor parameters: staged, committed, stored. Values found before are in use and stored again after each rule."""

from __future__ import annotations

import struct
from collections.abc import Mapping

from commissioner.conformance import pdu
from commissioner.conformance.drive import Drive, words_for
from commissioner.conformance.records import Broken, Steps, Wait, Words
from commissioner.conformance.registry import rules_of
from commissioner.registers.codec import crc16_modbus

RULES, rule = rules_of("Write-back")

BUSY, DONE, WRONG_CHECK_SUM, OUT_OF_RANGE = 1, 2, 3, 4
POLLS, POLL_S = 400, 0.005
CHANGE = 1.01
"""What a rule changes a parameter by: far above the format's resolution, harmless for the seconds it is in use."""


@rule
def staged_values_are_held(drive: Drive) -> Steps[None]:
    """Staged values read back bit by bit, and staging alone changes nothing in use."""
    before = yield from _held(drive, "")
    target = _changed(before)
    yield from _stage(drive, target)
    seen = yield from _held(drive, "staged_")
    if seen != target:
        raise Broken(f"staged {target} and read {seen}")
    yield from _must_hold(drive, "", before, "staging")


@rule
def a_wrong_check_sum_is_refused(drive: Drive) -> Steps[None]:
    """A commit whose check sum misses by one bit ends with result 3 and changes nothing in use."""
    before = yield from _held(drive, "")
    for flipped in (0x0001, 0x8000):
        yield from _stage(drive, _changed(before), spoil=flipped)
        result = yield from _carried_out(drive, "commit")
        yield from _must_hold(drive, "", before, "a commit with a wrong check sum")
        if result != WRONG_CHECK_SUM:
            raise Broken(f"commit_result is {result}, wanted {WRONG_CHECK_SUM}: check sum wrong")


@rule
def the_check_sum_covers_every_value(drive: Drive) -> Steps[None]:
    """A commit is refused where any one of the staged values is not what the check sum was made over."""
    before = yield from _held(drive, "")
    for name in _order(drive):
        yield from _stage(drive, before)
        changed = _changed({name: before[name]})[name]
        yield from pdu.write(drive.item(f"staged_{name}").address, changed)
        result = yield from _carried_out(drive, "commit")
        yield from _must_hold(drive, "", before, f"a commit with another {name} than summed")
        if result != WRONG_CHECK_SUM:
            raise Broken(
                f"{name} was changed behind the check sum and commit_result is {result}, not {WRONG_CHECK_SUM}"
            )


@rule
def impossible_values_are_refused(drive: Drive) -> Steps[None]:
    """A commit with a negative, zero or absurdly large value ends with result 4 and changes nothing in use."""
    before = yield from _held(drive, "")
    for name in _order(drive):
        item = drive.item(f"staged_{name}")
        for value in (-1.0, 0.0, 1e9):
            yield from _stage(drive, before | {name: words_for(item, value)})
            result = yield from _carried_out(drive, "commit")
            yield from _must_hold(drive, "", before, f"a commit with {name} = {value:g}")
            if result != OUT_OF_RANGE:
                raise Broken(f"{name} = {value:g} {item.unit}: commit_result is {result}, wanted {OUT_OF_RANGE}")


@rule
def a_commit_brings_into_use_and_does_not_store(drive: Drive) -> Steps[None]:
    """A right commit ends with result 2; the staged values are in use, the stored ones and their counter unchanged."""
    before, stored = (yield from _held(drive, "")), (yield from _held(drive, "stored_"))
    count = yield from drive.number("store_count")
    target = _changed(before)
    yield from _stage(drive, target)
    result = yield from _carried_out(drive, "commit")
    seen = yield from _held(drive, "")
    stored_after, count_after = (yield from _held(drive, "stored_")), (yield from drive.number("store_count"))
    yield from _stage(drive, before)
    back = yield from _carried_out(drive, "commit")
    yield from _must_hold(drive, "", before, "committing the old values again")
    if (result, back) != (DONE, DONE):
        raise Broken(f"commit_result is {result} and {back}, wanted {DONE}: done")
    if seen != target:
        raise Broken(f"{target} was committed and {seen} is in use")
    if stored_after != stored or count_after != count:
        raise Broken(
            f"a commit changed what is stored: {stored} to {stored_after}, counter {count:g} to {count_after:g}"
        )


@rule
def only_the_command_word_commits(drive: Drive) -> Steps[None]:
    """Another word than the command changes nothing in use and stores nothing."""
    before, count = (yield from _held(drive, "")), (yield from drive.number("store_count"))
    yield from _stage(drive, _changed(before))
    for name in ("commit", "store"):
        yield from drive.put_words(name, [drive.profile.commands[name] ^ 0x0001])
        yield Wait(0.1)
        yield from drive.words("status_word")
    yield from _must_hold(drive, "", before, "a word that is not the command")
    if (yield from drive.number("store_count")) != count:
        raise Broken("a word that is not the command stored")


@rule
def a_store_writes_once(drive: Drive) -> Steps[None]:
    """A store ends with result 2, the memory holds what is in use, and its counter has grown by one."""
    before, count = (yield from _held(drive, "")), (yield from drive.number("store_count"))
    target = _changed(before)
    result, stored, after = yield from _stored(drive, target)
    back, _, _ = yield from _stored(drive, before)
    yield from _must_hold(drive, "stored_", before, "storing the old values again")
    if (result, back) != (DONE, DONE):
        raise Broken(f"store_result is {result} and {back}, wanted {DONE}: done")
    if stored != target:
        raise Broken(f"{target} was in use when a store was asked for and {stored} is stored")
    if after != count + 1:
        raise Broken(f"store_count went from {count:g} to {after:g} by one store")


def _stored(drive: Drive, values: Mapping[str, Words]) -> Steps[tuple[int, dict[str, Words], float]]:
    """Commit and store a set: the store's result, what is stored then, and the memory's counter."""
    yield from _stage(drive, values)
    yield from _carried_out(drive, "commit")
    result = yield from _carried_out(drive, "store")
    return result, (yield from _held(drive, "stored_")), (yield from drive.number("store_count"))


def _order(drive: Drive) -> tuple[str, ...]:
    assert drive.profile.parameters is not None
    return drive.profile.parameters.order


def _held(drive: Drive, prefix: str) -> Steps[dict[str, Words]]:
    """The words of every parameter of a set: in use (empty), `staged_` or `stored_`."""
    held = {}
    for name in _order(drive):
        held[name] = yield from drive.words(prefix + name)
    return held


def _must_hold(drive: Drive, prefix: str, wanted: Mapping[str, Words], after: str) -> Steps[None]:
    seen = yield from _held(drive, prefix)
    if seen != wanted:
        name = next(name for name in wanted if seen[name] != wanted[name])
        raise Broken(f"after {after} {prefix}{name} is {seen[name]}, wanted {wanted[name]}")


def _changed(words: Mapping[str, Words]) -> dict[str, Words]:
    """The same floats times `CHANGE`, as words (the wire's unit: no scale in between)."""

    def times(pair: Words) -> Words:
        (value,) = struct.unpack(">f", struct.pack(">2H", *pair))
        return struct.unpack(">2H", struct.pack(">f", value * CHANGE))

    return {name: times(pair) for name, pair in words.items()}


def _stage(drive: Drive, values: Mapping[str, Words], spoil: int = 0) -> Steps[None]:
    """Stage a set with its check sum, or one that misses by the bits of `spoil`."""
    words = [word for name in _order(drive) for word in values[name]]
    yield from pdu.write(drive.item(f"staged_{_order(drive)[0]}").address, words)
    assert drive.profile.parameters is not None and drive.profile.parameters.staged_crc is not None
    yield from drive.put_words(drive.profile.parameters.staged_crc, [crc16_modbus(words) ^ spoil])


def _carried_out(drive: Drive, command: str) -> Steps[int]:
    """Give the command and wait until its result is no longer busy. Broken where it stays so."""
    yield from drive.put_words(command, [drive.profile.commands[command]])
    for _ in range(POLLS):
        (result,) = yield from drive.words(f"{command}_result")
        if result != BUSY:
            return result
        yield Wait(POLL_S)
    raise Broken(f"{command}_result is still busy after {POLLS * POLL_S:g} s")
