"""Rules of the excitation: the voltage channel against the map's formula, the currents against the axis."""

from __future__ import annotations

import numpy as np

from commissioner.conformance.drive import Drive, joined
from commissioner.conformance.records import Broken, Steps
from commissioner.conformance.registry import rules_of
from commissioner.conformance.signal import Real, Signal, commanded_v, ramp_allowance_v
from commissioner.registers.status import DriveState

RULES, rule = rules_of("The commissioning map: excitation", energises=True)

GRID_COUNTS = 1.5
"""Rounding of the command to the voltage's grid, and of a float's last place."""
AXES_DEG = (0.0, 60.0, 120.0, 200.0)
SETTLE_S = 0.5
"""The ramp and the first, fast part of the answer to it; the rotor's slow part moves along the axis only."""
ACROSS = 0.15
"""Current across the axis, of that along it: legs push across off the multiples of 30 degrees, gains differ by per cents."""
LOST_SUM = 0.08
"""Sum of the phase currents, of the largest: offsets and gains of three sensors."""


def _must_follow(seen: Real, wanted: Real, allowed: float, what: str) -> None:
    """Broken at the first sample that is further off than allowed."""
    off = np.abs(seen - wanted)
    if np.any(~(off <= allowed)):
        k = int(np.argmax(~(off <= allowed)))
        raise Broken(
            f"{what}: sample {k} is {seen[k]:.3f} V, the formula says {wanted[k]:.3f} V within {allowed:.3f} V"
        )


def _voltage(drive: Drive, signal: Signal, samples: int) -> Steps[tuple[Real, float, float]]:
    """(axis voltage in V, control period, allowance in V) of a test."""
    scales = yield from drive.scales()
    data = yield from drive.recorded(signal, samples)
    period_s, grid_v = scales["control_period_s"], scales["voltage_scale_v"]
    return data[:, 0] * grid_v, period_s, GRID_COUNTS * grid_v + ramp_allowance_v(signal, period_s)


@rule
def eight_tones_at_control_rate(drive: Drive) -> Steps[None]:
    """Eight tones with their own amplitudes, frequencies and phases, summed at every control period from t = 0 at enable."""
    drive.needs_level()
    each_v = 0.25 * drive.level_v
    frequencies_hz, phases = (
        (3.0, 11.3, 23.9, 41.7, 77.1, 123.4, 211.0, 347.0),
        (0.0, 1.0, -2.0, 0.5, 3.0, 2.2, -1.1, 4.0),
    )
    tones = tuple((each_v * (1 + 0.1 * k), frequencies_hz[k], phases[k]) for k in range(8))
    signal = Signal(tones=tones, scale_ramp_per_s=1000.0)
    seen_v, period_s, allowed_v = yield from _voltage(drive, signal, 1000)
    wanted_v = commanded_v(signal, len(seen_v), period_s)
    _must_follow(seen_v[2:], wanted_v[2:], allowed_v - ramp_allowance_v(signal, period_s), "eight tones")


@rule
def only_the_counted_tones_play(drive: Drive) -> Steps[None]:
    """Of the tones in the registers, only the first `tone_count` are played."""
    drive.needs_level()
    tone = (0.5 * drive.level_v, 20.0, 0.0)
    yield from drive.set_up(Signal(tones=(tone,) * 8), drive.supervision())
    signal = Signal(tones=(tone,), scale_ramp_per_s=1000.0)
    scales = yield from drive.scales()
    yield from drive.set_up(signal, drive.supervision())
    tones = tuple(float(part) for _ in range(8) for part in tone)
    yield from drive.put({"tones": tones})
    yield from drive.walk_to_enabled()
    data = joined((yield from drive.stream(400)))
    yield from drive.stop()
    seen_v = data[2:, 0] * scales["voltage_scale_v"]
    wanted_v = commanded_v(signal, len(data), scales["control_period_s"])[2:]
    _must_follow(seen_v, wanted_v, GRID_COUNTS * scales["voltage_scale_v"], "one of eight tones")


@rule
def bias_follows_its_ramp(drive: Drive) -> Steps[None]:
    """The bias rises at its own ramp to its target, and stays there."""
    drive.needs_level()
    for sign in (1.0, -1.0):
        signal = Signal(bias_v=sign * drive.level_v, bias_ramp_v_per_s=8.0 * drive.level_v)
        seen_v, period_s, allowed_v = yield from _voltage(drive, signal, 900)
        _must_follow(seen_v, commanded_v(signal, len(seen_v), period_s), allowed_v, "a ramped bias")


