"""The drive's control interrupt, compiled: excitation, machine, sensing, trips, decimation, sample ring."""

from __future__ import annotations

import math

import numpy as np

from sim.physics import layout as at
from sim.physics.compiled import kernel, lent
from sim.physics.kernel import advance_period, all_currents, load
from sim.physics.sensing import between, convert, phase_of, sense

HISTORY = 16
"""Control periods of current kept for a sampling delay."""
CHANNELS = 4
COUNTS_PER_LSB = 16.0
FLAG_CLIPPED, FLAG_CLAMPED = 2, 8


@kernel
def _towards(value, target, step):
    if value < target:
        return min(target, value + step)
    return max(target, value - step)


@kernel
def _command(e, t, period):
    """Axis voltage (V) for the period from `t`: u = bias + scale * sum A cos(2 pi f t + phi), on the PWM's grid."""
    if t >= e[at.E_DURATION]:
        e[at.E_BIAS] = _towards(e[at.E_BIAS], 0.0, period * max(e[at.E_BIAS_RAMP], 2.0 * abs(e[at.E_BIAS_TARGET])))
        e[at.E_SCALE] = _towards(e[at.E_SCALE], 0.0, period * max(e[at.E_SCALE_RAMP], 2.0))
    else:
        e[at.E_BIAS] = _towards(e[at.E_BIAS], e[at.E_BIAS_TARGET], period * e[at.E_BIAS_RAMP])
        e[at.E_SCALE] = _towards(e[at.E_SCALE], e[at.E_SCALE_TARGET], period * e[at.E_SCALE_RAMP])
    tones = 0.0
    if e[at.E_SCALE] != 0.0:
        for j in range(int(e[at.E_TONES])):
            turn = 2.0 * math.pi * e[at.E_FREQUENCY + j] * t + e[at.E_PHASE + j]
            tones += e[at.E_AMPLITUDE + j] * math.cos(turn)
    return e[at.E_BIAS] + e[at.E_SCALE] * tones


@kernel
def _cut(e, u, i_axis):
    """What reaches the motor (V) of a voltage that samples show as asked for: a part lost, a ceiling, a current folded back."""
    u *= 1.0 - e[at.E_LOST]
    u = min(e[at.E_MOST_V], max(-e[at.E_MOST_V], u))
    excess = abs(i_axis) - e[at.E_MOST_A]
    if excess > 0.0:
        u -= math.copysign(e[at.E_FOLDBACK_OHM] * excess, i_axis)
    return u


@kernel
def _has_ended(e, t):
    return t >= e[at.E_DURATION] and e[at.E_BIAS] == 0.0 and e[at.E_SCALE] == 0.0


@kernel
def _delayed(history, k, delay_periods):
    """Sensed alpha-beta current `delay_periods` before the start of period `k`."""
    back = math.floor(delay_periods)
    place = 1.0 - (delay_periods - back)
    which = k - 1 - back
    if which < 0:
        return 0.0, 0.0
    points = history[which % HISTORY]
    if place == 1.0:
        return points[at.POINTS - 1, 0], points[at.POINTS - 1, 1]
    return between(points, place)


