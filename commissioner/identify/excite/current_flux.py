"""Flux from the current alone: psi_R' = R_R i - alpha psi_R, psi_s = psi_R + L_sigma i.

It needs no voltage, so neither stator resistance nor inverter, forgets its start within a rotor time constant, and reads
too high where iron saturates. Because the rotor flux is a low-pass of L_M i, |psi_s| never passes L_s max |i|, whatever
the voltage: a drive that trips at I limits the flux to L_s I by itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from commissioner.motor.circuit import InverseGamma
from commissioner.records import Signal


@dataclass
class CurrentFlux:
    """One per energised stretch; `rotor_flux_wb` is what the rotor holds now."""

    machine: InverseGamma
    sample_period_s: float
    rotor_flux_wb: float = 0.0

    def advance(self, current_a: Signal, lost_before: int = 0) -> Signal:
        """The stator flux at the samples, `(n,)`; what was lost before them is bridged with the first current."""
        machine = self.machine
        keeps = math.exp(-self.sample_period_s * machine.rotor_resistance_ohm / machine.magnetizing_inductance_h)
        bridged = np.append(np.full(lost_before, current_a[0]), current_a)
        driven = (1.0 - keeps) * machine.magnetizing_inductance_h * bridged
        rotor = lfilter([1.0], [1.0, -keeps], driven, zi=[keeps * self.rotor_flux_wb])[0]
        self.rotor_flux_wb = float(rotor[-1])
        return np.asarray(rotor[lost_before:] + machine.leakage_inductance_h * current_a)
