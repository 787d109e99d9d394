"""Whether a recording can carry a fit: rate, length, stamps, order, sizes and speed; each refusal names step, value, limit and remedy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from commissioner.errors import DataRefused
from commissioner.estimation.numbers import Scales
from commissioner.estimation.window import Window
from commissioner.motor.channels.clock import turn_a_row, wrong_unit
from commissioner.motor.channels.faults import no_lines
from commissioner.motor.channels.levels import current_level, voltage_level
from commissioner.motor.channels.spikes import noise_of
from commissioner.records import RunningRecording

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
BLOCK_S = 0.02
JUMP, JUMP_SIGMA, MOST_JUMPS = 0.05, 12.0, 20
"""Of rated peak and of what is usual in this voltage: what its neighbours do not foretell was switched between two samples, and when is
not known: the fit begins anew. More samples than so many are another kind of voltage."""
OFF_VOLTAGE, OFF_CURRENT = 0.05, 0.03
"""Of rated peak: below both the contactor is open."""
LAG_DEG = (-15.0, 100.0)
"""By which a motor's currents lag while it starts; of one that may generate up to 180 degrees more than the least."""
READ_AS = (
    ("all turned round", 180.0), ("v, w, u as u, v, w", 120.0), ("w, u, v as u, v, w", -120.0), ("v, w, u as u, v, w and turned round", -60.0),
    ("w, u, v as u, v, w and turned round", 60.0),
)  # fmt: skip
"""Other readings of three currents, and the degrees by which they lag more in them."""
LEAST_FED = 0.003
"""Of the rated current, at a voltage however low."""
WANDERS = 0.1
"""Of a sample period, by which half of the stamps are off a whole number of them."""
STEADY_TURN = 0.05
"""Of the supply's frequency, within which it is one."""
MOST_LOCKED = 10.0
"""Locked-rotor current over the rated one, at rated voltage."""
LEAST_S, LEAST_RATE = 0.2, 40.0
"""Shortest window; fewest samples a period of the supply."""
AS_NAMED = 0.99
"""Of that rate: 2 kHz at 50 Hz are 39.99 where the mains stand a little above."""
LEAST_SAMPLES = 50
"""Of a file: fewer tell neither noise nor the supply's turning."""
MONITORED_S, MONITORED_RATE = 2.0, 10.0
"""Shortest steady stretch and fewest samples a period that `monitor` reads: it asks for less than a fit of the current's own course."""
FAST_HZ = 5000.0
"""Rate that shows a start's first milliseconds at the supplies of 50 and 60 Hz."""
MOST_OVER_FIELD = 1.5
"""Speed of a shaft over that of its field, beyond which it is in another unit: a load that drives takes a motor some per cent over, breakdown a fifth."""
NOISY_VOLTAGE = 0.15
"""Sample-to-sample noise over rated peak beyond which a voltage is pulses, not a waveform."""


def refused(what: str, value: object, limit: object, remedy: str) -> DataRefused:
    return DataRefused(what, step="read running recording", value=value, limit=limit, remedy=remedy)


def check(one: RunningRecording, voltage: Array, scales: Scales) -> float:
    """Hz of its supply (`hz_of_supply`); DataRefused where length, time, rate or voltage are no recording's."""
    per_period = 2 * np.pi / scales.frequency_rad_per_s / one.sample_period_s
    if one.time_s.size < LEAST_SAMPLES:
        raise refused(
            f"{one.source}: {one.time_s.size} samples are no recording", one.time_s.size, f"{LEAST_SAMPLES} samples, and {LEAST_S} s of a motor that is fed",
            "record a start, load steps, or a second of steady running",
        )  # fmt: skip
    supply_hz = hz_of_supply(one, voltage, scales)
    if (unit := wrong_unit(supply_hz, scales.frequency_rad_per_s / (2 * np.pi))) is not None:
        raise refused(
            f"{one.source}: by the time column the supply turns at {supply_hz:.3g} Hz: the time is in {unit}", one.sample_period_s,
            "seconds", f"name its unit, as `time ({unit[:-len('seconds')]}seconds)`, or give seconds",
        )  # fmt: skip
    _check_stamps(one)
    if per_period < AS_NAMED * LEAST_RATE:
        least = LEAST_RATE * scales.frequency_rad_per_s / (2 * np.pi)
        raise refused(
            f"{one.source}: {per_period:.0f} samples a period of the supply are too few",
            1.0 / one.sample_period_s,
            f"{least:.0f} samples a second",
            f"record faster: {max(least, FAST_HZ) / 1e3:g} kHz or more{_for_monitor(one, per_period)}",
        )
    sigma = max(noise_of(voltage[:, 0]), noise_of(voltage[:, 1]))
    if sigma > NOISY_VOLTAGE * scales.voltage_v:
        raise refused(
            f"{one.source}: the voltages are pulses of an inverter, not their means", sigma, NOISY_VOLTAGE * scales.voltage_v,
            "record through a sine filter or with averaging over whole carrier periods, or use the commanded voltages"
            f"{_for_monitor(one, per_period)}",
        )  # fmt: skip
    return supply_hz


