"""Windows of a running recording as the fit takes them: vectors, voltage between the samples, smoothed speed, states."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.signal import savgol_filter

from commissioner.errors import DataRefused
from commissioner.estimation.checks import (
    BLOCK_S,
    JUMP,
    JUMP_SIGMA,
    LEAST_S,
    MOST_JUMPS,
    OFF_CURRENT,
    OFF_VOLTAGE,
    check,
    check_lines,
    check_order,
    check_sizes,
    is_crossed,
    refused,
)
from commissioner.estimation.numbers import Scales
from commissioner.estimation.window import Window, first_part, last_part, swept, turns_backwards
from commissioner.motor import standing
from commissioner.motor.channels.clock import off_mains
from commissioner.motor.channels.faults import without_clipped
from commissioner.motor.channels.spikes import noise_of
from commissioner.motor.computed import is_negative_sum
from commissioner.motor.nameplate import Nameplate
from commissioner.records import RunningRecording

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
STATES = ("off", "start", "steady", "transient", "coasting")
"""What a stretch of 20 ms is: no voltage and no current; speeding up; nothing changes; a load step or a ramp; current without voltage."""
MOVES, FAST_UP, PAST_BREAKDOWN = 0.03, 2.0, 0.6
"""Change of the mean current from one block to the next that is one; the current over the rated one of a shaft that is still far from its
speed; the current a volt over its largest since closing of one that is past its breakdown torque. From there the run-up is over where
nothing changes, and where more current flows a volt than a block before: a shaft that speeds up takes less and less. (A load that pulsates changes
the current in every block: all of a recording was `start`, a load step in it had knots 0.15 s apart, and a healthy motor without a speed
column was called unexplained.)"""
FREE_IT = "look at shaft, load, voltage and connection, and record a start that ends"
STEADY_SHARE = 0.95
"""Of the samples of one steady load: what swings with the shaft makes a block of 20 ms look like a step now and then."""
ONE_LOAD = 0.1
"""Of the current a volt, by which it stays the same load: flicker of 2 % in the mains of a motor that saturates moved it by 0.07."""
OPENING_S = 0.01
"""Before a contactor has opened: each pole waits for the zero of its own current."""
FIELD_S = 2e-3
"""Of voltage without current before a closing: the field of a motor that still turns."""
OPEN = 0.15
"""Of rated peak: what the other phases carry where one is open."""
RUN_OUT_S = 0.1
"""From where the current of a start has fallen to twice the rated one until the shaft is near its speed."""
STARTS = 2.0
"""Of the usual current: what flows in a start at least."""
SMOOTH_S, SLOPE_S = 4e-3, 8e-3
"""Over which the measured speed and its derivative are smoothed (quadratic, no phase shift)."""
CARRIER = "switching_frequency_hz"
"""Of the inverter, whose rows' voltages are read by it: what is played by them is to be read so as well."""
RENEWALS, RENEWED_TO = (1, 2), 0.02
"""Rows a carrier period where each has its own voltage, which an inverter renews once or twice a period; how near to that."""
MOST_SAMPLES = 60_000
"""Of all windows together; longer ones end there. A start and its load steps are in the first seconds."""


