"""An identification as the contract's JSON document."""

from __future__ import annotations

import math

import numpy as np

from commissioner.identify import contract
from commissioner.identify.analysis import Identification
from commissioner.identify.estimate.axis import AxisResult
from commissioner.identify.inverter.staircase import InverterError, Staircase
from commissioner.motor.circuit import PARAMETERS, InverseGamma, Quantity

CONVENTION = "SI, per-phase star equivalent, rotor referred to the stator; std is one standard deviation"


def document(result: Identification) -> contract.IdentificationDocument:
    """`run` / `identify` of the contract, plain JSON types only."""
    return {
        "outcome": "identified",
        "reason": "",
        "convention": CONVENTION,
        "estimator": result.estimator,
        "parameters": parameters_json(result.parameters, np.asarray(result.covariance), result.holds_for_flux_wb),
        "holds_for_stator_flux_wb": result.holds_for_flux_wb,
        "t_model": {
            "stator_resistance_ohm": quantity(result.t_model.stator_resistance_ohm),
            "rotor_resistance_ohm": quantity(result.t_model.rotor_resistance_ohm),
            "stator_leakage_h": quantity(result.t_model.stator_leakage_h),
            "rotor_leakage_h": quantity(result.t_model.rotor_leakage_h),
            "magnetizing_inductance_h": {
                **quantity(result.t_model.magnetizing_inductance_h),
                "at_stator_flux_wb": result.holds_for_flux_wb,
            },
            "assumption": result.t_model.assumption,
        },
        "axes": [_axis(axis) for axis in result.axes],
        "dispersion": dict(zip(PARAMETERS, result.combined.relative_dispersion, strict=True)),
        "findings": [
            {
                "cause": f.cause.name.lower(),
                "sentence": f.cause.value,
                "relative_size": f.relative_size,
                "relative_std": f.relative_std,
                "probability_by_chance": f.probability_by_chance,
            }
            for f in result.combined.findings
        ],
        "rated_flux_wb": {
            "stator_rms": result.rated_flux.stator_rms_wb,
            "stator_peak": result.rated_flux.stator_peak_wb,
        },
        "inverter": inverter_json(result.inverter, result.axes[0].staircase),
        "delay_s": {"value": result.delay_s[0], "std": result.delay_s[1]},
        "time_shift_periods": {
            "value": result.delay_s[0] / result.time_shift.sample_period_s,
            "std": result.delay_s[1] / result.time_shift.sample_period_s,
        },
        "magnetizing_curve": [
            {
                "stator_flux_wb": flux,
                "magnetizing_inductance_h": {"value": value, "std": std, "at_stator_flux_wb": flux},
            }
            for flux, value, std in result.magnetizing_curve
        ],
        "stator_resistance_20degc_ohm": None
        if result.stator_resistance_20degc_ohm is None
        else quantity(Quantity(*result.stator_resistance_20degc_ohm)),
        "gaps": contract.Gaps(count=result.gaps, lost_samples=result.lost_samples),
        "duration_s": result.duration_s,
        "remarks": list(result.remarks),
    }


def parameters_json(machine: InverseGamma, covariance: np.ndarray, at_flux_wb: float) -> contract.Parameters:
    """The contract's `parameters`: the four and the rotor time constant, each with its standard deviation, at a peak stator flux."""
    r_s, r_r, l_sigma, l_m = (float(s) for s in np.sqrt(np.diag(covariance)))
    tau = machine.rotor_time_constant_s
    gradient = np.array([0.0, -tau / machine.rotor_resistance_ohm, 0.0, tau / machine.magnetizing_inductance_h])
    tau_std = math.sqrt(max(float(gradient @ covariance @ gradient), 0.0))
    return {
        "stator_resistance_ohm": {"value": machine.stator_resistance_ohm, "std": r_s},
        "rotor_resistance_ohm": {"value": machine.rotor_resistance_ohm, "std": r_r},
        "leakage_inductance_h": {"value": machine.leakage_inductance_h, "std": l_sigma},
        "magnetizing_inductance_h": {
            "value": machine.magnetizing_inductance_h,
            "std": l_m,
            "at_stator_flux_wb": at_flux_wb,
        },
        "rotor_time_constant_s": {"value": tau, "std": tau_std, "at_stator_flux_wb": at_flux_wb},
    }


def quantity(value: Quantity) -> contract.Measured:
    return {"value": value.value, "std": value.std}


def _axis(axis: AxisResult) -> contract.Axis:
    flux_wb = axis.peak_stator_flux_wb
    return {
        "axis_deg": axis.axis_deg,
        "parameters": parameters_json(axis.parameters, np.asarray(axis.covariance), flux_wb),
        "batch_parameters": parameters_json(*axis.batch.inverse_gamma_at(flux_wb), flux_wb),
        "disagreement_sigmas": axis.disagreement_sigmas,
        "whiteness": {
            "statistic": axis.whiteness.statistic,
            "limit": axis.whiteness.limit,
            "is_white": axis.whiteness.is_white,
        },
        "peak_rotor_flux_wb": axis.peak_rotor_flux_wb,
        "peak_stator_flux_wb": flux_wb,
        "residual_rms_a": axis.residual_rms_a,
        "delay_s": quantity(axis.batch.delay),
        "energised_s": axis.energised_s,
    }


def inverter_json(inverter: InverterError | None, staircase: Staircase | None) -> contract.Inverter:
    """The inverter's part of the document."""
    if inverter is None:
        return {"identified": False}
    out: contract.Inverter = {
        "identified": True,
        "leg_error_v": {"value": inverter.plateau_v, "std": inverter.std_v[-1] if inverter.std_v else None},
        "knee_a": inverter.knee_a,
        "leg_current_a": list(inverter.current_a),
        "leg_voltage_v": list(inverter.voltage_v),
    }
    if staircase is not None:
        r = staircase.stator_resistance
        out["staircase_resistance_ohm"] = {"value": r.value, "std": r.std}
    return out
