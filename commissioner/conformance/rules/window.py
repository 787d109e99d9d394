"""Rules of the sample window: idempotent, whole, honest about what is missing."""

from __future__ import annotations

import numpy as np

from commissioner.conformance import pdu
from commissioner.conformance.drive import Drive, RawWindow, is_close, joined
from commissioner.conformance.records import Broken, NotTested, Steps
from commissioner.conformance.registry import rules_of
from commissioner.conformance.signal import Signal, block_means, commanded_v

RULES, rule = rules_of("The commissioning map: sample window", energises=True)

LONGEST_FILL_S = 20.0
"""A ring that takes longer than this to overflow is not waited for."""
MOST_POLLS = 50000


def _running(drive: Drive, **changes: float) -> Steps[None]:
    """A quiet test: bias and one tone at the level."""
    drive.needs_level()
    tone = (0.5 * drive.level_v, 12.5, 0.3)
    mask, decimation = int(changes.get("mask", 15)), int(changes.get("decimation", 1))
    yield from drive.enable(Signal(bias_v=drive.level_v, tones=(tone,), mask=mask, decimation=decimation))


@rule
def the_check_sum_is_right(drive: Drive) -> Steps[None]:
    """The CRC-16/MODBUS over header and samples is right in every window, full, part full or empty."""
    yield from _running(drive)
    windows = yield from drive.stream(300)
    windows.append((yield from drive.window(1 << 24)))
    yield from drive.stop()
    windows += yield from drive.stream(300)
    for window in windows:
        if not window.has_right_check_sum:
            raise Broken(f"the check sum of the window from {window.first} ({window.count} samples) is wrong")


@rule
def the_header_says_what_the_window_is(drive: Drive) -> Steps[None]:
    """Session, channel mask, first index and DC link of every window are those of the session."""
    yield from _running(drive)
    windows = yield from drive.stream(300)
    session, link_v, scale_v = yield from drive.numbers("session_id", "dc_link_v", "dc_link_scale_v")
    yield from drive.stop()
    index = 0
    for window in windows:
        if (window.session, window.mask) != (session, 15):
            raise Broken(f"the header names session {window.session}, mask {window.mask}; wanted {session:g}, 15")
        if window.first != index:
            raise Broken(f"sample {index} was asked for and the header names {window.first}")
        if window.count * 4 > drive.layout.data_registers:
            raise Broken(f"{window.count} samples of 4 channels do not fit {drive.layout.data_registers} registers")
        if not is_close(window.dc_link_raw * scale_v, link_v, 0.03):
            raise Broken(f"dc_link_raw is {window.dc_link_raw * scale_v:.1f} V, the status says {link_v:.1f} V")
        index += window.count


@rule
def asking_again_gives_the_same_samples(drive: Drive) -> Steps[None]:
    """The same index, asked for again and again while the test goes on, gives the same samples."""
    yield from _running(drive)
    windows = yield from drive.stream(300)
    first = next((w for w in windows if w.count), None)
    if first is None:
        raise Broken("no sample came while the test was running")
    for _ in range(3):
        yield from drive.stream(100)
        again = yield from drive.window(first.first)
        rows = min(len(again.data), len(first.data))
        if again.first != first.first or not rows or not np.array_equal(again.data[:rows], first.data[:rows]):
            raise Broken(f"sample {first.first} on, asked for again, came as {again.first} on with other values")
    yield from drive.stop()


@rule
def windows_join_without_gap(drive: Drive) -> Steps[None]:
    """A reader that keeps pace gets every sample once, in order, and nothing is called overrun."""
    yield from _running(drive)
    windows = yield from drive.stream(2000)
    overruns, produced = (yield from drive.number("overruns")), (yield from drive.number("samples_produced"))
    yield from drive.stop()
    index = 0
    for window in windows:
        if window.first != index or window.flags & drive.layout.flags["overrun"]:
            raise Broken(f"sample {index} was asked for, {window.first} came, flags 0x{window.flags:02X}")
        index += window.count
    if overruns or produced < index:
        raise Broken(f"{index} samples were read; overruns {overruns:g}, samples_produced {produced:g}")


