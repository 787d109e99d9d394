"""Can this recording carry an answer? Cuts it into stretches, names what each is, refuses by name what cannot be
used."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks

from commissioner.errors import DataRefused
from commissioner.motor.nameplate import Nameplate, check
from commissioner.motor.space_vector import axis_current_a, orthogonal_current_a
from commissioner.records import Signal, StandstillRecording

STEP = "audit the recording"
SHORTEST_S = 0.5
LONGEST_PERIOD_S = 0.01
LARGEST_CROSS_CURRENT = 0.25
LARGEST_SUM = 0.06
"""Of the current, what the three phases may add up to in step with one of them: sensors differ by a few per cent."""
LARGEST_ROTATION = 0.7
LEAST_POWER_FACTOR = 0.01
MOST_STRETCHES = 200
OWN_LINK_SAMPLE = 0.2
"""Part of the samples at which the link must differ from the one before, or it was not read sample by sample."""
REST_S = 20.0
"""After a pause this long no rotor holds flux any more; after a shorter one the cage may still carry what the current
left behind."""


@dataclass(frozen=True)
class Stretch:
    """Consecutive samples of one segment on one axis without a hole. `kind`: staircase | multitone | biased | zero.

    `link_ratio` is the DC link's voltage over its median, where it was recorded sample by sample.
    """

    segment: int
    axis_deg: float
    voltage_v: Signal
    current_a: Signal
    cross_a: Signal
    kind: str
    starts_at_rest: bool
    lost_before: int
    start_s: float
    link_ratio: Signal | None = None

    @property
    def is_excited(self) -> bool:
        return self.kind != "zero"


@dataclass(frozen=True)
class Audit:
    stretches: tuple[Stretch, ...]
    gaps: int
    lost_samples: int
    duration_s: float
    remarks: tuple[str, ...]


def audit(recording: StandstillRecording) -> Audit:
    """The recording's stretches; DataRefused where it is too short, not finite, clipped, unevenly sampled, off its
    axis or without excitation."""
    _require_standstill(recording)
    _require_finite(recording)
    _require_even_steps(recording)
    stretches = _cut(recording)
    excited = [s for s in stretches if s.is_excited]
    if not excited:
        raise _refuse(
            "no segment is excited",
            f"largest |voltage_axis_v| {np.max(np.abs(recording.voltage_axis_v), initial=0):.3g} V",
            "a voltage that drives current along the axis",
            "record with the test voltage on, in the commanded unit (volts)",
        )
    seconds = sum(s.voltage_v.size for s in excited) * recording.sample_period_s
    if seconds < SHORTEST_S:
        raise _refuse(
            "the recording is too short", f"{seconds:.3g} s excited", f"{SHORTEST_S} s", "record several seconds"
        )
    if len(excited) > MOST_STRETCHES:
        raise _refuse(
            "the recording is in too many pieces",
            f"{len(excited)} stretches without a hole",
            f"at most {MOST_STRETCHES}",
            "record without losing samples, and number the segments by when the drive was energised",
        )
    for stretch in excited:
        _require_current(stretch)
        _require_on_axis(stretch)
        _require_power(stretch)
    _require_unclipped(recording)
    _require_balanced(recording)
    remarks = tuple(
        f"segment {s.segment} holds no excitation and was used for noise and offset only"
        for s in stretches
        if not s.is_excited and s.voltage_v.size * recording.sample_period_s > SHORTEST_S
    )
    gaps = [s.lost_before for s in stretches if s.lost_before > 0]
    return Audit(tuple(stretches), len(gaps), sum(gaps), seconds, remarks)


NAMEPLATE_KEYS = (
    "rated_power_w",
    "rated_voltage_v",
    "rated_frequency_hz",
    "rated_current_a",
    "rated_speed_rpm",
    "power_factor",
    "pole_pairs",
)


def nameplate_from(metadata: Mapping[str, float | str]) -> Nameplate:
    """The nameplate in a recording's metadata; DataRefused naming the first key that is missing or impossible."""
    for key in NAMEPLATE_KEYS:
        if not isinstance(metadata.get(key), float | int):
            raise DataRefused(
                f"the recording's metadata lack {key}",
                step="read the nameplate",
                value=metadata.get(key),
                limit="a number in SI units",
                remedy=f"add '# {key}: ...' to the file, or give --motor",
            )
    number = {key: float(metadata[key]) for key in NAMEPLATE_KEYS}
    pole_pairs = int(number.pop("pole_pairs"))
    inertia = metadata.get("inertia_kg_m2")
    plate = Nameplate(
        **number,
        pole_pairs=pole_pairs,
        connection=str(metadata.get("connection", "star")),
        inertia_kg_m2=float(inertia) if isinstance(inertia, float | int) else None,
    )
    for problem in check(plate):
        raise DataRefused(
            f"the nameplate cannot be right: {problem.key}",
            step="read the nameplate",
            value=problem.value,
            limit=problem.expected,
            remedy=f"correct {problem.key}, or give --motor",
        )
    return plate


