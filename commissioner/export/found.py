"""What a form is written from: one run's result as typed values, in each convention that simulators use."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from commissioner.errors import DataRefused
from commissioner.motor.circuit import PARAMETERS, Gamma, InverseGamma, Quantity

CONVENTION = (
    "SI units; one phase of the star equivalent; rotor quantities referred to the stator; currents, voltages and fluxes of "
    "space vectors are peak values; std is one standard error"
)


@dataclass(frozen=True)
class Found:
    """`curve`: (peak stator flux in Wb, L_M in H), empty where the iron was taken as straight; `leg`: (A, V) that one
    inverter leg loses; `drive`: rows of what was written (name, register, before, after, read back), SI."""

    run: str
    utc: str
    outcome: str
    plate: Mapping[str, Any]
    parameters: Mapping[str, Quantity]
    t_model: Mapping[str, Quantity]
    t_assumption: str
    holds_for_wb: float
    curve: tuple[tuple[float, float], ...]
    leg: tuple[tuple[float, float], ...]
    delay: Quantity | None
    drive: tuple[Mapping[str, Any], ...]

    @property
    def machine(self) -> InverseGamma:
        return InverseGamma(*(self.parameters[name].value for name in PARAMETERS))

    @property
    def gamma(self) -> Gamma:
        """The same machine with its leakage on the rotor side, at the flux of the result."""
        return Gamma.from_inverse_gamma(self.machine)

    @property
    def stator_curve(self) -> tuple[tuple[float, float], ...]:
        """(peak stator flux in Wb, stator inductance in H) of the Gamma circuit, whose leakage stays what it is while its
        iron bends: L_M = L_s^2 / (L_s + L_l) solved for L_s (Slemon 1989, doi:10.1109/28.44251)."""
        leakage_h = self.gamma.leakage_inductance_h
        return tuple((flux, 0.5 * (l_m + math.sqrt(l_m * l_m + 4.0 * l_m * leakage_h))) for flux, l_m in self.curve)


def found_in(result: Mapping[str, Any], plate: Mapping[str, Any], utc: str) -> Found:
    """From a result document. DataRefused where the run found no parameters, or did not accept them."""
    parameters = result.get("parameters") or {}
    if result.get("outcome") != "commissioned" or not parameters:
        raise DataRefused(
            f"{result.get('run')} has no accepted parameters", step="export",
            value=f"{result.get('outcome')}, {'four' if parameters else 'no'} parameters", limit="commissioned, four parameters",
            remedy="export another run, or this one's samples (--form samples) where it has some",
        )  # fmt: skip
    model, inverter, delay = result["t_model"], result.get("inverter") or {}, result.get("delay_s")
    return Found(
        run=str(result["run"]),
        utc=utc,
        outcome=str(result["outcome"]),
        plate={key: value for key, value in plate.items() if value is not None},
        parameters={name: _quantity(value) for name, value in parameters.items()},
        t_model={name: _quantity(value) for name, value in model.items() if name != "assumption"},
        t_assumption=str(model["assumption"]),
        holds_for_wb=float(result["holds_for_stator_flux_wb"]),
        curve=tuple(
            (p["stator_flux_wb"], p["magnetizing_inductance_h"]["value"]) for p in result.get("magnetizing_curve") or ()
        ),
        leg=tuple(zip(inverter.get("leg_current_a") or (), inverter.get("leg_voltage_v") or (), strict=True)),
        delay=_quantity(delay) if delay else None,
        drive=tuple(result.get("written") or ()),
    )


def _quantity(value: Mapping[str, Any]) -> Quantity:
    return Quantity(float(value["value"]), float(value["std"] or 0.0))