@rule
def what_is_not_there_yet_is_not_given(drive: Drive) -> Steps[None]:
    """A window beyond the newest sample has no samples and does not pretend to another index."""
    yield from _running(drive)
    yield from drive.stream(100)
    yield from drive.stop()
    produced = int((yield from drive.number("samples_produced")))
    for ahead in (0, 1000):
        window = yield from drive.window(produced + ahead)
        if window.count:
            raise Broken(f"{window.count} samples from {produced + ahead} on, of {produced} that exist")


@rule
def what_was_overwritten_is_flagged_and_counted(drive: Drive) -> Steps[None]:
    """Asked for an overwritten sample, the window begins at the oldest kept one, says overrun, and the loss is counted."""
    capacity = int((yield from drive.number("ring_capacity")))
    period_s = yield from drive.number("control_period_s")
    if capacity * period_s > LONGEST_FILL_S:
        raise NotTested(f"the ring holds {capacity * period_s:.0f} s")
    yield from _running(drive)
    behind = yield from _filled(drive, capacity + 500)
    window = yield from drive.window(0)
    counted = yield from drive.number("overruns")
    yield from drive.stop()
    if not window.flags & drive.layout.flags["overrun"] or not 0 < window.first <= behind:
        raise Broken(f"sample 0 of {behind} was asked for, {window.first} came, flags 0x{window.flags:02X}: no overrun")
    if not window.count or not counted:
        raise Broken(f"after an overrun {window.count} samples came and overruns is {counted:g}")


def _filled(drive: Drive, samples: int) -> Steps[int]:
    """Let the drive produce so many samples while nobody reads them; how many there are."""
    produced = 0
    for _ in range(MOST_POLLS):
        yield from drive.beat()
        produced = int((yield from drive.number("samples_produced")))
        if produced >= samples:
            break
    return produced


@rule
def the_mask_chooses_channels(drive: Drive) -> Steps[None]:
    """A window carries the channels of the mask, in mask order, and as many samples as fit."""
    yield from _running(drive, mask=15)
    every = joined((yield from drive.stream(200)))
    yield from drive.stop()
    for mask, columns in ((0b0001, [0]), (0b1010, [1, 3]), (0b0111, [0, 1, 2])):
        yield from _running(drive, mask=mask)
        windows = yield from drive.stream(400)
        yield from drive.stop()
        data, fits = joined(windows), drive.layout.data_registers // len(columns)
        largest = max((w.count for w in windows), default=0)
        if {w.mask for w in windows} != {mask} or not 0 < largest <= fits:
            raise Broken(
                f"mask {mask}: windows carry masks {sorted({w.mask for w in windows})}, up to {largest} samples"
            )
        if 0 in columns and not np.array_equal(data[:200, 0], every[:200, 0]):
            raise Broken(f"mask {mask}: the first channel is not the axis voltage of the same test with all channels")


@rule
def decimated_samples_are_means(drive: Drive) -> Steps[None]:
    """With a decimation of n, a sample is the mean over n control periods, and samples come n times slower."""
    drive.needs_level()
    scales = yield from drive.scales()
    for decimation in (2, 7, 100):
        tones = ((drive.level_v, 60.0, 0.4),)
        signal = Signal(tones=tones, scale_ramp_per_s=1000.0, decimation=decimation)
        samples = 400 // decimation + 20
        data = yield from drive.recorded(signal, samples)
        wanted_v = block_means(commanded_v(signal, samples * decimation, scales["control_period_s"]), decimation)
        off_v = np.abs(data[:, 0] * scales["voltage_scale_v"] - wanted_v)[1:]
        allowed_v = 1.5 * scales["voltage_scale_v"] + 0.01
        if float(off_v.max()) > allowed_v:
            k = int(off_v.argmax()) + 1
            raise Broken(
                f"decimation {decimation}: sample {k} is {data[k, 0] * scales['voltage_scale_v']:.3f} V, the mean of its "
                f"control periods {wanted_v[k]:.3f} V"
            )