def tones_in(voltage_v: Signal, period_s: float) -> tuple[float, ...]:
    """Frequencies (Hz) of the lines in a stretch's voltage that hold more than 0.1 % of its largest line's power."""
    if voltage_v.size < 16:
        return ()
    x = (voltage_v - np.mean(voltage_v)) * np.hanning(voltage_v.size)
    spectrum = np.abs(np.fft.rfft(x, 4 * voltage_v.size)) ** 2
    top = float(np.max(spectrum))
    if top <= 0.0:
        return ()
    # A Hann line is four bins of the padded spectrum wide on each side; ramps of the amplitude add skirts.
    peaks, _ = find_peaks(spectrum, height=1e-3 * top, distance=8, prominence=5e-4 * top)
    return tuple(float(p) / (4 * voltage_v.size * period_s) for p in peaks)


# -- stretches ----------------------------------------------------------------------------------------------------


def _cut(recording: StandstillRecording) -> list[Stretch]:
    segment = np.asarray(recording.segment)
    for number in np.unique(segment):
        axes = np.unique(recording.axis_deg[segment == number])
        if axes.size > 1:
            raise _refuse(
                f"segment {int(number)} changes its axis",
                f"{axes[0]:g} and {axes[1]:g} deg",
                "one axis per segment",
                "number the segments so that each has one axis",
            )
    steps = np.diff(recording.time_s)
    new_segment = np.diff(segment) != 0
    hole = steps > 1.5 * recording.sample_period_s
    starts = [0, *(np.flatnonzero(new_segment | hole) + 1)]
    ends = [*starts[1:], segment.size]
    out: list[Stretch] = []
    for a, b in zip(starts, ends, strict=True):
        begins = a == 0 or bool(new_segment[a - 1])
        lost = 0 if begins else round(float(steps[a - 1]) / recording.sample_period_s) - 1
        rested = begins and (a == 0 or float(steps[a - 1]) > REST_S)
        out.append(_stretch(recording, a, int(b), rested, lost))
    return out


def _stretch(recording: StandstillRecording, a: int, b: int, rested: bool, lost: int) -> Stretch:
    axis = float(recording.axis_deg[a])
    w = None if recording.current_w_a is None else recording.current_w_a[a:b]
    phases = recording.current_u_a[a:b], recording.current_v_a[a:b], w
    voltage = np.ascontiguousarray(recording.voltage_axis_v[a:b])
    current = axis_current_a(*phases, axis)
    return Stretch(
        segment=int(recording.segment[a]),
        axis_deg=axis,
        voltage_v=voltage,
        current_a=current,
        cross_a=orthogonal_current_a(*phases, axis),
        kind=_kind(voltage, recording.voltage_axis_v),
        starts_at_rest=rested and _is_still(current),
        lost_before=lost,
        start_s=float(recording.time_s[a]),
        link_ratio=_link_ratio(recording.dc_link_v, a, b),
    )


def _link_ratio(dc_link_v: Signal | None, a: int, b: int) -> Signal | None:
    if dc_link_v is None or not np.all(np.isfinite(dc_link_v)):
        return None
    median = float(np.median(dc_link_v))
    changes = np.diff(dc_link_v[a:b]) != 0.0
    if median <= 0.0 or not changes.size or np.mean(changes) < OWN_LINK_SAMPLE:
        return None
    return np.asarray(dc_link_v[a:b] / median)


