"""Rules of the link: functions, addresses, exceptions, whole numbers, time."""

from __future__ import annotations

from commissioner.conformance import pdu
from commissioner.conformance.drive import Drive, nan_words, same, words_for
from commissioner.conformance.records import Ask, Broken, NotTested, Steps
from commissioner.conformance.registry import rules_of
from commissioner.registers.profile import Item, plan_spans

RULES, rule = rules_of("Truths about the link")

TOKENS = (0xA5C3, 0x0000, 0xFFFF, 0x1234)
TIMED_READS = 11
TIME_ALLOWANCE_S = 0.05
"""On top of the drive file's turn-around: network, converter and a busy computer."""
STILL_THERE = 3
"""libmodbus 3.1.6 takes the frame that follows a request to another device for that device's answer and drops it."""
UNKNOWN_FUNCTION = 0x41
"""Of the user-defined range (65 ... 72) that no drive of this map implements."""


@rule
def echo_holds_any_word(drive: Drive) -> Steps[None]:
    """The echo register holds every token it is given, written by function 6 or 16."""
    address = drive.item("echo").address
    for k, token in enumerate(TOKENS):
        yield from (pdu.write_one(address, token) if k % 2 else pdu.write(address, [token]))
        (seen,) = yield from pdu.read(address, 1)
        if seen != token:
            raise Broken(f"the echo register was given 0x{token:04X} and holds 0x{seen:04X}")


@rule
def function_23_writes_before_it_reads(drive: Drive) -> Steps[None]:
    """Function 23 writes first: the echo register read in the same transaction shows the token just written."""
    if not drive.profile.link.has_read_write_multiple:
        raise NotTested("the drive file says that the drive has no function 23")
    address = drive.item("echo").address
    for token in TOKENS:
        (seen,) = yield from pdu.exchange(address, [token], address, 1)
        if seen != token:
            raise Broken(f"0x{token:04X} was written and 0x{seen:04X} read in one transaction")


@rule
def reads_agree_however_they_are_cut(drive: Drive) -> Steps[None]:
    """A run of registers read in one request is what its items are, read one by one."""
    fixed = [drive.item(name) for name in ("magic", "map_version", "firmware_version", "serial_number", "drive_type")]
    for span in plan_spans(fixed, drive.profile.link.max_read_registers):
        whole = yield from pdu.read(span.address, span.count)
        for address in range(span.address, span.address + span.count):
            (word,) = yield from pdu.read(address, 1)
            if word != whole[address - span.address]:
                raise Broken(
                    f"register {address} is 0x{word:04X} alone and 0x{whole[address - span.address]:04X} in a run"
                )


@rule
def longest_read_is_answered_and_longer_refused(drive: Drive) -> Steps[None]:
    """As many registers as the drive file allows come in one answer; none and one more than Modbus allows are refused."""
    layout = drive.layout
    yield from pdu.read(layout.address, layout.words)
    for count in (0, 126):
        yield from pdu.refusal(
            pdu.read_pdu(layout.address, count), (pdu.BAD_VALUE, pdu.BAD_ADDRESS), f"read {count} registers"
        )


@rule
def unmapped_registers_are_refused(drive: Drive) -> Steps[None]:
    """Reading or writing a register outside the map is answered with exception 2."""
    for address in _unmapped(drive):
        yield from pdu.refusal(pdu.read_pdu(address, 1), (pdu.BAD_ADDRESS,), f"read the unmapped register {address}")
        yield from pdu.refusal(
            pdu.write_pdu(address, [1]), (pdu.BAD_ADDRESS,), f"write the unmapped register {address}"
        )
    before = _unmapped(drive)[0]
    yield from pdu.refusal(
        pdu.read_pdu(before - 1, 2),
        (pdu.BAD_ADDRESS,),
        f"read registers {before - 1} and {before}, the second unmapped",
    )


@rule
def unknown_functions_are_refused(drive: Drive) -> Steps[None]:
    """A function the map does not use is answered with exception 1."""
    yield from pdu.refusal(bytes([UNKNOWN_FUNCTION]), (pdu.BAD_FUNCTION,), f"function {UNKNOWN_FUNCTION}")


@rule
def read_only_items_stay(drive: Drive) -> Steps[None]:
    """Writing an item that can only be read is refused and changes nothing."""
    for name in (
        "magic",
        "serial_number",
        "rated_drive_current_a",
        "ring_capacity",
        "stator_resistance",
        "store_count",
    ):
        item = drive.item(name)
        yield from drive.refuses(name, [1] * item.words, (pdu.BAD_ADDRESS, pdu.BAD_VALUE))


