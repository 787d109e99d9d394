"""Flux from the current alone: psi_R' = R_R i - alpha psi_R, psi_s = psi_R + L_sigma i.

It needs no voltage, so neither stator resistance nor inverter, forgets its start within a rotor time constant, and reads
too high where iron saturates. Because the rotor flux is a low-pass of L_M i, |psi_s| never passes L_s max |i|, whatever
the voltage: a drive that trips at I limits the flux to L_s I by itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from commissioner.compiled import writable
from commissioner.identify.excite.kernels import driven_flux
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
        flux: Signal
        flux, self.rotor_flux_wb = driven_flux(
            writable(current_a), lost_before, keeps, machine.magnetizing_inductance_h, machine.leakage_inductance_h,
            self.rotor_flux_wb,
        )  # fmt: skip
        return flux