@rule
def the_running_flag_is_the_output(drive: Drive) -> Steps[None]:
    """Windows say running while the output is on, and not after it went off."""
    yield from _running(drive)
    on = yield from drive.stream(150)
    yield from drive.stop()
    off = yield from drive.window(0)
    flag = drive.layout.flags["running"]
    if not all(w.flags & flag for w in on) or off.flags & flag:
        raise Broken(f"flags 0x{on[-1].flags:02X} while energised, 0x{off.flags:02X} after the output went off")


@rule
def the_last_window_says_that_it_is(drive: Drive) -> Steps[None]:
    """The flag `ended` stands in windows that reach the last sample of a session that is over, and in no other."""
    yield from _running(drive)
    on = yield from drive.stream(200)
    yield from drive.stop()
    flag = drive.layout.flags["ended"]
    early = next((w for w in on if w.flags & flag), None)
    if early is not None:
        raise Broken(f"the window from {early.first} says ended while the test is running")
    produced = int((yield from drive.number("samples_produced")))
    first = yield from drive.window(0)
    last = yield from drive.window(max(0, produced - 5))
    if bool(first.flags & flag) != (first.count >= produced):
        raise Broken(f"a window of {first.count} of {produced} samples says ended: {bool(first.flags & flag)}")
    if not last.flags & flag:
        raise Broken(f"the window from {last.first} reaches the last of {produced} samples and does not say ended")


@rule
def a_shorter_read_is_a_whole_window(drive: Drive) -> Steps[None]:
    """Fewer registers asked for bring fewer samples under a header and a check sum of their own: short answers over slow links."""
    yield from _running(drive)
    yield from drive.stream(60)
    yield from drive.stop()
    whole: RawWindow = yield from drive.window(0)
    for samples in (1, 5, 20):
        short: RawWindow = yield from drive.window(0, drive.layout.header_words + 4 * samples)
        if not short.has_right_check_sum or short.count != samples or short.first != whole.first:
            raise Broken(f"{samples} samples' registers asked for: {short.count} samples from {short.first} claimed")
        if not np.array_equal(short.data, whole.data[:samples]):
            raise Broken(f"the first {samples} samples differ from those of the whole window")


@rule
def samples_outlive_their_session(drive: Drive) -> Steps[None]:
    """What the ring keeps of a session can be read after its end until the next enable: a slow link downloads it then."""
    yield from _running(drive)
    live = joined((yield from drive.stream(200)))
    yield from drive.stop()
    kept = joined((yield from drive.stream(len(live))))
    if not np.array_equal(kept[: len(live)], live[: len(kept)]) or len(kept) < len(live):
        raise Broken(f"{len(live)} samples were read while the test ran, {len(kept)} of them are kept after its end")


@rule
def write_and_read_apart_give_the_same_window(drive: Drive) -> Steps[None]:
    """Index by function 16 and window by function 3 give what function 23 gives in one transaction."""
    if not drive.profile.link.has_read_write_multiple:
        raise NotTested("the drive file says that the drive has no function 23")
    yield from _running(drive)
    yield from drive.stream(150)
    yield from drive.stop()
    for index in (0, 31):
        together: RawWindow = yield from drive.window(index)
        yield from drive.window(index + 50)  # elsewhere, so that the next index is the one written apart
        yield from drive.put({"window_index": index})
        words = yield from pdu.read(drive.layout.address, drive.layout.words)
        apart = drive.decoded(words)
        if (apart.first, apart.count) != (together.first, together.count) or not np.array_equal(
            apart.data, together.data
        ):
            raise Broken(
                f"sample {index} on: {together.count} samples by function 23, {apart.count} others by 16 and 3"
            )


@rule
def clipped_samples_are_flagged(drive: Drive) -> Steps[None]:
    """A window in which a current touched the sensor's end says so."""
    raise NotTested("needs a current at the sensor's end, which no test of this kit drives")
    yield  # a course of no requests