@lent
def run_interrupts(n, x, p, e, s, c, white, history, means, ring, flags, trip, work):
    """Up to `n` control periods; returns how many ran. Stops early by itself with the reason in c[C_STOP].

    x, p machine; e excitation; s sensing; c int64 counters; white (n, 4) normals; history (HISTORY, POINTS, 2);
    means (CHANNELS,) sums of the sample in the making; ring (capacity, CHANNELS) int16; flags (capacity,) uint8;
    trip (1,) the measured current that tripped; work as of `scratch`.
    """
    axis = (math.cos(e[at.E_AXIS_RAD]), math.sin(e[at.E_AXIS_RAD]))
    period = p[at.P_PERIOD]
    grid = e[at.E_STEP_V]
    count_a = s[at.S_LSB_A] / COUNTS_PER_LSB
    capacity = ring.shape[0]
    known, m = all_currents(x, p), load(p)
    for j in range(n):
        k = c[at.C_PERIOD]
        t = k * period
        wanted = _command(e, t, period)
        if _has_ended(e, t):
            c[at.C_STOP] = at.STOP_ENDED
            return j
        if t >= e[at.E_TIME_LIMIT]:
            c[at.C_STOP] = at.STOP_TIME_LIMIT
            return j
        u = min(e[at.E_LIMIT_V], max(-e[at.E_LIMIT_V], wanted))
        if u != wanted:
            c[at.C_CLAMPED] = 1
        u = grid * math.floor(u / grid + 0.5)
        i_a, i_b = _delayed(history, k, s[at.S_DELAY] / period)
        largest = 0.0
        means[0] += u / grid
        for phase in range(3):
            seen = sense(phase_of(i_a, i_b, phase), x[at.X_TIME], phase, white[j, phase], s)
            if abs(seen) >= s[at.S_CLIP_A]:
                c[at.C_CLIPPED] = 1
            largest = max(largest, abs(seen))
            means[1 + phase] += convert(seen, s[at.S_LSB_A]) / count_a
        _finish_sample(c, means, ring, flags, capacity)
        if largest > s[at.S_TRIP_A]:
            c[at.C_STOP] = at.STOP_OVERCURRENT
            trip[0] = largest
            return j
        points = history[k % HISTORY]
        before = history[(k - 1) % HISTORY]
        points[at.POINTS - 1, 0] = before[at.POINTS - 1, 0]
        points[at.POINTS - 1, 1] = before[at.POINTS - 1, 1]
        known = advance_period(x, p, m, _cut(e, u, i_a * axis[0] + i_b * axis[1]), axis, work, points, known)
        c[at.C_PERIOD] = k + 1
    return n


@kernel
def _finish_sample(c, means, ring, flags, capacity):
    """Close the sample when enough periods are in its mean."""
    c[at.C_IN_MEAN] += 1
    if c[at.C_IN_MEAN] < c[at.C_DECIMATION]:
        return
    row = c[at.C_PRODUCED] % capacity
    for m in range(CHANNELS):
        value = math.floor(means[m] / c[at.C_IN_MEAN] + 0.5)
        ring[row, m] = int(min(32767.0, max(-32768.0, value)))
        means[m] = 0.0
    flags[row] = FLAG_CLIPPED * c[at.C_CLIPPED] + FLAG_CLAMPED * c[at.C_CLAMPED]
    c[at.C_CLIPPED] = 0
    c[at.C_CLAMPED] = 0
    c[at.C_IN_MEAN] = 0
    c[at.C_PRODUCED] += 1


def _crc_of(byte):
    for _ in range(8):
        byte = (byte >> 1) ^ 0xA001 if byte & 1 else byte >> 1
    return byte


_CRC_OF_BYTE = np.array([_crc_of(byte) for byte in range(256)])


@kernel
def crc16(words):
    """CRC-16/MODBUS over 16-bit registers, high byte first (polynomial 0xA001 reflected, start 0xFFFF)."""
    return crc16_from(0xFFFF, words)


@kernel
def crc16_from(crc, words):
    """The same, carried on."""
    for word in words:
        crc = (crc >> 8) ^ _CRC_OF_BYTE[(crc ^ (word >> 8)) & 0xFF]
        crc = (crc >> 8) ^ _CRC_OF_BYTE[(crc ^ word) & 0xFF]
    return crc


@kernel
def write_window(ring, flags, first, count, mask, stated, words, header):
    """Header, check sum and, behind `header` words, samples `first` ... of the channels in the mask as unsigned words, one sample after
    the other. `stated`: session, flags besides those of the samples, link in counts."""
    session, seen, link_count = stated
    at_word = header
    for k in range(first, first + count):
        row = k % ring.shape[0]
        seen |= flags[row]
        for channel in range(ring.shape[1]):
            if mask >> channel & 1:
                words[at_word] = ring[row, channel] & 0xFFFF
                at_word += 1
    words[0], words[1], words[2], words[3] = session, first >> 16 & 0xFFFF, first & 0xFFFF, count
    words[4], words[5], words[6] = mask, seen, link_count
    words[header - 1] = crc16_from(crc16_from(0xFFFF, words[: header - 1]), words[header:at_word])