@rule
def scale_follows_its_ramp(drive: Drive) -> Steps[None]:
    """The amplitude scale rises at its own ramp to its target, and stays there."""
    drive.needs_level()
    signal = Signal(scale=0.6, scale_ramp_per_s=5.0, tones=((drive.level_v, 35.0, 0.7),))
    seen_v, period_s, allowed_v = yield from _voltage(drive, signal, 900)
    _must_follow(seen_v, commanded_v(signal, len(seen_v), period_s), allowed_v, "a ramped scale")


@rule
def live_values_are_reached_at_their_ramps(drive: Drive) -> Steps[None]:
    """A bias and a scale changed while energised are ramped to, and the present values say where they are."""
    drive.needs_level()
    level_v = drive.level_v
    yield from drive.enable(Signal(bias_v=level_v, bias_ramp_v_per_s=8 * level_v, scale=1.0, tones=((1e-3, 1.0, 0.0),)))
    yield from drive.stream(900)
    yield from drive.put({"dc_bias_v": 0.5 * level_v, "amplitude_scale": 0.25})
    scales = yield from drive.scales()
    index = int((yield from drive.number("samples_produced")))
    data = joined((yield from drive.stream(900, start=index)))
    present_v, present = (yield from drive.number("present_bias_v")), (yield from drive.number("present_scale"))
    yield from drive.stop()
    if len(data) < 900:
        raise Broken(f"{len(data)} samples came after the change, wanted 900")
    seen_v = data[:, 0] * scales["voltage_scale_v"]
    steps_v = np.abs(np.diff(seen_v))
    largest_v = 8 * level_v * scales["control_period_s"] + 2 * GRID_COUNTS * scales["voltage_scale_v"]
    if float(steps_v.max()) > largest_v:
        raise Broken(
            f"the bias jumps by {float(steps_v.max()):.3g} V between samples, its ramp allows {largest_v:.3g} V"
        )
    if not abs(seen_v[-1] - 0.5 * level_v) < 3 * scales["voltage_scale_v"] or not abs(present_v - 0.5 * level_v) < 1e-2:
        raise Broken(
            f"the bias was set to {0.5 * level_v:.3f} V; the samples end at {seen_v[-1]:.3f} V, present {present_v:.3f} V"
        )
    if not abs(present - 0.25) < 1e-3:
        raise Broken(f"the scale was set to 0.25 and present_scale is {present:g}")