@rule
def numbers_are_never_written_by_half(drive: Drive) -> Steps[None]:
    """A request that would change one half of a 32-bit number is refused and changes nothing."""
    item = drive.item("current_limit_a")
    before = yield from drive.words(item.name)
    for address in (item.address, item.address + 1):
        request = pdu.write_one_pdu(address, 0x4120)
        yield from pdu.refusal(request, (pdu.BAD_ADDRESS, pdu.BAD_VALUE), f"write half of {item.name} at {address}")
    after = yield from drive.words(item.name)
    if not same(before, after):
        raise Broken(f"half of {item.name} was written: {before} became {after}")


@rule
def one_bad_value_keeps_the_whole_request_out(drive: Drive) -> Steps[None]:
    """A request with one value out of range changes none of its items."""
    names = ("watchdog_ms", "current_limit_a")
    watchdog, limit = (drive.item(name) for name in names)
    if limit.address != watchdog.end:
        raise NotTested("watchdog and current limit do not lie side by side in this drive file")
    before = yield from pdu.read(watchdog.address, watchdog.words + limit.words)
    shortest, _ = drive.watchdog_range_ms
    request = pdu.write_pdu(watchdog.address, [*words_for(watchdog, shortest + 7), *words_for(limit, -1.0)])
    yield from pdu.refusal(request, (pdu.BAD_VALUE,), "write a good watchdog time and a negative current limit")
    after = yield from pdu.read(watchdog.address, watchdog.words + limit.words)
    if not same(before, after):
        raise Broken(f"{before} became {after} by a request that was refused")


@rule
def values_out_of_range_are_refused(drive: Drive) -> Steps[None]:
    """A value below an item's minimum, above its maximum, or not a number is refused with exception 3 and changes nothing."""
    for name, words in _out_of_range(drive):
        yield from drive.refuses(name, words, (pdu.BAD_VALUE,))


@rule
def answers_come_within_the_turn_around(drive: Drive) -> Steps[None]:
    """The middle one of many answers begins within the drive file's turn-around time."""
    limit_s = drive.profile.link.turnaround_s + TIME_ALLOWANCE_S
    address = drive.item("status_word").address
    took = []
    for _ in range(TIMED_READS):
        reply = yield Ask(pdu.read_pdu(address, 1))
        pdu.words_of(reply, pdu.READ, 1, "read the status word")
        took.append(reply.took_s)
    middle = sorted(took)[TIMED_READS // 2]
    if middle > limit_s:
        raise Broken(f"an answer takes {1e3 * middle:.0f} ms, wanted at most {1e3 * limit_s:.0f} ms")


@rule
def other_devices_numbers_are_left_alone(drive: Drive) -> Steps[None]:
    """On a serial line a request to another device number is not answered."""
    if not drive.is_serial:
        raise NotTested("only a serial line has several devices")
    other = drive.device % 247 + 1
    reply = yield Ask(pdu.read_pdu(drive.item("echo").address, 1), device=other)
    if reply.pdu is not None or reply.flaw:
        raise Broken(f"a request to device {other} was answered by the drive, which is device {drive.device}")
    for _ in range(STILL_THERE):
        reply = yield Ask(pdu.read_pdu(drive.item("echo").address, 1))
        if reply.pdu is not None:
            break
    pdu.words_of(reply, pdu.READ, 1, "read the echo register after another device was asked")


def _unmapped(drive: Drive) -> tuple[int, ...]:
    """The first register behind each of two runs of the map, and one far away."""
    taken = {a for item in drive.profile.items.values() for a in range(item.address, item.end)}
    taken |= set(range(drive.layout.address, drive.layout.address + drive.layout.words))
    ends = sorted(address + 1 for address in taken if address + 1 not in taken)
    return (ends[0], ends[-1], 0xFFF0 if 0xFFF0 not in taken else ends[-1])


def _out_of_range(drive: Drive) -> list[tuple[str, tuple[int, ...]]]:
    """(item, words) the drive must refuse: the drive file's own bounds, what the map bounds, and NaN."""
    cases: list[tuple[str, tuple[int, ...]]] = []
    for item in drive.profile.items.values():
        if "w" not in item.access or item.length > 1:
            continue
        cases += [(item.name, words_for(item, value)) for value in _beyond(item)]
        if item.type == "f32":
            cases.append((item.name, nan_words(item)))
    for name, value in (("amplitude_scale", 1.5), ("amplitude_scale", -0.5), ("duration_s", -1.0)):
        cases.append((name, words_for(drive.item(name), value)))
    for name in ("current_limit_a", "test_time_limit_s", "voltage_limit_v", "bias_ramp_v_per_s", "scale_ramp_per_s"):
        cases.append((name, words_for(drive.item(name), -1.0)))
    return [*cases, ("channel_mask", (0,)), ("channel_mask", (16,))]


def _beyond(item: Item) -> list[float]:
    """One below the minimum and one above the maximum, where the register can hold it."""
    below = [item.minimum - 1] if item.minimum is not None and item.minimum > 0 else []
    above = [item.maximum + 1] if item.maximum is not None and item.type == "u16" and item.maximum < 0xFFFF else []
    return [*below, *above]
