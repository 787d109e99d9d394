"""Where the batch fit begins: a machine read off the impedance at the tones, which no wrong minimum can trap.

Currents and voltages at each line (Hann window) give complex impedances; four logarithms are fitted to them from the
plate's typical machine. Saturation and what is left of the inverter's loss bend the values by some ten per cent only.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from commissioner.identify.intake.stretches import Stretch, tones_in
from commissioner.identify.inverter.staircase import InverterError
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import ParameterBox
from commissioner.motor.standstill import admittance_s
from commissioner.records import Signal

FEWEST_TONES = 2
WIDEST_LOG = 3.0
"""How far from typical a machine is looked for: a factor of twenty."""


def from_impedance(
    stretches: Sequence[Stretch], period_s: float, box: ParameterBox, leg: InverterError | None
) -> InverseGamma | None:
    """The machine with the admittances seen at the tones of the strongest stretch; None for fewer than two tones."""
    stretch = max(stretches, key=lambda s: float(np.var(s.voltage_v)) * s.voltage_v.size)
    lost = leg.on_axis(stretch.current_a, stretch.axis_deg) if leg is not None else 0.0
    frequencies, admittances = _admittances(stretch.voltage_v, stretch.voltage_v - lost, stretch.current_a, period_s)
    if frequencies.size < FEWEST_TONES:
        return None
    typical = np.array(box.typical.as_tuple())

    def misfit(logs: Signal) -> Signal:
        ratio = admittance_s(InverseGamma(*map(float, typical * np.exp(logs))), frequencies) / admittances
        error = np.log(ratio)
        return np.concatenate([error.real, error.imag, 0.03 * logs])

    fit = least_squares(misfit, np.zeros(4), bounds=(-WIDEST_LOG, WIDEST_LOG), loss="soft_l1", f_scale=0.1)
    return InverseGamma(*map(float, typical * np.exp(fit.x)))


def _admittances(
    commanded_v: Signal, voltage_v: Signal, current_a: Signal, period_s: float
) -> tuple[Signal, np.ndarray]:
    frequencies = np.array(tones_in(commanded_v, period_s))
    window = np.hanning(voltage_v.size)
    # The voltage is held over the period that begins where the current is sampled.
    middle = (np.arange(voltage_v.size) + 0.5) * period_s
    lines = np.exp(-2j * np.pi * np.outer(frequencies, middle)) * window
    later = np.exp(2j * np.pi * frequencies * 0.5 * period_s)
    return frequencies, (lines @ current_a) * later / (lines @ voltage_v)
