"""The four parameters as the impedance at the tones says them: where a fit begins."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d

from commissioner.diagnose.intake.record import Record

SILENT = (1.0, 1.0, 0.01, 0.2)
"""Where a fit begins when no current answers the command (an audit refuses such a recording)."""
AUDIBLE = 10.0
"""Times the median of the highest quarter of the spectrum, that a line of the current is at least: of noise it is 3.7 in the strongest of
ten thousand bins, and would turn a line of 5. A random binary command asks at every frequency, and is answered by noise alone at most."""
SKIRT_BINS = 4
"""The Hann window's main lobe and first side lobes: no second tone is looked for so near."""


def impedance_starts(record: Record, delay_s: float = 0.0) -> list[tuple[float, float, float, float]]:
    """From the command's spectrum: resistance at the lowest line and at the median tone, reactance at the highest; two
    spreads of L_M. A tone is read in its strongest bin: the skirts beside it are anyone's.
    `delay_s` of the current, and the half period by which it follows a held command, are taken out of the phases first.
    Clipped samples count as they are: without them the lines would be further off.
    """
    segment = max(record.segments, key=lambda s: float(np.std(s.voltage_axis_v)))
    n = segment.count
    window = np.hanning(n)
    volts = np.fft.rfft(segment.voltage_axis_v * window)
    amps = np.fft.rfft(segment.axis_current_a * window)
    frequency = np.fft.rfftfreq(n, record.facts.sample_period_s)
    strong = np.flatnonzero(np.abs(volts) > 0.02 * np.abs(volts[1:]).max())
    floor = AUDIBLE * float(np.median(np.abs(amps[3 * amps.size // 4 :])))
    strong = strong[(strong > 0) & (np.abs(amps[strong]) > floor)]
    if strong.size == 0:
        return [SILENT] * 2
    late = delay_s + 0.5 * record.facts.sample_period_s
    impedance = volts[strong] / amps[strong] * np.exp(-2j * np.pi * frequency[strong] * late)
    is_tone = np.abs(volts[strong]) == maximum_filter1d(np.abs(volts), 2 * SKIRT_BINS + 1)[strong]
    tones = np.flatnonzero(is_tone) if is_tone.any() else np.arange(strong.size)
    high, low = impedance[tones[-1]], impedance[0]
    w_high, w_low = 2 * np.pi * frequency[strong[tones[-1]]], 2 * np.pi * frequency[strong[0]]
    leakage = max(abs(high.imag) / w_high, 1e-5)
    total = max(float(np.median(np.abs(impedance[tones].real))), 1e-3)
    stator = float(np.clip(abs(low.real), 0.2 * total, 0.9 * total))
    rotor = max(total - stator, 0.2 * total)
    magnetizing = max(abs(low.imag) / w_low, 4.0 * leakage)
    return [
        (stator, rotor, leakage, magnetizing),
        (0.55 * total, 0.45 * total, leakage, 12.0 * leakage),
    ]