@dataclass(frozen=True)
class Record:
    """Windows of one motor. `has_zero`: three currents were measured; else `computed`: the phases that may have no sensor; `is_renewed`: a row for each voltage that
    the inverter makes; `sigma`: white noise of alpha, beta, zero; of the voltage vector's parts;
    of the electrical speed before smoothing; `mains_hz`: the supply's frequency, None of an inverter, or where it moves."""

    windows: tuple[Window, ...]
    period_s: float
    scales: Scales
    plate: Nameplate
    has_speed: bool
    has_zero: bool
    is_commanded: bool
    is_renewed: bool
    sigma_a: tuple[float, float, float]
    sigma_v: float
    sigma_w: float = 0.0
    mains_hz: float | None = None
    remarks: tuple[str, ...] = ()
    computed: str = ""
    not_started: tuple[str, ...] = ()
    """Of a motor that was switched on and does not come up to speed: that it does not."""

    def refusal_of_standing(self, step: str) -> DataRefused | None:
        """Why a fit fails where the motor did not start; None where it did."""
        if not self.not_started:
            return None
        return DataRefused(
            "; ".join(self.not_started), step=step, value="no start", limit="a start that ends", remedy=FREE_IT
        )

    @property
    def has_start(self) -> bool:
        """Whether a window begins at rest."""
        return any(w.is_from_rest for w in self.windows)

    @property
    def is_steady(self) -> bool:
        """Whether there is one window, and hardly anything moves in it."""
        return len(self.windows) == 1 and bool(np.mean(self.windows[0].state == STATES.index("steady")) > STEADY_SHARE)

    @property
    def has_one_load(self) -> bool:
        """Whether no start and no other load is in it: flickering mains, which make a steady load none, are no second one."""
        means = (_means(window, self.period_s) for window in self.windows)
        a_volt = np.array([c / max(v, 1e-9) for currents, volts in means for c, v in zip(currents, volts, strict=True)])
        least, median, most = np.quantile(a_volt, (0.02, 0.5, 0.98))
        return not self.has_start and bool(most - least < ONE_LOAD * median)


def scales_of(plate: Nameplate) -> Scales:
    """Rated peaks and torque of the plate."""
    torque = plate.rated_power_w / (2 * np.pi * plate.rated_speed_rpm / 60.0)
    return Scales(
        plate.rated_current_peak_a,
        float(np.sqrt(2 / 3) * plate.rated_voltage_v),
        plate.rated_frequency_rad_per_s,
        torque,
        plate.pole_pairs,
    )


def prepare(recordings: Sequence[RunningRecording], plate: Nameplate) -> Record:
    """The recordings' windows. DataRefused names what cannot carry a fit: rate, length, pulses, crossed phases, no current."""
    scales = scales_of(plate)
    period = recordings[0].sample_period_s
    windows: list[Window] = []
    remarks: list[str] = []
    standing_still: list[str] = []
    clipped: list[str] = []
    supplies: list[float] = []
    has_speed, said_of_speed = _has_speed(recordings)
    remarks += said_of_speed
    computed = [r.source for r in recordings if is_negative_sum(*r.currents_a)]
    has_zero = not computed and all(np.isfinite(r.currents_a[k]).any() for r in recordings for k in range(3))
    sigmas, without = [], set("uvw") if computed else set[str]()
    for one in recordings:
        if abs(one.sample_period_s / period - 1.0) > 1e-6:
            what = f"{one.source}: sampled at another rate than the first file"
            raise refused(what, one.sample_period_s, period, "diagnose them one by one")
        supplies.append(check(one, _voltages(one), scales))
        one, cut_off = without_clipped(one)  # noqa: PLW2901
        remarks += cut_off
        clipped += cut_off
        current, voltage = _currents(one), _voltages(one)
        check_lines(one, voltage, scales)
        open_phases = _open_phases(one, current, scales)
        is_open: Bools = np.asarray(open_phases.any(axis=0))
        sigmas.append([*(noise_of(current[:, k]) for k in range(3)), noise_of(voltage[:, 0]), noise_of(voltage[:, 1])])
        if is_crossed(np.where(is_open[:, None], 0.0, current), voltage, scales):
            raise refused(
                f"{one.source}: currents and voltages turn against each other",
                "opposite",
                "one phase order",
                "exchange two current channels, or two voltages, with --map",
            )
        remarks += _of_open_phases(one, open_phases)
        is_backwards = turns_backwards(voltage)
        without |= {("uwv" if is_backwards else "uvw")[k] for k in range(3) if not np.isfinite(one.currents_a[k]).any()}
        if is_backwards:
            current, voltage = current * [1, -1, 1], voltage * [1, -1]
            remarks.append(
                f"{one.source}: the supply turns backwards (u, w, v): phases v and w are taken for one another."
            )
        signed, speed = one, one.speed_rad_per_s
        if speed is not None and _turns_against(speed, voltage):
            signed = replace(one, speed_rad_per_s=-speed)
            if not is_backwards:
                remarks.append(
                    f"{one.source}: shaft and supply turn against each other: the speed's sign is taken for wrong."
                )
        lost = 0 if speed is None or not has_speed else int(np.count_nonzero(~np.isfinite(speed)))
        if lost:
            remarks.append(
                f"{one.source}: {lost} samples have no speed: the stretches used end there and begin behind it."
            )
        own = tuple(_windows(signed, current, voltage, plate, has_speed, scales, ~is_open))
        standing_still += (said for w in own if (said := _not_started(w, one, scales, has_speed)))
        own, of_windows = _checked(own, one, supplies[-1], has_speed, scales)
        remarks += of_windows
        windows += own
    if not windows:
        raise _nothing_left(clipped, remarks)
    if sum(w.count for w in windows) > MOST_SAMPLES:
        most = MOST_SAMPLES // len(windows)
        windows = [first_part(w, min(most, w.count)) for w in windows]
        remarks.append(f"Of each stretch the first {most * period:.3g} s are used.")
    remarks += (
        f"{said}. That tells the sum of R_s and R_R, and L_sigma, and little else: {FREE_IT}."
        for said in standing_still
    )
    remarks += _of_third_current(computed, has_zero)
    sigma = np.median(np.array(sigmas), axis=0)
    floor = 1e-6 * scales.current_a
    carrier = _carrier_hz(recordings[0])
    return Record(
        tuple(windows), period, scales, plate, has_speed, has_zero, carrier > 0.0, _is_renewed(carrier, period), (max(sigma[0], floor), max(sigma[1], floor), max(sigma[2], floor)),
        float(np.hypot(sigma[3], sigma[4]) / np.sqrt(2.0)),
        _speed_noise(recordings, plate) if has_speed else 0.0, _mains_hz(supplies, carrier), tuple(remarks), "".join(sorted(without)),
        tuple(standing_still),
    )  # fmt: skip