def check_lines(one: RunningRecording, voltage: Array, scales: Scales) -> None:
    if (odd := no_lines(one, scales.current_a, scales.voltage_v)) is not None:
        raise refused(
            f"{one.source}: {odd.what}", f"{odd.share:.2f} of them is left", f"at most {odd.limit:g}", odd.remedy
        )
    _check_speed(one, voltage, scales)


def _block(one: RunningRecording) -> int:
    """Rows of a period of the supply, and enough of them where the time column is in another unit."""
    return max(round(BLOCK_S / one.sample_period_s), LEAST_SAMPLES)


def _turn(one: RunningRecording, voltage: Array, scales: Scales) -> tuple[Array, Bools]:
    """(rad/s by which the voltage turns in blocks of a period, its sense with it, and whether it is there in all of a block)."""
    block = _block(one)
    whole = one.time_s.size // block * block
    v = np.nan_to_num(voltage[:whole, 0] + 1j * voltage[:whole, 1]).reshape(-1, block)
    turn = np.angle(np.sum(np.conj(v[:, :-1]) * v[:, 1:], axis=1)) / one.sample_period_s
    return turn, (np.abs(v).min(axis=1) > OFF_VOLTAGE * scales.voltage_v) & (turn != 0.0)


def hz_of_supply(one: RunningRecording, voltage: Array, scales: Scales) -> float:
    """Of most of the recording (its longest stretch in one sense); 0 where the motor is not fed, or by a frequency that moves."""
    turn, is_fed = _turn(one, voltage, scales)
    if not is_fed.any():
        return 0.0
    least, median, most = np.quantile(np.abs(turn[is_fed]), (0.1, 0.5, 0.9))
    if not most - least < STEADY_TURN * median:
        return 0.0
    first, last = _longest(np.flatnonzero(is_fed), turn)
    block = _block(one)
    vector = voltage[first * block : last * block] @ np.array([1.0, 1j])
    return abs(turn_a_row(vector)) / (2 * np.pi * one.sample_period_s)


def _longest(at: NDArray[np.int64], turn: Array) -> tuple[int, int]:
    """First and last + 1 of the longest run of neighbours that turn in one sense."""
    runs = np.split(at, np.flatnonzero((np.diff(at) > 1) | (np.diff(np.sign(turn[at])) != 0.0)) + 1)
    run = max(runs, key=len)
    return int(run[0]), int(run[-1]) + 1


def _check_stamps(one: RunningRecording) -> None:
    """DataRefused where time stamps wander by half a period: no stretch would be left between them. (Lost rows make steps of whole ones.)"""
    steps = np.diff(one.time_s) / one.sample_period_s
    wander = int(np.count_nonzero(~((steps > 0.0) & (steps < 1.5))))
    if wander > MOST_JUMPS and float(np.median(np.abs(steps - np.round(steps)))) > WANDERS:
        raise refused(
            f"{one.source}: the time stamps wander: {wander} steps are none of one sample period", f"{np.std(steps):.2g} of a period rms",
            "a stamp within half a period", "record with a hardware clock; if the samples were taken at even steps, leave the time column out and give `# sample_period_s:`",
        )  # fmt: skip


def check_sizes(windows: Sequence[Window], one: RunningRecording, supply_hz: float, scales: Scales) -> None:
    """DataRefused where most of what flows, or of the voltage, is of a size that this motor cannot have."""
    if not windows:
        return
    amps, volts = (
        np.concatenate([np.hypot(*x.T) for x in group])
        for group in ([w.current[:, :2] for w in windows], [w.voltage[::2] for w in windows])
    )
    rated_hz = scales.frequency_rad_per_s / (2 * np.pi)
    levels = [current_level(float(np.median(amps)) / scales.current_a, LEAST_FED, 1.5 * MOST_LOCKED)]
    if supply_hz > 0.0:
        levels.append(
            voltage_level(float(np.median(volts)) / scales.voltage_v * rated_hz / supply_hz, supply_hz / rated_hz)
        )
    for level in levels:
        if level is not None:
            raise refused(f"{one.source}: {level.what}", f"{level.value:.3g} of the plate's", level.limit, level.remedy)