def _is_still(current: Signal) -> bool:
    """Current near zero where a segment begins: its first samples are small beside the stretch."""
    head = np.abs(current[:2])
    return bool(head.size and np.max(head) < 0.1 * max(float(np.max(np.abs(current))), 1e-12))


def _kind(voltage: Signal, everything: Signal) -> str:
    top = float(np.max(np.abs(voltage), initial=0.0))
    if top <= 1e-3 * float(np.max(np.abs(everything), initial=0.0)) or top == 0.0:
        return "zero"
    changes = np.abs(np.diff(voltage)) > 1e-6 * top
    if voltage.size < 3 or np.mean(changes) < 0.5:
        return "staircase"
    spread = float(np.std(voltage))
    return "biased" if abs(float(np.mean(voltage))) > 0.5 * spread else "multitone"


# -- refusals -----------------------------------------------------------------------------------------------------


def _require_standstill(recording: StandstillRecording) -> None:
    kind = recording.metadata.get("kind", "standstill")
    if kind != "standstill":
        raise _refuse(
            "this is not a standstill recording",
            f"kind: {kind}",
            "kind: standstill",
            "give a recording of a motor at rest, or use `commissioner monitor` for one that runs",
        )


def _require_finite(recording: StandstillRecording) -> None:
    columns = {
        "time_s": recording.time_s,
        "axis_deg": recording.axis_deg,
        "voltage_axis_v": recording.voltage_axis_v,
        "current_u_a": recording.current_u_a,
        "current_v_a": recording.current_v_a,
        "current_w_a": recording.current_w_a,
    }
    for name, values in columns.items():
        if values is None:
            continue
        bad = ~np.isfinite(values)
        if bad.any():
            raise _refuse(
                f"column {name} holds values that are not numbers",
                f"{int(bad.sum())}, first in row {int(np.argmax(bad))}",
                "finite numbers",
                "leave lost samples out as missing rows",
            )
    if recording.time_s.size < 2:
        raise _refuse("the recording is too short", f"{recording.time_s.size} samples", "2 or more", "record longer")


def _require_even_steps(recording: StandstillRecording) -> None:
    inside = np.diff(np.asarray(recording.segment)) == 0
    steps = np.diff(recording.time_s)[inside] / recording.sample_period_s
    if steps.size == 0:
        raise _refuse("no segment holds two samples", steps.size, "consecutive samples", "number the segments")
    if recording.sample_period_s > LONGEST_PERIOD_S:
        raise _refuse(
            "the samples are too far apart",
            f"sample period {recording.sample_period_s:.4g} s",
            f"at most {LONGEST_PERIOD_S:g} s",
            "give time_s in seconds, and record at 1 kHz or faster",
        )
    usual = float(np.median(steps))
    if abs(usual - 1.0) > 0.05:
        raise _refuse(
            "the time steps are not those of the named sample period",
            f"most are {usual * recording.sample_period_s:.6g} s",
            f"sample_period_s {recording.sample_period_s:.6g} s",
            "give time_s and sample_period_s in seconds",
        )
    off = np.abs(steps - np.maximum(np.round(steps), 1.0))
    if np.max(off) > 0.05:
        worst = int(np.argmax(off))
        raise _refuse(
            "the time steps are not equal",
            f"{steps[worst] * recording.sample_period_s:.6g} s",
            f"multiples of {recording.sample_period_s:.6g} s",
            "record at a fixed rate",
        )


def _require_current(stretch: Stretch) -> None:
    rms = float(np.std(stretch.current_a)) + abs(float(np.mean(stretch.current_a)))
    if rms <= 0.0:
        raise _refuse(
            f"segment {stretch.segment} carries no current",
            "0 A",
            "a current along the axis",
            "check the current channels and that the drive was enabled",
        )


