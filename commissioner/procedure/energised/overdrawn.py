"""Does an unknown motor draw far more under its first tones than the plate's would? Told by the samples themselves, before the drive's
own limit ends the test with a trip.

The plate's motor is played under the same voltages, with the resistance that direct currents told. Of the 31 machines of
tests/data/motors whose plate can be true each draws 0.89 ... 1.23 of what its plate's typical one draws so, wired in delta for star
1.37 ... 3.2 times it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from commissioner.identify.inverter.staircase import InverterError
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.standstill import played, pulse_transfers
from commissioner.records import Signal


@dataclass
class Drawn:
    """What one test has driven and drawn so far, from rest; `axis_deg` as the voltage acts, samples `period_s` apart."""

    typical: InverseGamma
    inverter: InverterError
    axis_deg: float
    period_s: float
    _voltage_v: list[Signal] = field(default_factory=list, init=False)
    _current_a: list[Signal] = field(default_factory=list, init=False)
    _is_whole: bool = field(default=True, init=False)

    def take(self, voltage_v: Signal, current_a: Signal, lost_before: int) -> None:
        """A block's voltages, each held over its period, and currents along the axis, `(n,)`."""
        self._is_whole &= lost_before == 0
        self._voltage_v.append(voltage_v)
        self._current_a.append(current_a)

    @property
    def over_typical(self) -> float | None:
        """Rms of the current over that of the plate's typical motor; None where samples were lost or nothing was driven."""
        if not self._is_whole or not self._voltage_v:
            return None
        current_a = np.concatenate(self._current_a)
        lost_v = self.inverter.on_axis(current_a, self.axis_deg)
        transfer = pulse_transfers(np.array([self.typical.as_tuple()]), self.period_s)[0]
        typical_a = played(transfer, np.concatenate(self._voltage_v) - lost_v)
        typical_rms_a = float(np.sqrt(np.mean(typical_a**2)))
        return float(np.sqrt(np.mean(current_a**2))) / typical_rms_a if typical_rms_a > 0.0 else None