def _check_speed(one: RunningRecording, voltage: Array, scales: Scales) -> None:
    """Refused where the shaft is told to turn much faster than the field of the voltage: another unit."""
    if one.speed_rad_per_s is None:
        return
    turn, is_fed = _turn(one, voltage, scales)
    block = _block(one)
    speed = scales.pole_pairs * np.abs(one.speed_rad_per_s[: turn.size * block].reshape(-1, block)).mean(axis=1)
    is_fed &= np.isfinite(speed)
    ratio = float(np.median(speed[is_fed] / np.abs(turn[is_fed]))) if is_fed.any() else 0.0
    if ratio > MOST_OVER_FIELD:
        raise refused(
            f"{one.source}: the shaft would turn {ratio:.3g} times as fast as the field that the voltage makes", ratio, MOST_OVER_FIELD,
            "the column is the shaft's speed in rad/s (9.55 times too much: it is in rev/min, which the column speed_rpm takes; as many times as "
            "the poles have pairs: it is the electrical one)",
        )  # fmt: skip


def _for_monitor(one: RunningRecording, per_period: float) -> str:
    """What else reads this recording, as the end of a remedy; empty where its rate or length is too little there too."""
    if per_period < MONITORED_RATE or (one.time_s.size + 1) * one.sample_period_s < MONITORED_S:
        return ""
    return "; this recording of a running motor is for `commissioner monitor`: speed, torque and parameters of a steady load"


def is_crossed(current: Array, voltage: Array, scales: Scales) -> bool:
    """Whether most of the current turns against the voltage, less what the voltage's own weaker part drives: at that part the motor is as
    good as locked, so that an idle one's current turns backwards from a few per cent of it on."""
    v, i = (np.nan_to_num(x[:, 0] + 1j * x[:, 1]) for x in (voltage, current))
    turn = abs(float(np.angle(np.sum(np.conj(v[:-1]) * v[1:]))))
    quarter = min(max(round(0.5 * np.pi / max(turn, 1e-9)), 1), v.size // 2)
    (forward, backward), parts = _turning(v, quarter), _turning(i, quarter)
    along, against = np.where(forward > backward, parts, parts[::-1]) * (
        forward + backward > OFF_VOLTAGE * scales.voltage_v
    )
    driven = MOST_LOCKED * scales.current_a / scales.voltage_v * np.minimum(forward, backward)
    return bool(np.sum(np.maximum(against - driven, 0.0) ** 2) > np.sum(along**2))


def check_order(windows: Sequence[Window], source: str) -> None:
    """DataRefused where the currents lag by what no motor's do: in a start they take power, in any state they magnetize."""
    from_rest = [w for w in windows if w.is_from_rest]
    parts = [(w.voltage[::2] @ [1, 1j], w.current[:, :2] @ [1, 1j]) for w in from_rest or windows]
    lag = float(np.degrees(np.angle(sum(complex(np.sum(v * np.conj(i))) for v, i in parts)))) * (
        windows[0].direction if windows else 1.0
    )
    least, most = LAG_DEG if from_rest else (LAG_DEG[0], 180.0 + LAG_DEG[0])
    if not parts or least < lag < most or lag < most - 360.0:
        return
    others = [said for said, by in READ_AS if LAG_DEG[0] < (lag + by + 180.0) % 360.0 - 180.0 < LAG_DEG[1]]
    raise refused(
        f"{source}: the currents lag their voltages by {lag:.0f} degrees, which no motor's do: channels are in another order or turned round",
        f"{lag:.0f} degrees", f"{least:g} ... {most:g}", f"check sign and order of the current channels (a motor's lag has the currents {' or '.join(others)})",
    )  # fmt: skip


def _turning(x: NDArray[np.complex128], quarter: int) -> Array:
    """(2, n): sizes of a vector's parts that turn forward and backward, from what it is a quarter of a period later."""
    return 0.5 * np.abs(x[:-quarter] + np.outer([-1j, 1j], x[quarter:]))
