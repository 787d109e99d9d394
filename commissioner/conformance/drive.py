"""The drive under test as rules see it: items by name, states, enabling, windows. Every method is a course of requests."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from commissioner.conformance import pdu
from commissioner.conformance.records import Broken, NotTested, Steps, Wait, Words
from commissioner.conformance.signal import Real, Signal, Supervision
from commissioner.registers.codec import Value, crc16_modbus, decode_span, encode_item, encode_span
from commissioner.registers.profile import DriveProfile, Item, WindowLayout, plan_spans
from commissioner.registers.status import DriveState, decode_state

DISABLE_VOLTAGE, QUICK_STOP, SHUTDOWN, SWITCH_ON, ENABLE, RESET_FAULT = 0x00, 0x02, 0x06, 0x07, 0x0F, 0x80
POLLS = 200
POLL_S = 0.005


@dataclass(frozen=True)
class RawWindow:
    """A window as it came: nothing believed, nothing refused. `data` is samples by channels, in counts."""

    session: int
    first: int
    count: int
    mask: int
    flags: int
    dc_link_raw: int
    has_right_check_sum: bool
    data: Real


class Drive:
    """`level_v`: the bias that makes the test current, found by the first rule that energises; 0 until then."""

    def __init__(self, profile: DriveProfile, device: int, *, is_serial: bool) -> None:
        self.profile = profile
        self.device = device
        self.is_serial = is_serial
        self.level_v = 0.0
        self.test_current_a = 0.0
        self.heartbeat = 0

    # --- items ------------------------------------------------------------------------------------------------------
    def item(self, name: str) -> Item:
        return self.profile.item(name)

    @property
    def layout(self) -> WindowLayout:
        assert self.profile.window is not None
        return self.profile.window

    @property
    def watchdog_range_ms(self) -> tuple[int, int]:
        """Shortest and longest watchdog time of the drive file, ms."""
        assert self.profile.watchdog is not None
        return int(self.profile.watchdog.min_ms), int(self.profile.watchdog.max_ms)

    def words(self, name: str) -> Steps[Words]:
        item = self.item(name)
        return (yield from pdu.read(item.address, item.words))

    def get(self, *names: str) -> Steps[dict[str, Value]]:
        """The items' values in their units."""
        values: dict[str, Value] = {}
        limit = self.profile.link.max_read_registers
        for span in plan_spans([self.item(name) for name in names], limit):
            values |= decode_span(span, (yield from pdu.read(span.address, span.count)))
        return values

    def get_word_by_word(self, *names: str) -> Steps[dict[str, Value]]:
        """The same, no two registers in one request."""
        values: dict[str, Value] = {}
        for name in names:
            (span,) = plan_spans([self.item(name)], self.profile.link.max_read_registers)
            words: Words = ()
            for at in range(span.count):
                words += yield from pdu.read(span.address + at, 1)
            values |= decode_span(span, words)
        return values

    def number(self, name: str) -> Steps[float]:
        (value,) = yield from self.numbers(name)
        return value

    def numbers(self, *names: str) -> Steps[tuple[float, ...]]:
        """The items' values in the order of the names. Broken where one is no number."""
        values = yield from self.get(*names)
        numbers = []
        for name in names:
            value = values[name]
            if not isinstance(value, int | float):
                raise Broken(f"{name} is no number: {value!r}")
            numbers.append(float(value))
        return tuple(numbers)

    def put(self, values: Mapping[str, Value]) -> Steps[None]:
        """Write items, neighbours in one request."""
        limit = self.profile.link.max_write_registers
        for span in plan_spans([self.item(name) for name in values], limit):
            yield from pdu.write(span.address, encode_span(span, values))

    def put_words(self, name: str, words: Sequence[int]) -> Steps[None]:
        yield from pdu.write(self.item(name).address, words)

    def refuses(self, name: str, words: Sequence[int], codes: Sequence[int]) -> Steps[None]:
        """Broken unless writing these words is refused so and the item still holds what it held."""
        item = self.item(name)
        before = yield from self.words(name)
        yield from pdu.refusal(pdu.write_pdu(item.address, words), codes, f"write {tuple(words)} into {name}")
        after = yield from self.words(name)
        if not same(before, after):
            raise Broken(f"{name} changed from {before} to {after} by a write that was refused")

    # --- states -----------------------------------------------------------------------------------------------------
    def state(self) -> Steps[DriveState]:
        (word,) = yield from self.words("status_word")
        return decode_state(self.profile.status_decoder, word, self.profile.status_bits)

    def command(self, word: int) -> Steps[None]:
        yield from pdu.write(self.item("control_word").address, [word])

    def reaches(self, wanted: DriveState, polls: int = POLLS) -> Steps[DriveState]:
        """The state after waiting for `wanted`, heart beating; the last one seen where it does not come."""
        seen = DriveState.UNKNOWN
        for _ in range(polls):
            yield from self.beat()
            seen = yield from self.state()
            if seen is wanted:
                break
            yield Wait(POLL_S)
        return seen

    def must_reach(self, wanted: DriveState, after: str) -> Steps[None]:
        seen = yield from self.reaches(wanted)
        if seen is not wanted:
            raise Broken(f"after {after} the drive is '{seen.value}', wanted '{wanted.value}'")

    def beat(self) -> Steps[None]:
        """A changed heartbeat."""
        self.heartbeat = (self.heartbeat + 1) & 0xFFFF
        yield from pdu.write(self.item("heartbeat").address, [self.heartbeat])

    def make_safe(self) -> Steps[None]:
        """Output off, faults reset, whatever the rule before left behind; raises nothing about what it sees."""
        for word in (DISABLE_VOLTAGE, RESET_FAULT, DISABLE_VOLTAGE):
            yield from self.command(word)
        for _ in range(POLLS):
            state = yield from self.state()
            if not state.may_be_energised and state is not DriveState.FAULT:
                return
            yield Wait(POLL_S)

    # --- energised ----------------------------------------------------------------------------------------------------
    def supervision(self, **changes: float) -> Supervision:
        """Wide enough for the test current and no wider."""
        wanted = {"watchdog_ms": 1000.0, "current_limit_a": 3.0 * self.test_current_a, "test_time_limit_s": 60.0}
        wanted |= {"voltage_limit_v": max(6.0 * self.level_v, 10.0)} | changes
        return Supervision(int(wanted.pop("watchdog_ms")), **wanted)

    def set_up(self, signal: Signal, supervision: Supervision) -> Steps[None]:
        """Everything an enable needs, written in whole spans."""
        tones = tuple(float(part) for tone in signal.tones for part in tone)
        yield from self.put(
            {
                "watchdog_ms": supervision.watchdog_ms,
                "current_limit_a": supervision.current_limit_a,
                "test_time_limit_s": supervision.test_time_limit_s,
                "voltage_limit_v": supervision.voltage_limit_v,
                "axis_deg": signal.axis_deg,
                "dc_bias_v": signal.bias_v,
                "bias_ramp_v_per_s": signal.bias_ramp_v_per_s,
                "amplitude_scale": signal.scale,
                "scale_ramp_per_s": signal.scale_ramp_per_s,
                "duration_s": signal.duration_s,
                "tone_count": len(signal.tones),
                "tones": tones,
                "channel_mask": signal.mask,
                "decimation": signal.decimation,
                "mode": 1,
            }
        )

    def walk_to_enabled(self, held: int = 0) -> Steps[None]:
        """The three commands, whatever the drive makes of them; `held` bits are set in each."""
        for word in (SHUTDOWN, SWITCH_ON, ENABLE):
            yield from self.beat()
            yield from self.command(word | held)

    def enable(self, signal: Signal, supervision: Supervision | None = None) -> Steps[None]:
        """Set up and energise. Broken where the drive does not follow."""
        yield from self.set_up(signal, supervision or self.supervision())
        yield from self.walk_to_enabled()
        seen = yield from self.reaches(DriveState.OPERATION_ENABLED)
        if seen is not DriveState.OPERATION_ENABLED:
            raise Broken(f"the drive does not enable: '{seen.value}'")

    def stop(self) -> Steps[None]:
        yield from self.command(DISABLE_VOLTAGE)
        yield from self.must_reach(DriveState.SWITCH_ON_DISABLED, "disable voltage")

    def window(self, index: int, registers: int | None = None) -> Steps[RawWindow]:
        """The window from `index` on, or its first registers, the watchdog fed."""
        self.heartbeat = (self.heartbeat + 1) & 0xFFFF
        request = [self.heartbeat, index >> 16 & 0xFFFF, index & 0xFFFF]
        address, layout = self.item("heartbeat").address, self.layout
        asked = layout.words if registers is None else registers
        if self.profile.link.has_read_write_multiple:
            return self.decoded((yield from pdu.exchange(address, request, layout.address, asked)))
        yield from pdu.write(address, request)
        return self.decoded((yield from pdu.read(layout.address, asked)))

    def decoded(self, words: Words) -> RawWindow:
        """The window's words as they claim to be; a count that cannot be is cut to what is there."""
        head = self.layout.header_words
        session, high, low, count, mask, flags, link, crc = words[:head]
        channels = mask.bit_count()
        rows = min(count, (len(words) - head) // channels) if channels else 0
        used = words[head : head + rows * channels]
        data = np.array(used, np.uint16).astype(np.int16).astype(float).reshape(rows, channels)
        right = crc16_modbus([*words[: head - 1], *used]) == crc
        return RawWindow(session, high << 16 | low, count, mask, flags, link, right, data)

    def stream(self, samples: int, start: int = 0) -> Steps[list[RawWindow]]:
        """Windows one after the other from `start` on until so many samples are there or the session has ended."""
        index, windows, idle = start, [], 0
        ended = self.layout.flags["ended"]
        while index < start + samples:
            window = yield from self.window(index)
            windows.append(window)
            index = window.first + window.count
            idle = 0 if window.count else idle + 1
            if window.flags & ended or idle > POLLS:
                break
            if window.count < self.layout.data_registers // max(1, window.mask.bit_count()):
                yield Wait(POLL_S)  # a window that is full costs the line no more than one that is not
        return windows

    def recorded(self, signal: Signal, samples: int, supervision: Supervision | None = None) -> Steps[Real]:
        """Enable, take so many samples, stop; samples by channels in counts. Broken where fewer came."""
        yield from self.enable(signal, supervision)
        data = joined((yield from self.stream(samples)))
        yield from self.stop()
        if len(data) < samples:
            raise Broken(f"{len(data)} samples came, wanted {samples}")
        return data[:samples]

    def scales(self) -> Steps[dict[str, float]]:
        names = ("control_period_s", "voltage_scale_v", "current_scale_a", "dc_link_scale_v")
        return dict(zip(names, (yield from self.numbers(*names)), strict=True))

    def needs_level(self) -> None:
        """NotTested where no test current was found."""
        if not self.level_v:
            raise NotTested("no bias that makes a test current was found")


def joined(windows: Sequence[RawWindow]) -> Real:
    """All samples of a stream, one row each."""
    rows = [window.data for window in windows if window.count and len(window.data)]
    widths = {block.shape[1] for block in rows}
    if len(widths) > 1:
        raise Broken(f"the windows of one session carry {sorted(widths)} channels")
    return np.concatenate(rows) if rows else np.zeros((0, 1))


def same(first: Words, second: Words) -> bool:
    return tuple(first) == tuple(second)


def nan_words(item: Item) -> Words:
    """A quiet NaN as every element of the item."""
    return (0x7FC0, 0x0000) * item.length


def words_for(item: Item, value: Value) -> Words:
    """`value` without the item's own range in the way."""
    return encode_item(replace(item, minimum=None, maximum=None), value)


def is_close(seen: float, wanted: float, relative: float) -> bool:
    return math.isfinite(seen) and abs(seen - wanted) <= relative * abs(wanted)