@rule
def currents_lie_along_the_axis(drive: Drive) -> Steps[None]:
    """A direct voltage along an axis makes a current along that axis, in all three phases."""
    drive.needs_level()
    period_s = yield from drive.number("control_period_s")
    samples = round(SETTLE_S / period_s)
    for axis_deg in AXES_DEG:
        signal = Signal(axis_deg=axis_deg, bias_v=drive.level_v, bias_ramp_v_per_s=20 * drive.level_v)
        data = yield from drive.recorded(signal, samples)
        currents = data[-samples // 5 :, 1:].mean(axis=0)
        angles = np.radians(axis_deg) - np.radians([0.0, 120.0, 240.0])
        along = float(2 / 3 * currents @ np.cos(angles))
        across = float(-2 / 3 * currents @ np.sin(angles))
        if not along > 0 or abs(across) > ACROSS * along:
            raise Broken(
                f"axis {axis_deg:g} degrees: currents u, v, w of {currents.round().tolist()} counts are {along:.0f} "
                f"along it and {across:.0f} across"
            )


@rule
def phase_currents_sum_to_nothing(drive: Drive) -> Steps[None]:
    """The three phase currents sum to nothing but the sensors' offsets: the star point floats."""
    drive.needs_level()
    signal = Signal(axis_deg=20.0, bias_v=drive.level_v, tones=((0.5 * drive.level_v, 15.0, 0.0),))
    data = yield from drive.recorded(signal, 1500)
    scale_a = yield from drive.number("current_scale_a")
    total, largest = float(np.abs(data[:, 1:].sum(axis=1)).max()) * scale_a, float(np.abs(data[:, 1:]).max()) * scale_a
    if total > LOST_SUM * largest + 0.12 * drive.test_current_a:
        raise Broken(f"the phase currents sum to up to {total:.3g} A, the largest being {largest:.3g} A")


@rule
def the_voltage_limit_clamps_and_is_flagged(drive: Drive) -> Steps[None]:
    """The axis voltage never passes the voltage limit, and windows in which it was clamped say so, others do not."""
    drive.needs_level()
    limit_v, flag = 0.6 * drive.level_v, drive.layout.flags["voltage_clamped"]
    scales = yield from drive.scales()
    signal = Signal(tones=((drive.level_v, 20.0, 0.0),), scale_ramp_per_s=4.0)
    yield from drive.enable(signal, drive.supervision(voltage_limit_v=limit_v))
    windows = yield from drive.stream(1500)
    yield from drive.stop()
    grid_v, index = scales["voltage_scale_v"], 0
    asked_v = np.abs(commanded_v(signal, 1500 + drive.layout.data_registers, scales["control_period_s"]))
    for window in windows:
        peak_v = float(np.abs(window.data[:, 0]).max(initial=0.0)) * grid_v
        most_v = float(asked_v[index : index + window.count].max(initial=0.0))
        index += window.count
        if peak_v > limit_v + grid_v:
            raise Broken(f"{peak_v:.2f} V pass the voltage limit of {limit_v:.2f} V")
        is_flagged = bool(window.flags & flag)
        if (is_flagged and most_v < limit_v - 0.2) or (not is_flagged and most_v > limit_v + 0.2):
            raise Broken(
                f"up to {most_v:.2f} V were asked for, the limit is {limit_v:.2f} V, flagged clamped: {is_flagged}"
            )


@rule
def the_test_ends_by_itself_after_its_duration(drive: Drive) -> Steps[None]:
    """After its duration the excitation ramps down and the drive switches off, without a fault."""
    drive.needs_level()
    period_s = yield from drive.number("control_period_s")
    grid_v = yield from drive.number("voltage_scale_v")
    signal = Signal(bias_v=drive.level_v, bias_ramp_v_per_s=8 * drive.level_v, duration_s=0.3)
    yield from drive.enable(signal)
    windows = yield from drive.stream(round(3.0 / period_s))
    seen = yield from drive.reaches(DriveState.SWITCH_ON_DISABLED, polls=20)
    fault = yield from drive.number("fault_code")
    data = joined(windows)
    lasted_s = len(data) * period_s
    if seen is not DriveState.SWITCH_ON_DISABLED or fault:
        raise Broken(f"after its duration the drive is '{seen.value}' with fault code {fault:g}")
    if not signal.duration_s - 2 * period_s <= lasted_s <= signal.duration_s + 1.0:
        raise Broken(f"a test of {signal.duration_s:g} s lasted {lasted_s:.3f} s")
    last_v, step_v = abs(float(data[-1, 0])) * grid_v, 8 * drive.level_v * period_s
    if last_v > 4 * step_v + 2 * grid_v:
        raise Broken(f"the output went off at {last_v:.2f} V instead of ramping down")


@rule
def the_status_says_what_is_applied(drive: Drive) -> Steps[None]:
    """While energised, present bias, current and remaining time are those of the test."""
    drive.needs_level()
    limit_s = 20.0
    scales = yield from drive.scales()
    signal = Signal(bias_v=drive.level_v, bias_ramp_v_per_s=2.5 * drive.level_v)
    yield from drive.enable(signal, drive.supervision(test_time_limit_s=limit_s))
    before = joined((yield from drive.stream(300)))
    rising_v = yield from drive.number("present_bias_v")
    data = joined((yield from drive.stream(3000, start=len(before))))
    names = ("present_bias_v", "current_magnitude_a", "test_time_left_s", "samples_produced")
    bias_v, current_a, left_s, produced = yield from drive.numbers(*names)
    yield from drive.stop()
    grid_v, largest_a = scales["voltage_scale_v"], float(np.abs(data[-20:, 1:]).max()) * scales["current_scale_a"]
    if not float(before[-1, 0]) * grid_v - 2 * grid_v <= rising_v <= 0.9 * drive.level_v:
        raise Broken(
            f"present_bias_v is {rising_v:.3f} V on the way from {before[-1, 0] * grid_v:.3f} V to {drive.level_v:.3f} V"
        )
    if abs(bias_v - drive.level_v) > 1e-2 * drive.level_v:
        raise Broken(f"present_bias_v is {bias_v:.3f} V with {drive.level_v:.3f} V applied")
    if not 0.7 * largest_a < current_a < 1.4 * largest_a:
        raise Broken(f"current_magnitude_a is {current_a:.3f} A, the samples say {largest_a:.3f} A")
    wanted_s = limit_s - produced * scales["control_period_s"]
    if abs(left_s - wanted_s) > 0.1:
        raise Broken(f"test_time_left_s is {left_s:.3f} s after {produced:.0f} samples, wanted {wanted_s:.3f} s")