def _require_on_axis(stretch: Stretch) -> None:
    """Current must flow where the voltage points: compare what follows the voltage along and across the axis."""
    along = float(np.sqrt(np.mean(stretch.current_a**2)))
    across = float(np.sqrt(np.mean((stretch.cross_a - np.mean(stretch.cross_a)) ** 2)))
    matched = abs(float(np.mean(stretch.cross_a * stretch.current_a))) / max(along, 1e-12)
    if stretch.kind != "staircase" and across > LARGEST_ROTATION * along and matched < LARGEST_CROSS_CURRENT * along:
        raise _refuse(
            f"segment {stretch.segment}: the current rotates",
            f"{across:.3g} A rms across the axis, {along:.3g} A along it, unrelated",
            f"at most {LARGEST_ROTATION:.0%} of the current across the axis",
            "record with the motor at rest and one axis excited; a running motor is for `commissioner monitor`",
        )
    if (stretch.kind != "staircase" and max(matched, 0.0) > LARGEST_CROSS_CURRENT * along) or across > 2.0 * along:
        moment = np.mean((stretch.current_a + 1j * stretch.cross_a) ** 2)
        seen = (stretch.axis_deg + math.degrees(0.5 * float(np.angle(moment)))) % 180.0
        raise _refuse(
            f"segment {stretch.segment}: the current does not flow along the named axis",
            f"axis_deg {stretch.axis_deg:g}, current along {seen:.1f} deg (modulo 180)",
            f"at most {LARGEST_CROSS_CURRENT:.0%} of the current across the axis",
            "correct axis_deg, or the order of the phases",
        )


def _require_power(stretch: Stretch) -> None:
    """A machine at standstill only takes power in."""
    rms = float(np.sqrt(np.mean(stretch.voltage_v**2) * np.mean(stretch.current_a**2)))
    power = float(np.mean(stretch.voltage_v * stretch.current_a))
    if power < LEAST_POWER_FACTOR * rms:
        raise _refuse(
            f"segment {stretch.segment}: the current does not follow the voltage",
            f"power factor {power / rms:.2f}",
            f"above {LEAST_POWER_FACTOR}",
            "check the sign of the current sensors, the order of the phases, axis_deg and the alignment in time",
        )


def _require_unclipped(recording: StandstillRecording) -> None:
    moving = np.zeros(recording.time_s.size, dtype=bool)
    moving[1:] = np.abs(np.diff(recording.voltage_axis_v)) > 0.0
    for name in ("current_u_a", "current_v_a", "current_w_a"):
        values = getattr(recording, name)
        if values is None:
            continue
        for sign in (1.0, -1.0):
            piled = _piled_up(sign * values[moving])
            if piled is not None:
                raise _refuse(
                    f"{name} is clipped",
                    f"{piled} samples at {sign * float(np.max(sign * values)):.4g} A",
                    "samples inside the sensor's range",
                    "lower the amplitude or widen the sensor's range, and record again",
                )


def _require_balanced(recording: StandstillRecording) -> None:
    """A star point carries no current: where the three phases do not cancel, one channel is limited or wrongly scaled."""
    if recording.current_w_a is None:
        return
    phases = [i - np.mean(i) for i in (recording.current_u_a, recording.current_v_a, recording.current_w_a)]
    total = phases[0] + phases[1] + phases[2]
    largest = max(float(np.mean(i * i)) for i in phases)
    shares = [abs(float(np.mean(total * i))) / max(largest, 1e-300) for i in phases]
    if max(shares) > LARGEST_SUM:
        raise _refuse(
            "the phase currents do not add up to zero",
            f"{max(shares):.0%} of the current is left, in step with phase {'uvw'[int(np.argmax(shares))]}",
            f"at most {LARGEST_SUM:.0%}",
            "look for a clipped or wrongly scaled current channel; two sound phases are enough, leave the third out",
        )


def _piled_up(values: Signal) -> int | None:
    """How many samples sit at the largest value, if more than its neighbourhood makes plausible."""
    if values.size < 100:
        return None
    top = float(np.max(values))
    if top <= 0.0:
        return None
    levels = np.unique(values)
    quantum = float(np.min(np.diff(levels))) if levels.size > 1 else top
    at_top = int(np.sum(values >= top - 0.01 * quantum - 1e-9 * top))
    near = int(np.sum(values >= top - max(0.05 * top, 10.0 * quantum)))
    return at_top if at_top >= 8 and at_top > 0.45 * near and near < values.size // 2 else None


def _refuse(what: str, value: object, limit: object, remedy: str) -> DataRefused:
    return DataRefused(what, step=STEP, value=value, limit=limit, remedy=remedy)


def excited(stretches: Sequence[Stretch]) -> list[Stretch]:
    return [s for s in stretches if s.is_excited]
