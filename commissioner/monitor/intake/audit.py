"""May this recording carry an answer? Time, levels, clipping, sequence, pairing, steadiness: named findings, or a refusal.

Findings are values; `Finding.stops` marks those after which there is no torque curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from commissioner.monitor.intake import channels, clock, columns, levels
from commissioner.monitor.intake.findings import Audited, Finding, Findings, Fundamental
from commissioner.monitor.intake.sensors import SKEW_STD_S, evened, trust_of
from commissioner.monitor.signals.supply import (
    SupplyAngle,
    Vector,
    dominant_frequency_hz,
    follow_supply,
    fundamental_phasor,
    phase_voltages,
    space_vector,
)
from commissioner.motor.channels.faults import no_lines
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import TCircuit
from commissioner.records import RunningRecording, Signal

HOPELESS = frozenset({"time_order", "dead_channel", "sample_rate"})
"""After these not even the fundamental means anything; after other refusals it is still reported."""


def inspect(
    recording: RunningRecording,
    plate: Nameplate,
    start: TCircuit,
    lag_deg: float | None = None,
    wired: channels.Wiring | None = None,
    skew_std_s: float = SKEW_STD_S,
) -> Audited:
    """Everything that can be said about the recording before any verdict; never raises on bad data.

    `lag_deg`: the order of the channels is known to be that of this lag of the currents; `wired`: it is known as such; `skew_std_s`: standard
    deviation of their delay against the voltages.
    """
    findings = Findings(Finding(note.code, "note", note.what) for note in recording.notes)
    recording, exchanged = columns.sort_by_kind(recording, plate)
    recording, completed = columns.complete(recording)
    findings += [*exchanged, *completed]
    low, high = clock.whole_stretch(recording, findings)
    period = clock.sample_clock(recording, slice(low, high), findings)
    clock.fast_enough(period, plate, findings)
    currents = [signal[low:high] for signal in recording.currents_a]
    voltages = [signal[low:high] for signal in recording.voltages_v]
    empty = np.zeros(0, dtype=np.complex128)
    if any(finding.code in HOPELESS and finding.stops for finding in findings) or high - low < clock.LEAST_SAMPLES:
        return Audited(low, 0.0, period, empty, empty, None, None, tuple(findings), {})
    levels.channel_levels(currents, voltages, findings)
    if any(finding.code in HOPELESS and finding.stops for finding in findings):
        return Audited(low, 0.0, period, empty, empty, None, None, tuple(findings), {})
    raw_frequency = abs(dominant_frequency_hz(space_vector(*voltages), period))
    levels.supply_range(raw_frequency, plate, findings)
    pairing = channels.pair(
        *_phasors(currents, voltages, period, raw_frequency),
        plate,
        start,
        raw_frequency,
        recording.voltages_are_line_to_line,
        lag_deg,
        wired,
    )
    findings += pairing.findings
    if pairing.is_refused:
        return Audited(low, 0.0, period, empty, empty, None, None, tuple(findings), pairing.channel_map)
    straight_i = [sign * currents[k] for k, sign in zip(pairing.current_order, pairing.current_sign, strict=True)]
    straight_v = [sign * voltages[k] for k, sign in zip(pairing.voltage_order, pairing.voltage_sign, strict=True)]
    i, v = _vectors(straight_i, straight_v, recording.voltages_are_line_to_line)
    supply = follow_supply(v, period, raw_frequency)
    fundamental = measure_fundamental(i, v, supply, period, pairing.runs_backwards)
    levels.switched_voltage(v, fundamental, findings)
    if all(note.code != "carrier_means" for note in recording.notes):
        # of means over a carrier what is left of its ripple turns the vector as jitter would
        clock.hidden_jitter(v, supply, fundamental, period, findings)
    levels.plausible_size(fundamental, plate, findings)
    if not recording.metadata.get("switching_frequency_hz"):
        levels.of_mains(fundamental, findings)
    even_i = evened(straight_i, True, supply, period)
    even_v = evened(straight_v, recording.voltages_are_line_to_line, supply, period)
    levels.unlike_gains(even_i.difference, "current", findings)
    levels.unlike_gains(even_v.difference, "voltage", findings)
    turned = _turned(recording, pairing, slice(low, high))
    levels.open_sum(no_lines(turned, plate.rated_current_peak_a, np.sqrt(2 / 3) * plate.rated_voltage_v), findings)
    i, v = _vectors(even_i.signals, even_v.signals, recording.voltages_are_line_to_line)
    return Audited(
        low,
        float(recording.time_s[low]),
        period,
        i,
        v,
        supply,
        fundamental,
        tuple(findings),
        pairing.channel_map,
        trust_of(even_i, even_v, supply, skew_std_s),
        pairing.lag_deg,
        pairing.rivals_deg,
        pairing.others_deg,
        pairing.generator,
        pairing.wired,
    )


def measure_fundamental(i: Vector, v: Vector, supply: SupplyAngle, period: float, backwards: bool) -> Fundamental:
    """Sequence phasors over a Hann window, and the mean power of the whole stretch."""
    time = np.arange(v.size) * period
    angle = supply.angle_rad(time)
    window = np.hanning(v.size + 2)[1:-1]
    window /= window.sum()
    forward = np.exp(-1j * angle) * window
    positive_v, positive_i = complex(v @ forward), complex(i @ forward)
    backward = np.conj(np.exp(-1j * angle)) * window
    negative_v, negative_i = complex(v @ backward), complex(i @ backward)
    apparent = 1.5 * positive_v * np.conj(positive_i)
    frequency = float(np.average(supply.frequency_rad_per_s(time), weights=window)) / (2 * np.pi)
    return Fundamental(
        frequency,
        positive_v,
        positive_i,
        np.conj(negative_v),
        np.conj(negative_i),
        float(apparent.real),
        float(apparent.imag),
        backwards,
    )


def _phasors(
    currents: list[Signal], voltages: list[Signal], period: float, frequency_hz: float
) -> tuple[list[complex], list[complex]]:
    """Peak phasors of six channels over the first seconds: long enough to average, short enough for one frequency."""
    count = min(currents[0].size, max(int(2.0 / period), int(5 / (frequency_hz * period))))
    angle = 2 * np.pi * frequency_hz * np.arange(count) * period
    return (
        [fundamental_phasor(signal[:count] - signal[:count].mean(), angle) for signal in currents],
        [fundamental_phasor(signal[:count] - signal[:count].mean(), angle) for signal in voltages],
    )


def _turned(recording: RunningRecording, pairing: channels.Pairing, part: slice) -> RunningRecording:
    """The stretch with every channel, in its place, the way round that the pairing takes it."""
    amps, volts = (
        [sign * group[k][part] for k, sign in sorted(zip(order, signs, strict=True))]
        for group, order, signs in (
            (recording.currents_a, pairing.current_order, pairing.current_sign),
            (recording.voltages_v, pairing.voltage_order, pairing.voltage_sign),
        )
    )
    return replace(recording, currents_a=(amps[0], amps[1], amps[2]), voltages_v=(volts[0], volts[1], volts[2]))


def _vectors(currents: Sequence[Signal], voltages: Sequence[Signal], line_to_line: bool) -> tuple[Vector, Vector]:
    star = phase_voltages(*voltages) if line_to_line else (voltages[0], voltages[1], voltages[2])
    i, v = space_vector(*currents), space_vector(*star)
    return i - i.mean(), v - v.mean()
