"""Results brought to one flux and one temperature, so that what differs between them is the motor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from commissioner.identify.estimate.axes import TEMPERATURE_K, Combined
from commissioner.motor.circuit import InverseGamma

COPPER_ZERO_DEGC = -234.5
SAME_FLUX = 0.002
"""Relative: levels closer than this need no bringing together (L_M moves by less than its repeatability)."""


@dataclass(frozen=True)
class Result:
    """A run's result. `curve`: peak stator flux in Wb, secant L_M in H, its standard error; empty: no saturation was seen. `ended`: how
    its run ended where that did not accept it."""

    name: str
    combined: Combined
    flux_wb: float | None
    curve: tuple[tuple[float, float, float], ...]
    winding_degc: float | None
    ended: str = ""


@dataclass(frozen=True)
class CommonGround:
    """Where two results are compared; None: each as it was measured. `sentences` say what was done to whom."""

    stator_flux_wb: float | None
    temperature_degc: float | None
    sentences: tuple[str, ...]


def brought_together(old: Result, new: Result) -> tuple[Combined, Combined, CommonGround]:
    """Both results at the lower of their flux levels, and at the first one's winding temperature where both are known."""
    (one, other), ground = on_common_ground((old, new))
    return one, other, ground


def on_common_ground(results: Sequence[Result]) -> tuple[tuple[Combined, ...], CommonGround]:
    """All results at the lowest of their flux levels, and at the first one's winding temperature where all are known."""
    moved, flux_wb, of_flux = at_one_flux(results)
    moved, degc, of_heat = _at_one_temperature(moved)
    return tuple(result.combined for result in moved), CommonGround(flux_wb, degc, (*of_flux, *of_heat))


def at_one_flux(results: Sequence[Result]) -> tuple[Sequence[Result], float | None, list[str]]:
    known = [result.flux_wb for result in results if result.flux_wb is not None]
    refused = [f"{one.name} was {one.ended}: its values are measured, not accepted" for one in results if one.ended]
    if len(known) < len(results):
        return results, None, [*refused, "the flux of one result is not known: L_M is compared as it was measured"]
    flux_wb = min(known)
    moved = [_at_flux(result, flux_wb) for result in results]
    sentences = [sentence for _, sentence in moved if sentence]
    if not sentences:
        sentences = [f"{'both' if len(results) == 2 else 'all'} L_M hold at {flux_wb:.3g} Wb peak stator flux"]
    return [result for result, _ in moved], flux_wb, [*refused, *sentences]


def _at_flux(result: Result, flux_wb: float) -> tuple[Result, str]:
    """The result at a flux not above its own, by its own magnetizing curve."""
    own_wb = result.flux_wb
    assert own_wb is not None
    if own_wb <= flux_wb * (1.0 + SAME_FLUX):
        return result, ""
    if not result.curve:
        return result, (
            f"{result.name} saw no saturation up to {own_wb:.3g} Wb: its L_M is taken as it is at {flux_wb:.3g} Wb"
        )
    flux, henry, std = (np.array(column) for column in zip(*sorted(result.curve), strict=True))
    there, here = float(np.interp(flux_wb, flux, henry)), float(np.interp(own_wb, flux, henry))
    relative_std = float(np.interp(flux_wb, flux, std)) / there
    before = result.combined.parameters
    after = replace(before, magnetizing_inductance_h=before.magnetizing_inductance_h * there / here)
    moved = replace(result, combined=_with_inductance(result.combined, after, relative_std))
    return moved, (
        f"L_M of {result.name}: {1e3 * before.magnetizing_inductance_h:.4g} mH at {own_wb:.3g} Wb peak stator flux is "
        f"{1e3 * after.magnetizing_inductance_h:.4g} mH at {flux_wb:.3g} Wb by its own magnetizing curve"
    )


def _with_inductance(combined: Combined, machine: InverseGamma, relative_std: float) -> Combined:
    """L_M with at least its curve's own error there."""
    covariance = combined.covariance.copy()
    own = math.sqrt(covariance[3, 3]) / combined.parameters.magnetizing_inductance_h
    scale = (
        max(own, relative_std) / own * machine.magnetizing_inductance_h / combined.parameters.magnetizing_inductance_h
    )
    covariance[3, :] *= scale
    covariance[:, 3] *= scale
    return replace(combined, parameters=machine, covariance=covariance)


def _at_one_temperature(results: Sequence[Result]) -> tuple[Sequence[Result], float | None, list[str]]:
    degc = results[0].winding_degc
    if degc is None or any(result.winding_degc is None for result in results):
        return (
            results,
            None,
            [f"a winding temperature is not known: resistances may differ by what {TEMPERATURE_K:g} K make"],
        )
    moved = [at_temperature(result, degc, results[0].name) for result in results[1:]]
    return [results[0], *(result for result, _ in moved)], degc, [sentence for _, sentence in moved]


def at_temperature(new: Result, degc: float, of: str) -> tuple[Result, str]:
    assert new.winding_degc is not None
    factor = (degc - COPPER_ZERO_DEGC) / (new.winding_degc - COPPER_ZERO_DEGC)
    before, scale = new.combined.parameters, np.array([factor, factor, 1.0, 1.0])
    after = replace(
        before,
        stator_resistance_ohm=factor * before.stator_resistance_ohm,
        rotor_resistance_ohm=factor * before.rotor_resistance_ohm,
    )
    combined = replace(new.combined, parameters=after, covariance=new.combined.covariance * np.outer(scale, scale))
    sentence = (
        f"resistances of {new.name}, measured at {new.winding_degc:.3g} °C, are compared at the {degc:.3g} °C of "
        f"{of} (R_s {before.stator_resistance_ohm:.4g} -> {after.stator_resistance_ohm:.4g} ohm); the rotor is taken to be "
        "as warm as the winding"
    )
    return replace(new, combined=combined), sentence
