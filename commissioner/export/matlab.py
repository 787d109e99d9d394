"""A MATLAB 5 file with one struct `motor`, for MATLAB and Simulink: `load file.mat; motor.inverse_gamma.R_s`."""

from __future__ import annotations

import io

import numpy as np

from commissioner.export.found import CONVENTION, Found


def as_struct(found: Found) -> bytes:
    """Nested structs by circuit; tables as columns; units and convention as text."""
    from scipy.io import savemat

    machine, gamma, t = found.machine, found.gamma, {name: q.value for name, q in found.t_model.items()}
    motor = {
        "run": found.run, "utc": found.utc, "convention": CONVENTION, "nameplate": dict(found.plate),
        "inverse_gamma": dict(zip(("R_s", "R_R", "L_sgm", "L_M"), machine.as_tuple(), strict=True)),
        "inverse_gamma_std": {key: q.std for key, q in zip(("R_s", "R_R", "L_sgm", "L_M", "T_R"), found.parameters.values(), strict=True)},
        "gamma": {
            "R_s": gamma.stator_resistance_ohm, "R_r": gamma.rotor_resistance_ohm, "L_l": gamma.leakage_inductance_h,
            "L_s": gamma.stator_inductance_h,
        },
        "T": dict(zip(("R_s", "R_r", "L_ls", "L_lr", "L_m"), t.values(), strict=True)), "T_assumption": found.t_assumption,
        "holds_for_stator_flux_wb": found.holds_for_wb,
        "curve_stator_flux_wb": _column(found.curve, 0), "curve_L_M_h": _column(found.curve, 1),
        "leg_current_a": _column(found.leg, 0), "leg_voltage_v": _column(found.leg, 1),
    }  # fmt: skip
    buffer = io.BytesIO()
    savemat(buffer, {"motor": motor}, long_field_names=True, oned_as="column")
    return buffer.getvalue()


def _column(table: tuple[tuple[float, float], ...], index: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.array([row[index] for row in table], dtype=np.float64)