def _mains_hz(supplies: Sequence[float], carrier_hz: float) -> float | None:
    """The supply's frequency where all recordings have one and no inverter makes it."""
    return float(np.mean(supplies)) if carrier_hz == 0.0 and all(hz > 0.0 for hz in supplies) else None


def _nothing_left(clipped: Sequence[str], remarks: Sequence[str]) -> DataRefused:
    """Why there is no window: what was left out of it, or that there was none."""
    if clipped:
        what = f"{' '.join(clipped)} Nothing long enough is left between them."
        return refused(
            what, f"less than {LEAST_S} s", f"{LEAST_S} s", "record with a larger range; a filter or a gain before the converter may have the smaller one"
        )  # fmt: skip
    return refused(
        " ".join(["no stretch with voltage and current in every phase is long enough.", *remarks]),
        0.0,
        f"{LEAST_S} s",
        "record a start, load steps, or a second of steady running, with all three phases closed; a test at standstill has the columns segment, axis_deg and voltage_axis_v",
    )


def _of_open_phases(one: RunningRecording, open_phases: Bools) -> Iterator[str]:
    """A remark for each phase without current while the others carry some."""
    for phase, quiet in zip("uvw", open_phases, strict=True):
        if quiet.any():
            yield (
                f"{one.source}: phase {phase} carries no current from {one.time_s[int(np.argmax(quiet))]:.3g} s on, "
                f"{quiet.sum() * one.sample_period_s:.2g} s in all, while the others do (a line, a fuse or a pole is open, or the sensor is dead): not used."
            )


def _checked(
    own: tuple[Window, ...], one: RunningRecording, supply_hz: float, has_speed: bool, scales: Scales
) -> tuple[tuple[Window, ...], list[str]]:
    """(a recording's windows, what is said of them). DataRefused: of no motor, or not of this one."""
    said: list[str] = []
    if not has_speed:
        own, said = _behind_run_ups(own, one, scales)
    check_order(own, one.source)
    check_sizes(own, one, supply_hz, scales)
    if not _carrier_hz(one) and (of_mains := off_mains(supply_hz)):
        said.append(f"{one.source}: {of_mains}.")
    return own, said


