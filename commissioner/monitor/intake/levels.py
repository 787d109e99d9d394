"""Sizes: dead and clipped channels, switched voltages, and values that this motor cannot have."""

from __future__ import annotations

import numpy as np

from commissioner.monitor.intake.findings import Finding, Findings, Fundamental
from commissioner.monitor.intake.sensors import SKEW_STD_S
from commissioner.monitor.signals.supply import Vector
from commissioner.motor.channels.clock import off_mains
from commissioner.motor.channels.ends import clipped
from commissioner.motor.channels.levels import current_level, voltage_level
from commissioner.motor.channels.sums import OpenSum
from commissioner.motor.nameplate import Nameplate
from commissioner.records import Signal

LARGEST_CLIPPED = 0.002
"""Share of samples that sit on the same extreme value beyond what a sine would put there."""
NOTED_GAIN = 0.01
SURE_DELAY = 4.0
"""Standard deviations from which a delay that was fitted is said."""
LARGEST_RIPPLE = 0.35
"""Share of the voltage's rms that is not its fundamental: beyond it the voltage is a switched one, sampled without filter."""


def channel_levels(currents: list[Signal], voltages: list[Signal], findings: Findings) -> None:
    """Dead channels and clipped ones."""
    for group, kind in ((currents, "current"), (voltages, "voltage")):
        rms = np.array([signal.std() for signal in group])
        for name, value in zip("uvw", rms, strict=True):
            if value < 0.2 * rms.max() or rms.max() == 0.0:
                findings.add(
                    "dead_channel",
                    "refused",
                    f"{kind} channel {name} carries {value:.3g} rms where the largest has {rms.max():.3g}",
                    float(value),
                    float(0.2 * rms.max()),
                    "check the sensor and its wiring",
                )
        for name, signal in zip("uvw", group, strict=True):
            _, share = clipped(signal)
            if share > LARGEST_CLIPPED:
                findings.add(
                    "clipped_channel",
                    "refused",
                    f"{kind} channel {name} is clipped: {share:.1%} of its samples sit on a limit",
                    share,
                    LARGEST_CLIPPED,
                    "use a larger range",
                )


def unlike_gains(difference: Signal, kind: str, findings: Findings) -> None:
    """Says so where the gains of three channels, whose sum should be zero, were made alike by more than a per cent."""
    largest = float(np.abs(difference).max())
    if largest > NOTED_GAIN:
        findings.add(
            "unlike_gains",
            "corrected",
            f"the {kind}s do not sum to zero: their gains were taken to differ by "
            + ", ".join(f"{100 * d:+.1f}" for d in difference)
            + " % from their mean",
            largest,
            NOTED_GAIN,
            f"calibrate the {kind} sensors against each other",
        )


def open_sum(odd: OpenSum | None, findings: Findings) -> None:
    """A refusal where three channels cannot be the lines of one motor."""
    if odd is not None:
        value, limit = odd.share if odd.gain is None else odd.gain, f"{odd.limit:g} of the three left in their sum"
        findings.add("open_sum", "refused", odd.what, value, limit, odd.remedy)


def switched_voltage(v: Vector, fundamental: Fundamental, findings: Findings) -> None:
    known = abs(fundamental.voltage_v) ** 2 + abs(fundamental.voltage_negative_v) ** 2
    share = float(np.sqrt(max(np.mean(np.abs(v) ** 2) - known, 0.0) / known))
    if share > LARGEST_RIPPLE:
        findings.add(
            "switched_voltage",
            "refused",
            f"{share:.0%} of the voltage is not its fundamental",
            share,
            LARGEST_RIPPLE,
            "filter the voltage before sampling, or give the mean over each switching period",
        )


def supply_range(frequency_hz: float, plate: Nameplate, findings: Findings) -> None:
    if not 0.1 * plate.rated_frequency_hz < frequency_hz < 2.0 * plate.rated_frequency_hz:
        findings.add(
            "supply_frequency",
            "refused",
            f"the strongest voltage line is at {frequency_hz:.4g} Hz",
            frequency_hz,
            f"{0.1 * plate.rated_frequency_hz:.3g} ... {2 * plate.rated_frequency_hz:.3g} Hz",
            "check the voltage channels",
        )


def plausible_size(fundamental: Fundamental, plate: Nameplate, findings: Findings) -> None:
    """A current in other units or of a probe's scale; line-to-line voltages under the names of phase voltages, or the reverse:
    root three too large or too small, and 30 degrees off.
    """
    share = abs(fundamental.current_a) / (np.sqrt(2) * plate.rated_current_a)
    per_hertz = abs(fundamental.voltage_v) / fundamental.frequency_hz
    rated = plate.rated_voltage_v * np.sqrt(2 / 3) / plate.rated_frequency_hz
    of_volts = voltage_level(float(per_hertz / rated), fundamental.frequency_hz / plate.rated_frequency_hz)
    for level in (current_level(float(share)), of_volts):
        if level is not None:
            findings.add(level.code, "refused", level.what, level.value, level.limit, level.remedy)


def of_mains(fundamental: Fundamental, findings: Findings) -> None:
    """A note where the supply is near the mains' frequency, and not at it."""
    if (said := off_mains(fundamental.frequency_hz)) is not None:
        findings.add(
            "clock_rate",
            "note",
            said,
            fundamental.frequency_hz,
            "50 or 60 Hz",
            "check sample_period_s and the time column",
        )


def late_currents(delay_s: float, std_s: float) -> tuple[Finding, ...]:
    """A finding where the fit put the currents right by more than sensors are usually apart."""
    if not abs(delay_s) > max(SKEW_STD_S, SURE_DELAY * std_s):
        return ()
    way = "behind" if delay_s > 0.0 else "before"
    return (
        Finding(
            "late_channel", "corrected", f"all currents are {abs(delay_s) * 1e6:.3g} us {way} the voltages (+- {2e6 * std_s:.2g} us): put right",
            delay_s, SKEW_STD_S, "use one converter for all channels, or correct the currents' time",
        ),
    )  # fmt: skip
