"""Where the batch fit begins: a machine read off the impedance at the tones, which no wrong minimum can trap.

Currents and voltages at each line (Hann window) give complex impedances; four logarithms are fitted to them from the
plate's typical machine. Saturation and what is left of the inverter's loss bend the values by some ten per cent only.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from commissioner.identify.intake.stretches import Stretch, tones_in
from commissioner.identify.inverter.staircase import InverterError
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import ParameterBox
from commissioner.motor.standstill import admittance_s
from commissioner.records import Signal

FEWEST_TONES = 2
WIDEST_LOG = 3.0
"""How far from typical a machine is looked for: a factor of twenty."""
MOST_LATE = 8.0
"""Sample periods by which the currents may lie behind the voltage, or before it."""


def from_impedance(
    stretches: Sequence[Stretch], period_s: float, box: ParameterBox, leg: InverterError | None
) -> InverseGamma | None:
    """The machine with the admittances seen at the tones of the strongest stretch; None for fewer than two tones."""
    found = _fitted(stretches, period_s, box, leg, FEWEST_TONES, is_on_time=True)
    return None if found is None else found[0]


def periods_late(
    stretches: Sequence[Stretch], period_s: float, box: ParameterBox, leg: InverterError | None = None
) -> float:
    """How many sample periods the currents lie behind the voltage, coarsely (half a period), from the impedance's angle over
    the tones; 0 where fewer than three are there to tell it from the machine."""
    found = _fitted(stretches, period_s, box, leg, FEWEST_TONES + 1, is_on_time=False)
    return 0.0 if found is None else found[1]


def _fitted(
    stretches: Sequence[Stretch], period_s: float, box: ParameterBox, leg: InverterError | None, fewest: int, *,
    is_on_time: bool,
) -> tuple[InverseGamma, float] | None:  # fmt: skip
    from scipy.optimize import least_squares

    stretch = max(stretches, key=lambda s: float(np.var(s.voltage_v)) * s.voltage_v.size)
    lost = leg.on_axis(stretch.current_a, stretch.axis_deg) if leg is not None else 0.0
    frequencies, admittances = _admittances(stretch.voltage_v, stretch.voltage_v - lost, stretch.current_a, period_s)
    if frequencies.size < fewest:
        return None
    typical = np.array(box.typical.as_tuple())
    turn = -2j * np.pi * frequencies * period_s * (0.0 if is_on_time else 1.0)

    def misfit(x: Signal) -> Signal:
        machine = InverseGamma(*map(float, typical * np.exp(x[:4])))
        error = np.log(admittance_s(machine, frequencies) / admittances) + turn * x[4]
        return np.concatenate([error.real, np.angle(np.exp(1j * error.imag)), 0.03 * x[:4], [1e-3 * x[4]]])

    bounds = np.array([WIDEST_LOG] * 4 + [MOST_LATE])
    fit = least_squares(misfit, np.zeros(5), bounds=(-bounds, bounds), loss="soft_l1", f_scale=0.1)
    return InverseGamma(*map(float, typical * np.exp(fit.x[:4]))), float(fit.x[4])


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
