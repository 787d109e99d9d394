"""The stretch of a recording that is analysed: as quiet as there is one, and without a step of the load in it.

A waveform averaged over two operating points belongs to neither, and the frequency at which a comb captures most is then that
of the longer one, not the mean.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import convolve1d

from commissioner.monitor.signals.supply import TurningFrame
from commissioner.records import Signal

SEGMENT_S = 10.0
SHORTER = (0.75, 0.6, 0.45, 0.35)
"""Of the length wanted, where the load steps in each stretch of that length."""
LEAST_SEGMENT_S = 3.0
LONGEST_SEGMENT_S = 60.0
"""Longer averages meet the motor's warming."""
HOP_S, HOPS = 0.1, 11
"""The level of the power: a Hann average over a second, ten a second. Loads above 2 Hz do not show in it."""
SAME_LEVEL, SAME_LEVEL_OF_APPARENT = 0.02, 0.004
"""Deviation of the level inside a steady stretch: of the mean power and of the apparent power (a voltage that wanders)."""
SAME_VARIATION = 1.3


def wander(power: Signal, block: int) -> float:
    """rms of the mean over `block` samples around the mean of all: a load that drifts, or swings more slowly than that."""
    count = power.size // max(block, 1)
    return float(np.std(power[: count * block].reshape(count, block).mean(axis=1))) if count > 1 else 0.0


def quietest(frame: TurningFrame) -> slice:
    """The stretch of `SEGMENT_S` with the least rms variation of instantaneous power, grown while it stays as quiet.

    Where the power's level moves in it, the longest shorter stretch (`SHORTER`) in which it does not. It grows second by second
    on either side while the level stays and the variation is within `SAME_VARIATION`, up to `LONGEST_SEGMENT_S`.
    """
    power = 1.5 * np.real(frame.voltage_v * np.conj(frame.current_a))
    hop = max(1, round(HOP_S / frame.sample_period_s))
    level = _level(power, hop)
    apparent = 1.5 * abs(np.mean(frame.voltage_v)) * float(np.mean(np.abs(frame.current_a)))
    allowed = float(SAME_LEVEL * np.mean(np.abs(power)) + SAME_LEVEL_OF_APPARENT * apparent)
    first, count = _steady(power, level, hop, min(int(SEGMENT_S / frame.sample_period_s), power.size), allowed, frame)
    spread = float(power[first : first + count].std())
    inside = level[first // hop : (first + count) // hop]
    middle = float(np.median(inside)) if inside.size else 0.0
    reach = max(allowed, float(np.max(np.abs(inside - middle), initial=0.0)))
    block, longest = 10 * hop, int(LONGEST_SEGMENT_S / frame.sample_period_s)

    def is_alike(low: int) -> bool:
        more = np.abs(level[low // hop : (low + block) // hop] - middle)
        return bool(np.all(more <= reach) and power[low : low + block].std() < SAME_VARIATION * spread)

    last = first + count
    grows = [True, True]
    while any(grows) and last - first + block <= longest:
        grows[0] = grows[0] and first >= block and is_alike(first - block)
        first -= block if grows[0] else 0
        grows[1] = grows[1] and last + block <= power.size and last - first + block <= longest and is_alike(last)
        last += block if grows[1] else 0
    return slice(first, last)


def _steady(
    power: Signal, level: Signal, hop: int, widest: int, allowed: float, frame: TurningFrame
) -> tuple[int, int]:
    """(first sample, length): the longest of the lengths in which the level stays; the whole length where it never does."""
    chosen: tuple[int, int] | None = None
    for share in (1.0, *SHORTER):
        count = int(share * widest)
        if chosen is not None and count * frame.sample_period_s < LEAST_SEGMENT_S:
            break
        starts = np.arange(0, power.size - count + 1, max(1, count // 20))
        still = np.array(
            [np.ptp(level[s // hop : max((s + count) // hop, s // hop + 1)]) < 2 * allowed for s in starts]
        )
        if still.any() or chosen is None:
            own = starts[still] if still.any() else starts
            first = int(own[int(np.argmin(_variance(power, own, count)))])
            chosen = (first, count)
        if still.any():
            break
    assert chosen is not None
    return chosen


def _variance(power: Signal, starts: np.ndarray[tuple[int, ...], np.dtype[np.int64]], count: int) -> Signal:
    """Of the power over `count` samples from each of `starts`."""
    centred = power - power.mean()
    sums, squares = (np.concatenate([[0.0], np.cumsum(x)]) for x in (centred, np.square(centred)))
    mean = (sums[starts + count] - sums[starts]) / count
    return np.asarray((squares[starts + count] - squares[starts]) / count - mean**2)


def _level(power: Signal, hop: int) -> Signal:
    """`(hops,)`: power averaged over `hop` samples, then over `HOPS` of these with a Hann window."""
    count = power.size // hop
    if count < 1:
        return np.array([power.mean()])
    window = np.hanning(HOPS + 2)[1:-1]
    means = power[: count * hop].reshape(count, hop).mean(axis=1)
    return np.asarray(convolve1d(means, window / window.sum(), mode="nearest"), dtype=np.float64)
