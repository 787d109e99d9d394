"""A parameter module for motulator (MIT, github.com/Aalto-Electric-Drives/motulator), version 0.5: its Gamma circuit, with the
stator inductance as a function of the stator flux where the iron was seen to bend."""

from __future__ import annotations

from commissioner.export.found import CONVENTION, Found

_HEAD = '''"""Induction machine of run {run} ({utc}), for motulator 0.5: `from this_file import par`.

{convention}.
Gamma circuit; constants from the inverse-Gamma values at a peak stator flux of {flux:.6g} Wb. Standard errors: {errors}.
Flux beyond the last point of the table was not measured: the inductance is held there.
"""

from motulator.drive.utils import InductionMachinePars
'''
_BENT = '''import numpy as np

STATOR_FLUX_WB = np.array([{flux}])
STATOR_INDUCTANCE_H = np.array([{inductance}])


def stator_inductance_h(stator_flux_wb):
    """Secant stator inductance at a peak stator flux."""
    return np.interp(np.abs(stator_flux_wb), STATOR_FLUX_WB, STATOR_INDUCTANCE_H)

'''
_PAR = """
par = InductionMachinePars(
    n_p={poles},
    R_s={r_s!r},
    R_r={r_r!r},
    L_ell={l_l!r},
    L_s={l_s},
)
"""


def as_module(found: Found) -> bytes:
    """Python text that motulator's users import."""
    gamma = found.gamma
    errors = ", ".join(f"{name} {quantity.std:.2g}" for name, quantity in found.parameters.items())
    head = _HEAD.format(run=found.run, utc=found.utc, convention=CONVENTION, flux=found.holds_for_wb, errors=errors)
    bent = ""
    if found.stator_curve:
        flux, inductance = (
            ", ".join(repr(float(v)) for v in column) for column in zip(*found.stator_curve, strict=True)
        )
        bent = _BENT.format(flux=flux, inductance=inductance)
    par = _PAR.format(
        poles=int(found.plate["pole_pairs"]), r_s=gamma.stator_resistance_ohm, r_r=gamma.rotor_resistance_ohm,
        l_l=gamma.leakage_inductance_h, l_s="stator_inductance_h" if bent else repr(gamma.stator_inductance_h),
    )  # fmt: skip
    return (head + bent + par).encode()