def _has_speed(recordings: Sequence[RunningRecording]) -> tuple[bool, list[str]]:
    """Whether all were measured with a speed, and what is said of one that is none."""
    named = [r.source for r in recordings if _is_named_speed(r)]
    if named:
        return False, [
            f"{', '.join(named)}: the speed is one number all along, while the motor starts: a set point or a plate's, and not used."
        ]
    speeds = [r.speed_rad_per_s for r in recordings]
    return all(s is not None and np.isfinite(s).any() for s in speeds), []


def _is_named_speed(one: RunningRecording) -> bool:
    """Whether the speed column holds one number of a shaft that turns, beside the current of a start."""
    speed = one.speed_rad_per_s
    if speed is None or not np.isfinite(speed).any() or not np.nanmax(speed) == np.nanmin(speed) != 0.0:
        return False
    current = np.sqrt(np.nansum(np.square(one.currents_a), axis=0))  # rows without any are none of a start
    block = max(round(BLOCK_S / one.sample_period_s), 1)
    means = current[: current.size // block * block].reshape(-1, block).mean(axis=1)
    return bool(means.size and np.nanmax(means) > STARTS * np.nanmedian(means))


def _carrier_hz(one: RunningRecording) -> float:
    """Of an inverter that feeds the motor; 0 where the recording names none. DataRefused: what it names is no frequency."""
    named = one.metadata.get(CARRIER) or 0.0
    if isinstance(named, int | float) and 0.0 <= named < np.inf:
        return float(named)
    raise refused(
        f"{one.source}: {CARRIER} is no frequency", named, "a number of Hz, 0 or none on the mains",
        "write the inverter's carrier frequency in Hz, or leave the line out",
    )  # fmt: skip


def _is_renewed(carrier_hz: float, period_s: float) -> bool:
    """Whether rows and what an inverter renews its voltage by go together."""
    return carrier_hz > 0.0 and any(abs(1.0 / (carrier_hz * period_s) / k - 1.0) < RENEWED_TO for k in RENEWALS)


def _of_third_current(computed: Sequence[str], has_zero: bool) -> Iterator[str]:
    """A remark where fewer than three currents were measured. `computed`: the files whose third is minus the sum of two."""
    if computed:
        yield (
            f"{', '.join(computed)}: third current computed from two: not used as a sensor. Which of the three it is cannot be told from "
            "the sum; unlike gains of two sensors are looked for in each pair."
        )
    elif not has_zero:
        yield "Two currents only: the third is taken as minus their sum, with what one sensor reads wrong."


def _speed_noise(recordings: Sequence[RunningRecording], plate: Nameplate) -> float:
    """Of the electrical speed, rad/s: white noise, and the steps of a counter, which stands still in most sixth differences."""
    speeds = [r.speed_rad_per_s for r in recordings if r.speed_rad_per_s is not None]
    return plate.pole_pairs * float(np.median([np.hypot(noise_of(x), _step_of(x) / np.sqrt(12.0)) for x in speeds]))


def _step_of(x: Array) -> float:
    """Smallest change of a signal that comes in steps; next to nothing for one that does not."""
    d = np.abs(np.diff(x))
    d = d[d > 0.0]
    return float(np.quantile(d, 0.05)) if d.size else 0.0


def _currents(one: RunningRecording) -> Array:
    phases = np.array(one.currents_a)
    absent = [k for k in range(3) if not np.isfinite(phases[k]).any()]
    for k in absent:
        phases[k] = -sum(phases[j] for j in range(3) if j != k)
    return _vector(phases)


def _voltages(one: RunningRecording) -> Array:
    volts = np.array(one.voltages_v)
    for k in range(3):
        if not np.isfinite(volts[k]).any():
            volts[k] = -sum(volts[j] for j in range(3) if j != k)
    if one.voltages_are_line_to_line:
        uv, vw, wu = volts - volts.mean(axis=0)
        volts = np.array([(uv - wu) / 3.0, (vw - uv) / 3.0, (wu - vw) / 3.0])
    return _vector(volts)[:, :2]


def _vector(x: Array) -> Array:
    u, v, w = x
    return np.stack([(2 * u - v - w) / 3.0, (v - w) / np.sqrt(3.0), (u + v + w) / 3.0], axis=1)


def negative_sequence(voltage: Array) -> float:
    """Size of a voltage's negative sequence, V, whatever the supply's frequency does: z^2 / |z| rests at 1.5 of it (to first order)."""
    z = voltage[:, 0] + 1j * voltage[:, 1]
    size = np.abs(z)
    return float(np.abs(np.mean(z[size > 0.0] ** 2 / size[size > 0.0])) / 1.5)


def _turns_against(speed: Array, voltage: Array) -> bool:
    """Whether the shaft turns mostly in the direction opposite to the supply's, as a sensor of the other sign shows it."""
    return bool(np.nansum(swept(voltage) * speed[1:]) < 0)


def _open_phases(one: RunningRecording, current: Array, scales: Scales) -> Bools:
    """(3, n): where a phase carries no current for a period while the others do, before and after it too: poles do not switch at once."""
    a, b, zero = np.nan_to_num(current).T
    phases = zero + np.array([a, *(-0.5 * a + s * np.sqrt(0.75) * b for s in (1.0, -1.0))])
    half = max(round(0.5 * BLOCK_S / one.sample_period_s), 1)
    largest = maximum_filter1d(np.abs(phases), 2 * half + 1, axis=1, mode="nearest") / scales.current_a
    others = ~_near(largest.max(axis=0) < OPEN, 2 * half)
    return np.array([_near(x < OFF_CURRENT, half) & others for x in largest])


def _near(mask: Bools, by: int) -> Bools:
    """Whether anything within `by` samples is in the mask."""
    return np.asarray(maximum_filter1d(mask, 2 * by + 1, mode="constant"))


def _jumps(voltage: Array, scales: Scales) -> Bools:
    """Samples that a cubic through two neighbours on either side does not foretell: a dip's edges, a reversing contactor."""
    told = (4.0 * (voltage[1:-3] + voltage[3:-1]) - (voltage[:-4] + voltage[4:])) / 6.0
    off = np.nan_to_num(np.hypot(*(voltage[2:-2] - told).T))
    found = np.pad(off > max(JUMP_SIGMA * float(np.median(off)), JUMP * scales.voltage_v), 2)
    return found & (np.count_nonzero(found) <= MOST_JUMPS)


def _windows(
    one: RunningRecording,
    current: Array,
    voltage: Array,
    plate: Nameplate,
    has_speed: bool,
    scales: Scales,
    is_whole: Bools,
) -> Iterator[Window]:
    """Stretches without gap, with voltage and current, with speed where there is one: they begin one sample after a closing and end before the poles open one by one."""
    seen = [current, voltage]
    if has_speed and one.speed_rad_per_s is not None:
        seen.append(one.speed_rad_per_s[:, None])
    finite: Bools = np.asarray(np.isfinite(np.hstack(seen)).all(axis=1))
    raw, size = np.hypot(*voltage.T), np.nan_to_num(np.hypot(current[:, 0], current[:, 1]))
    flows = size > OFF_CURRENT * min(scales.current_a, float(np.quantile(size, 0.9)))
    pole = round(OPENING_S / one.sample_period_s)
    volts = raw > OFF_VOLTAGE * scales.voltage_v
    fed = volts & _near(flows, 1)  # what a turning field leaves at open terminals is a voltage, and no supply
    driven = _near(volts, max(round(2e-3 / one.sample_period_s), 1))
    on = driven & _near(flows, pole) & (raw > 1e-9 * scales.voltage_v)
    steps = np.diff(one.time_s, prepend=one.time_s[0] - one.sample_period_s)
    is_break = (steps > 1.5 * one.sample_period_s) | (steps <= 0) | (_jumps(voltage, scales) & ~_near(~flows, 3))
    usable = on & finite & is_whole
    begins = np.flatnonzero(usable & (~np.roll(usable, 1) | is_break | (np.arange(usable.size) == 0)))
    for first in begins:
        after = np.flatnonzero(~usable[first:] | (is_break[first:] & (np.arange(usable.size - first) > 0)))
        last = int(first) + int(after[0]) if after.size else usable.size
        closing = first > 0 and not on[first - 1] and not is_break[first]
        begin = int(first)
        if closing:
            begin += int(np.argmax(fed[first:last])) + 1
        field = np.count_nonzero(volts[first : max(begin - 1, first)]) * one.sample_period_s
        if last < usable.size and finite[last] and not is_break[last] and np.any(flows[first:last]):
            last = int(first) + int(np.flatnonzero(flows[first:last])[-1]) - pole
        if (last - begin) * one.sample_period_s < LEAST_S:
            continue
        yield _window(
            one, current, voltage, slice(begin, int(last)), plate, has_speed, bool(closing and field < FIELD_S), scales
        )


def _window(
    one: RunningRecording,
    current: Array,
    voltage: Array,
    part: slice,
    plate: Nameplate,
    has_speed: bool,
    closing: bool,
    scales: Scales,
) -> Window:
    time = one.time_s[part] - one.time_s[part.start]
    u = voltage[part]
    if has_speed and one.speed_rad_per_s is not None:
        raw = one.speed_rad_per_s[part] * plate.pole_pairs
        speed = np.stack(
            [
                between(smoothed(raw, SMOOTH_S, 0, one.sample_period_s)),
                between(smoothed(raw, SLOPE_S, 1, one.sample_period_s)),
            ],
            axis=1,
        )
    else:
        speed = np.zeros((2 * time.size - 1, 2))
    is_from_rest = closing and (not has_speed or abs(speed[:20, 0].mean()) < 0.02 * scales.frequency_rad_per_s)
    window = Window(
        time,
        current[part],
        np.stack([between(u[:, 0]), between(u[:, 1])], axis=1),
        speed,
        np.zeros(time.size, np.int64),
        is_from_rest,
    )
    return replace(window, state=_states(window, scales, one.sample_period_s))


def _behind_run_ups(
    windows: Sequence[Window], one: RunningRecording, scales: Scales
) -> tuple[tuple[Window, ...], list[str]]:
    """Without a speed: the windows without the rest of a start that began before them, and what is said of it.

    Nobody knows at which speed it begins, and the load's knots are no run-up: a healthy motor was called unexplained, after 40 s.
    """
    block, out, said = max(round(BLOCK_S / one.sample_period_s), 1), [], []
    flows_at_once = float(np.nanmean(np.hypot(*_currents(one)[:block, :2].T))) > FAST_UP * scales.current_a
    for w in windows:
        fast = np.array(_means(w, one.sample_period_s)[0]) > FAST_UP * scales.current_a
        slow = np.flatnonzero(~fast)
        first = int(slow[0]) * block + round(RUN_OUT_S / one.sample_period_s) if slow.size else 0
        if (
            w is not windows[0]
            or not flows_at_once
            or w.is_from_rest
            or not fast[0]
            or not slow.size
            or (w.count - first) * one.sample_period_s < LEAST_S
        ):
            out.append(w)
            continue
        out.append(last_part(w, first))
        said.append(
            f"{one.source}: begins in a start, at a speed that nothing tells: its first {first * one.sample_period_s:.2g} s are not used."
        )
    return tuple(out), said


def smoothed(x: Array, span_s: float, order: int, period: float) -> Array:
    """The signal, or its derivative of an order, by quadratics over a span: no phase shift."""
    length = max(2 * round(0.5 * span_s / period) + 1, 5)
    return np.asarray(savgol_filter(x, length, 2, deriv=order, delta=period, mode="interp"))


def between(x: Array) -> Array:
    """The signal at its samples and, by a cubic, midway between them: (2n - 1,)."""
    out = np.empty(2 * x.size - 1)
    out[::2] = x
    out[3:-3:2] = (9.0 * (x[1:-2] + x[2:-1]) - (x[:-3] + x[3:])) / 16.0
    out[1] = (3.0 * x[0] + 6.0 * x[1] - x[2]) / 8.0
    out[-2] = (3.0 * x[-1] + 6.0 * x[-2] - x[-3]) / 8.0
    return out


def _not_started(window: Window, one: RunningRecording, scales: Scales, has_speed: bool) -> str:
    """Of a motor that was switched on and does not come up to speed: that it does not; empty for any other."""
    period = one.sample_period_s
    if not window.is_from_rest or window.count * period < standing.LEAST_S:
        return ""
    settled, part = round(standing.SETTLED_S / period), round(standing.LEAST_S / 5.0 / period)
    current, voltage = (x[settled:, 0] + 1j * x[settled:, 1] for x in (window.current, window.voltage[::2]))
    first, last = (
        float(np.sum(np.real(voltage[k] * np.conj(current[k]))) / np.sum(np.abs(current[k]) ** 2))
        for k in (slice(part), slice(-part, None))
    )
    speed = standing.highest_speed(first, last)
    if has_speed:
        speed = max(float(np.abs(window.speed[::2, 0]).max() / scales.frequency_rad_per_s), standing.LEAST_SPEED)
    if not standing.is_standing(first, last) or speed > standing.MOST_SPEED:
        return ""
    rated = float(np.sqrt(np.mean(np.abs(current) ** 2))) / scales.current_a
    return f"{one.source}: {standing.words(rated, window.count * period, speed)}"


def _means(window: Window, period: float) -> tuple[list[float], list[float]]:
    """Size of the current and of the voltage over blocks of a period of the supply."""
    block = max(round(BLOCK_S / period), 1)
    size, volts = np.hypot(*window.current[:, :2].T), np.hypot(*window.voltage[::2].T)
    starts = range(0, window.count, block)
    return [float(size[k : k + block].mean()) for k in starts], [float(volts[k : k + block].mean()) for k in starts]


def _stays(means: Sequence[float], j: int) -> float:
    """By how much the two blocks after this one differ from the two before: a step stays, what swings with the shaft comes back."""
    before, after = means[max(j - 2, 0) : j] or means[j : j + 1], means[j + 1 : j + 3] or means[j : j + 1]
    return abs(float(np.mean(after)) - float(np.mean(before)))


def _states(window: Window, scales: Scales, period: float) -> NDArray[np.int64]:
    """One of `STATES` for every sample, decided over blocks of a period of the supply."""
    block = max(round(BLOCK_S / period), 1)
    out = np.zeros(window.count, np.int64)
    means, fed = _means(window, period)
    a_volt = [mean / max(v, 1e-9) for mean, v in zip(means, fed, strict=True)]
    largest = np.maximum.accumulate(a_volt)
    started = not window.is_from_rest
    for j, mean in enumerate(means):
        part = slice(j * block, (j + 1) * block)
        before, after = means[max(j - 1, 0)], means[min(j + 1, len(means) - 1)]
        moves = max(abs(after - mean), abs(mean - before)) > MOVES * max(mean, 0.2 * scales.current_a)
        slips = (1.0 + MOVES) * a_volt[max(j - 1, 0)] < a_volt[j] < PAST_BREAKDOWN * largest[j]
        if fed[j] < OFF_VOLTAGE * scales.voltage_v:
            out[part] = STATES.index("coasting" if mean > OFF_CURRENT * scales.current_a else "off")
        elif not started and (mean > FAST_UP * scales.current_a or (moves and not slips)):
            out[part] = STATES.index("start")
        else:
            started = True
            out[part] = STATES.index(
                "transient" if moves and _stays(means, j) > MOVES * max(mean, 0.2 * scales.current_a) else "steady"
            )
    return out
